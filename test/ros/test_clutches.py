# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Forces on the clutches over topics: in, out, refused, stale, and closed by a controller."""

import math

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from reports import told
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64, Int8
from std_srvs.srv import SetBool, Trigger

from dm_ros import Simulation, VARIANTS
from dm_ros.mechanism.clutched import full_friction
from dm_ros.mechanism.variants import variant_named
from dm_ros.ros.recorder import Recorder

NAMES = ('carrier', 'front', 'rear', 'front_clutch', 'rear_clutch')
CLUTCHES = NAMES[3:]
TORQUES, JOINTS = '/differential/torques', '/differential/joint_states'
LAG = 'lsd.clutch.rear.actuator_time_constant'
SLIPPERY = {f'lsd.clutch.{clutch}.{name}': value for clutch in ('front', 'rear')
            for name, value in (('preload', 0.0), ('friction_coefficient', 0.05))}
HEAVY = {'lsd.inertia.front': 1.0, 'lsd.inertia.rear': 1.0}


def demand(efforts, names=NAMES):
    return JointState(name=list(names), effort=[float(effort) for effort in efforts])


def load(n):
    """Return torques and forces that lock, slip and reverse."""
    return (300.0 - n % 400, -100.0 + n % 37, -150.0 + n % 91), (20.0 * (n % 50), 7.0 * (n % 3))


def force(node):
    """Return the forces in force in a node."""
    return node.simulation.snapshot().clutch_force


# Out


@pytest.mark.parametrize('variant', ['lsd_ode', 'lsd_dae', 'lsd_lagged'])
def test_a_tick_in_lockstep_is_that_of_the_library_with_slip_and_force_on_clutches(ros, variant):
    ros.differential(variant, mode='lockstep', rate=500.0, **{LAG.replace('.', '__'): 0.01})
    joints = ros.listen(JointState, JOINTS)
    clutches = ros.listen(JointState, '/differential/clutches')
    moments = ros.listen(JointState, '/differential/internal_moments')
    publisher = ros.publisher(JointState, TORQUES)
    simulation = Simulation(variant, 1 / 500.0, {LAG: 0.01})
    for n in range(1, 61):
        torques, forces = load(n)
        publisher.publish(demand((*torques, *forces)))
        ros.until(lambda n=n: len(joints) == len(clutches) == len(moments) == n)
        snapshot = simulation.step(torques, forces)
        assert tuple(joints[-1].velocity) == snapshot.velocity
        assert tuple(moments[-1].effort) == snapshot.moment
        message = clutches[-1]
        assert tuple(message.name) == CLUTCHES
        assert tuple(message.effort) == snapshot.clutch_force
        for slips, values in ((message.position, snapshot.position),
                              (message.velocity, snapshot.velocity)):
            carrier, front, rear, _ = values
            assert tuple(slips) == (front - carrier, rear - carrier)
        assert message.header.stamp == joints[-1].header.stamp == moments[-1].header.stamp
    assert any(clutches[-1].velocity)


PLATES = {f'symmetric.clutch.{side}.{name}': value for side in ('left', 'right')
          for name, value in (('friction_surfaces', 4), ('friction_coefficient', 0.1),
                              ('preload', 80.0))}


def test_an_axle_with_plates_takes_forces_and_reports_its_clutches(ros):
    ros.differential('symmetric_dae', mode='lockstep', rate=500.0, **{
        name.replace('.', '__'): value for name, value in PLATES.items()})
    moments = ros.listen(JointState, '/differential/internal_moments')
    clutches = ros.listen(JointState, '/differential/clutches')
    publisher = ros.publisher(JointState, TORQUES)
    simulation = Simulation('symmetric_dae', 1 / 500.0, PLATES)
    for n in range(1, 31):
        (_, left, right), forces = load(n)
        publisher.publish(demand((90.0, left, right, *forces), (
            'pinion', 'left', 'right', 'left_clutch', 'right_clutch')))
        ros.until(lambda n=n: len(clutches) == len(moments) == n)
        snapshot = simulation.step((90.0, left, right), forces)
        assert tuple(moments[-1].effort) == snapshot.moment
        assert tuple(clutches[-1].effort) == snapshot.clutch_force
    assert list(moments[-1].name)[3:] == list(clutches[-1].name) == ['left_clutch', 'right_clutch']
    assert any(snapshot.moment[3:])


def test_an_axle_without_plates_gets_none_while_it_runs(ros):
    ros.differential('symmetric_ode')
    response = ros.call(SetParameters, '/differential/set_parameters', parameters=[
        Parameter('symmetric.clutch.left.friction_surfaces', value=2).to_parameter_msg()])
    result, = response.results
    assert not result.successful and 'at the start' in result.reason


