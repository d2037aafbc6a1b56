# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Faults around the processes: signals, kills, floods, missing rights, full disks."""

from contextlib import ExitStack, suppress
import ctypes
import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
import time

from processes import command, Forked, PATIENCE
import pytest
import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dm_ros.files.record import Record
from dm_ros.ros.transport import OLD_RANGE, prefer_udp, RANGE
from dm_ros.testing import DirectDifferential

ROOT = Path(__file__).parents[2]
NODE = command('differential')
# as the command does, and it tells when a signal no longer is the interpreter's affair
TELLING_NODE = """
import signal, sys
from dm_ros.commands import differential as main
set_handler, told = signal.signal, []
def tell(number, handler):
    set_handler(number, handler)
    if number == signal.SIGTERM and not told:
        told.append(number)
        print('begun', flush=True)
signal.signal = tell
sys.exit(main([]))
"""
CAP_SYS_NICE, PR_CAPBSET_DROP = 23, 24


@pytest.fixture
def start(ros):
    """Return a function that starts Python with pipes; it is ended after the test."""
    processes = []

    def start(*arguments, **options):
        processes.append(subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE,
                                          stderr=subprocess.PIPE, text=True, **options))
        return processes[-1]
    yield start
    for process in processes:
        process.kill()
        process.communicate()


@pytest.fixture
def fork(ros):
    """Return a function that starts a ``Forked`` process, ended after the test."""
    with ExitStack() as stack:
        yield lambda *arguments, **options: stack.enter_context(Forked(*arguments, **options))


def hear(ros, message_type, topic):
    """Return a list that fills with the messages of a topic, also of one that is yet to come."""
    messages = []
    ros.node.create_subscription(message_type, topic, messages.append, 1000)
    return messages


def until(ros, condition, process):
    """Spin until the condition holds while the process lives."""
    ros.until(lambda: condition() or process.returncode is not None)
    assert process.returncode is None, process.errors


def end(process, number=signal.SIGTERM):
    """End a process that was started; it must end with exit code 0; return its stderr."""
    process.send_signal(number)
    _, errors = process.communicate(timeout=PATIENCE)
    assert process.returncode == 0, errors
    return errors


# Signals


def signal_at(start, number, delay, again=None):
    """Send a signal a while after the node began, and perhaps once more; it must end quietly."""
    process = start('-c', TELLING_NODE)
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
    process = start('-c', TELLING_NODE)
    process.stdout.readline()
    begin = time.monotonic()
    assert 'at 200 Hz' in process.stderr.readline()
    seconds = time.monotonic() - begin
    end(process)
    return seconds


