# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a browser hears of ``watch``, for the tests over real topics."""

from contextlib import suppress
from http.client import HTTPConnection
import json
import queue
import re
import socket
import threading


class Page:
    """What a browser hears of ``watch``: the last event of each name."""

    def __init__(self, port):
        self._port = port
        self.token = self._token()
        self._connection = HTTPConnection('127.0.0.1', port, timeout=60.0)
        self._connection.request('GET', '/events')
        self._socket = self._connection.sock
        self._file = self._connection.getresponse()
        assert self._file.status == 200
        self.last, self.rows, self.history = {}, [], queue.SimpleQueue()
        threading.Thread(target=self._read, daemon=True).start()

    def _token(self):
        connection = HTTPConnection('127.0.0.1', self._port, timeout=60.0)
        connection.request('GET', '/')
        found = re.search('name="token" content="(.*?)"',
                          connection.getresponse().read().decode())
        return found and found.group(1)

    def _read(self):
        name = None
        try:
            while line := self._file.readline().decode():
                if line.startswith('event: '):
                    name = line.removeprefix('event: ').strip()
                elif line.startswith('data: '):
                    self._take(name, json.loads(line.removeprefix('data: ')))
        except (OSError, ValueError, AttributeError):   # closed
            pass

    def _take(self, name, data):
        if name == 'ticks':
            if data['emptied']:
                self.rows = []
            self.rows += data['rows']
        if name == 'scene' and data.get('variant') not in (None, self.variant):
            self.last.pop('ticks', None)   # those were of another node
        self.last[name] = data
        self.history.put((name, data))

    @property
    def now(self):
        """The newest tick, {} while there is none."""
        return self.last.get('ticks', {}).get('now') or {}

    @property
    def variant(self):
        """The variant that is shown, None while the page waits."""
        return self.last.get('scene', {}).get('variant')

    def ask(self, **request):
        """Return status and answer of a command."""
        connection = HTTPConnection('127.0.0.1', self._port, timeout=60.0)
        connection.request('POST', '/control', json.dumps(
            {'viewer': self.last['viewer'], **request}), {
                'Content-Type': 'application/json', 'X-Watch-Token': self.token or ''})
        response = connection.getresponse()
        text = response.read().decode()
        return response.status, json.loads(text) if response.status == 200 else text

    def close(self):
        """Leave."""
        with suppress(OSError):   # the server was faster
            self._socket.shutdown(socket.SHUT_RDWR)


def ask(ros, page, **request):
    """Return what ``page.ask`` does, while the nodes of this process spin."""
    answers = queue.SimpleQueue()
    threading.Thread(target=lambda: answers.put(page.ask(**request))).start()
    ros.until(lambda: not answers.empty())
    return answers.get()


def stamp_of(message):
    return message.header.stamp.sec + message.header.stamp.nanosec * 1e-9
