# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Whose requests are served: those that come from the page itself, at the address it is bound to.

A page of somebody else in the same browser can send requests to a loopback address, and by a name
that it lets point there (DNS rebinding) it could even read the answers. Its ``Origin``, its
``Host`` and ``Sec-Fetch-Site`` give it away. The token, which is only in the page, keeps others
from commanding who can send what they like in headers.
"""

from hmac import compare_digest
import ipaddress
import socket

TOKEN = 'X-Watch-Token'
LOOPBACK = {'127.0.0.1', '::1', 'localhost'}


def split(host):
    """Return the name and the port of a ``Host``, as text; the port may be empty."""
    name, colon, port = host.rpartition(':')
    if not colon or ']' in port:
        name, port = host, ''
    return name.strip('[]').lower(), port


def is_address(name):
    """Return whether a name is an IP address, which nobody can let point elsewhere."""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


class Guard:
    """Knows under which names the server may be asked for."""

    def __init__(self, host, address, port):
        """:param host: as the user gave it; address: IP to which it is bound; port: of TCP."""
        self._port = port
        bound = ipaddress.ip_address(address)
        self._names = {host.lower(), address}
        self.is_open = not bound.is_loopback   # others than this machine may reach it
        if bound.is_loopback:
            self._names |= {'localhost'}
        self._any_address = bound.is_unspecified   # it is asked for by each address of the host
        self.name = host   # to ask for it by
        if self._any_address:
            self.name = socket.gethostname()
            self._names |= LOOPBACK | {self.name.lower()}

    def allows_host(self, host):
        """Return whether a ``Host`` is the server's own."""
        name, port = split(host)
        return port in ({'', '80'} if self._port == 80 else {str(self._port)}) and (
            name in self._names or self._any_address and is_address(name))

    def refusal(self, headers, is_page=False):
        """
        Return why a request is refused, in words, or None.

        :param headers: of the request; is_page: whether it is for the page, to which a link on
            another one may lead.
        """
        hosts, origins = headers.get_all('Host', []), headers.get_all('Origin', [])
        if len(hosts) != 1 or not self.allows_host(hosts[0]):
            return f'the Host {", ".join(hosts) or "is missing, it"} is not the address of watch'
        for origin in origins:
            scheme, _, host = origin.partition('://')
            if scheme != 'http' or host.lower() != hosts[0].lower():
                return f'the Origin {origin} is another one than {hosts[0]}'
        site = headers.get('Sec-Fetch-Site', 'none')
        is_link = is_page and headers.get('Sec-Fetch-Mode') == 'navigate'
        if site not in ('none', 'same-origin') and not is_link:
            return f'the request comes from another site ({site})'
        return None


def is_token(given, token):
    """Return whether a token is the right one."""
    return compare_digest((given or '').encode(), token.encode())
