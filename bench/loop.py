# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The benchmark of the loop: does the node hold its rate, beside a loop in C on the same machine.

For each rate three loops run at the same time: one in C that sleeps to absolute deadlines, the
node's own loop with nothing to do in Python, and the node with two publishers and a subscriber
in processes of their own over DDS. A second table has, in turn, the node with a model that does
nothing, with one in C and with one in Python. It prints Markdown tables. Run ``make bench-loop``;
``python bench/loop.py --help`` has the options.
"""

import argparse
from array import array
from collections import Counter
from datetime import date
import json
import os
from pathlib import Path
import platform
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np

from dm_ros.mechanism.variants import variant_named

C_LOOP = r"""
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

static long long now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * 1000000000LL + t.tv_nsec;
}

int main(int argc, char **argv) {
  double period = 1e9 / atof(argv[1]);
  long long start = now(), end = start + (long long)(atof(argv[2]) * 1e9), k = 1;
  FILE *out = fopen(argv[3], "wb");
  while (1) {
    long long due = start + (long long)(k * period), woke;
    struct timespec t = {due / 1000000000LL, due % 1000000000LL};
    if (due > end) break;
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, NULL);
    woke = now();
    long long row[2] = {woke, woke - due};
    fwrite(row, sizeof row, 1, out);
    k += 1 + (long long)((woke - due) / period);
  }
  fclose(out);
  return 0;
}
"""
FLOOD = 10_000   # Hz
MODELS = {   # and the choice of the core
    'nothing': '', 'in C': 'c', 'in Python': 'python'}
ROUNDS = 3       # of all of them in turn
BESIDE = {'setter': 'parameters set at 10 Hz',
          'flood': f'a shaft flooded at up to {FLOOD:,} Hz'}
LEGEND = """\
`lateness` is how long after its deadline a tick begins. `missed` counts whole periods without a
tick; `alone` those in a second in which the C loop, which ran at the same time, missed none, nor
in the second before or after. `CPU` is that of the process, of one core. `round trip` is from the
publishing of a torque in another process to the arrival there of the joint state that carries it.
"""
COST_LEGEND = """
What the model costs the node, {variant}, passive, with books, at {rate:g} Hz, while two torques
come in at that rate: each node in turn, {rounds} times {seconds:g} s. `tick` is from the torques
in force to the snapshot; `CPU` is that of the process, of one core, median over the rounds.
"""
COST_HEAD = ['model', 'tick mean, us', 'p99.9, us', 'worst, us', 'CPU', 'over that with nothing']
HEAD = ['loop', 'rate held, Hz', 'lateness p50, us', 'p99, us', 'max, us', 'missed', 'alone',
        'ticks made', 'CPU', 'round trip p50, ms', 'p99, ms']


class Timeline:
    """When each tick of a loop began and how late, in ns; written to a file at the end."""

    def __init__(self, path):
        self.path, self.rows = path, array('q')
        self.cpu = cpu_seconds()
        self.begun = time.monotonic()

    def note(self, now, lateness):
        self.rows.extend((now, int(lateness)))

    def write(self):
        share = (cpu_seconds() - self.cpu) / (time.monotonic() - self.begun)
        self.path.write_bytes(self.rows.tobytes())
        self.path.with_suffix('.json').write_text(json.dumps({'cpu': share}))


def cpu_seconds():
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def watched_pacer(rate, timeline):
    """Return a ``Pacer`` that notes each tick."""
    from dm_ros.motion.pacing import Pacer

    class WatchedPacer(Pacer):
        def begin(self, now):
            timeline.note(now, now - self.due)
            super().begin(now)
    return WatchedPacer(1e9 / rate)


def python_loop(rate, seconds, path):
    """Run the node's loop with nothing to do."""
    from dm_ros.ros.loops import Control, follow_steady_clock
    control, timeline = Control(), Timeline(path)
    end = time.monotonic() + seconds

    def tick():
        if time.monotonic() > end:
            control.stopping.set()
    follow_steady_clock(control, watched_pacer(rate, timeline), tick)
    timeline.write()


def make_idle(simulation):
    """Let a simulation do nothing in a tick: its snapshot is that of the start."""
    start = simulation.snapshot()
    simulation.step = lambda *_: start


