# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A drive that a bag has recorded, as inputs for another run.

Each message on ``joint_states`` is the end of a tick, and its ``effort`` was in force in it. Under
simulated time, as in lockstep, its stamp tells which tick. Speeds outside of speed ports, and all
inputs of a bag without ``joint_states``, are those that were commanded.
"""

from collections import deque
from itertools import pairwise
import math
from pathlib import Path
from statistics import median
from typing import NamedTuple

from dm_ros.files.bag import JOINT_STATE, require_rosbags
from dm_ros.files.published import input_topics, RATE_TOLD
from dm_ros.files.torque_table import TorqueTable
from dm_ros.motion.held_inputs import HeldInputs, Joints

SUFFIXES = '.mcap', '.db3'
DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
JITTER = 0.1     # of a tick by which the usual gap of stamps of system time may be off
ROUNDING = 5e-3  # likewise, by which a rate that is told by them is
LATE = 1.5       # usual gaps between two stamps of system time, from which on one is missing


class RecordedDrive(NamedTuple):
    """What a bag tells of a drive."""

    table: TorqueTable
    dt: float       # s, of a tick of the node that was recorded
    values: dict    # parameters that a run of it needs: the speeds at the start, and no lag
    remarks: tuple  # lines for who wants to run it
    speeds: dict    # rad/s, of all shafts after the nth tick of that length, as recorded


def is_bag(path):
    """Return whether a path is that of a bag, a folder or a file of one."""
    path = Path(path)
    return path.is_dir() or path.suffix in SUFFIXES


def read_drive(path, mechanism, rate, node=None, timeout=0.0, default=None):
    """
    Return the ``RecordedDrive`` of a bag.

    :param path: a folder, or an .mcap or .db3 file; mechanism: the ``Mechanism`` to run.
    :param rate: ticks in a second that are expected, if stamps of system time are about so far
        apart and the node has not told it on ``/diagnostics``; stamps of simulated time tell it by
        themselves.
    :param node: full name of the node that was recorded; None for the only one, or of several
        for that named ``default``.
    :param timeout: s, after which its commands were stale, but in lockstep; 0 for never.
    :raises ValueError: one line that names the bag and says what is wrong.
    """
    if not Path(path).exists():
        raise ValueError(f'{path}: No such file or directory')
    if Path(path).is_dir() and not Path(path, 'metadata.yaml').exists():
        raise ValueError(f'{path}: no bag, a folder without metadata.yaml')
    require_rosbags()
    from rosbags.highlevel import AnyReader, AnyReaderError
    from rosbags.rosbag2 import ReaderError
    from rosbags.typesys import get_typestore, Stores
    try:
        with AnyReader([Path(path)],
                       default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
            return _Drive(reader, mechanism, node, default).inputs(rate, timeout)
    except (AnyReaderError, ReaderError, ValueError) as error:
        cure = ' It was not closed, as by a kill: mcap recover mends it.' if (
            'end magic' in str(error)) else ''
        raise ValueError(f'{path}: {error}{cure}') from None


class _Drive:
    """The messages of one node in an open bag."""

    def __init__(self, reader, mechanism, node, default):
        self._mechanism = mechanism
        self._reader = reader
        self.node, self._prefix = self._found(node, default)
        self.states = {}     # the last message on joint_states of each stamp, ns
        self.forces = {}     # likewise, those in force on the clutches
        self.commands = []   # (how many states came before, ns, topic, message)
        self._read()
        if self.forces and not mechanism.actuators:
            raise ValueError(f'{self.node} has clutches, and the parameters of this run give none')

    def inputs(self, rate, timeout):
        """Return the ``RecordedDrive``."""
        if self.states:
            return self._of_states(rate, timeout)
        return self._of_commands()

    # reading

    def _found(self, node, default):
        """Return the full name of the node, and the prefix of its joints."""
        found, shafts = {}, self._mechanism.shafts
        for topic in ('joint_states', 'torques'):
            for connection in self._reader.connections:
                name, slash, last = connection.topic.rpartition('/')
                if (last, connection.msgtype) == (topic, JOINT_STATE) and connection.msgcount:
                    found.setdefault(name, connection)
        if node is not None:
            node = '/' + node.strip('/')
            found = {name: at for name, at in found.items() if name == node}
        fitting, others = {}, []
        for name, connection in found.items():
            _, _, message = next(self._messages([connection]))
            if connection.topic.endswith('/joint_states'):
                prefix = _prefix(message.name, shafts)
            else:   # names of some ports
                prefix = next((prefix for port in self._mechanism.ports + self._mechanism.actuators
                               if (prefix := _prefix(message.name[:1], [port.name])) is not None),
                              None if message.name else '')
            if prefix is None:
                others.append(f'those of {connection.topic} are {", ".join(message.name)}')
            else:
                fitting[name] = prefix
        if len(fitting) > 1 and default not in fitting:
            raise ValueError('it has several differentials and --node names none of them: '
                             f'{", ".join(fitting)}')
        if not fitting:
            of = f' of {node}' if node else ''
            what = '; '.join(others) or f'it has no joint_states and no torques{of}'
            raise ValueError(f'no differential with the shafts {", ".join(shafts)}: {what}')
        node = default if len(fitting) > 1 else next(iter(fitting))
        return node, fitting[node]

    def _messages(self, connections):
        for connection, time, data in self._reader.messages(connections=connections):
            yield connection, time, self._reader.deserialize(data, connection.msgtype)

    def _read(self):
        wanted = {'joint_states', 'clutches', 'torques', *input_topics(self._mechanism)}
        connections = [c for c in self._reader.connections
                       if c.topic.startswith(f'{self.node}/')
                       and c.topic.removeprefix(f'{self.node}/') in wanted]
        moved = False
        for connection, time, message in self._messages(connections):
            topic = connection.topic.removeprefix(f'{self.node}/')
            if topic == 'joint_states':
                if moved and not message.position.any():
                    raise ValueError(f'{connection.topic}: a reset after {len(self.states)} '
                                     'messages; only a recording between resets can be run')
                moved = moved or message.position.any()
                self.states[_stamp(message)] = message
            elif topic == 'clutches':
                self.forces[_stamp(message)] = message.effort
            else:
                self.commands.append((len(self.states), time, topic, message))
        while self.forces and self.states and next(reversed(self.states)) not in self.forces:
            self.states.popitem()   # the recorder ended within a tick
        early = 0   # states that the recorder heard before it heard the clutches
        while self.forces and self.states and next(iter(self.states)) not in self.forces:
            del self.states[next(iter(self.states))]
            early += 1
        self.commands = [(max(0, seen - early), *rest) for seen, *rest in self.commands]

    def _told_rate(self):
        """Return the rate, Hz, that the node told of itself, None for none or several."""
        topics = {(c.topic, c.msgtype): c for c in self._reader.connections}
        told = topics.get(('/diagnostics', DIAGNOSTICS))
        rates = {}   # of each node
        for _, _, message in self._messages([told]) if told else ():
            for status in message.status:
                for value in status.values:
                    if value.key == RATE_TOLD:
                        rates.setdefault(status.hardware_id, set()).add(value.value)
        own = [rates[self.node]] if self.node in rates else [   # it has another name in the bag
            told for node, told in rates.items()
            if (f'{node}/joint_states', JOINT_STATE) not in topics]
        try:
            (rate,), = own
            rate = float(rate)
        except ValueError:
            return None
        return rate if 0.0 < rate < math.inf else None

    # inputs

    def _of_states(self, rate, timeout):
        stamps, messages = list(self.states), list(self.states.values())
        if len(stamps) < 2:
            raise ValueError(f'{self.node}/joint_states has less than two messages')
        rate, ends = _ticks(stamps, rate)
        simulated = ends is not None
        if not simulated:
            ends = range(len(stamps))
            rate = self._told_rate() or rate
        remarks = [_remark(stamps, ends, rate, simulated)]
        if self._mechanism.actuators and not self.forces and not self._presses():
            remarks.append(f'without {self.node}/clutches no force is taken to be on them')
        values = {}
        if simulated and ends[0] == 1:   # the start was not published
            ends, messages = [0, *ends], [None, *messages]
        else:
            values = self._start(messages[0])
            if any(values.values()):
                remarks.append('it begins with the speeds that it has there; all else that a '
                               'state holds begins anew')
        commanded = self._commanded(len(ends) - 1, simulated, rate, timeout)
        index = {name: i for i, name in enumerate(self._mechanism.shafts)}
        rows = []
        for i, message in enumerate(messages[1:]):
            given = commanded[i] if commanded else None
            rows.append(tuple(
                given[k] if port.kind == 'speed' else float(message.effort[index[port.name]])
                for k, port in enumerate(self._mechanism.ports))
                + self._forces_in(message, given))
        times = [(end - ends[0]) / rate for end in ends]
        rows.append(rows[-1])
        if self.forces:
            table = self._mechanism.parameters
            values |= {f'{table.prefix}.clutch.{clutch}.actuator_time_constant': 0.0
                       for clutch in self._mechanism.clutches}
        speeds = {end - ends[0]: tuple(message.velocity.tolist())
                  for end, message in zip(ends[1:], messages[1:])}
        return RecordedDrive(self._table(times, rows), 1 / rate, values,
                             tuple(filter(None, remarks)), speeds)

    def _start(self, message):
        speeds = dict(zip(self._mechanism.shafts, message.velocity))
        return {f'initial_velocity.{shaft}': float(speeds[shaft])
                for shaft in self._mechanism.outputs}

    def _forces_in(self, message, given):
        if not self.forces:
            return given[len(self._mechanism.ports):] if given else ()
        forces = self.forces.get(_stamp(message))
        if forces is None:
            raise ValueError(f'{self.node}/clutches lacks a message with the stamp '
                             f'{_stamp(message) * 1e-9:.9f} s of joint_states')
        return tuple(map(float, forces))

    def _presses(self):
        """Return whether any command was for a clutch."""
        clutches = {self._prefix + actuator.name for actuator in self._mechanism.actuators}
        return any(topic.startswith('clutch/') or topic == 'torques' and clutches.intersection(
            message.name) for _, _, topic, message in self.commands)

    def _commanded(self, count, simulated, rate, timeout):
        """Return what was commanded in each tick; None where nothing needs it."""
        if not (self._mechanism.half_shafts or self._mechanism.actuators and not self.forces):
            return None
        if simulated:
            held, rows = self._held(0.0), []
            for _, _, topic, message in self.commands:
                if topic == 'torques' and self._take(held, topic, message, 0):
                    rows.append(held.in_force(0))
            if len(rows) in (count, count + 1):   # each was a tick: it is lockstep
                return self._as_in_tables(held, rows[:count])
        held, rows, commands = self._held(timeout * rate), [], deque(self.commands)
        starts = len(self.states) > count   # the first state is no tick
        for tick in range(count):
            while commands and commands[0][0] <= tick + starts:
                _, _, topic, message = commands.popleft()
                self._take(held, topic, message, tick)
            rows.append(held.in_force(tick))
        return self._as_in_tables(held, rows)

    def _of_commands(self):
        """Return the drive of a bag without joint_states: commands by the time they came."""
        held, times, rows = self._held(0.0), [], []
        for _, time, topic, message in self.commands:
            if not self._take(held, topic, message, 0):
                continue
            if times and time == times[-1]:
                rows.pop()
            else:
                times.append(time)
            rows.append(held.in_force(0))
        if len(times) < 2:
            raise ValueError(f'{self.node} has no joint_states, and less than two commands')
        gap = median(after - before for before, after in pairwise(times))
        rate = next(_plain(1e9 / gap))
        return RecordedDrive(
            self._table([(time - times[0]) * 1e-9 for time in times],
                        self._as_in_tables(held, rows)), 1 / rate, {},
            (f'without {self.node}/joint_states what was commanded is taken, when it came',), {})

    def _held(self, timeout):
        ports = self._mechanism.ports + self._mechanism.actuators
        return HeldInputs(ports, (math.inf,) * len(ports), timeout, self._prefix)

    def _take(self, held, topic, message, tick):
        """Let a command be taken as the node takes it; return whether it was."""
        try:
            if topic == 'torques':
                held.demand(message.name, Joints(message.effort, message.velocity), tick, True)
            else:
                held.demand((input_topics(self._mechanism)[topic],), (message.data,), tick)
        except ValueError:
            return False
        return True

    def _as_in_tables(self, held, rows):
        """Return the rows as those of a table: without forces, where none ever came."""
        silent, count = held.silent(), len(self._mechanism.ports)
        if free := [shaft for shaft in self._mechanism.half_shafts if shaft in silent]:
            raise ValueError(f'no speed of {", ".join(free)}, where one comes in, is in it')
        if all(actuator.name in silent for actuator in self._mechanism.actuators):
            rows = [row[:count] for row in rows]
        return [tuple(None if value is None else float(value) for value in row) for row in rows]

    def _table(self, times, rows):
        idle = [port.idle for port in self._mechanism.ports]
        idle += [0.0] * (len(rows[0]) - len(idle))
        return TorqueTable(tuple(times), tuple(rows), tuple(idle))


def _stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def _prefix(names, shafts):
    """Return what stands before each of the shafts to make the names, None if nothing does."""
    if not names or len(names) != len(shafts) or not names[0].endswith(shafts[0]):
        return None
    prefix = names[0][:len(names[0]) - len(shafts[0])]
    return prefix if names == [prefix + shaft for shaft in shafts] else None


def _remark(stamps, ends, rate, simulated):
    """Return what a user may not know of ticks that end at some stamps; '' for nothing."""
    if simulated:
        lost = ends[-1] - ends[0] + 1 - len(ends)
        return f'{lost} ticks are missing, and are taken to be as the next one' if lost else ''
    gaps = [after - before for before, after in pairwise(stamps)]
    usual = median(gaps)
    late = sum(gap > LATE * usual for gap in gaps)
    return (f'{len(stamps)} messages with stamps of system time: each is taken for the end of a '
            f'tick of 1/{rate:g} s' + (f'; {late} came late, as ticks were missed by the node or '
                                       'messages by the recorder' if late else ''))


def _ticks(stamps, expected):
    """
    Return the rate of ticks, Hz, and which tick ends at each stamp.

    The latter is None where the stamps are no multiples of one tick, rounded to ns as a node
    rounds them; the rate is then the expected one, if that may be, or a plain number near it.
    """
    gap = median(after - before for before, after in pairwise(stamps))
    if gap <= 0:
        raise ValueError('its stamps go back in time')
    for rate in _plain(1e9 / gap):
        ends = [round(stamp * rate / 1e9) for stamp in stamps]
        if all(round(end * 1e9 / rate) == stamp for end, stamp in zip(ends, stamps)) and all(
                after > before for before, after in pairwise(ends)):
            return rate, ends
    if abs(expected * gap / 1e9 - 1) < JITTER:
        return expected, None
    return next(_plain(1e9 / gap)), None


def _plain(number):
    """Yield numbers near a number, from one with few digits on."""
    for digits in range(1, 17):
        rounded = float(f'{number:.{digits}g}')
        if abs(rounded / number - 1) < ROUNDING:
            yield rounded
