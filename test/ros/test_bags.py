# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Bags of what runs over topics: recorded, run again to the same bits, and played."""

from pathlib import Path

import numpy as np
import pytest
import rclpy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from dm_ros import Simulation
from dm_ros.files.bag import Bag, TickBag
from dm_ros.files.recorded_drive import read_drive
from dm_ros.ros.recorder import Taps
from dm_ros.tools.simulate import main

pytest.importorskip('rosbags', reason='bags need rosbags: the extra bag')

TORQUES = '/differential/torques'
SPEEDS = '    port.rear.kind: speed\n'
LAG = '    lsd.clutch.front.actuator_time_constant: 0.05\n'


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def again(variant, bag, parameters=''):
    """Run a bag by the tool ``simulate``; return its OUT.csv by column."""
    Path('params.yaml').write_text(
        f'/**:\n  ros__parameters:\n    variant: {variant}\n{parameters}')
    assert main(['--params', 'params.yaml', '--torques', bag, '--out', 'AGAIN.csv']) == 0
    return np.genfromtxt('AGAIN.csv', delimiter=',', names=True, deletechars='')


def messages(path, topic):
    from rosbags.highlevel import AnyReader
    with AnyReader([Path(path)]) as reader:
        of_topic = [c for c in reader.connections if c.topic == topic]
        assert of_topic
        return [reader.deserialize(data, connection.msgtype)
                for connection, _, data in reader.messages(of_topic)]


class Controller:
    """Answers each state with torques and forces that follow from it."""

    def __init__(self, differential, names, demand):
        self.node = rclpy.create_node('controller', context=differential.context)
        self.names, self.demand = names, demand
        self.torques = self.node.create_publisher(JointState, TORQUES, 10)
        self.node.create_subscription(JointState, '/differential/joint_states', self.answer, 10)

    def answer(self, message):
        efforts, velocities = self.demand(message)
        self.torques.publish(JointState(
            header=message.header, name=self.names, effort=efforts, velocity=velocities))


@pytest.mark.parametrize('variant', ['lsd_ode', 'lsd_lagged', 'symmetric_dae'])
def test_a_lockstep_run_of_the_fixture_is_run_again_bit_by_bit(differential, variant):
    vehicle = differential(variant, rate=400.0)
    names = list(vehicle.simulation.inputs)
    vehicle.attach(Controller(vehicle, names, lambda state: (
        [200.0 - state.velocity[0], -60.0, -70.0 * np.sin(state.position[0])], [])).node)
    vehicle.run(seconds=0.1)
    record = vehicle.run(seconds=0.2)
    vehicle.save_bag('drive')
    columns = again(variant, 'drive')
    for name, values in record.columns.items():
        assert (columns[name][41:] == values).all(), name


def test_a_lockstep_run_that_others_record_is_run_again_bit_by_bit(ros):
    node = ros.differential('lsd_ode', mode='lockstep', rate=500.0, port__rear__kind='speed',
                            lsd__clutch__front__actuator_time_constant=0.05)
    names = ['carrier', 'front', 'rear', 'front_clutch']
    publisher = ros.publisher(JointState, TORQUES, depth=1000)
    taps = Taps(ros.participant('recorder'), '/differential', node.simulation.mechanism)
    velocities, nan = [], float('nan')
    with Bag('drive') as bag:
        taps.record(bag)
        ros.until(lambda: all(output.get_subscription_count() for output, _ in
                              node.outputs.of_a_tick)
                  and publisher.get_subscription_count() == 2)
        for n in range(150):
            publisher.publish(JointState(
                name=names, effort=[100.0, -40.0, nan, 10.0 * (n % 7)],
                velocity=[nan, nan, 0.1 * n, nan]))
        publisher.publish(JointState(name=['nobody'], effort=[1.0]))   # refused, no tick
        publisher.publish(JointState())                                # a tick with what is held

        def whole():
            velocities.extend(tuple(message.velocity) for topic, message in taps.poll()
                              if topic.endswith('/joint_states'))
            return len(velocities) == 151
        ros.until(whole)
        ros.until(lambda: node.plant.inputs.refused == 1)
        list(taps.poll())
    columns = again('lsd_ode', 'drive', SPEEDS + LAG)
    ticks = np.array([columns[f'velocity.{shaft}'] for shaft in node.simulation.shafts]).T
    assert [tuple(row) for row in ticks[1:]] == velocities