def time_ticks(plant):
    """Return the times of the ticks that a plant makes from now on, s."""
    tick, times = plant.tick, array('d')

    def timed():
        start = time.perf_counter()
        snapshot = tick()
        times.append(time.perf_counter() - start)
        return snapshot
    plant.tick = timed
    return times


def node(rate, variant, path, model=''):
    """Run the node until SIGTERM, with one of ``MODELS`` timed, or as it is."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.parameter import Parameter

    from dm_ros.ros.driven_node import SWITCH_INTERVAL
    from dm_ros.ros.node import DifferentialNode
    rclpy.init()
    differential = DifferentialNode(parameter_overrides=[
        Parameter('variant', value=variant), Parameter('rate', value=float(rate))])
    timeline = Timeline(path)
    differential.pacer = watched_pacer(rate, timeline)
    if model == 'nothing':
        make_idle(differential.plant.simulation)
    times = time_ticks(differential.plant) if model else None
    executor = SingleThreadedExecutor()
    executor.add_node(differential)
    sys.setswitchinterval(SWITCH_INTERVAL)   # as main() of the node does
    differential.start()
    try:
        executor.spin()
    except Exception:
        if rclpy.ok():   # otherwise it is the shutdown that broke a call
            raise
    timeline.write()
    if model:
        path.with_suffix('.ticks').write_bytes(times.tobytes())
    differential.close()
    rclpy.try_shutdown()


def publisher(rate, shaft):
    """Publish a torque that changes, until SIGTERM."""
    import rclpy
    from std_msgs.msg import Float64
    rclpy.init()
    publish = rclpy.create_node('publisher').create_publisher(
        Float64, f'/differential/torque/{shaft}', 10).publish
    n, start = 0, time.monotonic()
    while rclpy.ok():
        try:
            publish(Float64(data=float(n % 20 - 10)))
        except Exception:
            if rclpy.ok():   # otherwise it is the shutdown that broke the call
                raise
        n = max(n + 1, int((time.monotonic() - start) * rate))
        time.sleep(max(0.0, start + n / rate - time.monotonic()))


def setter(parameter):
    """Set a parameter ten times a second, until SIGTERM."""
    from rcl_interfaces.srv import SetParameters
    import rclpy
    from rclpy.parameter import Parameter
    rclpy.init()
    me = rclpy.create_node('setter')
    client = me.create_client(SetParameters, '/differential/set_parameters')
    n = 0
    while rclpy.ok():
        if client.service_is_ready():
            n += 1
            value = Parameter(parameter, value=0.1 + 0.001 * (n % 2)).to_parameter_msg()
            future = client.call_async(SetParameters.Request(parameters=[value]))
            rclpy.spin_until_future_complete(me, future, timeout_sec=1.0)
        time.sleep(0.1)


def round_trips(shaft, index, path):
    """Publish torques on a shaft and measure when they come back, until SIGTERM."""
    import rclpy
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64

    from dm_ros.ros.messages import never_called, Polled
    from dm_ros.ros.privates import poll
    rclpy.init()
    me = rclpy.create_node('round_trips')
    states = me.create_subscription(JointState, '/differential/joint_states', never_called, 100,
                                    callback_group=Polled())
    publish = me.create_publisher(Float64, f'/differential/torque/{shaft}', 10).publish
    trips, value, sent = array('d'), 0.0, 0.0
    while rclpy.ok():
        if not sent or time.monotonic() - sent > 0.1:   # lost, or the next one
            value = value % 50.0 + 0.5
            sent = time.monotonic()
            publish(Float64(data=value))
        for message, _ in poll(states):
            if sent and message.effort[index] == value:
                trips.append(time.monotonic() - sent)
                sent = 0.0
                time.sleep(0.003 + 0.0037 * (len(trips) % 3))   # at all phases of a tick
        time.sleep(0.0001)
    path.write_bytes(trips.tobytes())


def seconds_of(rows, rate):
    """Return a Counter of missed periods by the second they were missed in."""
    missed = Counter()
    for woke, lateness in rows:
        periods = int(lateness * 1e-9 * rate)
        if periods > 0:
            missed[int(woke // 10**9)] += periods
    return missed


def read_rows(path, warm_up):
    rows = np.frombuffer(path.read_bytes(), dtype=np.int64).reshape(-1, 2)
    return rows[rows[:, 0] > rows[0, 0] + warm_up * 1e9]


def describe(name, rows, rate, reference, path, trips=None):
    """Return a row of the table and the numbers behind it."""
    lateness = rows[:, 1] * 1e-3
    span = (rows[-1, 0] - rows[0, 0]) * 1e-9
    missed = seconds_of(rows, rate)
    alone = sum(count for second, count in missed.items()
                if not any(reference[second + near] for near in (-1, 0, 1)))
    info = path.with_suffix('.json')
    cpu = f'{100 * json.loads(info.read_text())["cpu"]:.0f} %' if info.exists() else ''
    p50, p99 = np.quantile(lateness, [0.5, 0.99])
    total = len(rows) + sum(missed.values())
    cells = [f'{rate:g} Hz {name}', f'{(len(rows) - 1) / span:.2f}', f'{p50:.0f}', f'{p99:.0f}',
             f'{lateness.max():.0f}', f'{sum(missed.values())}', f'{alone}',
             f'{100 * len(rows) / total:.2f} %', cpu]
    if trips is not None and len(trips):
        cells += [f'{1e3 * np.quantile(trips, q):.2f}' for q in (0.5, 0.99)]
    else:
        cells += ['', '']
    return cells


def run_rate(rate, arguments, folder, c_loop, beside=None):
    """Return the rows of one rate; beside: one of ``BESIDE`` that loads the node, or None."""
    me = [sys.executable, __file__]
    children = []

    def child(*command):
        children.append(subprocess.Popen([str(part) for part in command]))
        return children[-1]
    length = arguments.duration + arguments.warm_up
    child(*me, 'node', rate, arguments.variant, folder / 'node')
    mechanism = variant_named(arguments.variant).mechanism
    input_shaft, output_shaft, flooded = mechanism.inputs
    child(*me, 'publisher', rate, input_shaft)
    child(*me, 'round_trips', output_shaft, 1, folder / 'trips')
    if beside == 'setter':
        child(*me, 'setter', f'{mechanism.name}.inertia.carrier')
    if beside == 'flood':
        child(*me, 'publisher', FLOOD, flooded)
    time.sleep(arguments.settle)
    timed = [child(*me, 'python_loop', rate, length, folder / 'python')]
    if c_loop:
        timed.append(child(c_loop, rate, length, folder / 'c'))
    for process in timed:
        process.wait()
    for process in children:
        if process.poll() is None:
            process.send_signal(signal.SIGTERM)
    for process in children:   # one that was seen to spin in the middleware as it ends is killed
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    rows = {name: read_rows(folder / name, arguments.warm_up)
            for name in ('c', 'python', 'node') if (folder / name).exists()}
    first = max(r[0, 0] for r in rows.values())
    rows = {name: r[r[:, 0] >= first] for name, r in rows.items()}
    reference = seconds_of(rows['c'], rate) if 'c' in rows else Counter()
    trips = np.frombuffer((folder / 'trips').read_bytes())
    names = {'c': 'C, clock_nanosleep', 'python': 'Python, no work',
             'node': f'node, {BESIDE[beside]}' if beside else 'node'}
    return [describe(names[name], rows[name], rate, reference, folder / name,
                     trips if name == 'node' else None) for name in rows]


def run_model(model, rate, arguments, folder):
    """Return the times of the ticks of a node, s, and its share of a core."""
    me, path = [sys.executable, __file__], folder / 'node'
    choice = {'DM_ROS_CORE': MODELS[model]} if MODELS[model] else {}
    input_shaft, *others = variant_named(arguments.variant).mechanism.inputs
    children = [subprocess.Popen([*map(str, (*me, 'node', rate, arguments.variant, path, model))],
                                 env={**os.environ, **choice})]
    children += [subprocess.Popen([*map(str, (*me, 'publisher', rate, shaft))])
                 for shaft in (input_shaft, others[0])]
    time.sleep(arguments.settle + arguments.duration)
    for process in children:
        process.send_signal(signal.SIGTERM)
    for process in children:
        try:
            process.wait(20)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
    times = np.frombuffer(path.with_suffix('.ticks').read_bytes())
    return times[len(times) // 4:], json.loads(path.with_suffix('.json').read_text())['cpu']


def print_models(rate, arguments, folder):
    """Print what the model costs the node."""
    found = {model: [] for model in MODELS}
    for n in range(ROUNDS):
        for model in MODELS:
            sub = folder / f'{model} {n}'
            sub.mkdir()
            found[model].append(run_model(model, rate, arguments, sub))
    print(COST_LEGEND.format(variant=arguments.variant, rate=rate, rounds=ROUNDS,
                             seconds=arguments.duration))
    print('| ' + ' | '.join(COST_HEAD) + ' |\n|---|' + '---:|' * (len(COST_HEAD) - 1))
    nothing = np.median([cpu for _, cpu in found['nothing']])
    for model, runs in found.items():
        times = 1e6 * np.concatenate([times for times, _ in runs])
        cpu = np.median([cpu for _, cpu in runs])
        cells = [model, f'{times.mean():.1f}', f'{np.quantile(times, 0.999):.0f}',
                 f'{times.max():.0f}', f'{100 * cpu:.1f} %',
                 f'{100 * (cpu / nothing - 1):+.0f} %' if model != 'nothing' else '']
        print('| ' + ' | '.join(cells) + ' |', flush=True)


def compiled(folder):
    """Return the C loop, None where there is no compiler."""
    compiler = shutil.which('cc') or shutil.which('gcc')
    if not compiler:
        return None
    source = folder / 'loop.c'
    source.write_text(C_LOOP)
    subprocess.run([compiler, '-O2', '-o', folder / 'loop', source], check=True)
    return folder / 'loop'


def parser():
    result = argparse.ArgumentParser('loop', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--rates', type=float, nargs='+', default=[200.0, 500.0, 1000.0])
    result.add_argument('--duration', type=float, default=20.0, help='s for each rate')
    result.add_argument('--warm-up', type=float, default=1.0, help='s left out at the start')
    result.add_argument('--settle', type=float, default=5.0,
                        help='s until the processes have found each other')
    result.add_argument('--variant', default='lsd_ode')
    return result


def started_node(rate, variant, path, model=''):
    """Run the node as ``differential`` does."""
    from dm_ros.ros.transport import prefer_udp
    prefer_udp()
    node(float(rate), variant, Path(path), model)


ROLES = {
    'node': started_node,
    'publisher': lambda rate, shaft: publisher(float(rate), shaft),
    'python_loop': lambda rate, s, path: python_loop(float(rate), float(s), Path(path)),
    'setter': setter,
    'round_trips': lambda shaft, index, path: round_trips(shaft, int(index), Path(path)),
}


def main():
    if len(sys.argv) > 1 and sys.argv[1] in ROLES:
        ROLES[sys.argv[1]](*sys.argv[2:])
        return
    arguments = parser().parse_args()
    from dm_ros.ros.domain import own_domain
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    print(f'{date.today()}, {platform.machine()}, {os.cpu_count()} cores, {platform.system()}, '
          f'Python {platform.python_version()}, {arguments.variant}, {arguments.duration:g} s for '
          f'each rate, load average {os.getloadavg()[0]:.1f} before\n\n{LEGEND}')
    print('| ' + ' | '.join(HEAD) + ' |\n|---|' + '---:|' * (len(HEAD) - 1))
    with own_domain() as domain, tempfile.TemporaryDirectory() as folder:
        os.environ['ROS_DOMAIN_ID'] = str(domain)
        c_loop = compiled(Path(folder))
        # each rate, and the last one once more with each load
        runs = [(rate, None) for rate in arguments.rates]
        runs += [(arguments.rates[-1], beside) for beside in BESIDE]
        for n, (rate, beside) in enumerate(runs):
            sub = Path(folder) / str(n)
            sub.mkdir()
            for cells in run_rate(rate, arguments, sub, c_loop, beside):
                print('| ' + ' | '.join(cells) + ' |', flush=True)
        print_models(arguments.rates[-1], arguments, Path(folder))
        if not c_loop:
            print('\nno C compiler here: no C loop')


if __name__ == '__main__':
    main()
