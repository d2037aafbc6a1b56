# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Fixtures for the tests of a controller, active in pytest as soon as dm_ros is installed.

- ``differential`` makes a ``LockstepDifferential``: real topics, the test's own nodes
- ``direct_differential`` makes a ``DirectDifferential``: a control law as a function, no topics
- ``driveline`` and ``direct_driveline`` make a ``LockstepDriveline`` and a ``DirectDriveline``

::

    def test_grip(differential):
        vehicle = differential(variant='lsd_ode', rate=500.0)
        vehicle.attach(Controller(context=vehicle.context))
        record = vehicle.run(seconds=5.0)
        assert abs(record.slip[record.time > 0.4]).max() < 5.0

With ``--differential-records FOLDER`` a failing test leaves the CSV, the picture and, where
rosbags is installed, the bag of each of its differentials there.
"""

from contextlib import ExitStack
import re

import pytest

FAILED = pytest.StashKey()


def pytest_addoption(parser):
    parser.getgroup('dm_ros').addoption(
        '--differential-records', metavar='FOLDER',
        help='where a failing test leaves the CSV, the picture and the bag of its differentials')


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item, call):
    outcome = yield
    if outcome.get_result().failed:
        item.stash[FAILED] = True


@pytest.fixture
def differential(request):
    """Return a function that starts a ``LockstepDifferential``; its arguments are those."""
    yield from makers(request, 'LockstepDifferential')


@pytest.fixture
def direct_differential(request):
    """Return a function that makes a ``DirectDifferential``; its arguments are those."""
    yield from makers(request, 'DirectDifferential')


@pytest.fixture
def driveline(request):
    """Return a function that starts a ``LockstepDriveline``; its arguments are those."""
    yield from makers(request, 'LockstepDriveline')


@pytest.fixture
def direct_driveline(request):
    """Return a function that makes a ``DirectDriveline``; its arguments are those."""
    yield from makers(request, 'DirectDriveline')


def makers(request, name):
    """Yield a function that makes what has a name in ``dm_ros.testing``; then end all of it."""
    from dm_ros import testing
    with ExitStack() as stack:
        made = []

        def make(*arguments, **options):
            one = getattr(testing, name)(*arguments, **options)
            made.append(stack.enter_context(one) if hasattr(one, '__exit__') else one)
            return made[-1]
        yield make
        leave_records(request, made)


def leave_records(request, differentials):
    """Write the records of a failed test, if somebody wants them."""
    folder = request.config.getoption('--differential-records')
    if not folder or not request.node.stash.get(FAILED, False):
        return
    from dm_ros.files.bag import has_rosbags
    folder = request.config.rootpath / folder
    folder.mkdir(parents=True, exist_ok=True)
    name = re.sub(r'[^\w.-]+', '_', request.node.nodeid)
    for number, made in enumerate(differentials, start=1):
        if made.snapshots:
            made.record.save_csv(folder / f'{name}_{number}.csv')
            made.record.save_plot(folder / f'{name}_{number}.png')
            if has_rosbags() and hasattr(made, 'save_bag'):
                made.save_bag(folder / f'{name}_{number}_bag')
