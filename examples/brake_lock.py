# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A brake-based differential lock: a car on a hill with its left wheel on ice, in three cases.

open    the open differential: the wheel on ice spins up and the car hardly moves
brake   the same, and a controller brakes the spinning wheel: torque reaches the other one
lsd     the self-locking differential as an axle differential, and no controller

The differential, the car and the controller are ROS 2 nodes in lockstep, one message a tick.
With --direct the same classes call each other, to the same bits.
"""

import argparse
from pathlib import Path
import sys
from typing import NamedTuple

from car import BrakeLock, Car, CarParameters, final_drive_ratio, with_wheels_and_engine
import numpy as np

from dm_ros.files.record import Record
from dm_ros.testing import DirectDifferential, LockstepDifferential

RATE = 1000.0   # Hz


class Case(NamedTuple):
    """A differential, with or without the lock."""

    name: str
    variant: str
    braked: bool
    title: str


CASES = (
    Case('open', 'symmetric_ode', False, 'open differential'),
    Case('brake', 'symmetric_ode', True, 'open differential, brake lock'),
    Case('lsd', 'lsd_ode', False, 'self-locking differential'),
)


class Run(NamedTuple):
    """What a case did: the record of the differential, and the car at the same ticks."""

    case: Case
    record: Record
    car: dict   # arrays: speed (m/s), left_brake and right_brake (N m)


def parameters_of(case, p=None):
    """Return the parameters that the differential of a case has in the car."""
    return with_wheels_and_engine(case.variant, p or CarParameters())


def make_car(case, rate=RATE, p=None):
    """Return the ``Car`` of a case."""
    return Car(1.0 / rate, p, final_drive_ratio(case.variant))


def attach(differential, case, rate=RATE, p=None):
    """Attach the nodes of a case to a ``LockstepDifferential``; return the ``Car``."""
    from car_nodes import BrakeLockNode, CarNode  # only those who use topics need ROS

    car, inputs = make_car(case, rate, p), differential.simulation.inputs
    differential.attach(CarNode(car, inputs, case.braked, context=differential.context))
    if case.braked:
        differential.attach(BrakeLockNode(
            BrakeLock(1.0 / rate), inputs[1:], context=differential.context))
    return car


def law_of(differential, case, rate=RATE, p=None):
    """Return the law for a ``DirectDifferential`` that does the same, and its ``Car``."""
    car, lock = make_car(case, rate, p), BrakeLock(1.0 / rate)
    simulation = differential.simulation
    drive, left, right = (simulation.shafts.index(name) for name in simulation.inputs)

    def law(snapshot):
        wheels = snapshot.velocity[left], snapshot.velocity[right]
        demands = lock.brakes(wheels) if case.braked else (0.0, 0.0)
        return car.torques(snapshot.velocity[drive], wheels, demands)
    return law, car


def run(case, seconds, direct=False):
    """Return the ``Run`` of a case, from rest."""
    if direct:
        differential = DirectDifferential(case.variant, RATE, parameters=parameters_of(case))
        law, car = law_of(differential, case)
        record = differential.run(law, seconds)
    else:
        with LockstepDifferential(case.variant, RATE, parameters_of(case)) as differential:
            car = attach(differential, case)
            record = differential.run(seconds)
    return as_run(case, record, car)


def as_run(case, record, car):
    """Return the ``Run`` of a record and of the car that made its torques."""
    # the car is at the start of each tick; it may already have answered the last state
    _, speed, left_brake, right_brake = np.array(car.history[:len(record)]).T
    return Run(case, record, {
        'speed': speed, 'left_brake': left_brake, 'right_brake': right_brake})


def report(runs):
    """Return a table of the cases as lines."""
    lines = [f'{"":8}{"car":>8}{"greatest slip":>17}{"left brake":>14}{"right tyre":>14}',
             f'{"":8}{"m/s":>8}{"rad/s":>17}{"N m":>14}{"N m":>14}']
    for case, record, car in runs:
        _, _, right = record.torque.values()
        lines.append(f'{case.name:8}{car["speed"][-1]:8.2f}{abs(record.slip).max():17.1f}'
                     f'{car["left_brake"].max():14.0f}{-right.min():14.0f}')
    return [*lines, 'speed at the end, the greatest of the rest']


def meshes(record):
    """Return the moments that the gears give to the left and the right shaft, N m."""
    return [values for name, values in record.moment.items() if name.endswith('_mesh')]


def save_plot(runs, path):
    """Draw the cases side by side as PNG."""
    from matplotlib.figure import Figure

    left_colour, right_colour, brake_colour = '#1f6fb5', '#d1441f', '#222222'
    figure = Figure(figsize=(12, 9), dpi=120, layout='constrained')
    figure.suptitle('Hill start, left wheel on ice, right wheel on asphalt', fontweight='bold')
    top, *rows = figure.subplot_mosaic(
        [['car'] * 3, [f'speed{i}' for i in range(3)], [f'torque{i}' for i in range(3)]],
        height_ratios=[1.0, 1.1, 1.3]).values()
    speeds, torques = rows[:3], rows[3:]

    for (case, record, car), colour in zip(runs, ('#888888', '#222222', '#2a8a3e')):
        top.plot(record.time, car['speed'], color=colour, linewidth=1.8)
        top.annotate(case.title, (record.time[-1], car['speed'][-1]), xytext=(5, 0),
                     textcoords='offset points', va='center', color=colour)
    top.set_ylabel('speed of the car, m/s')
    end = runs[0].record.time[-1]
    top.set_xlim(0.0, end * 1.22)   # room for the names
    top.set_xticks([tick for tick in top.get_xticks() if tick <= end])
    top.set_xlim(0.0, end * 1.22)

    for ax, (case, record, _) in zip(speeds, runs):
        _, left, right, *_ = record.velocity.values()
        ax.plot(record.time, left, color=left_colour, label='left, on ice')
        ax.plot(record.time, right, color=right_colour, label='right, on asphalt')
        ax.set_title(case.title)
        ax.sharey(speeds[0])
    for ax, (_, record, car) in zip(torques, runs):
        left, right = meshes(record)
        ax.plot(record.time, right, color=right_colour, linewidth=3.0, alpha=0.55,
                label='right_mesh')
        ax.plot(record.time, left, color=left_colour, label='left_mesh')
        for name, colour in (('front_clutch', '#8ab8de'), ('rear_clutch', '#eda58f')):
            if name in record.moment:
                ax.plot(record.time, record.moment[name], color=colour, label=name)
        if car['left_brake'].any():
            ax.plot(record.time, car['left_brake'], color=brake_colour, linestyle='--',
                    label='brake on the left wheel')
        ax.sharey(torques[0])
        ax.set_xlabel('time, s')
    # the self-locking differential has front and rear in place of left and right
    names = {'left_mesh': 'front_mesh, to the left wheel',
             'right_mesh': 'rear_mesh, to the right wheel',
             'rear_clutch': 'rear_clutch, negative: drives it'}
    handles, labels = torques[2].get_legend_handles_labels()
    torques[2].legend(handles, [names.get(label, label) for label in labels],
                      loc='upper right', fontsize='small')
    for ax in torques[:2]:
        ax.legend(loc='lower right', fontsize='small')
    speeds[0].legend(loc='center right', fontsize='small')
    speeds[0].set_ylabel('speed of the wheels, rad/s')
    torques[0].set_ylabel('internal moments and brake, N m')
    for ax in (top, *speeds, *torques):
        ax.grid(alpha=0.25)
        ax.spines[['top', 'right']].set_visible(False)
        ax.axhline(0.0, color='0.6', linewidth=0.6, zorder=0)
    for ax in (*speeds, *torques):
        ax.set_xlim(0.0, end)
    for ax in (*speeds[1:], *torques[1:]):
        ax.tick_params(labelleft=False)
    figure.align_ylabels([top, speeds[0], torques[0]])
    figure.savefig(path, format='png')


def positive(text):
    number = float(text)
    if not 0.0 < number < 1e4:
        raise argparse.ArgumentTypeError(f'{text} is not a positive number')
    return number


def main(args=None):
    """Run the three cases; return the exit code."""
    parser = argparse.ArgumentParser(
        'brake_lock.py', description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=Path, default=Path('run'), metavar='FOLDER',
                        help='where the picture and the CSVs go, default run')
    parser.add_argument('--seconds', type=positive, default=5.0, metavar='S',
                        help='simulated time of a case, default 5')
    parser.add_argument('--direct', action='store_true', help='without topics and ROS')
    arguments = parser.parse_args(args)
    arguments.out.mkdir(parents=True, exist_ok=True)
    runs = [run(case, arguments.seconds, arguments.direct) for case in CASES]
    for done in runs:
        done.record.save_csv(arguments.out / f'{done.case.name}.csv')
    save_plot(runs, arguments.out / 'example.png')
    print('\n'.join(report(runs)))
    print(f'\nwritten {arguments.out / "example.png"} and a CSV for each case')
    return 0


if __name__ == '__main__':
    sys.exit(main())
