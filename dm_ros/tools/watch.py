# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Serve a page that shows a running node live, for a browser on this machine."""

import argparse
import os
import sys
import threading

import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from dm_ros.ending import run_command
from dm_ros.ros.commander import Commander
from dm_ros.ros.transport import prefer_udp
from dm_ros.ros.watched import Asked, Watched
from dm_ros.tools.play_torques import full_name
from dm_ros.watch.commands import Commands
from dm_ros.watch.live import Live
from dm_ros.watch.server import Server
from dm_ros.watch.viewers import Viewers

PORT = 8350
NICE = 10       # a node on the same cores comes first
PERIOD = 0.04   # s from one look at what has come to the next, and so from event to event
EPILOG = """\
The page is at the URL that is printed, until Ctrl-C or SIGTERM. It shows the node while it runs,
and waits for it otherwise. Without --control nothing on the page reaches the node. A browser on
another machine needs --host, and then everybody who reaches that address sees the page, and
commands the node with --control: there is no password. Rather let ssh bring the port to you:
ssh -L 8350:127.0.0.1:8350 MACHINE. A node in a namespace: --node /rear/differential. A car:
--node driveline.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('watch', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--port', type=_port, default=PORT, metavar='N',
                        help='TCP port of the page, 0 for one that is free; default: %(default)s')
    result.add_argument('--control', action='store_true',
                        help='let the page set torques, speeds and forces, pause, step and reset')
    result.add_argument('--node', default='differential', metavar='NAME',
                        help='name of the node, a differential or a driveline, in the namespace '
                        'of this one or full; default: %(default)s')
    result.add_argument('--host', default='127.0.0.1', metavar='ADDR',
                        help='address to which the page is bound; default: %(default)s, which '
                        'only this machine reaches')
    return result


def _port(text):
    port = int(text)
    if not 0 <= port <= 65535:
        raise argparse.ArgumentTypeError(f'{text} must be in [0, 65535]')
    return port


def watched_name(node, text):
    """Return the full name of the node to watch; raise ValueError where it is none."""
    words = (f'--node: {text!r} is not the name of a node, such as differential or '
             '/rear/differential')
    if not text.rstrip('/'):
        raise ValueError(words)
    try:
        return full_name(node, text)
    except (RuntimeError, ValueError, NameValidationException) as error:   # in words of rcl
        raise ValueError(words) from error


def watch(args, arguments, ended):
    """Serve the page until ``ended`` is set."""
    viewers, commands = Viewers(), Commands()
    commander, serving = None, threading.Thread(target=lambda: server.serve_forever(0.1))
    # a viewer can ask for nothing before the node below is there
    server = Server(arguments.host, arguments.port, viewers,
                    (lambda *request: commander.command(*request)) if arguments.control else None)
    try:
        os.nice(NICE)   # also the threads of the middleware, which begin below
        prefer_udp()
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node('watch')
        name = watched_name(node, arguments.node)
        live, asked = Live(name, viewers, commands), Asked(node)
        watched = Watched(node, name, live, asked)
        if arguments.control:
            commander = Commander(node, name, live, commands, asked)
            viewers.on_leave = commands.leave
        serving.start()
        print(f'watching {name}: {server.url}', flush=True)
        if server.guard.is_open:
            may = 'sees this page' + ' and can command the node' * arguments.control
            print(f'everybody who reaches {arguments.host} {may}, without a password', flush=True)
        while not ended.wait(min(PERIOD, commander.period if commander else PERIOD)):
            watched.poll()
            if commander:
                commander.poll()
    finally:
        viewers.close()
        if commander:
            commander.close()
        if serving.ident:
            server.shutdown()
        server.server_close()
        rclpy.try_shutdown()


def main(args=None):
    """Serve the page until SIGINT or SIGTERM; return the exit code."""
    args = sys.argv if args is None else ['watch', *args]
    ended = threading.Event()

    def work():
        watch(args, parser().parse_args(remove_ros_args(args)[1:]), ended)
    return run_command(   # RuntimeError: of rclpy
        'watch', work, expected=(ValueError, RuntimeError, NameValidationException),
        on_signal=lambda *_: ended.set(), until_signal=True)


if __name__ == '__main__':
    sys.exit(main())
