# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a node drives: a simulation with what was demanded of it, what is refused, what it says of it.

The node gives what is ``Driven`` to a loop, and topics and services to the loop; a test or another
program drives it by the same methods. It knows no ROS, no clock and no thread: all its methods but
``prepared`` belong between two ticks.
"""

from dm_ros.motion.held_inputs import HeldInputs


class Condition:
    """
    Something that should not be: counted, logged when it begins and when it has ended.

    It is ``active`` until a second without it. The log is slower to say that it is over, so that
    one that comes and goes takes two lines, and not two in every second.
    """

    QUIET = 10   # s without it, after which the log says that it is over

    def __init__(self, what, log):
        """:param what: in words, such as ``ticks are missed``; log: has ``warning``, ``info``."""
        self.what = what
        self.count = 0
        self.reason = ''
        self.active = False
        self._log = log
        self._settled = self._before = self._quiet = 0
        self._told = False   # in the log that it has begun, and not yet that it is over

    def __str__(self):
        return f'{self.what}: {self.reason}'

    def happened(self, reason, times=1):
        """Count it, and log it if it begins now."""
        self.count += times
        self.reason = reason
        self.active = True
        if not self._told:
            self._told = True
            self._log.warning(str(self))

    def settle(self):
        """End it if it did not happen since the last call; to be called at 1 Hz."""
        self._quiet = self._quiet + 1 if self.count == self._settled else 0
        if self._quiet:
            self.active = False
        if self._told and self._quiet >= self.QUIET:
            self._tell('over')
        self._settled = self.count

    def end(self):
        """Tell what was since it began, if that is not over; when nothing more will happen."""
        if self._told:
            self._tell('at the end')

    def _tell(self, when):
        self._told = False
        times = self.count - self._before
        self._log.info(f'{when}: {self.what} ({times} times since it began)')
        self._before = self.count


class Driven:
    """
    A simulation as a node runs it, whatever it is of.

    A subclass has ``values`` and ``rows``, all parameters by full name and what is known of them;
    ``prepared`` and ``adopt``, which change some of them; ``title`` and ``words`` for the log; and
    ``_step``, which makes a tick under what is held for each port.

    :param settings: ``LoopParameters``; simulation: has ``ticks``, ``dt``, ``time``, ``language``,
        ``coarse_steps``, ``snapshot`` and ``reset``.
    :param ports: the ``Port`` s that it takes, in its order.
    :param single_topics: ``{topic: port name}`` of the topics of single ports, below ~.
    :param log: has ``warning`` and ``info``; conditions are logged there.
    """

    grouped = 'torques'   # the topic of messages that bring many inputs, below ~
    driving = ()          # names of the ports without all of which nothing is driven

    def __init__(self, settings, simulation, ports, single_topics, log):
        self.settings, self.simulation = settings, simulation
        self.single_topics = single_topics
        self.inputs = HeldInputs(ports, (), 0.0, settings.joint_prefix)
        self.ticks = 0   # in all, also refused ones and those before a reset
        self.refusing = Condition('messages are refused', log)
        self.clamping = Condition('demands are clamped', log)
        self.stale = Condition('demands are too old and count as zero', log)
        self.out_of_range = Condition('ticks are refused', log)
        self.coarse = Condition('solver steps are coarse', log)
        self._last_stamp = self._coarse_before = 0

    @property
    def lockstep(self):
        """Whether each demand brings its own tick."""
        return self.settings.mode == 'lockstep'

    def take(self, names, values, what, stamp=0, sparse=False):
        """
        Take a demand for some ports, whole or not at all; return whether it was taken.

        :param values: for each name, in the unit of its port, or ``Joints``, see
            ``HeldInputs.demand``.
        :param what: what brought it, in words.
        :param stamp: ns, in which demands must follow one another; 0 for none.
        :param sparse: whether NaN stands for no demand, else it is refused.
        """
        if stamp and stamp <= self._last_stamp:
            self.inputs.refused += 1
            self.refusing.happened(f'{what}: its stamp repeats or goes back in time')
            return False
        try:
            if clamped := self.inputs.demand(names, values, self.simulation.ticks, sparse):
                limits = dict.fromkeys(f'{limit:g} {port.unit}' for port, limit in clamped)
                self.clamping.happened(f'{what}: beyond {", ".join(limits)}')
        except ValueError as error:
            self.refusing.happened(f'{what}: {error}')
            return False
        self._last_stamp = stamp or self._last_stamp
        return True

    def tick(self):
        """
        Advance one tick under the inputs in force and return the ``Snapshot``.

        A tick that would lead out of the range of numbers is refused and counted: the state stays.
        """
        held = self.inputs.in_force(self.simulation.ticks)
        self.ticks += 1
        try:
            return self._step(held)
        except ValueError as error:
            self.out_of_range.happened(str(error))
            return self.simulation.snapshot()

    def reset(self):
        """Go back to the start, without any demand; parameters stay."""
        self._reset_simulation()
        self.inputs.forget()
        self._last_stamp = self._coarse_before = 0

    def _reset_simulation(self):
        self.simulation.reset()

    def checked(self, changes):
        """Return changes of parameters by full name; raise ValueError for what cannot change."""
        rows, before = self.rows, self.values
        for name, value in changes.items():
            if name not in rows:
                raise ValueError(f'{name}: there is no such parameter')
            if rows[name].read_only and value != before[name]:
                raise ValueError(f'{name}: it cannot be changed while it runs')
        return changes

    def limit(self, limits):
        """Put the limits of all ports, and the age at which a demand is stale, into force."""
        self.inputs.limits = limits
        # in lockstep time stands still without messages, so none is too old
        settings = self.settings
        self.inputs.timeout = 0.0 if self.lockstep else settings.torque_timeout * settings.rate

    def notice(self):
        """Notice what is not noticed where it happens; to be called at 1 Hz."""
        coarse = self.simulation.coarse_steps
        if coarse > self._coarse_before:
            self._notice_coarse(coarse - self._coarse_before)
        self._coarse_before = coarse
        if names := self.inputs.stale(self.simulation.ticks):
            self._notice_stale(names)

    def _notice_coarse(self, count):
        self.coarse.happened('their work reached its bound', count)

    def _notice_stale(self, names):
        self.stale.happened(', '.join(names))

    def told_of_loop(self):
        """Return ``{key: value}`` of what is driven, for diagnostics."""
        return {'steps in': self.simulation.language}

    def told_of_inputs(self):
        """Return ``{key: value}`` of what the inputs made of their demands, for diagnostics."""
        return {}

    def told_of_energy(self):
        """Return complaints and ``{key: value}`` of the energy, for diagnostics, None without."""
        return None

    def settle(self):
        """Let the conditions end that are over; to be called at 1 Hz, after ``notice``."""
        for condition in self.conditions:
            condition.settle()

    @property
    def of_inputs(self):
        """Those conditions that are of demands."""
        return self.refusing, self.clamping, self.stale

    @property
    def conditions(self):
        """All that should not be and may be."""
        return *self.of_inputs, self.out_of_range, self.coarse
