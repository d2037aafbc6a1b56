# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The server of ``watch``: whom it serves, what it refuses, and that nobody costs the others."""

from contextlib import contextmanager
from http.client import HTTPConnection
import json
from pathlib import Path
import re
import socket
import threading
import time

import pytest

from dm_ros.mechanism.variants import VARIANTS
from dm_ros.watch.commands import Commands, WORKS
from dm_ros.watch.guard import Guard
from dm_ros.watch.live import Live
from dm_ros.watch.scene import Scene
from dm_ros.watch.server import CONNECTIONS, LARGEST_BODY, Server
from dm_ros.watch.viewers import event, MOST, Viewers, WAITING

WEB = Path(__file__).parents[1] / 'dm_ros' / 'watch' / 'web'
PATIENCE = 60.0   # s for what will happen
ALONE = 'internal_moments', 'power_flow_stamped'   # topics with one array


def until(condition):
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, 'the condition did not come true in time'
        time.sleep(0.005)


@contextmanager
def serving(command=None, host='127.0.0.1'):
    """Give a server on a free port, without ROS."""
    server = Server(host, 0, Viewers(), command)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield server
    finally:
        server.viewers.close()
        server.shutdown()
        server.server_close()
        thread.join()


@pytest.fixture
def server():
    with serving() as server:
        yield server


@pytest.fixture
def controlled():
    """Give a server by which the default node can be commanded; ``commands`` has what came."""
    commands = Commands()
    commands.begin(Scene('/differential', {'variant': 'lsd_ode'}).ports)

    def command(viewer, request):
        commands.set(viewer, request.get('values'))
        return {'success': True, 'message': ''}
    with serving(command) as server:
        server.commands = commands
        server.viewers.on_leave = commands.leave
        yield server


def asked(server, method='GET', path='/', body=None, **headers):
    """Return status, headers and text of an answer; names of headers have _ for -."""
    connection = HTTPConnection('127.0.0.1', server.port, timeout=PATIENCE)
    headers = {name.replace('_', '-'): value for name, value in headers.items()}
    host = headers.pop('Host', f'127.0.0.1:{server.port}')
    connection.putrequest(method, path, skip_host=True)
    if host is not None:
        connection.putheader('Host', host)
    if body is not None and 'Content-Length' not in headers:
        headers['Content-Length'] = str(len(body))
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders(body)
    response = connection.getresponse()
    answer = response.status, response.headers, response.read().decode()
    connection.close()
    return answer


class Stream:
    """A viewer."""

    def __init__(self, server):
        self.socket = socket.create_connection(('127.0.0.1', server.port), timeout=PATIENCE)
        host = f'127.0.0.1:{server.port}'
        self.socket.sendall(f'GET /events HTTP/1.1\r\nHost: {host}\r\n\r\n'.encode())
        self.file = self.socket.makefile('rb')
        self.status = int(self.file.readline().split()[1])
        while self.file.readline().strip():
            pass

    def next(self):
        """Return name and data of the next event."""
        lines = []
        while line := self.file.readline().decode().rstrip('\n'):
            lines.append(line)
        name, data = lines
        return name.removeprefix('event: '), json.loads(data.removeprefix('data: '))

    def close(self):
        self.file.close()
        self.socket.close()


@pytest.fixture
def look():
    """Return a function that makes a viewer of a server, closed after the test."""
    streams = []

    def look(server):
        streams.append(Stream(server))
        return streams[-1]
    yield look
    for stream in streams:
        stream.close()


def request(server, stream, body=None, **headers):
    """Return what ``asked`` does for a command of a viewer, all as it should be but the given."""
    name, viewer = stream.next()
    assert name == 'viewer'
    if body is None:
        body = {'do': 'set', 'values': {'carrier': 12.5}}
    if isinstance(body, dict):
        body = json.dumps({'viewer': viewer, **body})
    return asked(server, 'POST', '/control', body.encode(), **{
        'Content_Type': 'application/json', 'X_Watch_Token': server.token, **headers})


def test_the_page_and_its_files_come_with_headers_that_let_nothing_else_in(server):
    _, headers, text = asked(server)
    names = re.findall(r'(?:href|src)="([^"#]+)"', text)
    assert 'page.js' in names and len(names) > 4
    for name in ['', *names]:
        status, headers, _ = asked(server, path=f'/{name}')
        assert status == 200, name
        policy = headers['Content-Security-Policy']
        assert policy.startswith("default-src 'none'; script-src 'self'; style-src 'self';")
        assert 'unsafe' not in policy and "frame-ancestors 'none'" in policy
        assert headers['X-Content-Type-Options'] == 'nosniff'
        assert headers['Content-Type'].split(';')[0] in {
            'text/html', 'text/javascript', 'text/css', 'image/svg+xml'}