def test_the_moment_of_a_clutch_follows_its_force_in_the_same_tick(ros):
    ros.differential('lsd_ode', mode='lockstep', rate=1000.0, initial_velocity__front=30.0, **{
        f'lsd__inertia__{shaft}': 10.0 for shaft in ('carrier', 'front', 'rear')})
    moments = ros.listen(JointState, '/differential/internal_moments')
    publisher = ros.publisher(JointState, TORQUES)
    publisher.publish(demand((0.0, 0.0), CLUTCHES))
    publisher.publish(demand((0.0, 5e3), CLUTCHES))
    ros.until(lambda: len(moments) == 2)
    p = Simulation('lsd_ode').parameters
    phi = full_friction(p)[0][1]
    # what does not follow the moment of the mesh: at full slip of preload and force, n_F mu R_F A
    before, after = (abs(message.effort[3]) - phi * abs(message.effort[1]) for message in moments)
    full = p.f[1] * 5e3 * p.R_2
    assert full > 100.0
    assert after - before == pytest.approx(full, rel=1e-6)


@pytest.mark.parametrize('variant', VARIANTS)
def test_the_outputs_of_a_tick_come_in_their_order_and_clutches_only_where_there_are_any(
        ros, variant):
    node, heard = ros.differential(variant, mode='lockstep'), []

    class Heard:
        def __init__(self, publisher):
            self.publisher = publisher

        def publish(self, message):
            heard.append(self.publisher.topic_name)
            self.publisher.publish(message)

    kinds = ['joint_states', 'internal_moments', 'clutches', 'power_flow_stamped', 'power_flow']
    if not variant_named(variant).mechanism.clutches:
        kinds.remove('clutches')
    with node.control.lock:
        node.outputs.of_a_tick[:] = [
            (Heard(publisher), message) for publisher, message in node.outputs.of_a_tick]
    flow = ros.listen(Int8, '/differential/power_flow')
    publisher = ros.publisher(JointState, TORQUES)
    for _ in range(3):
        publisher.publish(JointState())
    ros.until(lambda: len(flow) == 3)
    assert heard == [f'/differential/{kind}' for kind in kinds] * 3
    topics = {name for name, _ in node.get_topic_names_and_types()}
    assert ('/differential/clutches' in topics) == bool(node.simulation.clutches)


def test_clutch_topics_are_there_in_real_time_alone_and_where_there_are_clutches(ros):
    for parameters, wanted in (
            ({'variant': 'lsd_ode'}, {'/a/clutch/front', '/a/clutch/rear'}),
            ({'variant': 'lsd_ode', 'mode': 'lockstep'}, set()),
            ({'variant': 'symmetric_ode'}, set())):
        node = ros.differential(arguments=['--ros-args', '-r', '__node:=a'], **parameters)
        assert {s.topic_name for s in node.subscriptions if '/clutch' in s.topic_name} == wanted


# In


def test_each_clutch_has_its_own_topic_and_shares_the_grouped_one_with_the_shafts(ros):
    node = ros.differential('lsd_ode', torque_timeout=0.0)
    clutches = ros.listen(JointState, '/differential/clutches')
    for value, clutch in enumerate(('front', 'rear'), start=1):
        ros.publisher(Float64, f'/differential/clutch/{clutch}').publish(
            Float64(data=float(value)))
    ros.until(lambda: clutches and list(clutches[-1].effort) == [1.0, 2.0])
    assert node.simulation.snapshot().torque == (0.0, 0.0, 0.0)
    ros.publisher(JointState, TORQUES).publish(demand((30.0, 5.0), ('rear_clutch', 'front')))
    ros.until(lambda: list(clutches[-1].effort) == [1.0, 30.0])
    assert node.simulation.snapshot().torque == (0.0, 5.0, 0.0)


