# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Where the commands for each shaft and clutch come from, and where several sources fight."""

from collections import deque

from dm_ros.ros.graph import in_words

WINDOW = 3   # reports in which a port has changed its source ...
OFTEN = 2    # ... so many times if two fight over it: one change is a source that was replaced


class Sources:
    """
    The sources of what a node takes.

    The topic of a single port is for one publisher. By the grouped one several nodes may command
    different ports, so what counts there is what was received for each port: a message does not
    tell its publisher, but a number, which only grows as long as it is one and the same.
    """

    def __init__(self, ports, grouped, single, neighbours):
        """
        Begin without any command.

        :param ports: names of all ports, in their order.
        :param grouped: topic of the messages for many of them.
        :param single: {topic: (port, subscription)} of the topics of single ports.
        :param neighbours: tells who publishes.
        """
        self._ports, self._single, self._neighbours = ports, single, neighbours
        self._grouped = grouped
        self._last = [None] * len(ports)   # (whether it was grouped, number) of the last command
        self._changes = [0] * len(ports)
        self._seen = deque([tuple(self._changes)], WINDOW + 1)

    def note(self, ports, is_grouped, number):
        """
        Note a command; a microsecond in a tick.

        :param ports: by index; is_grouped: whether it came with others.
        :param number: of the message among those of its publisher, None where none is told.
        """
        for port in ports:
            if before := self._last[port]:
                was_grouped, last = before
                if was_grouped is not is_grouped or (
                        is_grouped and number is not None and number <= last):
                    self._changes[port] += 1
            self._last[port] = is_grouped, number or 0

    def contested(self):
        """Return ``{port: topics and nodes}`` of those that several command; for 1 Hz."""
        self._seen.append(tuple(self._changes))
        found = {}
        for index, port in enumerate(self._ports):
            single = [topic for topic, (name, _) in self._single.items() if name == port]
            if self._seen[-1][index] - self._seen[0][index] >= OFTEN:
                found[port] = self._who([*single, self._grouped])
            elif any(self._single[topic][1].get_publisher_count() > 1 for topic in single):
                found[port] = self._who(single)
        return found

    def _who(self, topics):
        publishers = {topic: self._neighbours.publishers(topic) for topic in topics}
        return ' and '.join(f'{topic} of {in_words(names)}'
                            for topic, names in publishers.items() if names)
