# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Compares the car on elastic half-shafts with the one whose wheels are in the differential.

Prints the tables of doc/example.md: by how much the two differ in the four cases, and what each
does at a rate that is too low for the tyre.
"""

from dataclasses import replace
import math

from brake_lock import CASES, run, SPEED, TORQUE
from car import CarParameters
from coupling import print_tables
import numpy as np

SECONDS, SETTLED = 5.0, 1.0   # s, of a run, and until the half-shafts have wound up
FINE = 4000.0                 # Hz
BRAKE = CASES[1]
CAR = CarParameters()
# ten times as stiff, and damped as well in proportion
STIFF = replace(CAR, half_shaft_stiffness=10 * CAR.half_shaft_stiffness,
                half_shaft_damping=10**0.5 * CAR.half_shaft_damping)
SIGNALS = {'speed of the car': lambda run: run.car['speed'], 'slip': lambda run: run.slip,
           'tyre on ice': lambda run: run.car['left_tyre'],
           'tyre on asphalt': lambda run: run.car['right_tyre']}


def differences(run, reference, after=0.0):
    """
    Return by how much a ``Run`` differs from another one, %, by the name of what differs.

    That of a signal is the greatest one at any time, in parts of the greatest value of the other
    run; that of the heat is in parts of the heat of the other run, NaN if it has none.

    :param after: s, from which on signals are compared.
    """
    found = {name: 100.0 * abs(one - other)[late].max() / abs(other).max()
             for name, one, other, late in _side_by_side(run, reference, after)}
    heat, other = (sum(each.heat.values()) for each in (run, reference))
    return {**found, 'heat': 100.0 * abs(heat - other) / other if other else math.nan}


def relative(run, reference, after):
    """Return the greatest differences, % of the value at the same time, from a time on, s."""
    return {name: 100.0 * (abs(one - other)[late] / abs(other)[late]).max()
            for name, one, other, late in _side_by_side(run, reference, after)}


def _side_by_side(run, reference, after):
    """Yield name, values, those of a run with as many ticks or more, and which are late."""
    time = run.car['time']
    stride = round(time[1] / reference.car['time'][1])
    for name, signal in SIGNALS.items():
        yield name, signal(run), signal(reference)[::stride][:len(time)], time >= after


def turns(torque):
    """Return the part of ticks at which a torque turns from growing to falling or back."""
    steps = np.diff(torque)
    return float((steps[1:] * steps[:-1] < 0.0).mean())


def tables():
    """Yield the lines of the tables of doc/example.md."""
    yield from (f'| half-shafts | from | case | {" | ".join((*SIGNALS, "heat"))} |',
                '|---|---|---|' + '---|' * (len(SIGNALS) + 1))
    torque, speed, stiff = ([run(case, SECONDS, True, p, coupling) for case in CASES]
                            for p, coupling in ((CAR, TORQUE), (CAR, SPEED), (STIFF, SPEED)))
    fine = [run(case, SECONDS, True, CAR, SPEED, FINE) for case in CASES]
    for p, runs, references, after in (
            (CAR, speed, torque, 0.0), (CAR, speed, torque, SETTLED), (STIFF, stiff, torque, 0.0),
            (None, speed, fine, 0.0)):
        for one, other in zip(runs, references):
            yield row(p, after, one.case, differences(one, other, after))
    yield from (
        '', '| rate, Hz | turns, torque ports | turns, speed ports | car, torque ports '
        '| car, speed ports |', '|---|---|---|---|---|')
    references = [run(BRAKE, 1.5, True, CAR, coupling, FINE) for coupling in (TORQUE, SPEED)]
    for rate in (1000.0, 500.0, 200.0, 100.0, 50.0):
        runs = [run(BRAKE, 1.5, True, CAR, coupling, rate) for coupling in (TORQUE, SPEED)]
        yield rate_row(rate, runs, references)


def row(p, after, case, found):
    """Return a row of the first table; p: None for what is compared with a finer tick."""
    what = f'{p.half_shaft_stiffness:.0f} N m/rad' if p else f'the same at {FINE:.0f} Hz'
    cells = ('none' if math.isnan(value) else f'{value:.2f}' for value in found.values())
    return f'| {what} | {after:g} s | {case.title} | {" | ".join(cells)} |'


def rate_row(rate, runs, references):
    """Return a row of the second table."""
    cells = [f'{100 * turns(each.car["right_tyre"]):.0f} %' for each in runs]
    cells += [f'{differences(*pair)["speed of the car"]:.2f} %' for pair in zip(runs, references)]
    return f'| {rate:.0f} | {" | ".join(cells)} |'


if __name__ == '__main__':
    print_tables(__doc__, tables)
