# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Speed ports over topics: in, refused, stale, taken up again, changed, and as the library."""

import math

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import numpy as np
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from reports import told
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, Trigger

from dm_ros import Simulation, VARIANTS
from dm_ros.mechanism.variants import variant_named
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.tools.play_torques import load, parser
from dm_ros.tools.simulate import main as simulate

NAN = math.nan
TORQUES, JOINTS = '/differential/torques', '/differential/joint_states'
LEFT = {'port__left__kind': 'speed', 'port__left__stiffness': 2e4, 'port__left__damping': 50.0}
PORT = {'left': (2e4, 50.0)}


def demand(names, effort=(), velocity=()):
    return JointState(name=list(names), effort=[float(v) for v in effort],
                      velocity=[float(v) for v in velocity])


def twist(node):
    """Return the twists in a node, rad."""
    return node.simulation.state.x[2:]


# As the library


@pytest.mark.parametrize('loss_law', LOSS_LAWS)
@pytest.mark.parametrize('variant', VARIANTS)
def test_a_tick_in_lockstep_is_that_of_the_library(ros, variant, loss_law):
    driving, one, other = variant_named(variant).mechanism.inputs
    ros.differential(variant, mode='lockstep', rate=500.0, loss_law=loss_law, **{
        f'port__{one}__kind': 'speed', f'port__{one}__stiffness': 3e4})
    joints = ros.listen(JointState, JOINTS)
    moments = ros.listen(JointState, '/differential/internal_moments')
    publisher = ros.publisher(JointState, TORQUES)
    simulation = Simulation(variant, 1 / 500.0, loss_law=loss_law, ports={one: (3e4, 100.0)})
    for n in range(1, 31):
        torque, speed, load = 40.0 + n % 7, 3.0 * n, -20.0 - n
        publisher.publish(demand((one, driving, other), (NAN, torque, load), (speed, NAN, NAN)))
        ros.until(lambda n=n: len(joints) == len(moments) == n)
        snapshot = simulation.step((torque, speed, load))
        assert tuple(joints[-1].velocity) == snapshot.velocity
        assert tuple(joints[-1].position) == snapshot.position
        assert tuple(moments[-1].effort) == snapshot.moment
        efforts = dict(zip(joints[-1].name, joints[-1].effort))
        assert tuple(efforts[name] for name in simulation.inputs) == snapshot.torque
    assert snapshot.torque[1] != speed


def test_speeds_and_forces_come_in_one_message_and_csv_gives_the_same_bits(ros, tmp_path):
    ros.differential('lsd_ode', mode='lockstep', rate=200.0, port__rear__kind='speed')
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    rows = [(200.0 - n, 30.0 + n / 9, -50.0 + n, 30.0 * n) for n in range(40)]
    for carrier, rear, front, force in rows:
        publisher.publish(demand(('carrier', 'rear', 'front', 'rear_clutch'),
                                 (carrier, NAN, front, force), (NAN, rear, NAN, NAN)))
    ros.until(lambda: len(joints) == len(rows))
    (tmp_path / 'speed.yaml').write_text('/**: {ros__parameters: {port.rear.kind: speed}}')
    lines = [','.join(map(repr, (n / 200, *row))) for n, row in enumerate(rows)]
    (tmp_path / 'in.csv').write_text('\n'.join(
        ['time,carrier,rear,front,rear_clutch', *lines, '0.2,0,0,0,0\n']))
    assert simulate(['--variant', 'lsd_ode', '--params', str(tmp_path / 'speed.yaml'),
                     '--torques', str(tmp_path / 'in.csv'),
                     '--out', str(tmp_path / 'out.csv')]) == 0
    columns = np.genfromtxt(tmp_path / 'out.csv', delimiter=',', names=True, deletechars='')
    for column, shaft in (('velocity.rear', 2), ('position.front', 1)):
        heard = [getattr(message, column.partition('.')[0])[shaft] for message in joints]
        assert heard == columns[column][1:].tolist()
    assert [message.effort[2] for message in joints] == columns['torque.rear'][1:].tolist()


