# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What helps a car on a hill with its left wheel on ice: a brake, plates, clutches; four cases.

open    the open differential: the wheel on ice spins up and the car hardly moves
brake   the same, and a controller brakes the spinning wheel: torque reaches the other one
plates  an axle with plates, pressed together by preload and load, and no controller
els     electronic limited slip: a controller presses the same plates, which are open without it

The differential, the car and the controller are ROS 2 nodes in lockstep, one message a tick.
With --direct the same classes call each other, to the same bits. With --coupling torque the
inertia of the wheels is in the differential and the car gives the torques of its tyres and brakes;
with --coupling speed the car owns its wheels and gives their speeds: elastic half-shafts are
between.
"""

import argparse
from dataclasses import dataclass
import math
from pathlib import Path
import sys
from typing import NamedTuple

from car import (
    ASPHALT,
    BrakeLock,
    Car,
    CarOnHalfShafts,
    CarParameters,
    ICE,
    LimitedSlip,
    Moment,
    speed_ports,
    with_engine,
    with_wheels_and_engine,
)
import numpy as np

from dm_ros.files.record import Record
from dm_ros.testing import DirectDifferential, LockstepDifferential

VARIANT, RATE = 'symmetric_ode', 1000.0   # Hz
TORQUE, SPEED = 'torque', 'speed'   # couplings
CARS = {TORQUE: Car, SPEED: CarOnHalfShafts}


@dataclass(frozen=True, eq=False)
class Case:
    """A differential in the car, and its controller."""

    name: str
    title: str
    controller: type = None   # BrakeLock or LimitedSlip
    parameters: tuple = ()    # of (name, value), beside those of wheels and engine


def on_both_sides(**clutch):
    """Return the parameters of two equal clutches as (name, value)."""
    return tuple((f'symmetric.clutch.{side}.{name}', value)
                 for side in ('left', 'right') for name, value in clutch.items())


PACKS = (('symmetric.satellite_count', 4), ('symmetric.side_gear_radius', 0.05),
         *on_both_sides(friction_surfaces=4, friction_coefficient=0.1, radius=0.055))
# A 2-way plate axle: ramps of 45 degrees on drive and on coast, and a preload of 62 N m a side.
PLATES = (*PACKS, ('symmetric.pressure_angle', math.radians(45.0)), *on_both_sides(preload=700.0))
# The same packs, without ramps and preload: only pistons press them.
PISTONS = (*PACKS, ('symmetric.pressure_angle', 0.0), *on_both_sides(actuator_time_constant=0.05))
CASES = (
    Case('open', 'open differential'),
    Case('brake', 'brake lock', BrakeLock),
    Case('plates', 'limited slip by plates', parameters=PLATES),
    Case('els', 'electronic limited slip', LimitedSlip, PISTONS),
)


class Run(NamedTuple):
    """What a case did: the record of the differential, and the car at the same ticks."""

    case: Case
    record: Record
    car: dict    # arrays, see car.Moment
    heat: dict   # J: of the brakes and of the clutches

    @property
    def slip(self):
        """By which the left wheel outruns the right one, rad/s."""
        return self.car['left_wheel'] - self.car['right_wheel']


def parameters_of(case, p=None, coupling=TORQUE):
    """Return the parameters that the differential of a case has in the car."""
    attached = with_engine if coupling == SPEED else with_wheels_and_engine
    return {**attached(VARIANT, p or CarParameters()), **dict(case.parameters)}


def ports_of(coupling, p=None):
    """Return the speed ports of the differential in the car."""
    return speed_ports(VARIANT, p or CarParameters()) if coupling == SPEED else {}


def direct_differential(case, rate=RATE, p=None, coupling=TORQUE):
    """Return the ``DirectDifferential`` of a case."""
    return DirectDifferential(VARIANT, rate, parameters=parameters_of(case, p, coupling),
                              ports=ports_of(coupling, p))


def lockstep_differential(case, rate=RATE, p=None, coupling=TORQUE):
    """Return the ``LockstepDifferential`` of a case."""
    ports = {f'port.{shaft}.{name}': value
             for shaft, (stiffness, damping) in ports_of(coupling, p).items()
             for name, value in (('kind', SPEED), ('stiffness', stiffness), ('damping', damping))}
    return LockstepDifferential(VARIANT, rate, {**parameters_of(case, p, coupling), **ports})


def attach(differential, case, rate=RATE, p=None, coupling=TORQUE):
    """Attach the nodes of a case to a ``LockstepDifferential``; return the ``Car``."""
    # only those who use topics need ROS
    from car_nodes import BrakeLockNode, CarNode, JOINT_STATES, WHEEL_STATES
    from limited_slip import LimitedSlipNode

    car, inputs = CARS[coupling](1.0 / rate, p), differential.simulation.inputs
    context, demands = differential.context, None
    if case.controller is BrakeLock:
        demands = 'brake_demands'
        differential.attach(BrakeLockNode(
            BrakeLock(1.0 / rate), inputs[1:], WHEEL_STATES if car.gives_speeds else JOINT_STATES,
            context=context))
    elif case.controller is LimitedSlip:
        demands = 'clutch_demands'
        differential.attach(LimitedSlipNode(demands, context=context))
    differential.attach(CarNode(car, inputs, demands, context=context))
    return car


def law_of(differential, case, rate=RATE, p=None, coupling=TORQUE):
    """Return the law for a ``DirectDifferential`` that does the same, and its ``Car``."""
    car, lock = CARS[coupling](1.0 / rate, p), BrakeLock(1.0 / rate)
    limited_slip, simulation = LimitedSlip(), differential.simulation
    index = simulation.shafts.index
    inputs = tuple(map(index, simulation.inputs))
    carrier, clutched = index('carrier'), tuple(map(index, simulation.clutches))

    def law(snapshot):
        speeds = snapshot.velocity
        car.see([speeds[k] for k in inputs], snapshot.torque)
        given = car.answer(
            lock.brakes(car.wheels) if case.controller is BrakeLock else (0.0, 0.0))
        if case.controller is not LimitedSlip:
            return given
        return given, tuple(limited_slip.force(speeds[k] - speeds[carrier]) for k in clutched)
    return law, car


def run(case, seconds, direct=False, p=None, coupling=TORQUE, rate=RATE):
    """Return the ``Run`` of a case, from rest, with the ``CarParameters`` p."""
    if direct:
        differential = direct_differential(case, rate, p, coupling)
        law, car = law_of(differential, case, rate, p, coupling)
        record = differential.run(law, seconds)
    else:
        with lockstep_differential(case, rate, p, coupling) as differential:
            car = attach(differential, case, rate, p, coupling)
            record = differential.run(seconds)
    return as_run(case, record, car)


def as_run(case, record, car):
    """Return the ``Run`` of a record and of the car that made its torques."""
    # the car is at the start of each tick; it may already have answered the last state
    moments = dict(zip(Moment._fields, np.array(car.history[:len(record)]).T))
    powers = {
        'brakes': [moments[f'{side}_brake'] * np.tanh(wheel / car.p.brake_soft_speed) * wheel
                   for side in ('left', 'right') for wheel in [moments[f'{side}_wheel']]],
        'clutches': [moment * (record.velocity[shaft] - record.velocity['carrier'])
                     for shaft, moment in clutch_moments(record).items()]}
    return Run(case, record, moments,
               {name: float(np.sum(values)) * car.dt for name, values in powers.items()})


def report(runs):
    """Return a table of the cases as lines."""
    lines = [f'{"":8}{"car":>6}{"slip":>8}{"left brake":>12}{"right tyre":>12}{"clutch":>8}'
             f'{"brakes":>8}{"clutches":>10}',
             f'{"":8}{"m/s":>6}{"rad/s":>8}{"N m":>12}{"N m":>12}{"kN":>8}{"kJ":>8}{"kJ":>10}']
    for run in runs:
        case, record, car, heat = run
        force = max((values.max() for values in record.clutch_force.values()), default=0.0)
        brakes, clutches = heat['brakes'] / 1e3, heat['clutches'] / 1e3
        lines.append(f'{case.name:8}{car["speed"][-1]:6.2f}{abs(run.slip).max():8.1f}'
                     f'{car["left_brake"].max():12.0f}{car["right_tyre"].max():12.0f}'
                     f'{force / 1e3:8.1f}{brakes:8.1f}{clutches:10.1f}')
    return [*lines, '', 'speed at the end; the greatest slip, torques and force of an actuator; '
            'all heat']


def clutch_moments(record):
    """Return the moments of the clutches, N m, by the shafts on which they are."""
    return {name.removesuffix('_clutch'): values for name, values in record.moment.items()
            if name.endswith('_clutch')}


LEFT, RIGHT, CONTROLLER = '#1f6fb5', '#d1441f', '#222222'   # colours
LEFT_CLUTCH, RIGHT_CLUTCH = '#8ab8de', '#eda58f'
CASE_COLOURS = '#888888', '#222222', '#2a8a3e', '#8e44ad'
FORCE_SCALE = 20.0   # N of an actuator drawn as 1 N m


def save_plot(runs, path):
    """Draw the cases side by side as PNG."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 9.5), dpi=110, layout='constrained')
    figure.suptitle('Hill start, left wheel on ice, right wheel on asphalt', fontweight='bold')
    count, end = len(runs), runs[0].record.time[-1]
    top, *rows = figure.subplot_mosaic(
        [['car'] * count, *([f'{row}{i}' for i in range(count)] for row in ('speed', 'moment'))],
        height_ratios=[1.0, 1.1, 1.4]).values()
    speeds, moments = rows[:count], rows[count:]
    draw_cars(top, runs, end)
    for ax, run in zip(speeds, runs):
        draw_wheels(ax, run)
        ax.sharey(speeds[0])
    for ax, run in zip(moments, runs):
        draw_moments(ax, run)
        ax.sharey(moments[0])
        ax.set_xlabel('time, s')
    speeds[0].set_ylabel('speed of the wheels, rad/s')
    moments[0].set_ylabel('moments and brake, N m')
    for ax in (top, *speeds, *moments):
        ax.grid(alpha=0.25)
        ax.spines[['top', 'right']].set_visible(False)
    for ax in (*speeds, *moments):
        ax.axhline(0.0, color='0.6', linewidth=0.6, zorder=0)
        ax.set_xlim(0.0, end)
    for ax in (*speeds[1:], *moments[1:]):
        ax.tick_params(labelleft=False)
    speeds[0].legend(loc='center right', fontsize='small')
    lines = {label: line for ax in moments for line, label in zip(*ax.get_legend_handles_labels())}
    figure.legend(lines.values(), lines, loc='outside lower center', ncols=len(lines),
                  fontsize='small')
    figure.align_ylabels([top, speeds[0], moments[0]])
    figure.savefig(path, format='png')


