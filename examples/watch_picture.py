# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Take the picture of doc/watch.md: a node under load as ``watch`` shows it.

Needs Chromium, its chromedriver, and selenium, as by ``pip install 'dm_ros[browser]'``.
"""

import argparse
from contextlib import ExitStack
import math
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import tempfile
import time

from selenium import webdriver

from dm_ros.mechanism.variants import variant_named, VARIANTS
from dm_ros.ros.domain import own_domain

SECONDS = 32.0   # until the strips are full
HEAT = 0.25      # of the most of the last seconds, at which a clutch is worth a picture
SCRIPT = """
const heat = name => document.querySelector(`[data-power=${name}]`)?.textContent ?? '0 W';
return arguments[0].map(heat);
"""
CALM = "return document.getElementById('alarm').hidden"


def load(variant, file):
    """Write the reference load of a mechanism, and pulses of force where there are clutches."""
    mechanism = variant_named(variant).mechanism
    names = [*mechanism.inputs, *mechanism.clutch_moments]
    rows = []
    for n in range(12_000):
        t = n / 100
        forces = [700.0 * max(0.0, math.sin(0.9 * t + phase)) ** 2 for phase in (0.0, 2.0)]
        rows.append([t, *mechanism.load(t), *forces[:len(mechanism.clutch_moments)]])
    file.write_text('\n'.join([
        ','.join(['time', *names]), *(','.join(map(repr, row)) for row in rows)]))


def command(name, *arguments, **options):
    """Start a command of the package."""
    return subprocess.Popen([sys.executable, '-m', 'dm_ros.commands', name, *map(str, arguments)],
                            **options)


def watts(text):
    """Return a power that the page tells, W."""
    number, unit = text.replace('\N{MINUS SIGN}', '-').split()
    return float(number) * {'W': 1.0, 'kW': 1e3, 'MW': 1e6}[unit]


def browser(arguments):
    """Return a Chromium that shows nothing on any screen."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which('chromium') or shutil.which('google-chrome')
    for argument in ('--headless=new', '--no-sandbox', '--disable-gpu', '--hide-scrollbars'):
        options.add_argument(argument)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(
        executable_path=shutil.which('chromedriver')))
    driver.execute_cdp_cmd('Emulation.setDeviceMetricsOverride', {
        'width': arguments.width, 'height': arguments.height, 'deviceScaleFactor': 1,
        'mobile': False})
    driver.execute_cdp_cmd('Emulation.setEmulatedMedia', {
        'features': [{'name': 'prefers-color-scheme', 'value': arguments.scheme}]})
    return driver


def take(arguments, url, clutches):
    """Take the picture, at a moment at which a clutch gets warm."""
    driver = browser(arguments)
    try:
        driver.get(url)
        end, hottest = time.monotonic() + SECONDS, 0.0
        while True:
            time.sleep(0.05)
            heat = max([0.0, *(watts(text) for text in driver.execute_script(SCRIPT, clutches)
                               if len(text.split()) == 2)])
            hottest = max(hottest * 0.998, heat)
            late = time.monotonic() - end
            calm = driver.execute_script(CALM)   # no warning, as a busy machine gives
            if late > 0.0 and (calm and heat >= HEAT * hottest > 0.0 or late > 30.0):
                break
        driver.save_screenshot(str(arguments.out))
    finally:
        driver.quit()


def main():
    """Start node, load and page in a domain of their own, and take the picture."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--variant', choices=VARIANTS, default='lsd_ode')
    parser.add_argument('--scheme', choices=('light', 'dark'), default='light')
    parser.add_argument('--width', type=int, default=1280)
    parser.add_argument('--height', type=int, default=800)
    parser.add_argument('--set', action='append', default=[], metavar='NAME:=VALUE',
                        help='a parameter of the node, as with -p')
    parser.add_argument('--control', action='store_true')
    parser.add_argument('--out', type=Path, default=Path('watch.png'))
    arguments = parser.parse_args()
    clutches = list(variant_named(arguments.variant).mechanism.clutch_moments)
    with ExitStack() as stack:
        os.environ['ROS_DOMAIN_ID'] = str(stack.enter_context(own_domain()))
        csv = Path(stack.enter_context(tempfile.TemporaryDirectory())) / 'load.csv'
        load(arguments.variant, csv)
        watch = command('watch', '--port', 0, *(['--control'] if arguments.control else []),
                        stdout=subprocess.PIPE, text=True)
        stack.callback(watch.terminate)
        url = re.search(r'http\S+', watch.stdout.readline()).group()
        for process in (
                command('differential', '--ros-args', '-p', f'variant:={arguments.variant}',
                        *(word for text in arguments.set for word in ('-p', text))),
                command('play_torques', '--variant', arguments.variant, '--torques', csv,
                        stderr=subprocess.DEVNULL)):
            stack.callback(process.terminate)
        take(arguments, url, clutches)


if __name__ == '__main__':
    main()