@pytest.mark.parametrize('value', [-1.0, -math.inf, math.inf, math.nan])
def test_on_the_topic_of_a_clutch_what_is_no_force_is_refused_and_named(ros, value):
    node = ros.differential('lsd_ode', torque_timeout=0.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(Float64, '/differential/clutch/front')
    publisher.publish(Float64(data=2.0))
    ros.until(lambda: force(node) == (2.0, 0.0))
    publisher.publish(Float64(data=value))
    ros.until(lambda: told(diagnostics)[2].get('refused messages') == '1')
    level, message, values = told(diagnostics)
    assert level == DiagnosticStatus.WARN and 'refused' in message
    assert values['last refused'].startswith(
        f'~/clutch/front: the force on front_clutch is {value}')
    assert force(node) == (2.0, 0.0)


@pytest.mark.parametrize('value', [-1.0, -math.inf, math.inf])
def test_a_grouped_message_with_a_force_that_must_not_be_is_refused_whole(ros, value):
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    publisher.publish(demand((1.0, 2.0, 3.0, 4.0, value)))
    publisher.publish(demand((7.0,), ('front_clutch',)))
    ros.until(lambda: joints)
    assert list(joints[0].effort) == [0.0] * 4
    assert force(node) == (7.0, 0.0)
    assert node.simulation.ticks == 1


def test_a_force_beyond_the_limit_of_its_actuator_is_clamped_and_told(ros):
    node = ros.differential('lsd_ode', torque_timeout=0.0,
                            lsd__clutch__rear__actuator_limit=50.0)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.publisher(Float64, '/differential/clutch/rear').publish(Float64(data=1e308))
    ros.until(lambda: force(node) == (0.0, 50.0))
    ros.until(lambda: told(diagnostics)[2].get('clamped messages') == '1')
    ros.until(lambda: told(diagnostics)[2]['force on rear_clutch [N]'] == '50')


def test_a_force_that_stops_coming_opens_the_clutch_and_one_that_comes_back_closes_it(
        ros, steady):
    node = ros.differential('lsd_ode', rate=200.0, torque_timeout=0.2,
                            lsd__clutch__front__actuator_time_constant=0.05)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(Float64, '/differential/clutch/front')

    def force_after_ticks(count):
        for _ in range(count):
            steady.tick(node)
        return force(node)[0]

    rise = -math.expm1(-0.005 / 0.05)
    publisher.publish(Float64(data=100.0))
    ros.until(lambda: force_after_ticks(1) > 0.0)
    assert force(node)[0] == pytest.approx(100.0 * rise)
    assert force_after_ticks(9) == pytest.approx(100.0 * (1.0 - math.exp(-1.0)))   # 63.2 %
    last = force_after_ticks(31)
    assert last > 98.0
    assert force_after_ticks(1) == pytest.approx(last * (1.0 - rise))
    ros.until(lambda: told(diagnostics)[2].get('stale') == 'front_clutch')
    level, message, _ = told(diagnostics)
    assert level == DiagnosticStatus.WARN and 'too old' in message
    publisher.publish(Float64(data=100.0))
    low = force(node)[0]
    ros.until(lambda: force_after_ticks(1) > low)
    ros.until(lambda: told(diagnostics)[:2] == (DiagnosticStatus.OK, 'no torque yet'))


def test_a_clutch_that_was_never_commanded_is_told_and_is_no_complaint(ros):
    ros.differential('lsd_ode')
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    publisher = ros.publisher(JointState, TORQUES)
    ros.until(lambda: told(diagnostics)[2].get('without any force yet')
              == 'front_clutch, rear_clutch')
    publisher.publish(demand((1.0, 2.0, 3.0, 4.0), NAMES[:4]))
    ros.until(lambda: told(diagnostics)[2]['without any force yet'] == 'rear_clutch')
    assert told(diagnostics)[2]['without any torque yet'] == 'none'


def test_a_reset_opens_the_clutches_and_publishes_it(ros):
    node = ros.differential('lsd_ode', mode='lockstep', **{LAG.replace('.', '__'): 1.0})
    clutches = ros.listen(JointState, '/differential/clutches')
    publisher = ros.publisher(JointState, TORQUES)
    publisher.publish(demand((1.0, 2.0, 3.0, 4.0, 5.0)))
    ros.until(lambda: len(clutches) == 1)
    assert all(clutches[0].effort)
    assert ros.call(Trigger, '/differential/reset').success
    ros.until(lambda: len(clutches) == 2)
    assert not any((*clutches[1].effort, *clutches[1].position, *clutches[1].velocity))
    publisher.publish(JointState())
    ros.until(lambda: len(clutches) == 3)
    assert list(clutches[2].effort) == [0.0, 0.0] == list(force(node))


def test_a_step_while_paused_takes_the_force_that_came(ros):
    node = ros.differential('lsd_ode')
    clutches = ros.listen(JointState, '/differential/clutches')
    publisher = ros.publisher(Float64, '/differential/clutch/rear')
    ros.call(SetBool, '/differential/pause', data=True)
    publisher.publish(Float64(data=9.0))

    def stepped():
        assert ros.call(Trigger, '/differential/step').success
        return force(node) == (0.0, 9.0)
    ros.until(stepped)
    ros.until(lambda: list(clutches[-1].effort) == [0.0, 9.0])


# NaN on the grouped topic


def test_in_lockstep_a_message_whose_values_are_all_nan_is_one_tick_with_what_is_held(ros):
    node = ros.differential('lsd_ode', mode='lockstep')
    joints = ros.listen(JointState, JOINTS)
    publisher = ros.publisher(JointState, TORQUES)
    publisher.publish(demand((1.0, 2.0, 3.0, 4.0, 5.0)))
    publisher.publish(demand([math.nan] * 5))
    publisher.publish(demand((math.nan, 6.0, math.nan, 7.0, math.nan)))
    ros.until(lambda: len(joints) == 3)
    assert [list(message.effort) for message in joints] == [
        [1.0, 2.0, 3.0, 0.0], [1.0, 2.0, 3.0, 0.0], [1.0, 6.0, 3.0, 0.0]]
    assert force(node) == (7.0, 5.0)
    assert (node.simulation.ticks, node.plant.inputs.refused) == (3, 0)


def test_in_real_time_where_nan_comes_what_was_commanded_grows_stale(ros, steady):
    node = ros.differential('lsd_ode', rate=200.0, torque_timeout=0.1)
    publisher = ros.publisher(JointState, TORQUES)

    def held():
        steady.tick(node)
        snapshot = node.simulation.snapshot()
        return (*snapshot.torque, *snapshot.clutch_force)

    def heard(message):
        """Send a message; return what is in force in the tick that it came in."""
        received = node.plant.inputs.received
        publisher.publish(message)
        while True:
            result = held()
            if node.plant.inputs.received > received:
                return result

    assert heard(demand((1.0, 2.0, 3.0, 4.0, 5.0))) == (1.0, 2.0, 3.0, 4.0, 5.0)
    arrived = node.simulation.ticks
    while node.simulation.ticks < arrived + 20:
        assert heard(demand((math.nan, 6.0, math.nan, math.nan, 7.0)))[0] in (1.0, 0.0)
    heard(demand((math.nan, 6.0, math.nan, math.nan, 7.0)))
    assert held() == (0.0, 6.0, 0.0, 0.0, 7.0)
    assert node.plant.inputs.refused == 0


# A controller


class SlipController(Node):
    """Closes both clutches by the slip of the axles, and lets one wheel have no grip."""

    def __init__(self, context):
        super().__init__('slip_controller', context=context)
        self.sent = []
        self.torques = self.create_publisher(JointState, TORQUES, 100)
        self.create_subscription(JointState, JOINTS, self.answer, 100)

    def answer(self, joints):
        _, front, rear, _ = joints.velocity
        closed = 1500.0 * max(0.0, abs(front - rear) - 0.5)
        rear_load = -150.0 if len(self.sent) < 100 else -20.0
        self.sent.append((300.0, -100.0, rear_load, closed, 0.5 * closed))
        self.torques.publish(JointState(
            header=joints.header, name=list(NAMES), effort=self.sent[-1]))


@pytest.mark.parametrize('lag', [0.0, 0.02])
def test_a_controller_that_closes_the_clutches_by_slip_is_the_library_to_the_last_bit_each_time(
        differential, lag):
    parameters, runs = {**SLIPPERY, **HEAVY, LAG: lag}, []
    for _ in range(2):
        vehicle = differential('lsd_ode', parameters=parameters)
        controller = vehicle.attach(SlipController(vehicle.context))
        runs.append((vehicle.run(seconds=0.4), controller.sent[:400]))
    (first, sent), (again, sent_again) = runs
    assert sent == sent_again and max(force for *_, force in sent) > 10.0
    simulation = Simulation('lsd_ode', 1e-3, parameters)
    snapshots = [simulation.step(demanded[:3], demanded[3:]) for demanded in sent]
    library = type(first).of(simulation, snapshots)
    for name, values in first.columns.items():
        assert len(values) == 400
        assert (values == again.columns[name]).all(), name
        assert (values == library.columns[name]).all(), name
    assert (first.clutch_force['rear'] > 0.0).any()


# A record


def test_what_is_recorded_over_topics_has_the_forces_of_each_tick(ros):
    node = ros.differential('lsd_ode', mode='lockstep', rate=100.0)
    simulation = Simulation('lsd_ode', 0.01)
    with Recorder('/differential', variant_named('lsd_ode').mechanism) as recorder:
        publisher = ros.publisher(JointState, TORQUES, depth=100)
        stamped = [output for output, message in node.outputs.of_a_tick
                   if isinstance(message, JointState)]
        ros.until(lambda: all(output.get_subscription_count() for output in stamped))
        for n in range(50):
            torques, forces = load(n)
            publisher.publish(demand((*torques, *forces)))
            simulation.step(torques, forces)
        rows = []

        def whole():
            recorder.poll()
            rows[:] = recorder._rows()
            return len(rows) == 50
        ros.until(whole)
        record = recorder.record(1.0, 'forces')
    assert list(record.clutch_force) == ['front', 'rear']
    for n in range(50):
        _, forces = load(n)
        assert tuple(values[n] for values in record.clutch_force.values()) == forces
    assert record.velocity['rear'][-1] == simulation.snapshot().velocity[2]