def draw_cars(ax, runs, end):
    """Draw the speeds of the cars, each with its name."""
    for run, colour in zip(runs, CASE_COLOURS):
        ax.plot(run.record.time, run.car['speed'], color=colour, linewidth=1.8)
    names = sorted((run.car['speed'][-1], run.case.title, colour)
                   for run, colour in zip(runs, CASE_COLOURS))
    room, height = 0.09 * max(ax.get_ylim()), -math.inf
    for speed, title, colour in names:   # from below, so that none covers another
        height = max(speed, height + room)
        ax.annotate(title, (end, height), xytext=(5, 0), textcoords='offset points',
                    va='center', color=colour)
    ax.set_ylim(top=max(ax.get_ylim()[1], height + 0.5 * room))
    ax.set_ylabel('speed of the car, m/s')
    ax.set_xlim(0.0, end * 1.16)   # room for the names
    ax.set_xticks([tick for tick in ax.get_xticks() if tick <= end])
    ax.set_xlim(0.0, end * 1.16)


def draw_wheels(ax, run):
    """Draw the speeds of the wheels; the title tells the slip and the heat."""
    case, record, _, heat = run
    ax.plot(record.time, record.velocity['left'], color=LEFT, label='left, on ice')
    ax.plot(record.time, record.velocity['right'], color=RIGHT, label='right, on asphalt')
    ax.set_title(f'{case.title}\nslip ≤ {abs(record.slip).max():.1f} rad/s; '
                 f'brakes, clutches {sum(heat.values()) / 1e3:.1f} kJ', fontsize='medium')


