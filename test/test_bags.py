# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Bags: what others read in them, and that a drive recorded in one gives the same bits again."""

from itertools import pairwise
from pathlib import Path
import re
import shutil

import numpy as np
import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.files.bag import Bag, INPUT_DEPTH, OUTPUT_DEPTH, TickBag
from dm_ros.files.published import Published, RATE_TOLD
from dm_ros.files.recorded_drive import DIAGNOSTICS, read_drive
from dm_ros.mechanism.variants import MECHANISMS, variant_named
from dm_ros.testing import DirectDifferential
from dm_ros.tools.simulate import main

pytest.importorskip('rosbags', reason='bags need rosbags: the extra bag')

PLATES = ''.join(f'    symmetric.clutch.{side}.friction_surfaces: 4\n'
                 f'    symmetric.clutch.{side}.actuator_time_constant: 0.02\n'
                 for side in ('left', 'right'))
LAG = '    lsd.clutch.rear.actuator_time_constant: 0.03\n'
# variant, parameters, rate: of the node's parameters
CASES = {
    **{variant: (variant, '', 1000.0) for variant in VARIANTS},
    'rate': ('lsd_ode', '', 300.0),
    'slow': ('lsd_ode', '', 100.0),
    'odd rate': ('symmetric_ode', '', 123.456),
    'prefix': ('lsd_dae', '    joint_prefix: rear_\n', 500.0),
    'lag': ('lsd_ode', LAG, 1000.0),
    'plates': ('symmetric_dae', PLATES, 1000.0),
    'speed': ('symmetric_ode', '    port.left.kind: speed\n', 1000.0),
    'speeds': ('lsd_ode', '    port.front.kind: speed\n    port.rear.kind: speed\n' + LAG, 500.0),
    'start': ('lsd_ode', '    initial_velocity.front: 30.0\n    initial_velocity.rear: 29.5\n',
              1000.0),
}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def simulate(*arguments):
    return main([str(argument) for argument in arguments])


def refusal(capsys, *arguments):
    """Return the one line in which the tool refuses; it leaves nothing new behind."""
    capsys.readouterr()
    before = sorted(Path().rglob('*'))
    assert simulate(*arguments) == 2
    assert sorted(Path().rglob('*')) == before
    line, = capsys.readouterr().err.splitlines()
    return line.removeprefix('simulate: error: ')


def write_load(variant, parameters, rate, ticks=200):
    """Write params.yaml and IN.csv, a row for each tick, with forces where there are clutches."""
    Path('params.yaml').write_text(
        f'/**:\n  ros__parameters:\n    variant: {variant}\n    rate: {rate!r}\n{parameters}')
    mechanism = variant_named(variant).mechanism
    clutched = mechanism.actuators or parameters == PLATES
    clutches = [f'{side}_clutch' for side in mechanism.outputs] if clutched else []
    random = np.random.default_rng(0)
    with open('IN.csv', 'w') as file:
        print('time', *mechanism.inputs, *clutches, sep=',', file=file)
        for n in range(ticks + 1):
            row = [T if f'port.{shaft}.kind' not in parameters else 5.0 * np.sin(0.05 * n)
                   for shaft, T in zip(mechanism.inputs, mechanism.load(n / 40))]
            forces = random.uniform(0.0, 500.0, len(clutches)) * (n % 40 > 20)
            print(repr(n / rate), *row, *forces, sep=',', file=file)


def recorded(case):
    """Run a case into the bag ``drive`` and OUT.csv; return the arguments that name it."""
    write_load(*CASES[case])
    arguments = ['--params', 'params.yaml']
    assert simulate(*arguments, '--torques', 'IN.csv', '--bag', 'drive', '--out', 'OUT.csv') == 0
    return arguments


def messages(path, topic):
    """Yield ``(time, message)`` of a topic as rosbags reads them."""
    from rosbags.highlevel import AnyReader
    with AnyReader([Path(path)]) as reader:
        for connection, time, data in reader.messages(
                [c for c in reader.connections if c.topic == topic]):
            yield time, reader.deserialize(data, connection.msgtype)


def stamp(message):
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


# Again


@pytest.mark.parametrize('case', CASES)
def test_a_drive_from_a_bag_gives_the_same_bits(case, capsys):
    arguments = recorded(case)
    for bag in ('drive', 'drive/drive.mcap'):
        capsys.readouterr()
        assert simulate(*arguments, '--torques', bag, '--out', 'AGAIN.csv') == 0
        assert Path('AGAIN.csv').read_bytes() == Path('OUT.csv').read_bytes()
        assert 'all speeds are those of the recording, bit by bit' in capsys.readouterr().err


