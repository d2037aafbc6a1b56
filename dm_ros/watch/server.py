# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The server of the page: files, one stream of events for each viewer, and commands."""

from html import escape
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
import json
from pathlib import Path
import secrets
import select
import socket
import sys
import threading

from dm_ros.watch.commands import read, Refused
from dm_ros.watch.guard import Guard, is_token, TOKEN

WEB = Path(__file__).with_name('web')
PAGE = WEB / 'page.html'
TYPES = {'.html': 'text/html; charset=utf-8', '.js': 'text/javascript; charset=utf-8',
         '.css': 'text/css; charset=utf-8', '.svg': 'image/svg+xml'}
HEADERS = {
    'Content-Security-Policy':
        "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; "
        "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
    'Referrer-Policy': 'no-referrer',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cache-Control': 'no-store',
}
LARGEST_BODY = 4096       # bytes of a request
PATIENCE = 5.0            # s for a viewer to take what is sent, and for a request to come
LOOK = 0.25               # s from one look at whether a viewer is still there to the next
BEAT = 10.0               # s from one sign of life to the next where nothing happens
SEND_BUFFER = 1 << 17     # bytes that the system keeps for a viewer
CONNECTIONS = 64          # at once
FULL = """<!doctype html><html lang="en"><meta charset="utf-8"><title>watch: full</title>
<h1>All seats are taken</h1><p>{} viewers look at this differential already. Close one of them and
load this page again.</p></html>"""


def files():
    """Return ``{path: (type, bytes)}`` of all that is served, but for the page itself."""
    return {f'/{path.relative_to(WEB).as_posix()}': (TYPES[path.suffix], path.read_bytes())
            for path in sorted(WEB.rglob('*')) if path.suffix in TYPES and path != PAGE}


def page(token):
    """Return the page; token: what allows to command, None where nobody may."""
    tag = f'<meta name="token" content="{escape(token)}">' if token else ''
    return PAGE.read_text().replace('<!-- token -->', tag).encode()


class Server(ThreadingHTTPServer):
    """
    Serves the page, in threads of its own.

    :raises ValueError: names the port or host to which it cannot be bound.
    """

    daemon_threads = True
    block_on_close = False
    request_queue_size = 32

    def __init__(self, host, port, viewers, command=None):
        """
        Bind to a port; 0 for one that is free.

        :param viewers: the ``Viewers`` to whom events go.
        :param command: function of a viewer and a request, which returns what to answer and
            raises ``Refused``; None where nobody may command.
        """
        try:
            family, _, _, _, address = socket.getaddrinfo(
                host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)[0]
            self.address_family = family
            super().__init__(address[:2], Handler)
        except OSError as error:
            raise ValueError(f'port {port} of {host}: {error.strerror}') from error
        self.port = self.server_address[1]
        self.guard = Guard(host, self.server_address[0], self.port)
        self.viewers, self.command = viewers, command
        self.token = secrets.token_urlsafe(32) if command else None
        self.files = files()
        self.page = page(self.token)
        self._room = threading.BoundedSemaphore(CONNECTIONS)
        name = self.guard.name
        self.url = f'http://{f"[{name}]" if ":" in name else name}:{self.port}/'

    def server_bind(self):
        """Bind without a look at the name of the host, which may take long."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = self.server_address[:2]

    def process_request(self, request, client_address):
        """Serve a connection in a thread, or close it where there are too many."""
        if not self._room.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request, client_address):
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._room.release()

    def handle_error(self, request, client_address):
        """Tell what went wrong, but for viewers who left in the middle of it."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class Handler(BaseHTTPRequestHandler):
    """Serves one request."""

    timeout = PATIENCE
    server_version = 'watch'
    sys_version = ''

    def do_GET(self):
        """Serve the page, its files, or the stream of events."""
        path = self.path.partition('?')[0]
        if refusal := self.server.guard.refusal(self.headers, is_page=path == '/'):
            self.tell(403, refusal)
        elif path == '/':
            if self.server.viewers.has_seat():
                self.answer(200, TYPES['.html'], self.server.page)
            else:
                self.answer(503, TYPES['.html'], FULL.format(len(self.server.viewers)).encode())
        elif path == '/events':
            self.stream()
        elif path in self.server.files:
            self.answer(200, *self.server.files[path])
        else:
            self.tell(404, 'there is no such page')

    def do_POST(self):
        """Take a command."""
        body = self.body()
        try:
            answer = self.obey(body)
        except Refused as refused:
            self.tell(refused.status, refused)
        else:
            self.answer(200, 'application/json', json.dumps(answer).encode())

    def obey(self, body):
        """Return what to answer to a command; raise ``Refused``."""
        server = self.server
        if refusal := server.guard.refusal(self.headers):
            raise Refused(403, refusal)
        if not server.command:
            raise Refused(403, 'nobody may command, watch was started without --control')
        if not is_token(self.headers.get(TOKEN), server.token):
            raise Refused(403, f'the header {TOKEN} has not the token of the page')
        if self.path != '/control':
            raise Refused(404, 'commands go to /control')
        if self.headers.get_content_type() != 'application/json':
            raise Refused(415, 'the body must be application/json')
        if body is None:
            raise Refused(413, f'a body of up to {LARGEST_BODY} bytes is expected, with its '
                               'Content-Length')
        request = read(body)
        viewer = request.get('viewer')
        if not server.viewers.knows(viewer):
            raise Refused(409, '"viewer" must be the one that the stream of events named')
        try:
            return server.command(viewer, request)
        finally:
            if not server.viewers.knows(viewer):   # it has left meanwhile
                server.viewers.on_leave(viewer)

    def body(self):
        """Return the body, None where it is too long or its length is not told."""
        length = self.headers.get('Content-Length', '')
        if not length.isascii() or not length.isdigit() or len(length) > 9:
            return None
        length = int(length)
        if length <= LARGEST_BODY:
            return self.rfile.read(length)
        for _ in range(min(length, 1 << 20) // LARGEST_BODY):   # for the answer to be read
            self.rfile.read(LARGEST_BODY)
        return None

    def stream(self):
        """Send events until the viewer leaves, or does not take them."""
        viewer = self.server.viewers.enter()
        if not viewer:
            self.tell(503, 'all seats are taken')
            return
        try:
            self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
            self.begin(200, 'text/event-stream')
            self.end_headers()
            quiet = 0.0
            while not viewer.gone.is_set() and not self.has_left():
                data = viewer.take(LOOK)
                quiet = 0.0 if data else quiet + LOOK
                if quiet > BEAT:
                    data, quiet = b': still here\n\n', 0.0
                if data:
                    self.wfile.write(data)
        except OSError:   # it left, or took nothing for so long
            pass
        finally:
            self.server.viewers.leave(viewer)

    def has_left(self):
        """Return whether the viewer has closed the connection: it has nothing more to say."""
        return bool(select.select([self.connection], [], [], 0)[0])

    def begin(self, status, kind):
        """Send the status and the headers that all answers have."""
        self.send_response(status)
        for name, value in {'Content-Type': kind, **HEADERS}.items():
            self.send_header(name, value)

    def answer(self, status, kind, data):
        """Send a whole answer."""
        self.begin(status, kind)
        self.send_header('Content-Length', str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def tell(self, status, words):
        """Send words."""
        self.answer(status, 'text/plain; charset=utf-8', f'{words}\n'.encode())

    def send_error(self, code, message=None, explain=None):
        """Answer what is no request, or no method of these, as all else."""
        self.close_connection = True
        self.tell(code, message or self.responses.get(code, ('?',))[0])

    def log_message(self, *_):
        """Write no log of requests."""
