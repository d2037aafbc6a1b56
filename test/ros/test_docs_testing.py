# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The code blocks of doc/testing.md are test files that pass."""

from pathlib import Path
import re

# loaded for good: what a run of pytest in this process loads, it forgets at its end
import matplotlib.backends.backend_agg  # noqa: F401
import matplotlib.figure  # noqa: F401
import pytest

from dm_ros.files.bag import has_rosbags
import dm_ros.ros.node  # noqa: F401
import dm_ros.testing.lockstep  # noqa: F401

pytest_plugins = ['pytester']

ROOT = Path(__file__).parents[2]
BLOCKS = re.findall(r'^```python\n# (\w+)\.py\n(.*?)^```', (
    ROOT / 'doc' / 'testing.md').read_text(), re.MULTILINE | re.DOTALL)


@pytest.fixture
def run(pytester):
    """Return a function that runs the tests of ``pytester`` in this process."""
    # the plugin of hypothesis, which nobody needs there, takes longer than the rest
    return lambda *arguments: pytester.runpytest_inprocess('-p', 'no:hypothesispytest', *arguments)


def test_the_blocks_of_the_page_run(pytester, run):
    pytester.makepyfile(**dict(BLOCKS))
    tests = sum(source.count('\ndef test_') for _, source in BLOCKS)
    assert tests == 5
    run('--differential-records', 'left').assert_outcomes(passed=tests)
    assert not (pytester.path / 'left').exists()


def test_the_failing_test_of_a_user_leaves_each_of_its_differentials(pytester, run):
    pytester.makepyfile(**{name: source for name, source in BLOCKS if name == 'governor'})
    pytester.makepyfile(test_it="""
        from governor import Governor, SpeedLaw

        def test_too_much(differential):
            for target in (5.0, 10.0):
                vehicle = differential()
                vehicle.attach(Governor(SpeedLaw(target, 0.001), context=vehicle.context))
                record = vehicle.run(seconds=0.1)
            assert record.velocity['carrier'].max() < 0.0
    """)
    run('--differential-records', 'left').assert_outcomes(failed=1)
    left = {path.name for path in (pytester.path / 'left').iterdir()}
    assert left == {f'test_it.py_test_too_much_{n}{kind}' for n in (1, 2)
                    for kind in ('.csv', '.png', *(['_bag'] if has_rosbags() else []))}


def test_an_exception_in_a_node_of_the_test_is_the_test_s(pytester, run):
    pytester.makepyfile(test_it="""
        import pytest
        from rclpy.node import Node
        from sensor_msgs.msg import JointState

        def test_it(differential):
            vehicle = differential()
            node = Node('broken', context=vehicle.context)
            node.create_publisher(JointState, 'differential/torques', 10)

            def fail(joints):
                raise ZeroDivisionError
            node.create_subscription(JointState, 'differential/joint_states', fail, 10)
            vehicle.attach(node)
            with pytest.raises(ZeroDivisionError):
                vehicle.run(seconds=1.0)
    """)
    run().assert_outcomes(passed=1)
