# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``driveline`` over real topics, in a domain of its own."""

from math import atan, cos, isnan, sin
from pathlib import Path
import signal

from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from processes import command, Forked
import pytest
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.parameter import Parameter
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64, Int8
from std_srvs.srv import SetBool, Trigger

from dm_ros import Driveline

NAN = float('nan')
CONFIG = Path(__file__).parents[2] / 'config'
WHEELS = 'front_left', 'front_right', 'rear_left', 'rear_right'


def values_of(message, array='velocity'):
    return dict(zip(message.name, getattr(message, array)))


def keys(diagnostics, which):
    """Return the values of the newest status whose name ends so, and its message."""
    status, = [s for s in diagnostics[-1].status if s.name.endswith(which)]
    return {pair.key: pair.value for pair in status.values}, status.message


@pytest.mark.parametrize('layout, planar', [('awd', False), ('awd', True), ('fwd', False),
                                            ('rwd', True)])
def test_a_tick_publishes_the_whole_car_by_name_with_one_stamp(ros, layout, planar):
    node = ros.driveline(layout=layout, planar=planar, initial_speed=10.0)
    car = Driveline(layout, planar)
    joints, moments, tyres = (ros.listen(JointState, f'/driveline/{topic}') for topic in (
        'joint_states', 'internal_moments', 'tyres'))
    odometry = ros.listen(Odometry, '/driveline/odometry')
    imu = ros.listen(Imu, '/driveline/imu')
    flows = [ros.listen(Int8, f'/driveline/power_flow/{name}') for name in car.differentials]
    ros.until(lambda: min(map(len, (joints, moments, tyres, odometry, imu, *flows))) > 5)
    assert node.get_name() == 'driveline'
    assert tuple(joints[-1].name) == car.shafts and tuple(moments[-1].name) == car.moments
    assert list(tyres[-1].name) == [f'{wheel}_{what}' for wheel in WHEELS
                                    for what in ('longitudinal', 'lateral', 'load')]
    assert isnan(values_of(tyres[-1])['front_left_load'])
    assert values_of(tyres[-1], 'effort')['front_left_load'] > 1000.0
    assert {flow[-1].data for flow in flows} <= {1, -1}
    stamp = odometry[-1].header.stamp
    same = [[m for m in messages if m.header.stamp == stamp] for messages in (joints, imu, tyres)]
    assert all(same)
    assert (odometry[-1].header.frame_id, odometry[-1].child_frame_id) == ('odom', 'base_link')
    assert imu[-1].header.frame_id == joints[-1].header.frame_id == 'base_link'
    assert 9.0 < odometry[-1].twist.twist.linear.x <= 10.0


def test_each_input_has_its_own_topic(ros):
    node = ros.driveline(planar=True, torque_timeout=0.0)
    for topic, value in (('torque/input', 100.0), ('brake/front_left', 30.0), ('steer', 0.05),
                         ('clutch/centre_rear', 400.0), ('grade', 0.1), ('grip/rear_right', 0.4),
                         ('contact/rear_left', 0.8)):
        ros.publisher(Float64, f'/driveline/{topic}').publish(Float64(data=value))

    def held():
        return dict(zip(node.plant.inputs.names, node.plant.inputs.in_force(0)))
    ros.until(lambda: held()['rear_left_contact'] == 0.8)
    assert {name: value for name, value in held().items() if value not in (0.0, 1.0)} == {
        'input': 100.0, 'front_left_brake': 30.0, 'steer': 0.05, 'centre_rear_clutch': 400.0,
        'grade': 0.1, 'rear_right_grip': 0.4, 'rear_left_contact': 0.8}