def test_how_far_a_run_is_from_the_recording_is_told(capsys):
    recorded('lsd_ode')
    assert simulate('--variant', 'lsd_ode', '--loss-law', 'paper', '--torques', 'drive',
                    '--out', 'AGAIN.csv') == 0
    told = capsys.readouterr().err.splitlines()[-1]
    away, when = map(float, re.fullmatch(
        r'simulate: speeds are up to (\S+) rad/s from those of the recording, at (\S+) s',
        told).groups())
    whole, again = (np.genfromtxt(name, delimiter=',', names=True)
                    for name in ('OUT.csv', 'AGAIN.csv'))
    differences = np.max([abs(whole[name] - again[name]) for name in whole.dtype.names
                          if name.startswith('velocity')], axis=0)
    assert away == pytest.approx(differences.max(), rel=5e-3) and away > 1e-3
    assert when == pytest.approx(whole['time'][differences.argmax()])
    assert simulate('--variant', 'lsd_ode', '--torques', 'drive', '--dt', '0.0005',
                    '--out', 'AGAIN.csv') == 0
    assert 'recording' not in capsys.readouterr().err   # other ticks


def test_what_a_run_needs_and_a_bag_lacks_is_told(capsys):
    recorded('lsd_ode')
    cut('drive', 'bare', lambda stamp: True, topics=('joint_states',))
    run = ['--variant', 'lsd_ode', '--torques', 'bare', '--out', 'AGAIN.csv']
    assert simulate(*run) == 0
    assert 'without /differential/clutches no force is taken' in capsys.readouterr().err
    Path('params.yaml').write_text('/**: {ros__parameters: {port.rear.kind: speed}}')
    assert refusal(capsys, *run, '--params', 'params.yaml') == (
        'bare: no speed of rear, where one comes in, is in it')


def test_speed_ports_replay_what_was_commanded_and_never_the_effort():
    recorded('speed')
    mechanism = Simulation('symmetric_ode', 1e-3, ports={'left': (1e4, 100.0)}).mechanism
    drive = read_drive('drive', mechanism, 1000.0)
    commanded = [float(line.split(',')[2]) for line in Path('IN.csv').read_text().split()[1:]]
    assert [row[1] for row in drive.table.torques[:-1]] == commanded[:-1]
    efforts = [message.effort[1] for _, message in messages('drive', '/differential/joint_states')]
    assert max(map(abs, efforts)) > 1.0 and efforts[1:] != commanded[:-1]


def test_the_start_state_is_no_tick_and_the_first_stamp_after_it_is_one():
    recorded('lsd_ode')
    mechanism = variant_named('lsd_ode').mechanism
    with_start = read_drive('drive', mechanism, 1.0)
    assert with_start.dt == 1e-3 and len(with_start.table.held(1e-3)) == 200
    rows = Simulation('lsd_ode', 1e-3)
    with TickBag('later', mechanism, 1000.0) as bag:   # as a node that was heard from its 1st tick
        for row in with_start.table.held(1e-3):
            bag.tick(row, rows.step(row[:3], row[3:]))
    without = read_drive('later', mechanism, 1.0)
    assert without.table == with_start.table and without.remarks == with_start.remarks == ()
    assert with_start.values.keys() - without.values == {'initial_velocity.front',
                                                         'initial_velocity.rear'}


def test_a_recording_that_begins_in_a_run_goes_on_from_its_speeds_and_says_so(capsys):
    arguments = recorded('lsd_ode')
    cut('drive', 'late', lambda stamp: stamp >= 80_000_000)
    assert simulate(*arguments, '--torques', 'late', '--out', 'AGAIN.csv') == 0
    assert 'it begins with the speeds that it has there' in capsys.readouterr().err
    whole, again = (np.genfromtxt(name, delimiter=',', names=True)
                    for name in ('OUT.csv', 'AGAIN.csv'))
    assert len(again) == 121
    for name in ('velocityfront', 'velocityrear', 'momentrear_clutch'):
        np.testing.assert_allclose(again[name][1:], whole[name][81:], rtol=1e-12)