def test_no_file_of_the_page_names_another_place():
    files = [path for path in WEB.rglob('*') if path.suffix in ('.html', '.js', '.css', '.svg')]
    assert len(files) > 8
    for path in files:
        found = set(re.findall(r'(?:https?:)?//[\w.-]+\.\w+[^\s)\">]*', path.read_text()))
        assert found <= {'http://www.w3.org/2000/svg', 'https://github.com/leeoniya/uPlot'}, path
        if path.suffix == '.html':
            assert not re.search(r'<script(?![^>]*src=)|\son\w+=|\sstyle=', path.read_text())


def test_the_vendored_library_is_as_published_with_its_licence():
    folder = WEB / 'uplot'
    assert 'uPlot (v1.6.32)' in (folder / 'uPlot.iife.min.js').read_text()[:80]
    assert 'The MIT License' in (folder / 'LICENSE').read_text()


@pytest.mark.parametrize('path', [
    '/../server.py', '/..%2fserver.py', '/web/page.html', '//etc/passwd', '/uplot', '/page.html'])
def test_nothing_else_is_served(server, path):
    assert asked(server, path=path)[0] == 404


@pytest.mark.parametrize('path', ['/', '/page.js', '/events'])
@pytest.mark.parametrize('host', [
    'evil.example', 'evil.example:{port}', '127.0.0.1', '127.0.0.1:1', 'localhost.evil:{port}',
    '127.0.0.1.nip.io:{port}', '192.168.0.1:{port}', '', None])
def test_another_host_is_refused(server, path, host):
    host = host and host.format(port=server.port)
    status, _, words = asked(server, path=path, Host=host)
    assert status == 403 and 'Host' in words


@pytest.mark.parametrize('host', ['127.0.0.1:{port}', 'localhost:{port}', 'LOCALHOST:{port}'])
def test_its_own_host_is_served(server, host):
    host = host.format(port=server.port)
    assert asked(server, Host=host)[0] == 200
    assert asked(server, Host=host, Origin=f'http://{host}')[0] == 200


@pytest.mark.parametrize('origin', [
    'null', 'http://evil.example', 'https://127.0.0.1:{port}', 'http://127.0.0.1:1',
    'http://localhost:{port}', 'file://'])
def test_another_origin_is_refused(server, origin):
    status, _, words = asked(server, Origin=origin.format(port=server.port))
    assert status == 403 and 'Origin' in words


def test_what_another_page_embeds_is_refused_and_a_link_on_it_leads_to_the_page(server):
    embedded = {'Sec_Fetch_Site': 'cross-site', 'Sec_Fetch_Mode': 'no-cors'}
    assert asked(server, path='/events', **embedded)[0] == 403
    assert asked(server, **embedded)[0] == 403
    link = {'Sec_Fetch_Site': 'cross-site', 'Sec_Fetch_Mode': 'navigate'}
    assert asked(server, **link)[0] == 200
    assert asked(server, path='/events', **link)[0] == 403


def test_on_all_addresses_an_address_is_served_and_a_foreign_name_is_not():
    with serving(host='0.0.0.0') as server:
        for name, status in (('127.0.0.1', 200), ('10.1.2.3', 200), (socket.gethostname(), 200),
                             ('evil.example', 403)):
            assert asked(server, Host=f'{name}:{server.port}')[0] == status
        assert server.url == f'http://{socket.gethostname()}:{server.port}/'


def test_an_address_of_version_6_is_asked_for_in_brackets():
    guard = Guard('::1', '::1', 8350)
    for host, allowed in (('[::1]:8350', True), ('localhost:8350', True), ('[::1]', False),
                          ('[::2]:8350', False), ('127.0.0.1:8350', False)):
        assert guard.allows_host(host) == allowed, host
    assert Guard('127.0.0.1', '127.0.0.1', 80).allows_host('127.0.0.1')


@pytest.mark.parametrize('path', ['/', '/control', '/events'])
def test_without_control_each_post_is_refused(server, path):
    assert server.token is None and 'token' not in asked(server)[2]
    body = json.dumps({'do': 'reset'}).encode()
    status, _, words = asked(server, 'POST', path, body, Content_Type='application/json')
    assert status == 403 and '--control' in words


def test_a_command_reaches_the_node_and_ends_with_its_viewer(controlled, look):
    stream = look(controlled)
    assert request(controlled, stream)[0] == 200
    assert controlled.commands.values == {'carrier': 12.5}
    stream.close()
    until(lambda: controlled.commands.values == {})


