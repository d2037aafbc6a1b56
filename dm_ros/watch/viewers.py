# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Those who look: each has a bounded queue of events, and costs the others nothing."""

from queue import Empty, Full, Queue
import secrets
import threading

MOST = 8          # viewers at once
WAITING = 150     # events that wait for a viewer before it is dropped, some seconds of them
LEAVING = 1.0     # s in which a page that is loaded anew finds its old seat free


def event(name, data):
    """Return a server-sent event; data: JSON in one line."""
    return f'event: {name}\ndata: {data}\n\n'.encode()


class Viewer:
    """One who looks."""

    def __init__(self):
        self.name = secrets.token_urlsafe(12)   # by which its commands are known as its own
        self.gone = threading.Event()
        self._events = Queue(WAITING)

    def put(self, data):
        """Give it an event; one that has not taken the last ones is dropped."""
        try:
            self._events.put_nowait(data)
        except Full:
            self.gone.set()

    def take(self, seconds):
        """Return all that waits for it, after so long at the most; may be empty."""
        parts = []
        try:
            parts.append(self._events.get(timeout=seconds))
            while True:
                parts.append(self._events.get_nowait())
        except Empty:
            return b''.join(parts)


class Viewers:
    """
    All who look; events go to each of them.

    :ivar greeting: function that returns the events with which a viewer begins.
    :ivar on_leave: function that is called with the name of one who has left.
    """

    def __init__(self, most=MOST):
        self._most = most
        self._viewers = []
        self._changed = threading.Condition(threading.RLock())
        self.greeting, self.on_leave = list, lambda name: None

    def __len__(self):
        return len(self._viewers)

    def has_seat(self, seconds=LEAVING):
        """Return whether there is room for one more, after so long at the most."""
        with self._changed:
            return self._changed.wait_for(lambda: len(self._viewers) < self._most, seconds)

    def enter(self):
        """Return a new ``Viewer``, None where there is no room."""
        with self._changed:
            if not self.has_seat():
                return None
            viewer = Viewer()
            viewer.put(event('viewer', f'"{viewer.name}"'))
            for data in self.greeting():   # at the lock: it misses no event and has none twice
                viewer.put(data)
            self._viewers.append(viewer)
            return viewer

    def knows(self, name):
        """Return whether one of this name looks now."""
        with self._changed:
            return any(viewer.name == name for viewer in self._viewers)

    def leave(self, viewer):
        """Let a viewer go."""
        with self._changed:
            self._viewers.remove(viewer)
            self._changed.notify_all()
        self.on_leave(viewer.name)

    def close(self):
        """Let all go."""
        with self._changed:
            for viewer in self._viewers:
                viewer.gone.set()

    def publish(self, *events, change=None):
        """
        Give events to all.

        :param change: function that brings what ``greeting`` tells to the state after them.
        """
        with self._changed:
            if change:
                change()
            for viewer in self._viewers:
                for data in events:
                    viewer.put(data)