class Wheel(Node):
    """A wheel of its own, that answers the torque of its shaft by its speed."""

    INERTIA, DT = 1.0, 1e-3

    def __init__(self, context):
        super().__init__('wheel', context=context)
        self.speed, self.sent = 20.0, []
        self.torques = self.create_publisher(JointState, TORQUES, 100)
        self.create_subscription(JointState, JOINTS, self.answer, 100)

    def answer(self, joints):
        torque = joints.effort[joints.name.index('left')]
        self.speed -= self.DT * (torque + 3.0 * (self.speed - 20.0)) / self.INERTIA
        self.sent.append(self.speed)
        self.torques.publish(demand(('pinion', 'left', 'right'), (60.0, NAN, -30.0),
                                    (NAN, self.speed, NAN)))


def test_a_wheel_over_topics_is_the_library_to_the_last_bit_each_time(differential):
    parameters, runs = {'port.left.kind': 'speed'}, []
    for _ in range(2):
        vehicle = differential('symmetric_ode', parameters=parameters)
        wheel = vehicle.attach(Wheel(vehicle.context))
        runs.append((vehicle.run(seconds=0.3), wheel.sent[:300]))
    (first, sent), (again, sent_again) = runs
    assert sent == sent_again and len(set(sent)) > 200
    simulation = Simulation('symmetric_ode', 1e-3, ports={'left': (1e4, 100.0)})
    library = type(first).of(simulation, [
        simulation.step((60.0, speed, -30.0)) for speed in sent])
    for name, values in first.columns.items():
        assert len(values) == 300
        assert values.tolist() == again.columns[name].tolist() == library.columns[name].tolist()


# In real time


def test_a_speed_port_has_its_own_topic_in_place_of_that_of_the_torque(ros):
    node = ros.differential('symmetric_ode', torque_timeout=0.0, **LEFT)
    topics = {s.topic_name for s in node.subscriptions}
    assert '/differential/speed/left' in topics and '/differential/torque/right' in topics
    assert not {'/differential/torque/left', '/differential/speed/right'} & topics
    assert twist(node) == (0.0,)
    ros.publisher(Float64, '/differential/speed/left').publish(Float64(data=3.0))
    ros.until(lambda: node.simulation.state.held[1] == 3.0)
    ros.until(lambda: abs(dict(zip(node.simulation.shafts, node.simulation.snapshot().velocity))[
        'left'] - 3.0) < 0.5)
    ros.publisher(JointState, TORQUES).publish(demand(('left',), (), (4.0,)))
    ros.until(lambda: node.simulation.state.held[1] == 4.0)


def test_a_speed_that_stops_coming_frees_the_shaft_and_one_that_comes_back_takes_it_up(
        ros, steady):
    node = ros.differential('symmetric_ode', rate=200.0, torque_timeout=0.1, **LEFT)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(Float64, '/differential/speed/left')

    def ticked():
        steady.tick(node)
        return node.simulation.state
    publisher.publish(Float64(data=5.0))
    ros.until(lambda: ticked().held[1] == 5.0)
    for _ in range(19):
        assert ticked().held[1] == 5.0
    assert twist(node) != (0.0,)
    while ticked().held[1] is not None:
        pass
    assert twist(node) == (0.0,) and node.simulation.state.torque[1] == 0.0
    ros.until(lambda: told(diagnostics)[2].get('stale') == 'left')
    level, message, _ = told(diagnostics)
    assert level == DiagnosticStatus.WARN and 'their shafts are free' in message
    velocity = node.simulation.snapshot().velocity
    publisher.publish(Float64(data=velocity[1]))
    ros.until(lambda: ticked().held[1] is not None)
    assert np.abs(np.subtract(node.simulation.snapshot().velocity, velocity))[:3].max() < 0.1
    ros.until(lambda: told(diagnostics)[0] == DiagnosticStatus.OK)


