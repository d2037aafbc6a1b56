# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Four controllers of a driveline, each with and without it, in lockstep over real topics.

``python examples/driveline_controllers.py --out FOLDER`` writes a picture of each; with
``--drive`` the demo instead: the start on a hill with a bag of each run. Needs rclpy and
matplotlib, and rosbags for the bags.
"""

import argparse
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from typing import Callable, NamedTuple

from centre_clutch import CentreClutch
from driver import brakes, Controller, ramp
from electronic_limited_slip import ElectronicLimitedSlip
from matplotlib.figure import Figure
from rclpy.node import Node
from sensor_msgs.msg import JointState
from torque_vectoring import TorqueVectoring
from traction_control import TractionControl

from dm_ros.files.bag import Bag, has_rosbags, quality
from dm_ros.testing import LockstepDriveline

RATE = 500.0   # Hz
LEFT_ON_ICE = {'front_left_grip': 0.1, 'rear_left_grip': 0.1}


def hill(time):
    """Start on a hill of 12 % with the left side on ice."""
    return {'grade': 0.12, **LEFT_ON_ICE, 'input': ramp(time, 0.4, 1.0, 450.0),
            **brakes(ramp(time, 0.8, 1.0, 0.0, 900.0))}


def wet_side(time):
    """Start on the flat with the left side on a wet, smooth road."""
    return {'front_left_grip': 0.2, 'rear_left_grip': 0.2, 'input': ramp(time, 0.2, 0.6, 350.0)}


def front_on_ice(time):
    """Start on a hill of 12 % with the front axle on ice."""
    return {'grade': 0.12, 'front_left_grip': 0.15, 'front_right_grip': 0.15,
            'input': ramp(time, 0.5, 1.0, 500.0), **brakes(ramp(time, 1.0, 1.2, 0.0, 800.0))}


def bend(time):
    """Steer to the left at 18 m/s, with worn tyres in front."""
    return {'input': 80.0, 'steer': ramp(time, 0.5, 0.8, 0.05), 'front_left_grip': 0.55,
            'front_right_grip': 0.55}


class Case(NamedTuple):
    """A run with and without a controller, and what a picture shows of it."""

    title: str
    driver: Callable
    law: Callable          # of the length of a tick, s
    layout: str
    seconds: float
    lines: dict            # {axis: function of a ``DrivelineRecord`` to {name: values}}
    planar: bool = False
    parameters: dict = {}


def wheels(*names):
    return lambda record: {name.replace('_', ' '): record.velocity[name] for name in names}


def speed(record):
    return {'body': record.longitudinal_speed}


def wanted(record):
    """Return the yaw rate of a neutral car in the bend, rad/s."""
    steer = [bend(time)['steer'] for time in record.time]
    return record.longitudinal_speed * steer / TorqueVectoring.WHEELBASE


CASES = {
    'traction-control': Case(
        'Start on a hill of 12 %, left side on ice, rear-wheel drive', hill,
        lambda dt: TractionControl(('rear',), dt), 'rwd', 4.0,
        {'speed, m/s': speed, 'rear wheels, rad/s': wheels('rear_left', 'rear_right')}),
    'electronic-limited-slip': Case(
        'Start with the left side on a wet road, rear-wheel drive', wet_side,
        lambda dt: ElectronicLimitedSlip('rear'), 'rwd', 4.0,
        {'speed, m/s': speed, 'rear wheels, rad/s': wheels('rear_left', 'rear_right')},
        parameters={'driveline.rear.pressure_angle': 0.0,   # the force alone presses
                    'driveline.rear.clutch.left.friction_surfaces': 8,
                    'driveline.rear.clutch.right.friction_surfaces': 8}),
    'centre-clutch': Case(
        'Start on a hill of 12 %, front axle on ice, all-wheel drive', front_on_ice,
        CentreClutch, 'awd', 4.0,
        {'speed, m/s': speed, 'wheels, rad/s': wheels('front_left', 'rear_left'),
         'torque of the propellers, N m': lambda record: {
             'front': record.torque['front_propeller'],
             'rear': record.torque['rear_propeller']}}),
    'torque-vectoring': Case(
        'Into a bend at 18 m/s with worn tyres in front, rear-wheel drive', bend,
        lambda dt: TorqueVectoring(dt, grip=0.9), 'rwd', 4.0,
        {'yaw rate, rad/s': lambda record: {'body': record.yaw_rate, 'wanted': wanted(record)},
         'speed, m/s': speed,
         'way to the left, m': lambda record: {'body': record.y}},
        planar=True, parameters={'initial_speed': 18.0})}


class BagRecorder(Node):
    """Puts what a driveline hears and says into a bag, as it comes, and sorted by its time."""

    def __init__(self, car, **options):
        super().__init__('bag_recorder', **options)
        self._came, node = [], car.node
        topics = [(publisher.topic_name, publisher.msg_type)
                  for publisher, _ in node.outputs.of_a_tick]
        self._kinds = {**dict(topics), '/driveline/commands': JointState}
        for topic, kind in self._kinds.items():
            self.create_subscription(
                kind, topic, lambda data, topic=topic: self._came.append(
                    (car.simulation.ticks, topic, data)), 1000, raw=True)

    def save(self, path):
        with Bag(path, instead=True) as bag:
            topics = {}
            for topic, kind in self._kinds.items():
                package, folder = kind.__module__.split('.')[:2]
                topics[topic] = bag.topic(topic, f'{package}/{folder}/{kind.__name__}',
                                          quality(1000))
            for tick, topic, data in sorted(self._came, key=itemgetter(0)):
                bag.write(topics[topic], round(tick * 1e9 / RATE), data)


def run(case, controlled, bag=None):
    """
    Return the ``DrivelineRecord`` of a case, with or without its controller.

    :param bag: where a bag goes, if anywhere.
    """
    with ExitStack() as stack:
        car = stack.enter_context(LockstepDriveline(
            case.layout, case.planar, RATE, case.parameters))
        if bag:
            recorder = car.attach(BagRecorder(car, context=car.context))
        car.attach(Controller(case.driver, case.law(1.0 / RATE) if controlled else None,
                              context=car.context))
        record = car.run(seconds=case.seconds)
        if bag:
            for _ in range(100):   # what is still on its way
                car.executor.spin_once(timeout_sec=0.01)
            recorder.save(bag)
    return record


def draw(path, case, records):
    """Draw a case; records: {how it was driven: ``DrivelineRecord``}."""
    figure = Figure(figsize=(10, 2.2 * len(case.lines) + 0.8), dpi=85, layout='constrained')
    axes = figure.subplots(len(case.lines), 1, sharex=True)
    axes[0].set_title(case.title, fontsize='medium')
    for axis, (label, of) in zip(axes, case.lines.items()):
        for (how, record), dashed in zip(records.items(), ((4, 2), (None, None))):
            for n, (name, values) in enumerate(of(record).items()):
                axis.plot(record.time, values, color=f'C{n}', dashes=dashed, linewidth=1.4,
                          label=f'{name}, {how}')
        axis.set_ylabel(label)
        axis.grid(alpha=0.25)
        axis.legend(fontsize='small', loc='upper left', bbox_to_anchor=(1.0, 1.02), frameon=False)
    axes[-1].set_xlabel('time, s')
    figure.savefig(path)


def told(name, records):
    """Return in a line what came out of a case."""
    ends = {how: f'{record.longitudinal_speed[-1]:.2f} m/s after {record.x[-1]:.2f} m'
            for how, record in records.items()}
    return f'{name}: ' + '; '.join(f'{how} {end}' for how, end in ends.items())


def main():
    parser = argparse.ArgumentParser('driveline_controllers', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--out', default='run', help='folder of the pictures (default: run)')
    parser.add_argument('--drive', action='store_true',
                        help='the start on a hill alone, with a bag of each run')
    arguments = parser.parse_args()
    folder = Path(arguments.out)
    folder.mkdir(parents=True, exist_ok=True)
    for name, case in CASES.items():
        if arguments.drive and name != 'traction-control':
            continue
        records = {}
        for how, controlled in (('without', False), ('with it', True)):
            bag = None
            if arguments.drive and has_rosbags():
                bag = folder / f'drive_{how.replace(" ", "_")}_bag'
            records[how] = run(case, controlled, bag)
        picture = folder / ('drive.png' if arguments.drive else f'{name}.png')
        draw(picture, case, records)
        print(f'{told(name, records)}; {picture}')
    if arguments.drive:
        print(f'bags: {", ".join(str(path) for path in sorted(folder.glob("drive_*_bag")))}'
              if has_rosbags() else 'no bags: pip install "dm_ros[bag]"')


if __name__ == '__main__':
    main()