def test_commands_stay_until_the_last_viewer_who_gave_any_leaves(controlled, look):
    first, second, onlooker = look(controlled), look(controlled), look(controlled)
    assert request(controlled, first)[0] == request(controlled, second, {
        'do': 'set', 'values': {'front_clutch': 300}})[0] == 200
    onlooker.close()
    first.close()
    until(lambda: len(controlled.viewers) == 1)
    assert controlled.commands.values == {'carrier': 12.5, 'front_clutch': 300.0}
    second.close()
    until(lambda: controlled.commands.values == {})


def test_no_command_stays_of_a_viewer_who_leaves_while_it_is_taken(controlled, look):
    stream, command = look(controlled), controlled.command

    def slow(viewer, request):
        stream.close()
        until(lambda: len(controlled.viewers) == 0)
        return command(viewer, request)
    controlled.command = slow
    assert request(controlled, stream)[0] == 200
    assert controlled.commands.values == {}


@pytest.mark.parametrize('token', ['', 'x', 'é'])
def test_a_command_needs_the_token_of_the_page(controlled, look, token):
    stream = look(controlled)
    assert f'content="{controlled.token}"' in asked(controlled)[2]
    assert controlled.token not in controlled.url
    status, _, words = request(controlled, stream, X_Watch_Token=token)
    assert status == 403 and 'token' in words and controlled.commands.values == {}


@pytest.mark.parametrize('headers', [
    {'Origin': 'http://evil.example'}, {'Host': 'evil.example'}, {'Sec_Fetch_Site': 'cross-site'}])
def test_a_command_from_elsewhere_is_refused_though_it_has_the_token(controlled, look, headers):
    assert request(controlled, look(controlled), **headers)[0] == 403
    assert controlled.commands.values == {}


@pytest.mark.parametrize('body, words', [
    ('', 'no JSON'), ('{', 'no JSON'), ('[' * 4000, 'no JSON'), ('[]', 'an object'),
    ('{"do": "fly"}', ', '.join(WORKS)), ({'do': 'set'}, '"values"'),
    ({'do': 'set', 'values': {}}, '"values"'), ({'do': 'set', 'values': [1]}, '"values"'),
    ({'do': 'set', 'values': {'pinion': 1}}, "'pinion' is not one of carrier, front"),
    ({'do': 'set', 'values': {'carrier': 1, 'front': 'x'}}, "front: 'x' is no finite number"),
    ({'do': 'set', 'values': {'carrier': True}}, 'no finite number'),
    ({'do': 'set', 'values': {'carrier': float('nan')}}, 'no finite number'),
    ({'do': 'set', 'values': {'carrier': 1e6}}, 'must be in [-100000, 100000]'),
    ({'do': 'set', 'values': {'carrier': 1, 'rear_clutch': -1}}, 'rear_clutch: -1 N'),
])
def test_a_bad_request_is_told_in_words_and_changes_nothing(controlled, look, body, words):
    stream = look(controlled)
    status, _, told = request(controlled, stream, body)
    assert status == 400 and words in told
    assert controlled.commands.values == {}


def test_a_command_needs_a_viewer_a_type_and_a_bounded_length(controlled, look):
    stream = look(controlled)
    assert request(controlled, stream, {'do': 'zero', 'viewer': 'x'})[0] == 409
    for change, status in (({'Content_Type': 'text/plain'}, 415), ({'body': '{' * 99_999}, 413),
                           ({'Content_Length': '-1'}, 413), ({'Content_Length': 'x'}, 413),
                           ({'Content_Length': '9' * 30}, 413)):
        assert request(controlled, look(controlled), **change)[0] == status
    assert LARGEST_BODY < 99_999
    for method in ('PUT', 'DELETE', 'OPTIONS', 'HEAD'):
        assert asked(controlled, method, '/control')[0] == 501


def test_the_ninth_viewer_is_told_that_there_is_no_seat(server, look):
    streams = [look(server) for _ in range(MOST)]
    assert [stream.status for stream in streams] == [200] * 8
    assert asked(server, path='/events')[0] == 503
    status, _, text = asked(server)
    assert status == 503 and '8 viewers look at this differential already' in text
    streams.pop().close()
    until(lambda: len(server.viewers) < MOST)
    assert asked(server)[0] == look(server).status == 200


def test_a_page_that_is_loaded_anew_finds_its_own_seat_free(server, look):
    streams = [look(server) for _ in range(MOST)]
    streams.pop().close()
    assert asked(server)[0] == 200 and look(server).status == 200


