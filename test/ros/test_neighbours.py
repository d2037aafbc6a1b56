# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Others on the topics of a node: whose QoS, type or topic does not fit, and who command alike."""

import math

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from reports import told
from sensor_msgs.msg import JointState
from std_msgs.msg import Float32, Float64

from dm_ros.ros.sources import Sources

TORQUES, JOINTS = '/differential/torques', '/differential/joint_states'


def torques(names, efforts):
    return JointState(name=list(names), effort=[float(effort) for effort in efforts])


# QoS


def test_a_subscriber_that_wants_what_the_node_does_not_offer_is_named_until_it_goes(ros):
    ros.differential()
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: told(diagnostics, 'connections')[0] == DiagnosticStatus.OK)
    subscription = ros.node.create_subscription(
        JointState, JOINTS, print,
        QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    ros.until(lambda: told(diagnostics, 'connections')[0] == DiagnosticStatus.WARN)
    _, message, values = told(diagnostics, 'connections')
    assert 'QoS' in message
    assert values['QoS that does not fit'] == '~/joint_states: DURABILITY of /user'
    ros.node.destroy_subscription(subscription)
    ros.until(lambda: told(diagnostics, 'connections')[:2] == (DiagnosticStatus.OK, 'fine'))


def test_a_publisher_that_does_not_offer_what_lockstep_needs_is_named_until_it_goes(ros):
    ros.differential('lsd_ode', mode='lockstep')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.node.create_publisher(
        JointState, TORQUES, QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT))
    ros.until(lambda: told(diagnostics, 'connections')[0] == DiagnosticStatus.WARN)
    assert told(diagnostics, 'connections')[2]['QoS that does not fit'] == (
        '~/torques: RELIABILITY of /user')
    ros.node.destroy_publisher(publisher)
    ros.until(lambda: told(diagnostics, 'connections')[:2] == (DiagnosticStatus.OK, 'fine'))


@pytest.mark.parametrize('profile', [
    QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT),
    QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL),
    QoSProfile(depth=50)])
def test_in_real_time_torques_of_every_qos_are_heard(ros, profile):
    node = ros.differential(torque_timeout=0.0)
    publisher = ros.publisher(JointState, TORQUES, profile)

    def heard():
        publisher.publish(torques(['left'], [4.0]))
        return node.simulation.snapshot().torque[1] == 4.0
    ros.until(heard)


# Several sources


class Nodes:
    """Other nodes of this test, with publishers; what each publishes is its own command."""

    def __init__(self, ros):
        self._ros, self._nodes, self._sends = ros, [], []

    def publisher(self, name, message_type, topic, message):
        node = rclpy.create_node(name, context=self._ros.context)
        self._nodes.append(node)
        publisher = node.create_publisher(message_type, topic, 10)
        self._ros.until(lambda: publisher.get_subscription_count() > 0)
        self._sends.append(lambda: publisher.publish(message))

    def elsewhere(self, name, message_type, topic):
        node = self._ros.participant(name)
        self._nodes.append(node)
        node.create_publisher(message_type, topic, 10)

    def torques(self, name, shafts, efforts):
        self.publisher(name, JointState, TORQUES, torques(shafts, efforts))

    def send(self):
        for send in self._sends:
            send()
        return True

    def close(self):
        self._sends.clear()
        for node in self._nodes:
            node.destroy_node()


@pytest.fixture
def nodes(ros):
    nodes = Nodes(ros)
    yield nodes
    nodes.close()


def contested(diagnostics):
    """Return level, message and who commands what several do, of the newest report."""
    level, message, values = told(diagnostics, 'connections')
    return level, message, values.get('commanded by several sources')


FINE = (DiagnosticStatus.OK, 'fine', 'none')
SEVERAL = DiagnosticStatus.WARN, 'several sources command one shaft or clutch'


@pytest.mark.parametrize('names, words', [
    (['one', 'other'], '/one, /other'), (['player', 'player'], '/player (2)')])
@pytest.mark.parametrize('topic, port', [('torque/left', 'left'), ('clutch/rear', 'rear_clutch')])
def test_two_publishers_on_the_topic_of_one_shaft_are_named_until_one_goes(
        ros, nodes, names, words, topic, port):
    ros.differential('lsd_ode' if 'rear' in topic else 'symmetric_ode')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    for name in names:
        assert contested(diagnostics) in (FINE, (None, '', None))
        nodes.publisher(name, Float64, f'/differential/{topic}', Float64(data=1.0))
    ros.until(lambda: nodes.send() and contested(diagnostics) == (
        *SEVERAL, f'{port}: ~/{topic} of {words}'))
    nodes.close()
    ros.until(lambda: contested(diagnostics) == FINE)


@pytest.mark.parametrize('mode', ['realtime', 'lockstep'])
def test_nodes_that_command_one_shaft_by_the_grouped_topic_are_named_until_one_stops(
        ros, nodes, mode):
    ros.differential(mode=mode)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    nodes.torques('engine', ['pinion', 'left'], [5, math.nan])
    nodes.torques('one', ['left', 'right'], [1, 1])
    nodes.torques('other', ['right'], [2])
    ros.until(lambda: nodes.send() and contested(diagnostics) == (
        *SEVERAL, 'right: ~/torques of /engine, /one, /other'))
    ros.until(lambda: contested(diagnostics) == FINE)