def test_it_tells_which_ports_still_wait(ros):
    ros.differential('symmetric_ode', **LEFT)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(JointState, TORQUES)
    ros.until(lambda: told(diagnostics)[2].get('without any speed yet') == 'left')
    assert told(diagnostics)[2]['without any torque yet'] == 'pinion, right'
    publisher.publish(demand(('left', 'right'), (NAN, 1.0), (2.0, NAN)))
    ros.until(lambda: told(diagnostics)[2]['without any speed yet'] == 'none')
    assert told(diagnostics)[2]['without any torque yet'] == 'pinion'


@pytest.mark.parametrize('message, words', [
    (demand(('left',), (5.0,)), '1 names but 0 velocities'),
    (demand(('left', 'right'), (NAN, 5.0), (3.0,)), '2 names but 1 velocities'),
    (demand(('left', 'right'), (), (3.0, NAN)), '2 names but 0 efforts'),
    (demand(('left',), (5.0,), (3.0,)), 'left takes a speed, its effort must be NaN'),
    (demand(('right',), (5.0,), (3.0,)), 'right takes no speed, its velocity must be NaN'),
    (demand(('left',), (), (math.inf,)), 'the speed on left is inf'),
    (demand(('left',), (), (-2e6,)), 'the speed on left is -2000000.0, it must not be below'),
    (demand(('wheel',), (1.0,)), "'wheel' is not one of"),
    (demand(('lft',), (), (5.0,)), "'lft' is not one of")])
def test_what_a_speed_port_cannot_take_is_refused_whole_and_named(ros, message, words):
    node = ros.differential('symmetric_ode', mode='lockstep', **LEFT)
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    publisher.publish(message)
    publisher.publish(demand(('left', 'pinion'), (NAN, 1.0), (2.0, NAN)))
    ros.until(lambda: joints)
    assert node.simulation.ticks == 1 and node.plant.inputs.refused == 1
    assert words in node.plant.refusing.reason
    assert node.simulation.state.held == (1.0, 2.0, 0.0)


def test_an_array_that_no_named_port_needs_may_be_empty_and_nan_keeps_what_was_held(ros):
    node = ros.differential('symmetric_ode', mode='lockstep', **LEFT)
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    for message in (demand(('right',), (5.0,)), demand(('left',), (), (2.0,)),
                    demand(('left', 'right'), (NAN, NAN), (NAN, NAN)), JointState()):
        publisher.publish(message)
    ros.until(lambda: len(joints) == 4)
    assert node.simulation.state.held == (0.0, 2.0, 5.0) and node.plant.inputs.refused == 0


def test_a_node_without_speed_ports_does_not_look_at_velocities(ros):
    node = ros.differential('symmetric_ode', mode='lockstep')
    joints = ros.listen(JointState, JOINTS)
    ros.publisher(JointState, TORQUES).publish(demand(('left',), (5.0,), (math.inf, 3.0)))
    ros.until(lambda: joints)
    assert node.simulation.state.held == (0.0, 5.0, 0.0)


# Services and parameters


def test_a_reset_frees_the_shaft_and_a_step_takes_the_speed_that_came(ros):
    node = ros.differential('symmetric_ode', torque_timeout=0.0, **LEFT)
    publisher = ros.publisher(Float64, '/differential/speed/left')
    publisher.publish(Float64(data=5.0))
    ros.until(lambda: node.simulation.state.held[1] == 5.0 and twist(node) != (0.0,))
    ros.call(SetBool, '/differential/pause', data=True)
    assert ros.call(Trigger, '/differential/reset').success
    assert node.simulation.state.held[1] is None and twist(node) == (0.0,)
    assert ros.call(Trigger, '/differential/step').success
    assert node.simulation.state.held[1] is None
    publisher.publish(Float64(data=6.0))

    def stepped():
        assert ros.call(Trigger, '/differential/step').success
        return node.simulation.state.held[1] == 6.0
    ros.until(stepped)