def test_missing_ticks_are_told_and_have_the_torque_of_the_next(capsys):
    arguments = recorded('lsd_ode')
    cut('drive', 'gap', lambda stamp: not 50_000_000 < stamp < 54_000_000)
    assert simulate(*arguments, '--torques', 'gap', '--out', 'AGAIN.csv') == 0
    assert '3 ticks are missing, and are taken to be as the next one' in capsys.readouterr().err
    again = np.genfromtxt('AGAIN.csv', delimiter=',', names=True)
    assert len(again) == 201
    assert len(set(again['torquecarrier'][51:55])) == 1


def cut(source, target, kept, clock=lambda time: time, topics=None):
    """Copy those messages of a bag whose stamps are to be kept, at times of another clock."""
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import get_typestore, Stores
    types, copies = get_typestore(Stores.ROS2_JAZZY), {}
    with AnyReader([Path(source)]) as reader, Bag(target) as bag:
        for connection, time, data in reader.messages():
            message = types.deserialize_cdr(data, connection.msgtype)
            name = connection.topic.rpartition('/')[2]
            if not hasattr(message, 'header') or not kept(stamp(message)) or (
                    topics and name not in topics):
                continue
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(
                clock(stamp(message)), 10**9)
            if connection.topic not in copies:
                copies[connection.topic] = bag.topic(connection.topic, connection.msgtype)
            bag.write(copies[connection.topic], clock(time),
                      types.serialize_cdr(message, connection.msgtype))


def test_states_that_were_heard_before_the_clutches_are_left_out():
    recorded('speeds')
    cut('drive', 'late', lambda stamp: True, topics=('joint_states', 'torques'))
    cut('drive', 'whole', lambda stamp: True)
    whole = {stamp(m): m for _, m in messages('whole', '/differential/clutches')}
    cut('drive', 'early', lambda time: time >= 60_000_000, topics=('clutches',))
    from rosbags.highlevel import AnyReader
    with AnyReader([Path('late')]) as a, AnyReader([Path('early')]) as b, Bag('both') as bag:
        for reader in (a, b):
            topics = {c.topic: bag.topic(c.topic, c.msgtype) for c in reader.connections}
            for connection, time, data in reader.messages():
                bag.write(topics[connection.topic], time, data)
    mechanism = Simulation('lsd_ode', 2e-3, ports=dict.fromkeys(
        ('front', 'rear'), (1e4, 100.0))).mechanism
    both, all_of_it = (read_drive(name, mechanism, 500.0) for name in ('both', 'drive'))
    assert len(whole) == 201 and len(both.table.times) == len(all_of_it.table.times) - 30
    assert both.table.torques == all_of_it.table.torques[30:]


def test_with_stamps_of_system_time_each_message_is_a_tick_and_what_is_late_is_told(capsys):
    arguments = recorded('lsd_ode')
    random, jitter = np.random.default_rng(1), {}

    def late(time):   # some 100 us, and once 5 ms: the node missed ticks
        jitter.setdefault(time, round(random.uniform(0, 1e5)))
        return 1_795_000_000 * 10**9 + time + jitter[time] + 5_000_000 * (time > 100_000_000)
    cut('drive', 'real', lambda stamp: True, clock=late)
    assert simulate(*arguments, '--torques', 'real', '--out', 'AGAIN.csv') == 0
    told = capsys.readouterr().err
    assert '201 messages with stamps of system time' in told and '1/1000 s; 1 came late' in told
    assert Path('AGAIN.csv').read_bytes() == Path('OUT.csv').read_bytes()


@pytest.mark.parametrize('told, dt', [
    ({'/differential': ['100', '100']}, 0.01),
    ({'/differential': ['100'], '/rear/differential': ['500']}, 0.01),
    ({'/elsewhere': ['100']}, 0.01),                        # recorded under another name
    ({'/elsewhere': ['100'], '/other': ['200']}, 1 / 99),   # whose?
    ({'/differential': ['100', '200']}, 1 / 99),            # when?
    ({'/differential': ['fast']}, 1 / 99), ({'/differential': ['0']}, 1 / 99), ({}, 1 / 99)])