def sweep(start, count):
    """Send the two signals in turn, from the first line of the node to beyond its first tick."""
    whole = start_up_time(start)
    for n in range(count):
        signal_at(start, (signal.SIGINT, signal.SIGTERM)[n % 2], 1.3 * whole * n / (count - 1),
                  again=[None, 0.0, 0.01, 0.03][n // 2 % 4])


def test_a_signal_at_any_moment_ends_it_with_exit_code_0_and_no_traceback(start):
    sweep(start, 6)


# Kills


def kill_and_restart(ros, fork, times):
    """Kill the node so often as soon as it ticks, and return its last process, which ticks."""
    joints = hear(ros, JointState, '/differential/joint_states')
    for n in range(times + 1):
        process = fork(NODE)
        joints.clear()
        # what was killed sends no more, and what is heard comes from the new one
        until(ros, lambda: len(joints) > 3, process)
        if n < times:
            process.ended(signal.SIGKILL)
    return process


def shared_memory(pid):
    """Return the names of the shared memory of DDS that a process uses."""
    maps = Path(f'/proc/{pid}/maps').read_text()
    return set(re.findall(r'/dev/shm/(fastrtps_\w+)', maps))


def udp_ports(pid):
    """Return the UDP ports that a process is bound to."""
    inodes = set()
    for link in Path(f'/proc/{pid}/fd').iterdir():
        with suppress(FileNotFoundError):
            inodes.add(os.readlink(link))
    rows = [line.split() for line in Path('/proc/net/udp').read_text().splitlines()[1:]]
    return {int(row[1].split(':')[1], 16) for row in rows if f'socket:[{row[9]}]' in inodes}


def heard_by(ros, process):
    """Wait until this process, with shared memory, hears another one, and is heard by it."""
    joints = hear(ros, JointState, '/differential/joint_states')
    torque = ros.node.create_publisher(Float64, '/differential/torque/left', 1)

    def answered():
        torque.publish(Float64(data=2.0))
        return any(message.effort[1] == 2.0 for message in joints)
    until(ros, answered, process)


@pytest.mark.skipif(not os.path.isdir('/proc/self/fd'), reason='needs /proc')
@pytest.mark.parametrize('discovery', ['LOCALHOST', 'SUBNET', OLD_RANGE])
def test_it_uses_no_shared_memory_which_a_killed_subscriber_would_block(ros, fork, discovery):
    chosen = {OLD_RANGE: '1'} if discovery == OLD_RANGE else {RANGE: discovery}
    process = fork(NODE, env={**os.environ, **chosen})
    heard_by(ros, process)
    assert not shared_memory(process.pid)
    # the profile for this host opens no door that the middleware has not for LOCALHOST
    multicast = 7400 + 250 * ros.domain
    assert (multicast in udp_ports(process.pid)) is (discovery == 'SUBNET')


@pytest.mark.skipif(not os.path.isdir('/proc/self/fd'), reason='needs /proc')
@pytest.mark.parametrize('choice', ['transport', 'profile', 'file', 'peers'])
def test_a_transport_that_its_user_chose_stays(ros, fork, tmp_path, choice):
    profiles = tmp_path / 'DEFAULT_FASTRTPS_PROFILES.xml'
    if choice in ('profile', 'file'):
        profiles.write_text('<profiles xmlns="http://www.eprosima.com/XMLSchemas/'
                            'fastRTPS_Profiles"><participant profile_name="mine"/></profiles>')
    chosen = {'transport': {'FASTDDS_BUILTIN_TRANSPORTS': 'DEFAULT'},
              'profile': {'FASTRTPS_DEFAULT_PROFILES_FILE': str(profiles)},
              'file': {}, 'peers': {'ROS_STATIC_PEERS': '127.0.0.1'}}[choice]
    process = fork(NODE, env={**os.environ, **chosen},
                   folder=tmp_path if choice == 'file' else None)
    heard_by(ros, process)
    assert shared_memory(process.pid)


def test_another_middleware_than_fast_dds_is_left_alone(monkeypatch):
    monkeypatch.setattr(rclpy, 'get_rmw_implementation_identifier', lambda: 'rmw_cyclonedds_cpp')
    environment = {RANGE: 'LOCALHOST'}
    prefer_udp(environment)
    assert environment == {RANGE: 'LOCALHOST'}


def test_killed_and_restarted_it_runs_and_leaves_nothing_behind(ros, fork):
    kill_again_and_again(ros, fork, 2)


def kill_again_and_again(ros, fork, times):
    """Kill and restart so often; there is no shared memory that a killed one would leave."""
    process = kill_and_restart(ros, fork, times)
    assert not shared_memory(process.pid)
    assert process.ended(signal.SIGTERM) == 0


# Floods


def test_a_publisher_at_10_khz_takes_no_tick(ros, steady):
    """Fifty messages between two ticks are one message to the node: the newest."""
    node = ros.differential(torque_timeout=0.0)
    flood = ros.publisher(Float64, '/differential/torque/left')
    sent = ticks = 0

    def flooded():
        """Flood a tick, and return whether it took the newest message of the flood."""
        nonlocal sent, ticks
        for _ in range(50):
            sent += 1
            flood.publish(Float64(data=float(sent)))
        ticks += 1
        steady.tick(node)
        assert node.simulation.ticks == ticks >= node.plant.inputs.received
        return ticks >= 20 and node.simulation.snapshot().torque[1] == sent

    ros.until(flooded)
    assert node.pacer.missed == 0


# Rights and places


def without_rights():
    """Give up the right to real-time priorities for this process and what it starts."""
    resource.setrlimit(resource.RLIMIT_RTPRIO, (0, 0))
    ctypes.CDLL(None).prctl(PR_CAPBSET_DROP, CAP_SYS_NICE, 0, 0, 0)


def test_without_the_right_to_a_priority_it_warns_and_goes_on(ros, start):
    # the bounding set counts when a program is executed, so a fork will not do
    process = start('-c', NODE, '--ros-args', '-p', 'realtime_priority:=50',
                    preexec_fn=without_rights)
    joints = hear(ros, JointState, '/differential/joint_states')
    ros.until(lambda: len(joints) > 20)
    errors = end(process)
    assert errors.count('realtime_priority 50: Operation not permitted; going on without') == 1


def test_without_a_home_it_runs(ros, fork):
    places = ('HOME', 'ROS_HOME', 'ROS_LOG_DIR')
    process = fork(NODE, env={k: v for k, v in os.environ.items() if k not in places})
    joints = hear(ros, JointState, '/differential/joint_states')
    until(ros, lambda: len(joints) > 3, process)
    assert process.ended(signal.SIGTERM) == 0
    assert 'Traceback' not in process.errors


def test_where_it_cannot_write_its_log_it_ends_with_one_line(fork):
    process = fork(NODE, env={**os.environ, 'ROS_LOG_DIR': '/proc/none'})
    assert process.ended() == 2
    line, = process.errors.strip().splitlines()
    assert line.startswith('differential: error: ') and '/proc/none' in line


# Full disks and folders that nobody can write to

TORQUES = 'time,pinion,left,right\n0,10,-15,-16\n5,0,0,0\n'
SMALL_FILES = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (16384, 16384))   # the disk is full then
"""
SIMULATE = """
from dm_ros.tools.simulate import main
sys.exit(main(['--variant', 'symmetric_ode', '--torques', 'in.csv', *sys.argv[1:]]))
"""
DEMO = """
import types
import numpy
from dm_ros.files.columns import column_names
from dm_ros.files.record import Record
from dm_ros.mechanism.variants import SYMMETRIC
from dm_ros.tools import demo
rows = numpy.tile(numpy.arange(int(sys.argv[1])) / 7, (len(column_names(SYMMETRIC)), 1)).T
demo.run_processes = lambda *_: types.SimpleNamespace(
    record=lambda *_: Record(SYMMETRIC, rows, 'full'), missed=0)
sys.exit(demo.main(['--out', 'out']))
"""
WRITERS = {   # what writes, with which arguments, the exit code and what is left
    'simulate, CSV': (SIMULATE, ['--out', 'out/result'], 2, []),
    'simulate, picture': (SIMULATE, ['--plot', 'out/result'], 2, []),
    'demo, CSV': (DEMO, [10_000], 1, []),
    # the demo writes its CSV before its picture, and whole
    'demo, picture': (DEMO, [10], 1, ['symmetric_ode.csv'])}


@pytest.mark.parametrize('what', WRITERS)
def test_a_full_disk_is_told_in_one_line_and_leaves_no_half_file(fork, tmp_path, what):
    source, arguments, exit_code, left = WRITERS[what]
    (tmp_path / 'out').mkdir()
    (tmp_path / 'in.csv').write_text(TORQUES)
    process = fork(SMALL_FILES + source, *arguments, folder=tmp_path)
    assert process.ended() == exit_code, process.errors
    line, = process.errors.strip().splitlines()
    assert 'File too large' in line and 'out/' in line
    assert [path.name for path in (tmp_path / 'out').iterdir()] == left


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
