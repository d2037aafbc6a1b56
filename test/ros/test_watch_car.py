# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""``watch`` beside a node ``driveline`` over real topics: what it tells is what that publishes."""

from nav_msgs.msg import Odometry
from pages import ask, stamp_of
import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState

from dm_ros.ros.driveline_node import DrivelineNode


def names_of(description):
    return [series for strip in description['strips'] for series in strip['series']]


@pytest.mark.parametrize('layout, planar', [('awd', True), ('fwd', False)])
def test_the_page_has_the_numbers_of_the_topics(ros, page, drive, layout, planar):
    drive(layout=layout, planar=planar, rate=50.0, initial_speed=10.0, joint_prefix='my_')
    heard = {topic: ros.listen(kind, f'/driveline/{topic}') for topic, kind in (
        ('joint_states', JointState), ('tyres', JointState), ('odometry', Odometry))}
    it = page('--node', 'driveline')
    ros.until(lambda: it.last.get('scene', {}).get('kind') == 'driveline' and it.now)
    description, seen = it.last['scene'], []
    assert (description['layout'], description['planar']) == (layout, planar)
    ros.until(lambda: seen.append(it.now) or len({now['stamp'] for now in seen}) > 5)
    for now in seen:
        joints, tyres, odometry = (
            next(m for m in messages if abs(stamp_of(m) - now['stamp']) < 1e-4)
            for messages in heard.values())
        speed = dict(zip(joints.name, joints.velocity))
        assert now['velocity'] == [speed[f'my_{wheel}'] for wheel in description['wheels']]
        force = dict(zip(tyres.name, tyres.effort))
        assert now['force'] == [[force[f'my_{wheel}_{way}'] for way in ('longitudinal', 'lateral')]
                                for wheel in description['wheels']]
        assert now['load'] == [force[f'my_{wheel}_load'] for wheel in description['wheels']]
        torque = dict(zip(joints.name, joints.effort))
        for one, power in zip(description['differentials'], now['power']):
            shaft = f'my_{one["input"]}'
            assert power[0] == torque[shaft] * speed[shaft]
        assert now['twist'][0] == odometry.twist.twist.linear.x == pytest.approx(10.0, abs=1.0)
        assert now['pose'][0] == odometry.pose.pose.position.x
    ros.until(lambda: it.now['flow'] and set(it.now['flow']) <= {1, -1})
    ros.until(lambda: any(it.rows))
    row = next(filter(None, reversed(it.rows)))
    assert len(row) == 1 + len(names_of(description))
    assert row[1 + names_of(description).index('forward')] == pytest.approx(10.0, abs=1.0)


def test_what_is_steered_and_where_is_ice_is_seen_though_no_topic_tells_it(
        ros, page, drive):
    node = drive(planar=True, initial_speed=15.0)
    it = page('--node', 'driveline')
    ros.until(lambda: it.now)
    publisher = ros.node.create_publisher(JointState, '/driveline/commands', 10)
    command = JointState(name=['steer', 'rear_left_grip', 'input'],
                         position=[0.05, 0.1, float('nan')],
                         effort=[float('nan'), float('nan'), 300.0])

    def is_seen():
        publisher.publish(command)
        grip = it.now['grip'][2]
        return grip and abs(grip / 0.1 - 1) < 0.1 and abs(it.now['steer'][0] - 0.05) < 2e-3
    ros.until(is_seen)
    assert it.now['steer'][0] > 0.05 > it.now['steer'][1] > 0.0
    assert not node.plant.inputs.refused


def test_a_driveline_is_commanded_by_the_names_of_its_ports(ros, page, drive):
    node = drive(planar=True, torque_timeout=0.2, joint_prefix='my_')
    it = page('--control', '--node', 'driveline')
    ros.until(lambda: it.now and it.last.get('viewer'))
    messages = []
    ros.node.create_subscription(JointState, '/driveline/commands', messages.append,
                                 QoSProfile(depth=1000))
    wanted = {'input': 40.0, 'rear_left_brake': 700.0, 'steer': 0.1, 'front_left_grip': 0.5}
    assert ask(ros, it, do='set', values=wanted)[0] == 200
    ros.until(lambda: len(messages) > 10)
    assert set(messages[-1].name) == {f'my_{name}' for name in wanted}

    def in_force():
        return dict(zip(node.plant.inputs.names, node.plant.inputs.in_force(
            node.simulation.ticks)))
    ros.until(lambda: {name: in_force()[name] for name in wanted} == wanted)
    assert ask(ros, it, do='set', values={'front_left_grip': 0.0})[0] == 400
    assert ask(ros, it, do='release')[0] == 200
    ros.until(lambda: in_force()['input'] == 0.0)
    # a car whose brakes let go is no safe state
    assert in_force()['rear_left_brake'] == 700.0 and in_force()['steer'] == 0.1
    assert ask(ros, it, do='zero')[0] == 200
    ros.until(lambda: in_force()['rear_left_brake'] == 0.0)
    assert in_force()['front_left_grip'] == 1.0 and in_force()['steer'] == 0.0
    assert not node.plant.inputs.refused
    assert not ros.node.get_publishers_info_by_topic('/driveline/torques')


def test_in_lockstep_the_buttons_make_ticks(ros, page, drive):
    node = drive(mode='lockstep')
    it = page('--control', '--node', 'driveline')
    ros.until(lambda: it.last.get('scene', {}).get('kind') and it.last.get('viewer'))
    ros.until(lambda: ros.node.get_publishers_info_by_topic('/driveline/commands'))

    def is_told():   # the first messages may be lost, until both sides are connected
        assert ask(ros, it, do='ticks', count=10)[1]['success']
        return it.now.get('stamp', 0.0) > 0.1
    ros.until(is_told)
    assert node.plant.ticks > 20 and not node.plant.inputs.refused


def test_a_driveline_and_then_a_differential_of_one_name_are_both_seen(
        ros, page, drive):
    it = page('--node', 'plant')
    ros.until(lambda: it.last.get('scene') == {'node': '/plant', 'refusal': None})
    node = DrivelineNode(context=ros.context, cli_args=['--ros-args', '-r', '__node:=plant'])
    node.start()
    ros.executor.add_node(node)
    ros.until(lambda: it.last['scene'].get('layout') == 'awd' and it.now)
    ros.executor.remove_node(node)
    node.close()
    ros.until(lambda: not it.last['scene'].get('kind'))
    ros.differential('lsd_ode', arguments=['--ros-args', '-r', '__node:=plant'])
    ros.until(lambda: it.variant == 'lsd_ode' and it.now)
    assert len(it.now['velocity']) == 4 and 'moment' in it.now