def test_a_viewer_who_does_not_read_is_dropped_and_the_others_hear_all(server, look):
    stalled, reader = look(server), look(server)
    assert reader.next()[0] == 'viewer'
    data = json.dumps('x' * 20_000)
    heard = 0
    for n in range(4 * WAITING):   # more than queue and system hold, not more than a reader takes
        server.viewers.publish(event('n', f'[{n}, {data}]'))
        name, (number, _) = reader.next()
        assert (name, number) == ('n', heard)
        heard += 1
    until(lambda: len(server.viewers) == 1)
    assert stalled.status == 200


def test_publishing_waits_for_nobody():
    viewers = Viewers()
    viewer = viewers.enter()
    for _ in range(WAITING):
        viewers.publish(b'x')
    assert viewer.gone.is_set()   # it had its own name waiting, too


def test_one_who_sends_no_request_and_too_many_connections_are_closed(server):
    idle = [socket.create_connection(('127.0.0.1', server.port), timeout=PATIENCE)
            for _ in range(CONNECTIONS + 4)]
    assert idle[-1].recv(1) == b''
    for connection in idle:
        connection.close()

    def is_served():
        try:
            return asked(server)[0] == 200
        except OSError:   # there is no room yet
            return False
    until(is_served)


def test_a_port_that_is_taken_is_named(server):
    with pytest.raises(ValueError, match=f'port {server.port} of 127.0.0.1: Address already in'):
        Server('127.0.0.1', server.port, Viewers())
    with pytest.raises(ValueError, match='port 80 of no.such.host.invalid: '):
        Server('no.such.host.invalid', 80, Viewers())


class Node:
    """What tells ``Live`` of a node."""

    def __init__(self, variant='symmetric_ode'):
        self.viewers, self.commands = Viewers(), Commands()
        self.live = Live('/differential', self.viewers, self.commands)
        self.live.came({'variant': variant})

    def tick(self, n, velocity=1.0):
        scene = self.live.scene
        for number, (topic, names) in enumerate(scene.names.items()):
            arrays = [(velocity * n,) * len(names)] * (1 if topic in ALONE else 3)
            self.live.put(number, n * 1_000_000, tuple(arrays))


def events(data):
    """Return name and data of the events in bytes."""
    return [(part.split('\n')[0].removeprefix('event: '),
             json.loads(part.split('\n')[1].removeprefix('data: ')))
            for part in data.decode().split('\n\n') if part]


@pytest.mark.parametrize('variant', VARIANTS)
def test_one_who_comes_later_sees_what_the_others_see(variant):
    node = Node(variant)
    early = node.viewers.enter()
    for n in range(1, 400):
        node.tick(n)
        if n % 40 == 0:
            node.live.flush()
    late = node.viewers.enter()
    told = events(early.take(0.0))
    rows = [row for name, data in told if name == 'ticks' for row in data['rows']]
    _, (_, scene), (_, ticks), *_ = events(late.take(0.0))
    assert ticks['rows'] == rows and len(rows) > 10
    assert scene == dict(told)['scene'] and scene['variant'] == variant
    assert ticks['now'] == [data for name, data in told if name == 'ticks'][-1]['now']


def test_a_node_that_went_is_waited_for_and_its_commands_are_forgotten():
    node = Node()
    node.commands.set('me', {'pinion': 1.0})
    node.live.went()
    assert node.commands.values == {}
    viewer = node.viewers.enter()
    told = dict(events(viewer.take(0.0)))
    assert told['scene'] == {'node': '/differential', 'refusal': None}
    assert told['ticks']['rows'] == []
    node.live.came({'variant': 'lsd_ode'})
    assert dict(events(viewer.take(0.0)))['scene']['variant'] == 'lsd_ode'


def test_the_strips_go_on_when_a_parameter_changes():
    node = Node()
    node.tick(1)
    node.tick(2)
    node.live.flush()
    node.live.changed({'variant': 'symmetric_ode', 'symmetric.satellite_count': 3})
    node.tick(3)
    node.live.flush()
    told = dict(events(node.viewers.enter().take(0.0)))
    assert told['scene']['gears']['count'] == 3
    values = [row[1] for row in told['ticks']['rows']]
    assert (values[0], values[-1]) == (1.0, 3.0)   # before the change and after it
    node.live.changed({'variant': 'symmetric_ode', 'symmetric.clutch.left.friction_surfaces': 2})
    assert dict(events(node.viewers.enter().take(0.0)))['ticks']['rows'] == []


def test_no_number_is_null_on_the_page():
    node = Node()
    node.tick(1, velocity=float('nan'))
    node.live.flush()
    told = dict(events(node.viewers.enter().take(0.0)))
    assert told['ticks']['now']['velocity'] == [None] * 5
