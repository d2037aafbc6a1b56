# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Take the picture of a driveline of doc/watch.md: a bend with ice under one wheel.

Needs what ``watch_picture.py`` needs, which stands beside it.
"""

import argparse
from contextlib import ExitStack
import math
import os
from pathlib import Path
import re
import subprocess
import time

import rclpy
from sensor_msgs.msg import JointState
from watch_picture import browser, CALM, command

from dm_ros.driveline_plant import make_driveline, node_ports
from dm_ros.files.published import CommandMessage
from dm_ros.ros.domain import own_domain

SECONDS = 31.0   # until the strips are full
PERIOD = 0.02    # s from one command to the next
LATE = 60.0      # s more to wait for such a moment
WAIT = 15.0      # s for the page to show the car
DRY, ICE = 0.9, 0.12   # grip below one front wheel, in turns


def demand(t):
    """Return {port: value} at a time, s: a slalom, pulled and pushed, on ice now and then."""
    phase = t % 9.0
    ice = min(max(min(phase - 2.0, 9.0 - phase), 0.0), 0.5) / 0.5
    return {'input': 90.0 + 320.0 * math.sin(0.55 * t + 3.0),
            'steer': 0.055 * math.sin(0.8 * t + 1.4),
            'front_left_grip': DRY + (ICE - DRY) * ice}


def drive(driver, arguments):
    """Command the car until the strips are full and it pulls on ice, then take the picture."""
    ports = [port for port in node_ports(make_driveline({'layout': arguments.layout,
                                                         'planar': True}))
             if port.name in demand(0.0)]
    commands = CommandMessage(ports)
    node = rclpy.create_node('driver')
    publisher = node.create_publisher(JointState, '/driveline/commands', 10)
    begin = time.monotonic()
    while (t := time.monotonic() - begin) < arguments.seconds + LATE:
        values = demand(t)
        calm = driver.execute_script(CALM)   # no warning, as a busy machine gives
        if (t > arguments.seconds and calm and values['front_left_grip'] == ICE
                and values['input'] > 250.0):
            break
        position, velocity, effort = commands.arrays([values[port.name] for port in ports])
        publisher.publish(JointState(name=commands.names, position=position, velocity=velocity,
                                     effort=effort))
        time.sleep(PERIOD)
    driver.save_screenshot(str(arguments.out))
    node.destroy_node()


def main():
    """Start node and page in a domain of their own, drive, and take the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--layout', choices=('fwd', 'rwd', 'awd'), default='awd')
    parser.add_argument('--scheme', choices=('light', 'dark'), default='light')
    parser.add_argument('--width', type=int, default=1280)
    parser.add_argument('--height', type=int, default=800)
    parser.add_argument('--seconds', type=float, default=SECONDS)
    parser.add_argument('--control', action='store_true')
    parser.add_argument('--out', type=Path, default=Path('watch_car.png'))
    arguments = parser.parse_args()
    with ExitStack() as stack:
        os.environ['ROS_DOMAIN_ID'] = str(stack.enter_context(own_domain()))
        watch = command('watch', '--port', 0, '--node', 'driveline',
                        *(['--control'] if arguments.control else []),
                        stdout=subprocess.PIPE, text=True)
        stack.callback(watch.terminate)
        url = re.search(r'http\S+', watch.stdout.readline()).group()
        node = command('driveline', '--ros-args', '-p', f'layout:={arguments.layout}',
                       '-p', 'planar:=true', '-p', 'initial_speed:=15.0')
        stack.callback(node.terminate)
        rclpy.init()
        stack.callback(rclpy.try_shutdown)
        driver = browser(arguments)
        stack.callback(driver.quit)
        driver.get(url)
        end = time.monotonic() + WAIT
        while not driver.find_elements('css selector', '#flows tr') and time.monotonic() < end:
            time.sleep(0.1)
        drive(driver, arguments)


if __name__ == '__main__':
    main()