def test_what_came_on_topics_of_single_shafts_and_clutches_is_in_the_bag(ros):
    node = ros.differential('lsd_ode', port__front__kind='speed', torque_timeout=0.0)
    mechanism = node.simulation.mechanism
    taps = Taps(ros.participant('recorder'), '/differential', mechanism)
    with Bag('drive') as bag:
        taps.record(bag, '/renamed/d')
        for topic, value in (('torque/carrier', 30.0), ('speed/front', 2.0),
                             ('clutch/rear', 99.0)):
            publisher = ros.publisher(Float64, f'/differential/{topic}')

            def came(topic=topic, publisher=publisher, value=value):
                publisher.publish(Float64(data=value))   # until the recorder hears it as well
                return f'/differential/{topic}' in [name for name, _ in taps.poll()]
            ros.until(came)
        ros.until(lambda: node.simulation.state.force == (0.0, 99.0))
        states = []

        def some():
            states.extend(message for topic, message in taps.poll()
                          if topic.endswith('/joint_states'))
            return len(states) > 20
        ros.until(some)
    drive = read_drive('drive', mechanism, 200.0)
    assert drive.table.torques[-1] == (30.0, 2.0, 0.0, 0.0, 99.0)
    assert {message.data for message in messages('drive', '/renamed/d/speed/front')} == {2.0}


def test_play_torques_records_the_node_that_it_plays_to(ros, play):
    ros.differential('lsd_ode', rate=100.0)
    Path('IN.csv').write_text(
        'time,carrier,front,rear,rear_clutch\n0,30,-10,-15,500\n0.5,0,0,0,0\n')
    process = play('--variant', 'lsd_ode', '--torques', 'IN.csv', '--wait', 60,
                   '--record', 'drive', '--rate', 50)
    ros.until(lambda: process.returncode is not None)
    assert process.returncode == 0, process.errors
    commands = messages('drive', TORQUES)
    assert [list(message.effort) for message in commands[:-1]] == [
        [30.0, -10.0, -15.0, 0.0, 500.0]] * len(commands[:-1])
    assert list(commands[-1].effort) == [0.0] * 5 and len(commands) > 5
    states = messages('drive', '/differential/joint_states')
    assert [30.0, -10.0, -15.0, 0.0] in [list(message.effort) for message in states]
    assert list(states[-1].effort) == [0.0] * 4   # and the end of the load is seen
    columns = again('lsd_ode', 'drive')
    stamps = [message.header.stamp for message in messages('drive', '/differential/clutches')]
    heard = [message for message in states if message.header.stamp in stamps]   # whole ticks
    loaded = [n for n, message in enumerate(heard) if any(message.effort)]
    for n in loaded[1:]:
        assert columns['velocity.rear'][n] == pytest.approx(heard[n].velocity[2], rel=1e-9)
    process = play('--variant', 'lsd_ode', '--record', 'drive')
    ros.until(lambda: process.returncode is not None)
    assert process.returncode == 2
    assert 'drive: it is there already, and a bag needs a new folder' in process.errors


def test_play_torques_plays_a_bag(ros, play):
    simulation = Simulation('lsd_ode', 0.01)
    with TickBag('drive', simulation.mechanism, 100.0) as bag:
        bag.start(simulation.snapshot())
        for n in range(30):
            torques = (n + 1.0, -1.0, -2.0)
            bag.tick((*torques, 0.0, 7.0), simulation.step(torques, (0.0, 7.0)))
    heard = []
    ros.node.create_subscription(JointState, TORQUES, heard.append, 100)
    process = play('--variant', 'lsd_ode', '--torques', 'drive', '--wait', 60)
    ros.until(lambda: process.returncode is not None)
    ros.until(lambda: heard and not any(heard[-1].effort))
    assert process.returncode == 0, process.errors
    *played, _ = [list(message.effort) for message in heard]
    # a machine that is late passes rows over
    rows = [[n + 1.0, -1.0, -2.0, 0.0, 7.0] for n in range(30)]
    assert played[0] == rows[0] and played == [row for row in rows if row in played]
