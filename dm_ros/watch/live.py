# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What is known of the node now, and the events that tell the viewers when it changes."""

import json

from dm_ros.watch.scenes import scene_of
from dm_ros.watch.ticks import Joined, Strips, Travel
from dm_ros.watch.viewers import event


def as_json(value):
    """Return JSON in one line; what is no number there is null."""
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        return json.dumps(json.loads(json.dumps(value), parse_constant=lambda _: None))


class Live:
    """
    The node as the viewers see it; all methods are for one thread.

    :ivar scene: what ``scene_of`` returns for the node, None while there is none.
    """

    def __init__(self, name, viewers, commands):
        """:param name: full name of the node; viewers: ``Viewers``; commands: ``Commands``."""
        self._name, self._viewers, self._commands = name, viewers, commands
        self.scene = None
        self._now, self._reports, self._told = None, [], {}
        self._waiting = {'node': name, 'refusal': None}
        self._fresh()
        viewers.greeting = self._greeting

    def _fresh(self):
        self._strips, self._travel = Strips(), Travel()
        self._joined = None

    def came(self, values):
        """
        Take the parameters of a node that has come; raise ValueError for what cannot be shown.

        :param values: ``{full name: value}``.
        """
        scene = scene_of(self._name, values)
        self._fresh()
        self._strips = Strips(1 / scene.node.rate)
        self._joined = Joined(len(scene.topics))
        self._commands.begin(scene.ports)
        self._now, self._reports = None, []
        self._show(scene)

    def changed(self, values):
        """Take the parameters of the node after some have been changed, as ``came`` does."""
        scene = scene_of(self._name, values)
        if self.scene and (scene.names, scene.topics) == (
                self.scene.names, self.scene.topics):
            if scene.ports != self.scene.ports:
                self._commands.begin(scene.ports)
            self._show(scene)
        else:   # clutches have come or gone
            self.came(values)

    def went(self, refusal=None):
        """Forget the node: it has ended; refusal: why it cannot be shown, if that is so."""
        if not self.scene and self._waiting['refusal'] == refusal:
            return
        self._waiting = {'node': self._name, 'refusal': refusal}
        self._fresh()
        self._now, self._reports = None, []
        self._commands.begin([])
        self._show(None)

    def put(self, topic, stamp, arrays):
        """
        Take a message of the node.

        :param topic: which of ``scene.topics``, by number; stamp: ns; arrays: of numbers.
        """
        self._joined.put(topic, stamp, arrays)

    def put_flow(self, topic, flow):
        """Take a power-flow index without a stamp; topic: one of ``scene.flows``."""
        self.scene.take_flow(topic, flow)

    def reports(self, statuses):
        """Take what the node says of itself: a dictionary for each status."""
        self._reports = statuses
        self._viewers.publish(event('diagnostics', as_json(statuses)))

    def flush(self):
        """Tell the viewers what has come since the last call."""
        if self.scene:
            self._tell_ticks()
        values = self._commands.values
        if values != self._told:
            def change():
                self._told = values
            self._viewers.publish(event('commands', as_json(values)), change=change)

    def _tell_ticks(self):
        ticks, scene = self._joined.take(), self.scene
        if not ticks:
            return
        for tick in ticks:
            is_reset = self._travel.add(scene.angles(tick.parts))
            self._strips.add(tick.stamp, scene.row(tick.parts), is_reset)
        if len(ticks) == 1:   # it may be the last one for long
            self._strips.close()
        now = {'stamp': tick.stamp * 1e-9, 'ticks': len(ticks), 'lost': self._joined.lost,
               **scene.told(tick.parts, self._travel.total)}
        emptied, rows = self._strips.take()

        def change():
            self._now = now
        self._viewers.publish(self._ticks_event(emptied, rows, now), change=change)

    @staticmethod
    def _ticks_event(emptied, rows, now):
        return event('ticks', f'{{"emptied":{as_json(emptied)},"rows":{rows},'
                              f'"now":{as_json(now)}}}')

    def _show(self, scene):
        def change():
            self.scene = scene
        self._viewers.publish(self._scene_event(scene), change=change)

    def _scene_event(self, scene):
        return event('scene', as_json(scene.description if scene else self._waiting))

    def _greeting(self):
        """Return the events that tell all."""
        return [self._scene_event(self.scene),
                self._ticks_event(True, self._strips.all(), self._now),
                event('diagnostics', as_json(self._reports)),
                event('commands', as_json(self._told))]