def test_stiffness_and_damping_may_change_while_it_runs_and_the_kind_may_not(ros):
    node = ros.differential('symmetric_ode', mode='lockstep', **LEFT)
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)

    def set_to(**values):
        return ros.call(SetParameters, '/differential/set_parameters', parameters=[
            Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
            for name, value in values.items()]).results
    publisher.publish(demand(('left',), (), (5.0,)))
    ros.until(lambda: len(joints) == 1)
    before = twist(node)
    assert all(r.successful for r in set_to(port__left__stiffness=5e4, port__left__damping=10.0))
    assert node.simulation.ports == {'left': (5e4, 10.0)} and twist(node) == before != (0.0,)
    result, *_ = set_to(port__right__kind='speed')
    assert not result.successful
    refused = set_to(port__left__damping=20.0, port__left__stiffness=-1.0)
    assert not any(r.successful for r in refused)
    assert any('port.left.stiffness: -1.0' in r.reason for r in refused)
    assert node.simulation.ports == {'left': (5e4, 10.0)}
    assert node.get_parameter('port.left.stiffness').value == 5e4
    # of a torque port they wait for a start with it
    assert all(r.successful for r in set_to(port__right__stiffness=7e4))
    assert node.simulation.ports == {'left': (5e4, 10.0)}


def test_energy_in_the_diagnostics_knows_the_half_shafts(ros):
    ros.differential('symmetric_ode', torque_timeout=0.0, **LEFT)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.publisher(Float64, '/differential/speed/left').publish(Float64(data=5.0))

    def lost():
        for status in (s for message in reversed(diagnostics) for s in message.status):
            values = {v.key: v.value for v in status.values}
            if 'lost in half-shafts [J]' in values:
                return float(values['lost in half-shafts [J]'])
        return 0.0
    ros.until(lambda: lost() > 0.0)


# Played


def test_a_file_is_played_with_speeds_where_the_parameters_say_so(tmp_path):
    (tmp_path / 'speed.yaml').write_text('/**: {ros__parameters: {port.left.kind: speed}}')
    (tmp_path / 'in.csv').write_text('time,pinion,left,right\n0.5,1,2,3\n1,4,5,6\n')
    arguments = ['--params', str(tmp_path / 'speed.yaml')]
    played = [*arguments, '--torques', str(tmp_path / 'in.csv')]
    played = load(parser().parse_args(played))
    assert [port.kind for port in played.ports] == ['torque', 'speed', 'torque']
    assert (played.values_at(0), played.values_at(60)) == ((0.0, None, 0.0), (1.0, 2.0, 3.0))
    with pytest.raises(ValueError, match='--torques: it is needed where speed comes in, on left'):
        load(parser().parse_args(arguments))


def test_the_player_sends_speeds_as_velocity_and_ends_without_any(ros, tmp_path):
    import subprocess
    import sys
    (tmp_path / 'speed.yaml').write_text('/**: {ros__parameters: {port.left.kind: speed}}')
    (tmp_path / 'in.csv').write_text('time,pinion,left,right\n0,1,2,3\n0.3,0,0,0\n')
    node = ros.differential('symmetric_ode', torque_timeout=0.3, **LEFT)
    player = subprocess.Popen([
        sys.executable, '-m', 'dm_ros.tools.play_torques', '--params',
        str(tmp_path / 'speed.yaml'), '--torques', str(tmp_path / 'in.csv')],
        stderr=subprocess.DEVNULL)
    try:
        ros.until(lambda: node.simulation.state.held == (1.0, 2.0, 3.0))
        ros.until(lambda: node.simulation.state.held == (0.0, None, 0.0))
        assert player.wait(timeout=30.0) == 0 and node.plant.inputs.refused == 0
    finally:
        player.kill()
        player.wait()