def test_in_lockstep_each_message_is_one_tick_of_the_library(ros):
    node = ros.driveline(mode='lockstep', rate=500.0, planar=True)
    car = Driveline('awd', True, 0.002)
    joints = ros.listen(JointState, '/driveline/joint_states')
    odometry = ros.listen(Odometry, '/driveline/odometry')
    imu = ros.listen(Imu, '/driveline/imu')
    commands = ros.publisher(JointState, '/driveline/commands')
    for n in range(60):
        commands.publish(JointState(
            name=['input', 'steer', 'grade', 'front_right_grip'],
            effort=[400.0, NAN, NAN, NAN], position=[NAN, 0.001 * n, 0.12, 0.2]))
        ros.until(lambda n=n: len(imu) == n + 1)
        snapshot = car.step(400.0, steer=0.001 * n, grade=0.12, grip=(1.0, 0.2, 1.0, 1.0))
        assert tuple(joints[n].velocity) == snapshot.velocity
    efforts = values_of(joints[-1], 'effort')
    assert efforts['input'] == 400.0 and efforts['front_axle_satellite'] == 0.0
    torque = dict(zip(car.connections, snapshot.torque))
    assert efforts['centre_carrier'] == torque['input']
    assert efforts['rear_axle_pinion'] == torque['rear_propeller']
    assert efforts['rear_left'] == torque['rear_left_half'] and efforts['centre_rear'] == 0.0
    x, y, yaw = snapshot.pose
    pose, twist = odometry[-1].pose.pose, odometry[-1].twist.twist
    assert (pose.position.x, pose.position.y) == (x, y)
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == snapshot.twist_body
    assert pose.orientation.z == pytest.approx(sin(yaw / 2), abs=1e-15)
    f_x, f_y = snapshot.acceleration
    force, q = imu[-1].linear_acceleration, imu[-1].orientation
    assert (force.x, force.y) == (f_x, f_y)
    assert force.z == pytest.approx(9.81 * cos(atan(0.12)))
    # the forward axis of the car, in the world: up by the slope, to the left by the yaw
    forward = (1 - 2 * (q.y**2 + q.z**2), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y))
    assert forward == pytest.approx((cos(atan(0.12)) * cos(yaw), cos(atan(0.12)) * sin(yaw),
                                     sin(atan(0.12))), abs=1e-12)
    stamp = joints[-1].header.stamp
    assert stamp.sec * 10**9 + stamp.nanosec == 120_000_000
    assert node.simulation.ticks == 60


