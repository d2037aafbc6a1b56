# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The inputs in force: what was demanded, what of it is refused, clamped or too old."""

from typing import NamedTuple, Sequence

NOUNS = {'effort': 'effort', 'velocity': 'speed', 'position': 'position'}


class Joints(NamedTuple):
    """The arrays of a JointState; those that no port takes are not looked at."""

    effort: Sequence
    velocity: Sequence = ()
    position: Sequence = ()


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
        self._arrays = [array for array in Joints._fields
                        if array == 'effort' or array in [port.array for port in ports]]
        self.forget()

    def forget(self):
        """Drop all demands: every port waits for its first one."""
        self._demand = [port.idle for port in self.ports]
        self._arrival = [None] * len(self.ports)
        self.commanded = []   # the ports of the last demand that was taken, by index

    def demand(self, names, values, tick, sparse=False):
        """
        Take a demand for some ports at a tick; return ``(port, limit)`` where it was clamped.

        :param values: for each name, or ``Joints``: where ports take several of its arrays,
            each holds NaN, or is empty, where another counts.
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
        return tuple([
            port.idle if arrival is None or arrival < oldest and not port.lasts else value
            for port, value, arrival in zip(self.ports, self._demand, self._arrival)])

    def stale(self, tick):
        """Return the names of the ports whose demand is too old."""
        return [port.name for port, arrival in zip(self.ports, self._arrival)
                if self.timeout and arrival is not None and arrival < tick - self.timeout
                and not port.lasts]

    def silent(self):
        """Return the names of the ports that never had a demand."""
        return [name for name, arrival in zip(self.names, self._arrival) if arrival is None]

    def _without_prefix(self, names):
        for name in names:
            if name not in self._prefixed:
                raise ValueError(f'{name!r} is not one of {", ".join(self._prefixed)}')
        return [self._prefixed[name] for name in names]

    def _mismatch(self, names, array, values):
        """Return why an array of a message is refused, and what to do about it."""
        known = self._prefixed or self._index
        others = [name for name in names if name not in known] if array == 'effort' else ()
        plural = {'effort': 'efforts', 'velocity': 'velocities', 'position': 'positions'}[array]
        if 'position' in self._arrays:
            return (f'{len(names)} names but {len(values)} {plural}: each array needs one for '
                    'each name, NaN where another array has its command, or none at all')
        return (f'{len(names)} names but {len(values)} {plural}: each name needs one, NaN for no '
                f'command{", but leave out " * bool(others)}{", ".join(others)}; in ros2_control '
                f'declare a command interface {array} for each joint of the system, and joints '
                'without in a system of their own')

    def _of_arrays(self, names, joints):
        """Return one value for each name, from the array that its port takes."""
        for name in names:
            if name not in self._index:
                raise ValueError(f'{name!r} is not one of {", ".join(self.names)}')
        taken = [self.ports[self._index[name]].array for name in names]
        for array in self._arrays:
            values = getattr(joints, array)
            if len(values) != len(names) and (len(values) or array in taken):
                raise ValueError(self._mismatch(names, array, values))
        values = []
        for i, (name, array) in enumerate(zip(names, taken)):
            for other in self._arrays:
                numbers = getattr(joints, other)
                if other != array and len(numbers) and numbers[i] == numbers[i]:   # not NaN
                    raise ValueError(f'{name} takes '
                                     f'{f"no {NOUNS[other]}" if array == "effort" else ""}'
                                     f'{f"a {NOUNS[array]}" if array != "effort" else ""}'
                                     f', its {other} must be NaN')
            values.append(getattr(joints, array)[i])
        return values

    def _take(self, names, values, tick, sparse):
        if isinstance(values, Joints):
            only_efforts = len(self._arrays) == 1
            if only_efforts and len(names) != len(values.effort):
                raise ValueError(self._mismatch(names, 'effort', values.effort))
            if self._prefixed:
                names = self._without_prefix(names)
            values = values.effort if only_efforts else self._of_arrays(names, values)
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