def draw_moments(ax, run):
    """Draw the moments on the shafts, and what the controller does."""
    _, record, car, _ = run
    ax.plot(record.time, record.moment['right_mesh'], color=RIGHT, linewidth=3.0, alpha=0.55,
            label='gear, right shaft')
    ax.plot(record.time, record.moment['left_mesh'], color=LEFT, label='gear, left shaft')
    for moment, (colour, label) in zip(clutch_moments(record).values(), (
            (LEFT_CLUTCH, 'clutch, left shaft: > 0 slows it'),
            (RIGHT_CLUTCH, 'clutch, right shaft: < 0 drives it'))):
        ax.plot(record.time, moment, color=colour, label=label)
    if car['left_brake'].any():
        ax.plot(record.time, car['left_brake'], color=CONTROLLER, linestyle='--',
                label='brake, left wheel')
    forces = list(record.clutch_force.values())
    if any(force.any() for force in forces):
        # both clutches have about the same
        ax.plot(record.time, forces[0] / FORCE_SCALE, color=CONTROLLER, linestyle=':',
                label='actuator, left clutch (scale on the right)')
        ax.secondary_yaxis('right', functions=(
            lambda moment: moment * FORCE_SCALE / 1e3, lambda force: force * 1e3 / FORCE_SCALE,
            )).set_ylabel('force of the actuator, kN')


