# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The benchmark of restarts: what subscribers that are killed cost the node, by transport.

A node with the transports of the middleware, which are shared memory and UDP, and one with UDP
alone, as ``differential`` chooses, run at the same time, each in a domain of its own. Beside each
a subscriber of its topics is killed and started anew, again and again, and torques are sent to
measure the round trip. It prints a Markdown table. Run ``make bench-restarts``;
``python bench/restarts.py --help`` has the options.
"""

import argparse
from contextlib import ExitStack
from datetime import date
import json
import os
from pathlib import Path
import platform
import random
import signal
import subprocess
import sys
import tempfile
import time

from loop import node, round_trips, Timeline
import numpy as np

TRANSPORTS = {'both': 'shared memory and UDP', 'udp': 'UDP'}
BLOCKED = 100e6   # ns of publishing that count as blocked
GIVEN_UP = 334e6  # ns after which shared memory gives a dead reader up, and ...
NEAR = 5e6        # ns from a multiple of them that count as just that
LEGEND = """\
`publish` is how long the node takes to publish the messages of a tick, `blocked` how often that
took more than 100 ms, as on a busy machine, and `dead` how often a multiple of 334 ms, after which
shared memory gives a dead reader up. `missed` are whole periods without a tick. `CPU` is that of
the node, of one core. `round trip` is from the publishing of a torque in another process to the
arrival there of the joint state that carries it.
"""
HEAD = ['transport of the node', 'restarts', 'publish p50, us', 'p99, us', 'max, ms', 'blocked',
        'dead', 'missed', 'CPU', 'round trip p50, ms', 'p99, ms']


def watched_node(transport, rate, path):
    """Run the node until SIGTERM, and write how long it publishes in each tick."""
    from dm_ros.ros.topics import Outputs
    from dm_ros.ros.transport import prefer_udp
    if transport == 'udp':
        prefer_udp()
    durations, publish = Timeline(path.with_name('publish')), Outputs.publish

    def watched(outputs, *arguments):
        begin = time.monotonic_ns()
        publish(outputs, *arguments)
        end = time.monotonic_ns()
        durations.note(end, end - begin)
    Outputs.publish = watched
    node(rate, 'lsd_ode', path)
    durations.write()


def victims(count):
    """Start a subscriber of all topics and kill it when it hears them, so often."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from sensor_msgs.msg import JointState

    def hear(told):
        rclpy.init()
        me = rclpy.create_node('victim')
        heard = set()

        def tell(topic):
            if topic not in heard:
                heard.add(topic)
                os.write(told, b'.')
        topics = 'joint_states', 'internal_moments', 'clutches'
        for topic in topics:
            me.create_subscription(JointState, f'/differential/{topic}',
                                   lambda _, topic=topic: tell(topic), 10)
        executor = SingleThreadedExecutor()
        executor.add_node(me)
        executor.spin()

    for _ in range(count):
        ear, told = os.pipe()
        child = os.fork()
        if not child:
            hear(told)
        os.close(told)
        for _ in range(3):
            if not os.read(ear, 1):
                raise RuntimeError('a subscriber ended by itself')
        time.sleep(random.uniform(0.0, 0.3))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(ear)


ROLES = {
    'node': lambda transport, rate, path: watched_node(transport, float(rate), Path(path)),
    'victims': lambda count: victims(int(count)),
    'round_trips': lambda path: round_trips('front', 1, Path(path)),
}


def row(transport, restarts, folder, rate):
    """Return the cells of one transport."""
    ticks = np.frombuffer((folder / 'node').read_bytes(), dtype=np.int64).reshape(-1, 2)
    publish = np.frombuffer((folder / 'publish').read_bytes(), dtype=np.int64)[1::2]
    blocked = publish[publish > BLOCKED]
    dead = abs(blocked - GIVEN_UP * np.maximum(1, np.round(blocked / GIVEN_UP))) < NEAR
    trips = np.frombuffer((folder / 'trips').read_bytes())
    cpu = json.loads((folder / 'node.json').read_text())['cpu']
    return [TRANSPORTS[transport], restarts,
            *(f'{1e-3 * q:.0f}' for q in np.quantile(publish, [0.5, 0.99])),
            f'{publish.max() / 1e6:.1f}', len(blocked), dead.sum(),
            (ticks[:, 1] * 1e-9 * rate).astype(int).sum(), f'{100 * cpu:.1f} %',
            *([f'{1e3 * q:.2f}' for q in np.quantile(trips, [0.5, 0.99])]
              if len(trips) else ['-', '-'])]   # over before the first one


def main():
    if len(sys.argv) > 1 and sys.argv[1] in ROLES:
        ROLES[sys.argv[1]](*sys.argv[2:])
        return
    parser = argparse.ArgumentParser('restarts', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--count', type=int, default=300, help='restarts for each transport')
    parser.add_argument('--rate', type=float, default=200.0, help='Hz')
    parser.add_argument('--subnet', action='store_true',
                        help='discovery on the subnet, as ROS has it, and not on this host alone')
    arguments = parser.parse_args()
    from dm_ros.ros.domain import own_domain
    if not arguments.subnet:
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    print(f'{date.today()}, {platform.machine()}, {os.cpu_count()} cores, {platform.system()}, '
          f'Python {platform.python_version()}, lsd_ode at {arguments.rate:g} Hz, '
          f'{"SUBNET" if arguments.subnet else "LOCALHOST"}, '
          f'load average {os.getloadavg()[0]:.1f} before\n\n{LEGEND}')
    with ExitStack() as stack:
        folders, nodes, killers = {}, [], []
        for transport in TRANSPORTS:
            environment = {**os.environ,
                           'ROS_DOMAIN_ID': str(stack.enter_context(own_domain()))}
            folders[transport] = folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))

            def child(*command, environment=environment):
                return subprocess.Popen([sys.executable, __file__, *map(str, command)],
                                        env=environment)
            nodes += [child('node', transport, arguments.rate, folder / 'node'),
                      child('round_trips', folder / 'trips')]
            killers.append(child('victims', arguments.count))
        for process in killers:
            process.wait()
        for process in nodes:
            process.send_signal(signal.SIGTERM)
        for process in nodes:   # as in loop.py
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        print('| ' + ' | '.join(HEAD) + ' |\n|---|' + '---:|' * (len(HEAD) - 1))
        for transport, folder in folders.items():
            cells = row(transport, arguments.count, folder, arguments.rate)
            print('| ' + ' | '.join(map(str, cells)) + ' |')


if __name__ == '__main__':
    main()
