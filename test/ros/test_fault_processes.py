# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Faults around the processes: signals, kills, floods, missing rights, full disks."""

from contextlib import suppress
import ctypes
import fcntl
import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from sensor_msgs.msg import JointState

from dm_ros.files.record import Record
from dm_ros.testing import DirectDifferential

ROOT = Path(__file__).parents[2]
NODE = [sys.executable, '-m', 'dm_ros.ros.command']
# as the command does, and it tells when a signal no longer is the interpreter's affair
TELLING_NODE = [sys.executable, '-c', """
import signal, sys
from dm_ros.ros.command import main
set_handler, told = signal.signal, []
def tell(number, handler):
    set_handler(number, handler)
    if number == signal.SIGTERM and not told:
        told.append(number)
        print('begun', flush=True)
signal.signal = tell
sys.exit(main([]))
"""]
PATIENCE = 60.0
CAP_SYS_NICE, PR_CAPBSET_DROP = 23, 24


@pytest.fixture
def start(ros):
    """Return a function that starts a process with pipes, ended after the test."""
    processes = []

    def start(command, **options):
        processes.append(subprocess.Popen(command, stdout=subprocess.PIPE,
                                          stderr=subprocess.PIPE, text=True, **options))
        return processes[-1]
    yield start
    for process in processes:
        process.kill()
        process.communicate()


def hear(ros, message_type, topic):
    """Return a list that fills with the messages of a topic, also of one that is yet to come."""
    messages = []
    ros.node.create_subscription(message_type, topic, messages.append, 1000)
    return messages


def until(ros, condition, *processes):
    """Spin until the condition holds while the processes live."""
    ros.until(lambda: condition() or any(p.poll() is not None for p in processes), PATIENCE)
    for process in processes:
        assert process.poll() is None, process.communicate()


def end(process, number=signal.SIGTERM):
    """End a process and return what it said on stderr; it must end with exit code 0."""
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return errors


# Signals


def signal_at(start, number, delay, again=None):
    """Send a signal a while after the node began, and perhaps once more; it must end quietly."""
    process = start(TELLING_NODE)
    assert process.stdout.readline() == 'begun\n'
    time.sleep(delay)
    process.send_signal(number)
    if again is not None:
        time.sleep(again)
        process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, (delay, again, errors)
    assert 'Traceback' not in errors and 'rror' not in errors, (delay, again, errors)


def start_up_time(start):
    """Return how long the node takes from its first line to its first tick, s."""
    process = start(TELLING_NODE)
    process.stdout.readline()
    begin = time.monotonic()
    assert 'at 200 Hz' in process.stderr.readline()
    seconds = time.monotonic() - begin
    end(process)
    return seconds


def sweep(start, count):
    """Send signals at so many moments from the first line of the node to beyond its end."""
    whole = start_up_time(start)
    for n in range(count):
        delay = 1.3 * whole * n / max(1, count - 1)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal_at(start, number, delay, again=[None, 0.0, 0.01, 0.03][n % 4])


def test_a_signal_at_any_moment_ends_it_with_exit_code_0_and_no_traceback(start):
    sweep(start, 6)


# Kills


def kill_and_restart(ros, start, times):
    """Kill the node so often as soon as it ticks, and return its last process, which ticks."""
    joints = hear(ros, JointState, '/differential/joint_states')
    for n in range(times + 1):
        process = start(NODE)
        joints.clear()
        # what was killed sends no more, and what is heard comes from the new one
        until(ros, lambda: len(joints) > 3, process)
        if n < times:
            process.kill()
            process.communicate()
    return process


def orphans():
    """Return the locks of shared memory that no living process holds."""
    found = set()
    for path in Path('/dev/shm').glob('fastrtps_*_el'):
        if re.fullmatch('fastrtps_[0-9a-f]{16}_el', path.name):
            try:
                with open(path) as file:
                    fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
                    found.add(path)
            except OSError:   # somebody holds it, or it is gone
                continue
    return found