def positive(text):
    number = float(text)
    if not 0.0 < number < 1e4:
        raise argparse.ArgumentTypeError(f'{text} is not a positive number')
    return number


def grip(text):
    number = float(text)
    if not 0.0 <= number <= 2.0:
        raise argparse.ArgumentTypeError(f'{text} is not in [0, 2]')
    return number


def main(args=None):
    """Run the four cases; return the exit code."""
    parser = argparse.ArgumentParser(
        'brake_lock.py', description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', type=Path, default=Path('run'), metavar='FOLDER',
                        help='where the picture and the CSVs go, default run')
    parser.add_argument('--seconds', type=positive, default=5.0, metavar='S',
                        help='simulated time of a case, default 5')
    parser.add_argument('--ice', type=grip, default=ICE, metavar='GRIP',
                        help=f'friction coefficient of the tyre on ice, default {ICE}')
    parser.add_argument('--coupling', choices=CARS, default=TORQUE,
                        help=f'what the wheels give to the differential, default {TORQUE}')
    parser.add_argument('--direct', action='store_true', help='without topics and ROS')
    arguments = parser.parse_args(args)
    arguments.out.mkdir(parents=True, exist_ok=True)
    p = CarParameters(grip=(arguments.ice, ASPHALT))
    runs = [run(case, arguments.seconds, arguments.direct, p, arguments.coupling)
            for case in CASES]
    for done in runs:
        done.record.save_csv(arguments.out / f'{done.case.name}.csv')
    save_plot(runs, arguments.out / 'example.png')
    print('\n'.join(report(runs)))
    print(f'\nwritten {arguments.out / "example.png"} and a CSV for each case')
    return 0


if __name__ == '__main__':
    sys.exit(main())