def test_the_rate_that_a_node_told_counts_where_its_stamps_are_of_system_time(told, dt):
    recorded('slow')
    # as on a busy machine, where most ticks are late
    cut('drive', 'real', lambda stamp: True, clock=lambda time: time * 1006 // 1000 + 10**18 + 1)
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import get_typestore, Stores
    types = get_typestore(Stores.ROS2_JAZZY)
    array, status, value, header, time = (types.types[kind] for kind in (
        DIAGNOSTICS, 'diagnostic_msgs/msg/DiagnosticStatus', 'diagnostic_msgs/msg/KeyValue',
        'std_msgs/msg/Header', 'builtin_interfaces/msg/Time'))
    with AnyReader([Path('real')]) as reader, Bag('whole') as bag:
        topics = {c.topic: bag.topic(c.topic, c.msgtype) for c in reader.connections}
        for connection, came, data in reader.messages():
            bag.write(topics[connection.topic], came, data)
        diagnostics = bag.topic('/diagnostics', DIAGNOSTICS)
        for node, rates in told.items():
            for rate in rates:
                bag.write(diagnostics, came, types.serialize_cdr(array(header(time(0, 0), ''), [
                    status(0, f'{node}: loop', 'running', node, [value('ticks', '5'),
                                                                 value(RATE_TOLD, rate)])]),
                    DIAGNOSTICS))
    assert read_drive('whole', Simulation('lsd_ode').mechanism, 500.0).dt == dt
    assert simulate('--variant', 'lsd_ode', '--torques', 'whole', '--out', 'AGAIN.csv') == 0
    assert (Path('AGAIN.csv').read_bytes() == Path('OUT.csv').read_bytes()) == (dt == 0.01)


def test_a_bag_of_commands_alone_is_played_as_they_came(capsys):
    write_load('lsd_ode', '', 100.0)
    arguments = ['--params', 'params.yaml', '--torques']
    assert simulate(*arguments, 'IN.csv', '--bag', 'drive', '--out', 'OUT.csv') == 0
    from rosbags.highlevel import AnyReader
    with AnyReader([Path('drive')]) as reader, Bag('commands') as bag:
        torques, = (c for c in reader.connections if c.topic == '/differential/torques')
        topic = bag.topic('/differential/torques', torques.msgtype)
        for _, time, data in reader.messages([torques]):
            bag.write(topic, time + 1_795_000_000 * 10**9, data)
    capsys.readouterr()
    assert simulate(*arguments, 'commands', '--out', 'AGAIN.csv') == 0
    assert 'without /differential/joint_states what was commanded is taken' in (
        capsys.readouterr().err)
    whole, again = (Path(name).read_text().splitlines() for name in ('OUT.csv', 'AGAIN.csv'))
    assert again == whole[:-1]   # how long the last command held nobody knows


def test_a_fixture_leaves_a_bag_of_the_run_since_the_reset():
    def law(snapshot):
        return (300.0 - snapshot.velocity[0], -100.0, -150.0), (0.0, 400.0 * (snapshot.time > 0.1))
    vehicle = DirectDifferential('lsd_ode', rate=500.0)
    vehicle.run(lambda snapshot: (1.0, 2.0, 3.0), seconds=0.1)
    vehicle.simulation.reset()
    record = vehicle.run(law, seconds=0.2)
    vehicle.save_bag('drive')
    vehicle.save_bag('drive')   # in place of the old one
    assert simulate('--variant', 'lsd_ode', '--torques', 'drive', '--out', 'AGAIN.csv') == 0
    again = np.genfromtxt('AGAIN.csv', delimiter=',', names=True)
    assert (again['velocityrear'][1:] == record.velocity['rear']).all()
    assert (again['clutch_forcerear'][1:] == record.clutch_force['rear']).all()


# What others read


def test_mcap_ros2_support_reads_the_numbers_of_the_run():
    reader = pytest.importorskip('mcap_ros2.reader', reason='the extra mcap')
    recorded('prefix')
    columns = np.genfromtxt('OUT.csv', delimiter=',', names=True, deletechars='')
    mechanism = variant_named('lsd_dae').mechanism
    ticks = {}
    for one in reader.read_ros2_messages('drive/drive.mcap'):
        ticks.setdefault(one.channel.topic, []).append(one)
    joints = ticks['/differential/joint_states']
    assert len(joints) == len(columns) == 201
    for n, one in enumerate(joints):
        message = one.ros_msg
        assert list(message.name) == [f'rear_{shaft}' for shaft in mechanism.shafts]
        assert list(message.velocity) == [
            columns[f'velocity.{shaft}'][n] for shaft in mechanism.shafts]
        assert message.header.frame_id == 'rear_housing_link'
        assert stamp(message) == one.log_time_ns == n * 2_000_000
    for topic, kind, field, names in (
            ('internal_moments', 'moment', 'effort', mechanism.moments),
            ('clutches', 'clutch_force', 'effort', mechanism.clutches)):
        for n, one in enumerate(ticks[f'/differential/{topic}']):
            assert list(getattr(one.ros_msg, field)) == [
                columns[f'{kind}.{name}'][n] for name in names]
    flows = zip(ticks['/differential/power_flow'], ticks['/differential/power_flow_stamped'])
    for n, (plain, stamped) in enumerate(flows):
        assert plain.ros_msg.data == stamped.ros_msg.position[0] == columns['power_flow'][n]
    assert len(ticks['/differential/torques']) == 200


def test_topics_types_and_quality_of_service_are_those_of_the_node():
    import yaml
    recorded('lag')
    info = yaml.safe_load(Path('drive/metadata.yaml').read_text())['rosbag2_bagfile_information']
    assert (info['storage_identifier'], info['relative_file_paths']) == ('mcap', ['drive.mcap'])
    assert info['duration']['nanoseconds'] == 200_000_000
    topics = {one['topic_metadata']['name']: one for one in info['topics_with_message_count']}
    outputs = {f'/differential/{topic}' for topic in (
        'joint_states', 'internal_moments', 'clutches', 'power_flow_stamped', 'power_flow')}
    assert topics.keys() == outputs | {'/differential/torques'}
    for name, topic in topics.items():
        kind = 'std_msgs/msg/Int8' if name.endswith('/power_flow') else (
            'sensor_msgs/msg/JointState')
        assert topic['topic_metadata']['type'] == kind
        assert topic['message_count'] == (201 if name in outputs else 200)
        offered, = topic['topic_metadata']['offered_qos_profiles']
        assert (offered['reliability'], offered['durability']) == ('reliable', 'volatile')
        assert offered['depth'] == (OUTPUT_DEPTH if name in outputs else INPUT_DEPTH)


def test_the_messages_of_a_tick_are_those_of_the_node_in_their_order():
    recorded('lsd_ode')
    from rosbags.highlevel import AnyReader
    with AnyReader([Path('drive')]) as reader:
        order = [connection.topic for connection, *_ in reader.messages()]
    published = [f'/differential/{topic}'
                 for topic in (*Published(variant_named('lsd_ode').mechanism).names, 'power_flow')]
    assert order[:5] == published
    for n in range(200):
        assert order[5 + 6 * n:][:6] == ['/differential/torques', *published]


# What is refused


def test_what_is_no_bag_or_not_the_right_one_is_refused_in_one_line(capsys):
    recorded('lsd_ode')
    Path('empty').mkdir()
    Path('text.mcap').write_text('time,carrier\n')
    Path('cut.mcap').write_bytes(Path('drive/drive.mcap').read_bytes()[:20_000])
    run = ['--variant', 'lsd_ode', '--out', 'x.csv', '--torques']
    for bag, why in (('nowhere.mcap', 'No such file or directory'),
                     ('empty', 'no bag, a folder without metadata.yaml'),
                     ('text.mcap', 'File magic is invalid.'),
                     ('cut.mcap', 'File end magic is invalid. It was not closed, as by a kill: '
                      'mcap recover mends it.')):
        assert refusal(capsys, *run, bag) == f'{bag}: {why}'
    assert refusal(capsys, '--variant', 'symmetric_ode', '--torques', 'drive') == (
        'drive: no differential with the shafts carrier, left, right, pinion, satellite: those of '
        '/differential/joint_states are carrier, front, rear, satellite')
    assert refusal(capsys, *run, 'drive', '--node', '/other') == (
        'drive: no differential with the shafts carrier, front, rear, satellite: it has no '
        'joint_states and no torques of /other')
    assert refusal(capsys, *run, 'IN.csv', '--node', '/other') == '--node: only a bag has nodes'
    assert refusal(capsys, *run, 'drive', '--ignore-columns', 'a') == (
        '--ignore-columns: a bag has no columns')


def test_one_of_several_differentials_is_chosen_by_its_name(capsys):
    mechanism = MECHANISMS['lsd']
    simulation = Simulation('lsd_ode', 1e-3)
    with TickBag('front', mechanism, 1e3, node='/a/d') as bag:
        bag.start(simulation.snapshot())
        bag.tick((1.0, 0.0, 0.0), simulation.step((1.0, 0.0, 0.0)))
    from rosbags.highlevel import AnyReader
    with AnyReader([Path('front')]) as reader, Bag('both') as bag:
        for name in ('/a/d', '/b/d'):
            topics = {c.topic: bag.topic(c.topic.replace('/a/d', name), c.msgtype)
                      for c in reader.connections}
            for connection, time, data in reader.messages():
                bag.write(topics[connection.topic], time, data)
    run = ['--variant', 'lsd_ode', '--out', 'x.csv', '--torques', 'both']
    assert refusal(capsys, *run) == (
        'both: it has several differentials and --node names none of them: /a/d, /b/d')
    for name in ('/b/d', 'b/d'):
        assert simulate(*run, '--node', name) == 0


def test_a_reset_within_a_recording_is_refused_with_its_place(capsys):
    simulation = Simulation('lsd_ode', 1e-3)
    with TickBag('drive', simulation.mechanism, 1e3) as bag:
        bag.start(simulation.snapshot())
        for _ in range(5):
            bag.tick((1.0, 0.0, 0.0), simulation.step((1.0, 0.0, 0.0)))
        simulation.reset()
        bag.tick((0.0, 0.0, 0.0), simulation.snapshot())
    assert refusal(capsys, '--variant', 'lsd_ode', '--torques', 'drive') == (
        'drive: /differential/joint_states: a reset after 6 messages; only a recording between '
        'resets can be run')


def test_forces_on_clutches_that_the_parameters_do_not_give_are_refused(capsys):
    recorded('plates')
    assert refusal(capsys, '--variant', 'symmetric_dae', '--torques', 'drive') == (
        'drive: /differential has clutches, and the parameters of this run give none')


def test_a_bag_needs_a_new_folder_and_a_run_that_fails_leaves_none(capsys):
    arguments = recorded('lsd_ode')
    before = Path('drive/drive.mcap').read_bytes()
    for folder in ('drive', 'IN.csv'):
        line = refusal(capsys, *arguments, '--torques', 'drive/drive.mcap', '--bag', folder)
        assert line == f'{folder}: it is there already, and a bag needs a new folder'
    assert Path('drive/drive.mcap').read_bytes() == before
    Path('huge.csv').write_text('time,carrier,front,rear\n0,1,1,1\n0.1,-1e308,1e308,1e308\n1,0,0,0')
    assert 'huge.csv: after' in refusal(
        capsys, *arguments, '--torques', 'huge.csv', '--bag', 'new')


def test_only_a_bag_gives_place_to_another():
    Path('mine').mkdir()
    Path('mine/thesis.txt').write_text('all of it')
    with pytest.raises(ValueError, match='mine: it is there already'):
        Bag('mine', instead=True)
    assert Path('mine/thesis.txt').exists()


def test_a_bag_with_other_stamps_than_times_is_read_by_its_stamps():
    arguments = recorded('lsd_ode')   # as of ros2 bag record, in lockstep slower than real time
    from rosbags.highlevel import AnyReader
    with AnyReader([Path('drive')]) as reader, Bag('wall') as bag:
        topics = {c.topic: bag.topic(c.topic, c.msgtype) for c in reader.connections}
        for n, (connection, _, data) in enumerate(reader.messages()):
            bag.write(topics[connection.topic], 1_795_000_000 * 10**9 + 31_415 * n, data)
    assert simulate(*arguments, '--torques', 'wall', '--out', 'AGAIN.csv') == 0
    assert Path('AGAIN.csv').read_bytes() == Path('OUT.csv').read_bytes()


def test_a_sqlite_bag_is_read_as_well():
    from rosbags.highlevel import AnyReader
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import get_typestore, Stores
    arguments = recorded('lag')
    with (AnyReader([Path('drive')]) as reader,
          Writer('old', version=8, storage_plugin=StoragePlugin.SQLITE3) as writer):
        topics = {c.topic: writer.add_connection(
            c.topic, c.msgtype, typestore=get_typestore(Stores.ROS2_JAZZY))
            for c in reader.connections}
        for connection, time, data in reader.messages():
            writer.write(topics[connection.topic], time, data)
    assert simulate(*arguments, '--torques', 'old', '--out', 'AGAIN.csv') == 0
    assert Path('AGAIN.csv').read_bytes() == Path('OUT.csv').read_bytes()
    shutil.rmtree('old')


def test_a_held_torque_of_a_bag_changes_in_the_tick_in_which_it_did():
    simulation = Simulation('symmetric_ode', 1e-3)
    torques = [(float(n), -1.0, -2.0) for n in range(50)]
    with TickBag('drive', simulation.mechanism, 1e3) as bag:
        bag.start(simulation.snapshot())
        for torque in torques:
            bag.tick(torque, simulation.step(torque))
    drive = read_drive('drive', simulation.mechanism, 1.0)
    assert list(drive.table.held(drive.dt)) == torques
    assert all(after > before for before, after in pairwise(drive.table.times))
