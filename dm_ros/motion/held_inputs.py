# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The inputs in force: what was demanded, what of it is refused, clamped or too old."""

from typing import NamedTuple, Sequence


class Joints(NamedTuple):
    """The arrays of a JointState; what there is no speed port for is not looked at."""

    efforts: Sequence
    velocities: Sequence


class HeldInputs:
    """
    The last demand for each port and when it came, counted in ticks.

    A demand is taken whole or not at all. A port without one in force has what it has when
    idle: no torque, no force, and no speed, which is None. Ages are counted in simulated time, so
    a paused mechanism does not lose its inputs.
    """

    def __init__(self, ports, limits, timeout, prefix=''):
        """
        Start without any demand.

        :param ports: the ``Port`` s of a mechanism; the inputs in force follow their order.
        :param limits: of each port, larger demands are clamped to it, in the unit of the port.
        :param timeout: ticks, an older demand counts as zero; 0 for never.
        :param prefix: before the names that come with ``Joints``.
        """
        self.ports = ports
        self.names = tuple(port.name for port in ports)
        self.limits = limits
        self.timeout = timeout
        self.received = self.refused = self.clamped = 0
        self._index = {name: i for i, name in enumerate(self.names)}
        self._prefixed = {prefix + name: name for name in self.names} if prefix else None
        self._speeds = {port.name for port in ports if port.kind == 'speed'}
        self.forget()

    def forget(self):
        """Drop all demands: every port waits for its first one."""
        self._demand = [port.idle for port in self.ports]
        self._arrival = [None] * len(self.ports)
        self.commanded = []   # the ports of the last demand that was taken, by index

    def demand(self, names, values, tick, sparse=False):
        """
        Take a demand for some ports at a tick; return ``(port, limit)`` where it was clamped.

        :param values: for each name, or ``Joints``: where there are speed ports each of its
            arrays holds NaN, or is empty, where the other counts.
        :param sparse: whether NaN stands for no demand: the port keeps the older one, and its age.
        :raises ValueError: says why the demand is refused; the older one stays.
        """
        try:
            clamped = self._take(names, values, tick, sparse)
        except ValueError:
            self.refused += 1
            raise
        self.received += 1
        self.clamped += bool(clamped)
        return clamped

    def in_force(self, tick):
        """Return the inputs that hold in a tick, as a tuple."""
        if not self.timeout:
            return tuple(self._demand)
        oldest = tick - self.timeout
        return tuple([port.idle if arrival is None or arrival < oldest else value
                      for port, value, arrival in zip(self.ports, self._demand, self._arrival)])

    def stale(self, tick):
        """Return the names of the ports whose demand is too old."""
        return [name for name, arrival in zip(self.names, self._arrival)
                if self.timeout and arrival is not None and arrival < tick - self.timeout]

    def silent(self):
        """Return the names of the ports that never had a demand."""
        return [name for name, arrival in zip(self.names, self._arrival) if arrival is None]

    def _without_prefix(self, names):
        for name in names:
            if name not in self._prefixed:
                raise ValueError(f'{name!r} is not one of {", ".join(self._prefixed)}')
        return [self._prefixed[name] for name in names]

    def _mismatch(self, names, what, values):
        """Return why an array of a message is refused, and what to do about it."""
        known = self._prefixed or self._index
        others = [name for name in names if name not in known] if what == 'efforts' else ()
        return (f'{len(names)} names but {len(values)} {what}: each name needs one, NaN for no '
                f'command{", but leave out " * bool(others)}{", ".join(others)}; in ros2_control '
                f'declare a command interface {"effort" if what == "efforts" else "velocity"} for '
                'each joint of the system, and joints without in a system of their own')

    def _of_kinds(self, names, efforts, velocities):
        """Return one value for each name, the one that its port takes."""
        for name in names:
            if name not in self._index:
                raise ValueError(f'{name!r} is not one of {", ".join(self.names)}')
        kinds = [name in self._speeds for name in names]
        for what, values, needed in (('efforts', efforts, False),
                                     ('velocities', velocities, True)):
            if len(values) != len(names) and (len(values) or needed in kinds):
                raise ValueError(self._mismatch(names, what, values))
        values = []
        for i, (name, is_speed) in enumerate(zip(names, kinds)):
            takes, other = (velocities, efforts) if is_speed else (efforts, velocities)
            if len(other) and other[i] == other[i]:   # not NaN
                raise ValueError(f'{name} takes {"a speed" if is_speed else "no speed"}, its '
                                 f'{"effort" if is_speed else "velocity"} must be NaN')
            values.append(takes[i])
        return values

    def _take(self, names, values, tick, sparse):
        if isinstance(values, Joints):
            if not self._speeds and len(names) != len(values.efforts):
                raise ValueError(self._mismatch(names, 'efforts', values.efforts))
            if self._prefixed:
                names = self._without_prefix(names)
            values = (self._of_kinds(names, *values) if self._speeds else values.efforts)
        if len(names) != len(values):
            raise ValueError(f'{len(names)} names but {len(values)} values')
        if len(set(names)) != len(names):
            raise ValueError(f'a name comes twice in {", ".join(names)}')
        demands = []
        for name, value in zip(names, values):
            if name not in self._index:
                raise ValueError(f'{name!r} is not one of {", ".join(self.names)}')
            if sparse and value != value:   # NaN
                continue
            i = self._index[name]
            if refusal := self.ports[i].refusal(value):
                raise ValueError(refusal)
            demands.append((i, value))
        clamped = []
        self.commanded = [i for i, _ in demands]
        for i, value in demands:
            limit = self.limits[i]
            self._demand[i] = min(max(value, -limit), limit)
            self._arrival[i] = tick
            if abs(value) > limit:
                clamped.append((self.ports[i], limit))
        return clamped