@pytest.mark.skipif(not os.path.isdir('/dev/shm'), reason='needs /dev/shm')
def test_killed_and_restarted_it_runs_and_clears_what_the_killed_left(ros, start):
    kill_and_clear(ros, start, 4)


def kill_and_clear(ros, start, times):
    """Kill and restart so often; what the killed left in /dev/shm goes with a later start."""
    end(kill_and_restart(ros, start, times))
    left = orphans()
    for path in left:   # as if the last kills were some time ago
        with suppress(FileNotFoundError):   # somebody else's node was faster
            os.utime(path, (0, 0))
    process = start(NODE)
    assert 'at 200 Hz' in process.stderr.readline()
    end(process)
    assert not [path for path in left if path.exists()]


# Floods

FLOOD = """
import sys, time
import rclpy
from std_msgs.msg import Float64
rclpy.init()
publisher = rclpy.create_node('flood').create_publisher(
    Float64, '/flooded/torque/left', 10)
message, sent, begin = Float64(data=1.0), 0, time.monotonic()
while not publisher.get_subscription_count():
    time.sleep(0.01)
print('begun', flush=True)
begin = time.monotonic()
try:
    while rclpy.ok():
        publisher.publish(message)
        sent += 1
        time.sleep(max(0.0, begin + sent * 1e-4 - time.monotonic()))
finally:
    print(sent / (time.monotonic() - begin), flush=True)
"""


def test_a_publisher_at_10_khz_takes_no_tick(ros, start):
    """Two nodes in one run: the flooded one makes as many ticks as the other, to 1 %."""
    diagnostics = hear(ros, DiagnosticArray, '/diagnostics')
    nodes = [start([*NODE, '--ros-args', '-r', f'__node:={name}'])
             for name in ('flooded', 'calm')]

    def ticks(name):
        return [int(pair.value) for message in diagnostics for status in message.status
                for pair in status.values if status.name == f'{name}: loop'
                and pair.key == 'ticks']

    until(ros, lambda: ticks('flooded') and ticks('calm'), *nodes)
    flood = start([sys.executable, '-c', FLOOD])
    assert flood.stdout.readline() == 'begun\n'

    def equal():
        """Return whether over three seconds both made as many ticks, to 1 %."""
        flooded, calm = ticks('flooded')[-4:], ticks('calm')[-4:]
        if len(flooded) < 4 or len(calm) < 4:
            return False
        return abs((flooded[-1] - flooded[0]) / (calm[-1] - calm[0]) - 1.0) < 0.01
    diagnostics.clear()
    until(ros, equal, *nodes, flood)
    flood.send_signal(signal.SIGINT)
    output, _ = flood.communicate(timeout=PATIENCE)
    assert float(output) > 10 * 200   # far more than the ticks can take


# Rights and places


def without_rights():
    """Give up the right to real-time priorities for this process and what it starts."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)


def test_without_the_right_to_a_priority_it_warns_and_goes_on(ros, start):
    process = start([*NODE, '--ros-args', '-p', 'realtime_priority:=50'],
                    preexec_fn=without_rights)
    joints = hear(ros, JointState, '/differential/joint_states')
    until(ros, lambda: len(joints) > 20, process)
    errors = end(process)
    assert errors.count('realtime_priority 50: Operation not permitted; going on without') == 1


def test_without_a_home_it_runs(ros, start):
    places = ('HOME', 'ROS_HOME', 'ROS_LOG_DIR')
    process = start(NODE, env={k: v for k, v in os.environ.items() if k not in places})
    joints = hear(ros, JointState, '/differential/joint_states')
    until(ros, lambda: len(joints) > 3, process)
    assert 'Traceback' not in end(process)


def test_where_it_cannot_write_its_log_it_ends_with_one_line(start):
    process = start(NODE, env={**os.environ, 'ROS_LOG_DIR': '/proc/none'})
    _, errors = process.communicate(timeout=PATIENCE)
    line, = errors.strip().splitlines()
    assert process.returncode == 2
    assert line.startswith('differential: error: ') and '/proc/none' in line


# Full disks and folders that nobody can write to

TORQUES = 'time,pinion,left,right\n0,10,-15,-16\n5,0,0,0\n'
WRITERS = {   # what writes, and what it says when the disk is full, with the exit code
    'simulate, CSV': ("from dm_ros.tools.simulate import main; sys.exit(main(['--variant', "
                      "'symmetric_ode', '--torques', 'in.csv', '--out', 'out/result']))", 2),
    'simulate, picture': ("from dm_ros.tools.simulate import main; sys.exit(main(['--variant', "
                          "'symmetric_ode', '--torques', 'in.csv', '--plot', 'out/result']))", 2),
    'demo, CSV': ('from test_demo_on_a_full_disk import run; run(10000)', 1),
    'demo, picture': ('from test_demo_on_a_full_disk import run; run(10)', 1),
}
DEMO = """
import sys, types
import numpy
from dm_ros.files.columns import column_names
from dm_ros.files.record import Record
from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.tools import demo

