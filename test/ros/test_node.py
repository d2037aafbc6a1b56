# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The node ``differential`` over real topics, in a domain of its own."""

from array import array
import math
from pathlib import Path
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.msg import ParameterType
from rcl_interfaces.srv import (
    DescribeParameters,
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
import rclpy
from rclpy.parameter import (
    get_parameter_value,
    Parameter,
    parameter_dict_from_yaml_file,
    parameter_value_to_python,
)
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int8
from std_srvs.srv import SetBool, Trigger
import yaml

from dm_ros import Simulation, VARIANTS
from dm_ros.files.urdf import urdf
from dm_ros.mechanism.parameters import SelfLockingParameters, SymmetricParameters
from dm_ros.settings import NodeParameters

CONFIG = Path(__file__).parents[2] / 'config'


def as_messages(**parameters):
    return [Parameter(name.replace('__', '.'), value=value).to_parameter_msg()
            for name, value in parameters.items()]


def keys(diagnostics, which):
    """Return the values of the newest status whose name ends so, and its message."""
    status = [s for s in diagnostics[-1].status if s.name.endswith(which)][0]
    return {pair.key: pair.value for pair in status.values}, status.message


@pytest.mark.parametrize('variant', VARIANTS)
def test_a_tick_publishes_all_shafts_and_moments_by_name_with_one_stamp(ros, variant):
    node = ros.differential(variant)
    joints = ros.listen(JointState, '/differential/joint_states')
    moments = ros.listen(JointState, '/differential/internal_moments')
    flow = ros.listen(Int8, '/differential/power_flow')
    stamped = ros.listen(JointState, '/differential/power_flow_stamped')
    ros.until(lambda: min(map(len, (joints, moments, flow, stamped))) > 5)
    names = Simulation(variant)
    assert tuple(joints[-1].name) == names.shafts
    assert tuple(moments[-1].name) == names.moments
    assert len(joints[-1].position) == len(joints[-1].velocity) == len(joints[-1].effort) \
        == len(names.shafts)
    assert len(moments[-1].effort) == len(names.moments)
    assert flow[-1].data == 1
    assert (list(stamped[-1].name), list(stamped[-1].position)) == (['power_flow'], [1.0])
    stamps = {(m.header.stamp.sec, m.header.stamp.nanosec) for m in joints}
    assert len(stamps) == len(joints)
    for other in (moments, stamped):
        assert stamps & {(m.header.stamp.sec, m.header.stamp.nanosec) for m in other}
    assert node.get_name() == 'differential'


def test_a_constant_torque_gives_the_acceleration_of_the_equations(ros, steady):
    node = ros.differential(torque_timeout=0.0, loss_law='paper')
    joints = ros.listen(JointState, '/differential/joint_states')
    ros.publisher(JointState, '/differential/torques').publish(
        JointState(name=['pinion', 'left', 'right'], effort=[10.0, -15.0, -15.0]))

    def loaded():
        return [m for m in joints if m.effort[3] == 10.0]
    while len(loaded()) <= 10:
        steady.tick(node, joints)
    loaded = loaded()
    assert list(loaded[0].effort) == [0.0, -15.0, -15.0, 10.0, 0.0]
    # (18)-(20) at rest with equal wheels: (I_1Sigma + I_2Sigma) e = T_Sigma
    eta_0 = 0.975 * 0.995
    inertia = 0.1 / 0.975 + 2 * 1.8e-4 / (eta_0 * 0.99) + 1.56e-4 * 3.517**2 * 0.995
    torque = 10.0 * 3.517 * 0.995 - 30.0 / (eta_0 * 0.99)
    tick = 1 / 200
    assert loaded[0].velocity[1] == pytest.approx(torque / inertia * tick, rel=1e-3)
    assert loaded[0].velocity[1] == pytest.approx(loaded[0].velocity[2], rel=1e-12)
    # and exactly what the library gives
    simulation = Simulation('symmetric_ode', tick, loss_law='paper')
    for message in loaded:
        assert message.velocity == array('d', simulation.step((10.0, -15.0, -15.0)).velocity)


def test_each_shaft_has_its_own_topic(ros):
    node = ros.differential('lsd_ode', torque_timeout=0.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    for value, shaft in enumerate(('carrier', 'front', 'rear'), start=1):
        ros.publisher(Float64, f'/differential/torque/{shaft}').publish(
            Float64(data=float(value)))
    ros.until(lambda: joints and list(joints[-1].effort) == [1.0, 2.0, 3.0, 0.0])
    assert node.simulation.snapshot().torque == (1.0, 2.0, 3.0)


def test_two_controllers_share_the_torques_topic_within_a_tick(ros):
    ros.differential(torque_timeout=0.0, rate=5.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    one = ros.publisher(JointState, '/differential/torques')
    other = ros.publisher(JointState, '/differential/torques')
    one.publish(JointState(name=['pinion'], effort=[1.0]))
    other.publish(JointState(name=['left', 'right'], effort=[2.0, 3.0]))
    ros.until(lambda: joints and list(joints[-1].effort) == [0.0, 2.0, 3.0, 1.0, 0.0])


@pytest.mark.parametrize('names, efforts, why', [
    (['pinion', 'left'], [5.0, math.inf], 'inf'),
    (['pinion', 'left'], [5.0, -math.inf], 'inf'),
    (['pinion', 'wheel'], [5.0, 5.0], 'wheel'),
    (['pinion', 'pinion'], [5.0, 5.0], 'twice'),
    (['pinion', 'left'], [5.0], '2 names'),
    (['pinion'], [], '0 efforts'),
])
def test_a_bad_message_is_refused_whole_and_the_node_goes_on(ros, names, efforts, why):
    node = ros.differential(torque_timeout=0.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    torques = ros.publisher(JointState, '/differential/torques')
    torques.publish(JointState(name=['pinion', 'left'], effort=[1.0, 2.0]))
    ros.until(lambda: joints and joints[-1].effort[3] == 1.0)
    torques.publish(JointState(name=names, effort=efforts))
    ros.until(lambda: diagnostics and keys(diagnostics, 'torques')[0]['refused messages'] == '1')
    values, message = keys(diagnostics, 'torques')
    assert why in values['last refused']
    assert 'refused' in message
    ticks = node.simulation.ticks
    ros.until(lambda: node.simulation.ticks > ticks + 3)
    assert node.simulation.snapshot().torque == (1.0, 2.0, 0.0)


def test_a_torque_beyond_the_limit_is_clamped_and_counted(ros):
    ros.differential(torque_timeout=0.0, torque_limit=20.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.publisher(Float64, '/differential/torque/left').publish(Float64(data=-1e308))
    ros.until(lambda: joints and joints[-1].effort[1] == -20.0)
    ros.until(lambda: diagnostics and keys(diagnostics, 'torques')[0]['clamped messages'] == '1')


def test_a_torque_that_is_not_renewed_becomes_zero(ros, steady):
    node = ros.differential(torque_timeout=0.1, rate=100.0)
    joints = ros.listen(JointState, '/differential/joint_states')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.publisher(Float64, '/differential/torque/left').publish(Float64(data=1.0))

    def zero_again():
        steady.tick(node, joints)
        return any(m.effort[1] for m in joints) and joints[-1].effort[1] == 0.0
    ros.until(zero_again)
    # the tick it came in and ten more
    assert sum(m.effort[1] == 1.0 for m in joints) == 11
    ros.until(lambda: diagnostics and keys(diagnostics, 'torques')[0]['stale'] == 'left')


@pytest.mark.parametrize('variant, table', [
    ('symmetric_dae', SymmetricParameters), ('lsd_lagged', SelfLockingParameters)])
def test_every_parameter_has_its_default_a_description_a_unit_and_a_range(
        ros, variant, table):
    ros.differential(variant)
    rows = {**dict(table.rows().values()), **dict(NodeParameters.rows().values())}
    listed = ros.call(ListParameters, '/differential/list_parameters').result.names
    mine = [name for name in rows if name in listed]
    assert set(dict(table.rows().values())) <= set(mine)
    assert {'initial_velocity.' + shaft for shaft in Simulation(variant).outputs} <= set(mine)
    described = ros.call(DescribeParameters, '/differential/describe_parameters', names=mine)
    values = ros.call(GetParameters, '/differential/get_parameters', names=mine)
    defaults = {**table().named(), **NodeParameters(variant=variant).named()}
    for name, d, value in zip(mine, described.descriptors, values.values, strict=True):
        entry = rows[name]
        assert d.description.startswith(entry.description)
        assert entry.unit in ('', '1') or entry.unit in d.description
        assert d.read_only == entry.read_only
        if entry.kind is float:
            assert value.double_value == defaults[name]
            assert (d.floating_point_range[0].from_value, d.floating_point_range[0].to_value) \
                == (entry.low, entry.high)
        elif entry.kind is int:
            assert value.integer_value == defaults[name]
            assert (d.integer_range[0].from_value, d.integer_range[0].to_value) \
                == (entry.low, entry.high)


@pytest.mark.parametrize('service', ['set_parameters', 'set_parameters_atomically'])
@pytest.mark.parametrize('bad, why', [
    ({'lsd.efficiency.rear_mesh': 1.5}, 'lsd.efficiency.rear_mesh'),
    ({'lsd.inertia.carrier': 0.0}, 'lsd.inertia.carrier'),
    ({'lsd.clutch.rear.friction_coefficient': 0.5}, 'locks itself'),
    ({'lsd.inertia.wheel': 1.0}, 'lsd.inertia.wheel'),
    ({'rate': 100.0}, 'rate'),
    ({'lsd.inertia.front': 1}, 'lsd.inertia.front'),
])
def test_a_request_with_one_impossible_parameter_changes_nothing(ros, service, bad, why):
    node = ros.differential('lsd_ode')
    before = node.simulation.parameters
    kind = SetParameters if service == 'set_parameters' else SetParametersAtomically
    response = ros.call(kind, f'/differential/{service}', parameters=as_messages(
        lsd__clutch__rear__preload=50.0, substeps=3, **bad))
    results = response.results if service == 'set_parameters' else [response.result]
    assert not any(result.successful for result in results)
    assert all(why in result.reason for result in results)
    values = ros.call(GetParameters, '/differential/get_parameters',
                      names=['lsd.clutch.rear.preload', 'substeps']).values
    assert (values[0].double_value, values[1].integer_value) == (100.0, 1)
    assert node.simulation.parameters == before
    assert node.simulation.substeps == 1


def dump_and_load(ros, path):
    """Write a file as ``ros2 param dump`` does; return what ``ros2 param load`` makes of it."""
    names = ros.call(ListParameters, '/differential/list_parameters').result.names
    values = ros.call(GetParameters, '/differential/get_parameters', names=names).values
    tree = {}
    for name, value in zip(names, values, strict=True):
        *groups, leaf = name.split('.')
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        branch[leaf] = parameter_value_to_python(value)
    path.write_text(yaml.dump({'/differential': {'ros__parameters': tree}}))
    return list(parameter_dict_from_yaml_file(str(path)).values())


@pytest.mark.parametrize('service', ['set_parameters', 'set_parameters_atomically'])
@pytest.mark.parametrize('variant, more', [
    ('symmetric_ode', {}), ('lsd_ode', {'port__rear__kind': 'speed'}),
    ('symmetric_dae', {'use_sim_time': True})])
def test_loading_its_own_dump_succeeds_and_changes_nothing(ros, tmp_path, service, variant, more):
    node = ros.differential(variant, **more)
    before = node.plant.values
    loaded = dump_and_load(ros, tmp_path / 'dump.yaml')
    kind = SetParameters if service == 'set_parameters' else SetParametersAtomically
    response = ros.call(kind, f'/differential/{service}', parameters=loaded)
    results = response.results if service == 'set_parameters' else [response.result]
    assert {result.reason for result in results} == {''}
    assert all(result.successful for result in results)
    assert len(results) == (len(loaded) if service == 'set_parameters' else 1)
    assert node.plant.values == before


@pytest.mark.parametrize('service', ['set_parameters', 'set_parameters_atomically'])
@pytest.mark.parametrize('same, other', [
    ({'rate': 200.0}, {'rate': 100.0}), ({'variant': 'lsd_ode'}, {'variant': 'lsd_dae'}),
    ({'energy_audit': True}, {'energy_audit': False}),
    ({'realtime_priority': 0}, {'realtime_priority': False}),
    ({'start_type_description_service': True}, {'start_type_description_service': False})])
def test_a_read_only_parameter_may_be_set_to_the_value_it_has_alone_or_in_a_set(
        ros, service, same, other):
    node = ros.differential('lsd_ode')
    kind = SetParameters if service == 'set_parameters' else SetParametersAtomically

    def succeeds(**parameters):
        response = ros.call(kind, f'/differential/{service}', parameters=as_messages(**parameters))
        results = response.results if service == 'set_parameters' else [response.result]
        succeeded, = {result.successful for result in results}
        return succeeded
    assert succeeds(**same)
    assert succeeds(substeps=2, **same) and node.simulation.substeps == 2
    assert not succeeds(substeps=3, **other) and node.simulation.substeps == 2
    assert not succeeds(**other)


def test_a_number_with_an_exponent_of_which_ros2_param_makes_a_string_is_a_double(ros):
    node = ros.differential()

    def succeeds(text):
        value = get_parameter_value(text)
        result, = ros.call(SetParameters, '/differential/set_parameters', parameters=[
            ParameterMessage(name='symmetric.inertia.satellite', value=value)]).results
        return result.successful
    assert get_parameter_value('5e-05').type == ParameterType.PARAMETER_STRING
    assert succeeds('5e-05') and node.simulation.parameters.I_s == 5e-5
    assert not succeeds('1e300') and not succeeds('5') and not succeeds('five')
    assert node.simulation.parameters.I_s == 5e-5


def test_parameters_that_are_only_possible_together_are_taken_together(ros):
    node = ros.differential('lsd_ode')
    response = ros.call(
        SetParameters, '/differential/set_parameters', parameters=as_messages(
            lsd__clutch__rear__friction_coefficient=0.5, lsd__pressure_angle=0.1, substeps=2))
    assert [result.successful for result in response.results] == [True] * 3
    assert (node.simulation.parameters.mu_2, node.simulation.parameters.alpha) == (0.5, 0.1)
    assert node.simulation.substeps == 2


def test_a_change_of_parameters_while_turning_moves_no_shaft(ros):
    node = ros.differential('lsd_dae', torque_timeout=0.0, initial_velocity__front=50.0,
                            initial_velocity__rear=40.0)
    ros.call(SetBool, '/differential/pause', data=True)
    before = node.simulation.snapshot()
    ros.call(SetParameters, '/differential/set_parameters', parameters=as_messages(
        lsd__crown_radius__rear=0.07, lsd__clutch__rear__radius=0.07))
    after = node.simulation.snapshot()
    assert after.velocity[1:3] == pytest.approx(before.velocity[1:3], rel=1e-14)
    assert after.position == before.position
    assert node.simulation.parameters.g_12 == pytest.approx(0.07 / 0.04)


def test_pause_stops_time_and_step_gives_one_tick(ros, steady, monkeypatch):
    node = ros.differential(torque_timeout=0.0)
    running, waits = node.control.running, []   # what the paused loop waits for, and how often
    wait = running.wait
    monkeypatch.setattr(running, 'wait', lambda timeout: waits.append(timeout) or wait(timeout))
    steady.tick(node)
    assert not ros.call(Trigger, '/differential/step').success
    assert ros.call(SetBool, '/differential/pause', data=True).success
    assert node.simulation.ticks == 1
    ros.publisher(Float64, '/differential/torque/left').publish(Float64(data=1.0))
    steps = 0

    def step():
        nonlocal steps
        steps += 1
        assert ros.call(Trigger, '/differential/step').success
        return node.simulation.snapshot().torque == (0.0, 1.0, 0.0)
    ros.until(step)
    steady.leaps(node.simulation.dt)   # wakes the loop, which sees that it is paused
    ros.until(lambda: waits)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: diagnostics and keys(diagnostics, 'loop')[1] == 'paused')
    assert node.simulation.ticks == 1 + steps
    steady.leaps(3600.0)
    ros.call(SetBool, '/differential/pause', data=False)
    ros.until(steady.stands)   # the hour of the pause is not caught up with
    for _ in range(3):
        steady.tick(node)
    assert node.simulation.ticks == 1 + steps + 3
    assert node.pacer.missed == 0


def test_reset_goes_back_to_the_start(ros):
    node = ros.differential(torque_timeout=0.0, initial_velocity__left=3.0)
    ros.publisher(Float64, '/differential/torque/pinion').publish(Float64(data=5.0))
    ros.until(lambda: node.simulation.snapshot().torque == (5.0, 0.0, 0.0))
    ros.call(SetBool, '/differential/pause', data=True)
    assert ros.call(Trigger, '/differential/reset').success
    assert node.simulation.snapshot() == Simulation(
        'symmetric_ode', initial_velocity=(3.0, 0.0)).snapshot()


def test_diagnostics_tell_the_rate_the_lateness_and_the_inputs(ros):
    ros.differential(rate=100.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: diagnostics
              and float(keys(diagnostics, 'loop')[0]['rate held [Hz]']) > 0.0)
    loop, _ = keys(diagnostics, 'loop')
    torques, message = keys(diagnostics, 'torques')
    assert loop['rate wanted [Hz]'] == '100'
    latenesses = [float(loop[f'lateness {which} [us]']) for which in ('p50', 'p99', 'max')]
    assert latenesses == sorted(latenesses)
    assert int(loop['ticks']) > 0
    assert message == 'no torque yet'
    assert torques['without any torque yet'] == 'pinion, left, right'


@pytest.mark.parametrize('variant', ['symmetric_dae', 'lsd_ode'])
def test_diagnostics_tell_that_the_energy_balances(ros, variant):
    node = ros.differential(variant, torque_timeout=0.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    torque = ros.publisher(JointState, '/differential/torques')
    torque.publish(JointState(name=list(node.simulation.inputs), effort=[30.0, -9.0, -11.0]))
    ros.until(lambda: diagnostics and float(
        keys(diagnostics, 'energy')[0]['work of the torques [J]']) > 10.0)
    energy, _ = keys(diagnostics, 'energy')
    assert float(energy['worst balance residual since the last report [relative]']) < 1e-9
    spent = sum(float(energy[key]) for key in (
        'stored [J]', 'lost by drag [J]', 'lost in gears and bearings [J]',
        'lost in clutches [J]'))
    assert spent == pytest.approx(float(energy['work of the torques [J]']), rel=1e-4)


def test_diagnostics_warn_while_gears_and_bearings_give_energy_back(ros):
    ros.differential(
        torque_timeout=0.0, loss_law='paper', initial_velocity__left=20.0,
        initial_velocity__right=20.0, symmetric__inertia__left=1.0, symmetric__inertia__right=1.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.publisher(JointState, '/differential/torques').publish(
        JointState(name=['pinion', 'left', 'right'], effort=[54.4, -100.0, -100.0]))
    ros.until(lambda: diagnostics and 'as motors' in keys(diagnostics, 'energy')[1])
    values, message = keys(diagnostics, 'energy')
    assert message.startswith('gears and bearings give energy back, as motors: ')
    assert message.endswith('loss_law: passive does not')
    status = [status for status in diagnostics[-1].status if status.name.endswith('energy')][0]
    assert status.level == DiagnosticStatus.WARN
    assert float(values['lost in gears and bearings [J]']) < 0.0
    ros.call(SetBool, '/differential/pause', data=True)
    ros.until(lambda: keys(diagnostics, 'energy')[1] == 'fine')


def test_without_the_energy_audit_nothing_is_said_of_energy(ros):
    ros.differential(energy_audit=False)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: diagnostics)
    assert not any(status.name.endswith('energy') for status in diagnostics[-1].status)


def test_several_differentials_live_in_their_namespaces(ros):
    ros.differential(arguments=['--ros-args', '-r', '__ns:=/front_axle'])
    ros.differential('lsd_ode', arguments=['--ros-args', '-r', '__node:=centre'])
    front = ros.listen(JointState, '/front_axle/differential/joint_states')
    centre = ros.listen(JointState, '/centre/joint_states')
    ros.until(lambda: front and centre)
    assert (len(front[0].name), len(centre[0].name)) == (5, 4)


def test_diagnostics_of_several_differentials_are_told_apart_by_their_full_names(ros):
    ros.differential(arguments=['--ros-args', '-r', '__ns:=/car/front'])
    ros.differential('lsd_ode', arguments=['--ros-args', '-r', '__ns:=/car/rear'])
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    names = ['/car/front/differential', '/car/rear/differential']
    parts = ['loop', 'torques', 'connections', 'energy']

    def heard():
        return {(status.hardware_id, status.name)
                for message in diagnostics for status in message.status}
    ros.until(lambda: len(heard()) >= 8)
    assert heard() == {(name, f'{name}: {part}') for name in names for part in parts}


def prefixed(names, prefix='rear_'):
    return [prefix + name for name in names]


@pytest.mark.parametrize('variant, more', [
    ('lsd_ode', {}), ('symmetric_ode', {'symmetric__clutch__left__friction_surfaces': 4}),
    ('lsd_dae', {'port__rear__kind': 'speed'})])
def test_a_joint_prefix_is_before_every_name_that_goes_out(ros, variant, more):
    node = ros.differential(variant, joint_prefix='rear_', **more)
    mechanism = node.simulation.mechanism
    heard = {topic: ros.listen(JointState, f'/differential/{topic}')
             for topic in ('joint_states', 'internal_moments', 'clutches', 'power_flow_stamped')}
    ros.until(lambda: all(heard.values()))
    names = {topic: messages[-1].name for topic, messages in heard.items()}
    frames = {messages[-1].header.frame_id for messages in heard.values()}
    robot = ElementTree.fromstring(urdf(mechanism, mechanism.parameters(), 'rear_'))
    links = {link.get('name') for link in robot.findall('link')}
    root = links - {joint.find('child').get('link') for joint in robot.findall('joint')}
    assert frames == root
    assert names == {'joint_states': prefixed(mechanism.shafts),
                     'internal_moments': prefixed(mechanism.moments),
                     'clutches': prefixed(mechanism.clutch_moments),
                     'power_flow_stamped': ['rear_power_flow']}


@pytest.mark.parametrize('prefix', ['rear_', 'axle2/', 'L.'])
def test_a_joint_prefix_is_before_every_name_that_comes_in_but_in_no_topic(ros, prefix):
    node = ros.differential('lsd_ode', joint_prefix=prefix, torque_timeout=0.0,
                            port__rear__kind='speed', rate=50.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    torques = ros.publisher(JointState, '/differential/torques')

    def publish(names):
        torques.publish(JointState(name=names, effort=[3.0, math.nan, 40.0],
                                   velocity=[math.nan, 0.5, math.nan]))
    names = ['carrier', 'rear', 'rear_clutch']
    publish(names)
    ros.until(lambda: diagnostics and keys(diagnostics, 'torques')[0]['refused messages'] == '1')
    assert keys(diagnostics, 'torques')[0]['last refused'].startswith(
        f"~/torques: 'carrier' is not one of {prefix}carrier, {prefix}front, ")
    publish(prefixed(names, prefix))
    ros.until(lambda: node.plant.inputs.in_force(0) == (3.0, 0.0, 0.5, 0.0, 40.0))
    ros.publisher(Float64, '/differential/torque/front').publish(Float64(data=2.0))
    ros.publisher(Float64, '/differential/clutch/front').publish(Float64(data=7.0))
    ros.until(lambda: node.plant.inputs.in_force(0) == (3.0, 2.0, 0.5, 7.0, 40.0))


def test_in_lockstep_names_have_the_joint_prefix_too(ros):
    node = ros.differential('lsd_ode', mode='lockstep', joint_prefix='rear_')
    joints = ros.listen(JointState, '/differential/joint_states')
    torques = ros.publisher(JointState, '/differential/torques')
    torques.publish(JointState(name=['carrier'], effort=[1.0]))
    torques.publish(JointState(name=['rear_carrier'], effort=[2.0]))
    ros.until(lambda: joints)
    assert (node.plant.inputs.refused, node.simulation.ticks) == (1, 1)
    assert joints[0].effort[joints[0].name.index('rear_carrier')] == 2.0


@pytest.mark.parametrize('name, table', [
    ('symmetric.yaml', SymmetricParameters), ('lsd.yaml', SelfLockingParameters)])
def test_ros_reads_the_default_files_as_the_defaults(ros, name, table):
    node = rclpy.create_node(
        'differential', context=ros.context, automatically_declare_parameters_from_overrides=True,
        cli_args=['--ros-args', '--params-file', str(CONFIG / name)])
    try:
        values = {full_name: node.get_parameter(full_name).value for full_name in table().named()}
    finally:
        node.destroy_node()
    assert values == table().named()