def test_a_shaft_that_is_commanded_by_both_topics_is_told_with_the_nodes(ros, nodes):
    ros.differential()
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    nodes.torques('one', ['left', 'right'], [1, 1])
    nodes.publisher('other', Float64, '/differential/torque/left', Float64(data=2.0))
    ros.until(lambda: nodes.send() and contested(diagnostics) == (
        *SEVERAL, 'left: ~/torque/left of /other and ~/torques of /one'))


@pytest.mark.parametrize('mode', ['realtime', 'lockstep'])
def test_nodes_that_command_different_shafts_are_fine(ros, nodes, mode):
    node = ros.differential(mode=mode)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    nodes.torques('one', ['left', 'pinion'], [1, math.nan])
    nodes.torques('other', ['right'], [1])
    if mode == 'realtime':
        nodes.publisher('engine', Float64, '/differential/torque/pinion', Float64(data=2.0))
    ros.until(lambda: nodes.send() and node.plant.inputs.received > 30)
    first = len(diagnostics)
    ros.until(lambda: nodes.send() and len(diagnostics) > first + 5)
    assert all(contested([message]) in (FINE, (None, '', None)) for message in diagnostics)


def test_a_source_that_is_replaced_or_starts_anew_fights_with_nobody():
    sources = Sources(['left'], '~/torques', {}, None)
    for number in (7, 8, 1, 2):
        sources.note([0], True, number)
        assert sources.contested() == {}
    for _ in range(5):   # and seconds later
        assert sources.contested() == {}
    for _ in range(5):
        sources.note([0], False, None)
        assert sources.contested() == {}


# Topics that nobody hears


def unheard(diagnostics):
    """Return level, message and the topics that nobody hears, of the newest report."""
    level, message, values = told(diagnostics, 'connections')
    return level, message, values.get('topics that nobody hears')


@pytest.mark.parametrize('parameters, message_type, topic, words', [
    ({'mode': 'lockstep'}, Float64, 'torque/left', ''),
    ({'mode': 'lockstep', 'variant': 'lsd_ode'}, Float64, 'clutch/rear', ''),
    ({'mode': 'lockstep', 'port.left.kind': 'speed'}, Float64, 'speed/left', ''),
    ({'port.left.kind': 'speed'}, Float64, 'torque/left', ''),
    ({}, Float64, 'speed/left', ''),
    ({}, Float64, 'torque/front', ''),
    ({}, Float64, 'torque/lefft', ''),
    ({}, Float64, 'clutch/left', ''),
    ({}, Float32, 'torque/left', ' as std_msgs/msg/Float32 instead of std_msgs/msg/Float64'),
    ({'mode': 'lockstep'}, Float64, 'torques',
     ' as std_msgs/msg/Float64 instead of sensor_msgs/msg/JointState')])
def test_a_topic_that_nobody_hears_is_named_with_its_nodes_until_they_go(
        ros, nodes, capfd, parameters, message_type, topic, words):
    node = ros.differential(**parameters)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    nodes.torques('controller', [], [])
    ros.until(lambda: unheard(diagnostics) == FINE)
    nodes.elsewhere('one', message_type, f'/differential/{topic}')
    line = f'/differential/{topic} of /one{words}'
    ros.until(lambda: unheard(diagnostics) == (
        DiagnosticStatus.WARN, 'nobody hears a topic', line))
    hears = ', '.join(node.resolve_topic_name(heard) for heard in node.neighbours.heard)
    assert f'nobody hears a topic: {line}; the node hears {hears}\n' in capfd.readouterr().err
    nodes.close()
    ros.until(lambda: unheard(diagnostics) == FINE)


def test_topics_of_others_and_of_another_name_are_none_of_its_business(ros, nodes):
    ros.differential()
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    for topic in ('/torque/left', '/differential_2/torque/left', '/differential/joint_states',
                  '/differential/torque_limits', '/differential/torques_of_others'):
        nodes.elsewhere('one', Float64, topic)
    nodes.torques('controller', [], [])
    nodes.elsewhere('other', Float64, '/differential/torques')
    line = ('/differential/torques of /other as std_msgs/msg/Float64 instead of '
            'sensor_msgs/msg/JointState')
    ros.until(lambda: unheard(diagnostics)[2] == line)


def test_what_is_remapped_is_heard_by_its_new_name_and_no_longer_by_the_old_one(
        ros, nodes, capfd):
    ros.differential(arguments=['--ros-args', '-r', '~/torques:=/commands',
                                '-r', '~/torque/left:=/left'])
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    nodes.publisher('good', Float64, '/left', Float64(data=1.0))
    nodes.publisher('better', JointState, '/commands', torques(['right'], [1.0]))
    nodes.elsewhere('old', Float64, '/differential/torque/left')
    nodes.elsewhere('older', JointState, '/differential/torques')
    ros.until(lambda: unheard(diagnostics)[2] == (
        '/differential/torque/left of /old; /differential/torques of /older'))
    assert ('; the node hears /differential/torque/pinion, /left, /differential/torque/right, '
            '/commands\n') in capfd.readouterr().err


# Names


def test_two_nodes_of_one_name_both_run_and_both_say_so(ros):
    one = ros.differential('symmetric_ode')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    other = ros.differential('symmetric_ode')
    ros.until(lambda: told(diagnostics, 'connections')[2].get(
        'other nodes of the same name') == '1')
    level, message, _ = told(diagnostics, 'connections')
    assert level == DiagnosticStatus.WARN and 'same name' in message
    ticks = one.simulation.ticks, other.simulation.ticks
    ros.until(lambda: one.simulation.ticks > ticks[0] + 50
              and other.simulation.ticks > ticks[1] + 50)