def run(rows):
    names = column_names(SYMMETRIC)
    record = Record(SYMMETRIC, numpy.tile(numpy.arange(rows) / 7, (len(names), 1)).T, 'full')
    recorder = types.SimpleNamespace(record=lambda *_: record, missed=0)
    demo.run_processes = lambda arguments: recorder
    sys.exit(demo.main(['--out', 'out']))
"""


def small_files():
    """Let no file of this process grow beyond 16 kB: the disk is full then."""
    resource.setrlimit(resource.RLIMIT_FSIZE, (16384, 16384))


@pytest.mark.parametrize('what', WRITERS)
def test_a_full_disk_is_told_in_one_line_and_leaves_no_half_file(start, tmp_path, what):
    code, exit_code = WRITERS[what]
    (tmp_path / 'out').mkdir()
    (tmp_path / 'in.csv').write_text(TORQUES)
    (tmp_path / 'test_demo_on_a_full_disk.py').write_text(DEMO)
    process = start(
        [sys.executable, '-c', f'import sys; sys.path.insert(0, "."); import matplotlib.figure; '
         f'import matplotlib.font_manager; {code}'], cwd=tmp_path, preexec_fn=small_files,
        env={**os.environ, 'PYTHONDONTWRITEBYTECODE': '1', 'PYTHONPATH': os.pathsep.join(
            path or os.getcwd() for path in sys.path)})
    _, errors = process.communicate(timeout=PATIENCE)
    line, = errors.strip().splitlines()
    assert process.returncode == exit_code, errors
    assert 'File too large' in line and 'out/' in line
    left = [path.name for path in (tmp_path / 'out').iterdir()]
    # the demo writes its CSV before its picture, and whole
    assert left == (['symmetric_ode.csv'] if what == 'demo, picture' else [])


@pytest.mark.parametrize('save', [Record.save_csv, Record.save_plot])
def test_a_record_on_a_full_disk_leaves_no_half_file(tmp_path, save):
    record = DirectDifferential().run(lambda _: (1.0, 0.0, 0.0), seconds=0.1)
    save(record, tmp_path / 'whole')   # and matplotlib has its caches
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
        with pytest.raises(OSError, match='File too large') as error:
            save(record, tmp_path / 'file')
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert error.value.filename == str(tmp_path / 'file')
    assert [path.name for path in tmp_path.iterdir()] == ['whole']


def test_nothing_opens_a_file_to_write_but_the_one_function_that_leaves_no_half_file():
    writing = re.compile(r"\bopen\([^)]*'[wax]b?'|write_text|write_bytes|savetxt|to_csv")
    found = [f'{path.name}: {line.strip()}' for path in (ROOT / 'dm_ros').rglob('*.py')
             for line in path.read_text().splitlines() if writing.search(line)]
    assert found == ["simulate.py: file = stack.enter_context(open(1, 'w', closefd=False))"]