def test_a_bad_message_is_refused_whole_and_told_and_the_node_goes_on(ros):
    node = ros.driveline(torque_timeout=0.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    commands = ros.publisher(JointState, '/driveline/commands')
    commands.publish(JointState(name=['input', 'front_left_brake'], effort=[100.0, -5.0]))
    ros.until(lambda: diagnostics and keys(diagnostics, 'commands')[0]['refused messages'] == '1')
    values, message = keys(diagnostics, 'commands')
    assert 'front_left_brake is -5.0, it must not be below 0' in values['last refused']
    assert 'refused' in message
    commands.publish(JointState(name=['input'], effort=[70.0]))
    ros.until(lambda: node.simulation.torque == 70.0)
    ros.until(lambda: keys(diagnostics, 'energy')[0]['work of the input [J]'] != '0')
    assert keys(diagnostics, 'loop')[0]['layout'] == 'awd'


def test_a_stale_torque_becomes_zero_and_the_brakes_hold(ros, steady):
    node = ros.driveline(rate=100.0, torque_timeout=0.05)
    joints = ros.listen(JointState, '/driveline/joint_states')
    ros.publisher(JointState, '/driveline/commands').publish(JointState(
        name=['input', *(f'{wheel}_brake' for wheel in WHEELS)], effort=[50.0] + [900.0] * 4))
    ros.until(lambda: node.plant.inputs.received or steady.tick(node, joints))
    for _ in range(12):
        steady.tick(node, joints)
    inputs = [values_of(m, 'effort')['input'] for m in joints]
    assert inputs.count(50.0) == 6 and inputs[-1] == 0.0
    held = dict(zip(node.plant.inputs.names, node.plant.inputs.in_force(node.simulation.ticks)))
    assert [held[f'{wheel}_brake'] for wheel in WHEELS] == [900.0] * 4


def test_it_is_paused_stepped_reset_and_changed_as_a_differential_is(ros):
    node = ros.driveline(initial_speed=12.0)
    assert ros.call(SetBool, '/driveline/pause', data=True).success
    ticks = node.simulation.ticks
    assert ros.call(Trigger, '/driveline/step').message.startswith('time ')
    assert node.simulation.ticks == ticks + 1
    parameters = [Parameter('driveline.mass', value=2000.0).to_parameter_msg()]
    answer = ros.call(SetParametersAtomically, '/driveline/set_parameters_atomically',
                      parameters=parameters)
    assert answer.result.successful
    assert node.simulation.parameters['driveline.mass'] == 2000.0
    assert node.simulation.ticks == ticks + 1
    bad = [Parameter('driveline.tyre.damping', value=50.0).to_parameter_msg()]
    refused = ros.call(SetParametersAtomically, '/driveline/set_parameters_atomically',
                       parameters=bad)
    assert not refused.result.successful and 'driveline.tyre.damping' in refused.result.reason
    assert ros.call(Trigger, '/driveline/reset').success
    assert node.simulation.ticks == 0 and node.simulation.snapshot().twist_body[0] == 12.0


def test_names_have_the_prefix_in_and_out(ros):
    node = ros.driveline(mode='lockstep', joint_prefix='truck_', rate=500.0)
    joints = ros.listen(JointState, '/driveline/joint_states')
    clutches = ros.listen(JointState, '/driveline/clutches')
    ros.publisher(JointState, '/driveline/commands').publish(JointState(
        name=['truck_input', 'truck_centre_rear_clutch'], effort=[80.0, 300.0]))
    ros.until(lambda: joints and clutches)
    assert joints[0].name[0] == 'truck_input' and node.simulation.torque == 80.0
    assert values_of(clutches[0], 'effort') == {'truck_centre_front_clutch': 0.0,
                                                'truck_centre_rear_clutch': 300.0}


def test_a_wrong_parameter_ends_it_by_name_and_one_of_another_layout_is_passed_over(ros):
    for name, value, words in (('driveline.mas', 1.0, 'driveline.mas: there is no such'),
                               ('layout', 'rwdd', "layout: 'rwdd' is not allowed"),
                               ('driveline.mass', 5, 'driveline.mass: 5 is not allowed, it must'),
                               ('driveline.mass', -1.0, 'driveline.mass: -1.0 is not allowed')):
        with pytest.raises(ValueError, match=words):
            ros.driveline(**{name.replace('.', '__'): value})
    node = ros.driveline(layout='fwd', driveline__rear__satellite_count=3)
    assert node.plant.title == 'fwd'


def test_the_fixture_stops_to_the_tick_and_repeats_bit_for_bit(driveline):
    from rclpy.node import Node

    class Driver(Node):
        """Answers each state with a torque that grows."""

        def __init__(self, context):
            super().__init__('driver', context=context)
            self.publisher = self.create_publisher(JointState, '/driveline/commands', 10)
            self.create_subscription(JointState, '/driveline/joint_states', self.answer, 10)

        def answer(self, message):
            speed = values_of(message)['input']
            self.publisher.publish(JointState(name=['input'], effort=[200.0 - speed]))
    car = driveline(layout='rwd', rate=500.0, parameters={'initial_speed': 3.0})
    car.attach(Driver(car.context))
    record = car.run(until=lambda snapshot: snapshot.twist_body[0] > 3.5)
    assert record.longitudinal_speed[-1] > 3.5 >= record.longitudinal_speed[-2]
    first = record.columns['velocity.input'].tobytes()
    car.reset()
    again = car.run(seconds=len(record) / 500.0)
    assert again.columns['velocity.input'].tobytes() == first
    with pytest.raises(ValueError, match='parameters: layout is not one of them here'):
        driveline(parameters={'layout': 'fwd'})


@pytest.mark.parametrize('layout, words', [('awd', []), ('fwd', ['76 parameters of another'])])
def test_as_a_process_its_parameter_file_loads_and_a_signal_ends_it(ros, layout, words):
    with Forked(command('driveline'), '--ros-args', '--params-file',
                CONFIG / 'driveline_awd.yaml', '-p', f'layout:={layout}') as process:
        joints = ros.listen(JointState, '/driveline/joint_states')
        ros.until(lambda: len(joints) > 3)
        assert process.ended(signal.SIGTERM) == 0
        assert 'Traceback' not in process.errors
        assert all(word in process.errors for word in [f'{layout} at 200 Hz', *words])


@pytest.mark.parametrize('parameter, words', [
    ('driveline.mas:=1.0', 'driveline: error: driveline.mas: there is no such parameter'),
    ('layout:=4wd', "driveline: error: layout: '4wd' is not allowed, it must be one of fwd, rwd"),
    ('base_frame_id:=2x', "driveline: error: base_frame_id: '2x' is not allowed"),
    ('driveline.tyre.damping:=4.0', 'driveline: error: driveline.tyre.damping: damping times')])
def test_as_a_process_a_wrong_parameter_ends_it_with_code_2_and_one_line(ros, parameter, words):
    with Forked(command('driveline'), '--ros-args', '-p', parameter) as process:
        assert process.ended() == 2
        line, = process.errors.strip().splitlines()
    assert line.startswith(words)
