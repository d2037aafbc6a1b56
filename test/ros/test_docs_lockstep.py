# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What doc/lockstep.md claims beside what test_lockstep.py and test_clocks.py show."""

from pathlib import Path
import re

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from sensor_msgs.msg import JointState

from dm_ros import Simulation, VARIANTS
from dm_ros.mechanism.variants import SYMMETRIC

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / 'doc' / 'lockstep.md').read_text()


def torque(effort, shaft='carrier'):
    return JointState(name=[shaft], effort=[effort])


def test_a_clamped_torque_is_a_tick(ros):
    node = ros.differential('lsd_ode', mode='lockstep', torque_limit=50.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    ros.publisher(JointState, '/differential/torques').publish(torque(60.0))
    ros.until(lambda: joints)
    assert joints[0].effort[0] == 50.0
    assert node.simulation.ticks == 1


def test_a_tick_out_of_range_is_answered_with_the_old_state(ros):
    # so light, and without drag, that a torque of 1e9 N m takes it out of the range of numbers
    shafts = Simulation('lsd_ode').shafts
    ros.differential('lsd_ode', mode='lockstep', rate=0.1, torque_limit=1e9, loss_law='paper',
                     **{f'lsd__inertia__{shaft}': 1e-300 for shaft in shafts},
                     **{f'lsd__viscosity__{shaft}': 0.0 for shaft in shafts})
    joints = ros.listen(JointState, '/differential/joint_states')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(JointState, '/differential/torques')
    publisher.publish(torque(0.0, 'carrier'))
    publisher.publish(torque(1e9, 'carrier'))
    ros.until(lambda: len(joints) == 2)
    assert joints[0] == joints[1]
    ros.until(lambda: diagnostics and any(
        pair.key == 'refused ticks' and pair.value == '1'
        for status in diagnostics[-1].status for pair in status.values))


@pytest.mark.parametrize('variant', VARIANTS)
def test_names_keep_their_order_and_these_indices(ros, variant):
    ros.differential(variant, mode='lockstep')
    joints = ros.listen(JointState, '/differential/joint_states')
    moments = ros.listen(JointState, '/differential/internal_moments')
    publisher = ros.publisher(JointState, '/differential/torques')
    for _ in range(3):
        publisher.publish(JointState())
    ros.until(lambda: len(joints) == len(moments) == 3)
    kind = 'symmetric' if Simulation(variant).mechanism is SYMMETRIC else 'self-locking'
    for messages, title in ((joints, 'joint_states'), (moments, 'internal_moments')):
        table = PAGE.split(f'| index in `{title}`', 1)[1].split('\n\n', 1)[0]
        row = re.search(rf'^\| {kind} \|(.*)\|$', table, re.MULTILINE).group(1)
        assert {tuple(m.name) for m in messages} == {tuple(re.findall(r'`(\w+)`', row))}
    assert not moments[-1].velocity and not moments[-1].position
    assert list(Simulation(variant).shafts) == list(joints[-1].name)


def test_every_test_that_the_page_names_is_there():
    sources = ''.join(
        (ROOT / 'test' / 'ros' / f'test_{name}.py').read_text()
        for name in ('lockstep', 'clocks', 'node', 'docs_lockstep'))
    named = {name for group in re.findall(r'\((`\w+`(?:,\s+`\w+`)*)\)', PAGE)
             for name in re.findall(r'`(\w+)`', group)}
    assert len(named) > 20
    for name in named:
        assert f'def test_{name}(' in sources, name
