# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What advances, without ROS: demands, ticks, resets, parameters and conditions of a ``Plant``."""

import math

import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.driven import Condition
from dm_ros.energy import Energy
from dm_ros.mechanism.variants import SYMMETRIC, variant_named
from dm_ros.motion.energy import given_back, Layout
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.plant import Plant

NAMES = {'symmetric': ('pinion', 'left', 'right'), 'lsd': ('carrier', 'front', 'rear')}


class Log:
    """Keeps what is logged."""

    def __init__(self):
        self.lines = []

    def warning(self, line):
        self.lines.append(f'WARN {line}')

    def info(self, line):
        self.lines.append(f'INFO {line}')


@pytest.fixture
def log():
    return Log()


@pytest.fixture
def lockstep(log):
    return Plant({'variant': 'lsd_ode', 'mode': 'lockstep'}, log)


def load(n):
    """Return torques that lock, slip and reverse."""
    return 300.0 - n % 400, -100.0 + n % 37, -150.0 + n % 91


def in_force(plant):
    """Return all that a refused request must not touch."""
    simulation, inputs = plant.simulation, plant.inputs
    return (plant.settings, simulation.parameters, simulation.substeps, simulation.state,
            simulation.ticks, simulation.power_flow_deadband, simulation.initial_velocity,
            inputs.in_force(simulation.ticks), inputs.limits, inputs.timeout, inputs.received)


# Ticks


@pytest.mark.parametrize('variant', VARIANTS)
@pytest.mark.parametrize('audited', [True, False])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_it_moves_as_the_simulation_bit_for_bit(variant, audited, loss_law, log):
    mechanism = variant_named(variant).mechanism.name
    outputs = NAMES[mechanism][1:]
    plant = Plant({
        'variant': variant, 'rate': 500.0, 'energy_audit': audited, 'loss_law': loss_law,
        'substeps': 2, 'power_flow_deadband': 3.0, f'{mechanism}.satellite_ratio': 0.9,
        f'initial_velocity.{outputs[0]}': 5.0, f'initial_velocity.{outputs[1]}': 4.0}, log)
    simulation = Simulation(variant, 1 / 500.0, {f'{mechanism}.satellite_ratio': 0.9},
                            loss_law=loss_law, substeps=2, power_flow_deadband=3.0,
                            initial_velocity=(5.0, 4.0))
    for n in range(300):
        assert plant.take(NAMES[mechanism], load(n), 'test')
        assert tuple(plant.tick()) == tuple(simulation.step(load(n)))
    assert plant.ticks == plant.simulation.ticks == 300
    assert not log.lines


def test_the_losses_follow_the_law_that_is_asked_for(log):
    torques = (10.0, 15.0, -40.0)   # the wheel that drives gets more than it gives under paper
    ends = {}
    for loss_law in LOSS_LAWS:
        plant = Plant({'loss_law': loss_law}, log)
        plant.take(('pinion', 'left', 'right'), torques, 'test')
        for _ in range(50):
            ends[loss_law] = plant.tick()
    assert ends['passive'].velocity != ends['paper'].velocity


def test_an_unknown_law_is_refused_and_named(log):
    with pytest.raises(ValueError, match="loss_law: 'torsen' is not allowed.*passive, paper"):
        Plant({'loss_law': 'torsen'}, log)


def test_a_tick_out_of_range_is_refused_and_counted_and_the_state_stays(log, monkeypatch):
    plant = Plant({'torque_limit': 1e9}, log)
    step = plant.simulation.step

    def bounded(torques, *forces):
        if max(map(abs, torques)) > 1e8:
            raise ValueError('out of the range of floating point numbers')
        return step(torques, *forces)
    monkeypatch.setattr(plant.simulation, 'step', bounded)
    before = plant.tick()
    assert plant.take(('pinion',), (1e9,), 'test')
    assert plant.tick() == before
    assert (plant.ticks, plant.simulation.ticks, plant.out_of_range.count) == (2, 1, 1)


# Demands


def test_in_their_order_stamps_go_up_and_a_zero_stamp_is_none(lockstep, log):
    taken = [lockstep.take(('carrier',), (float(effort),), 'test', stamp)
             for effort, stamp in enumerate((0, 100, 100, 50, -1, 0, 100, 101))]
    assert taken == [True, True, False, False, False, True, False, True]
    assert lockstep.inputs.in_force(0) == (7.0, 0.0, 0.0, 0.0, 0.0)
    assert (lockstep.inputs.received, lockstep.inputs.refused) == (4, 4)
    assert log.lines == [
        'WARN messages are refused: test: its stamp repeats or goes back in time']
    lockstep.reset()
    assert lockstep.take(('carrier',), (1.0,), 'test', 1)


def test_a_stamp_of_a_refused_demand_does_not_count(lockstep):
    assert not lockstep.take(('wheel',), (1.0,), 'test', 100)
    assert lockstep.take(('carrier',), (1.0,), 'test', 50)


@pytest.mark.parametrize('names, values, why', [
    (('front', 'wheel'), (1.0, 1.0), "'wheel' is not one of carrier, front, rear, "
     'front_clutch, rear_clutch'),
    (('front', 'front'), (1.0, 1.0), 'a name comes twice in front, front'),
    (('front', 'rear'), (1.0,), '2 names but 1 values'),
    (('front', 'rear'), (1.0, float('nan')), 'the torque on rear is nan')])
def test_a_refused_demand_leaves_everything_as_it_was(lockstep, names, values, why):
    lockstep.take(('carrier', 'front'), (3.0, 2.0), 'test')
    lockstep.tick()
    before = in_force(lockstep)
    assert not lockstep.take(names, values, 'a test')
    assert in_force(lockstep) == before
    assert lockstep.inputs.refused == lockstep.refusing.count == 1
    assert lockstep.refusing.reason == f'a test: {why}'


def test_a_demand_beyond_the_limit_is_clamped_and_counted(log):
    plant = Plant({'torque_limit': 20.0}, log)
    assert plant.take(('left', 'right'), (-1e308, 5.0), 'test')
    assert plant.tick().torque == (0.0, -20.0, 5.0)
    assert log.lines == ['WARN demands are clamped: test: beyond 20 N m']


def test_a_demand_grows_stale_in_real_time_and_never_in_lockstep(log):
    for mode, torque in (('realtime', 0.0), ('lockstep', 7.0)):
        plant = Plant({'mode': mode, 'rate': 100.0, 'torque_timeout': 0.1}, log)
        plant.take(('left',), (7.0,), 'test')
        for _ in range(11):
            assert plant.tick().torque[1] == 7.0
        assert plant.tick().torque[1] == torque
        plant.notice()
    assert log.lines == ['WARN demands are too old and count as zero: left']


# Forces on the clutches


CLUTCHES = ('front_clutch', 'rear_clutch')
LSD_NAMES = (*NAMES['lsd'], *CLUTCHES)


def lsd(log, **parameters):
    """Return a ``Plant`` whose forces are limited to 900 N at the rear."""
    return Plant({'variant': 'lsd_ode', 'rate': 100.0, 'lsd.clutch.rear.actuator_limit': 900.0,
                  **{name.replace('__', '.'): value for name, value in parameters.items()}}, log)


@pytest.mark.parametrize('variant', ['lsd_ode', 'lsd_dae', 'lsd_lagged'])
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
@pytest.mark.parametrize('audited', [True, False])
def test_with_forces_it_moves_as_the_simulation_bit_for_bit(variant, loss_law, audited, log):
    lag = {'lsd.clutch.front.actuator_time_constant': 0.03}
    plant = Plant({'variant': variant, 'rate': 500.0, 'loss_law': loss_law,
                   'energy_audit': audited, **lag}, log)
    simulation = Simulation(variant, 1 / 500.0, lag, loss_law=loss_law)
    forces = (0.0, 0.0)
    for n in range(300):
        if n % 3 == 0:   # in between they are held; at times they are zero, and the lag goes on
            forces = (float(n % 90) * 10.0, 0.0) if n % 120 < 60 else (0.0, float(n % 7))
            assert plant.take(LSD_NAMES, (*load(n), *forces), 'test')
        else:
            assert plant.take(NAMES['lsd'], load(n), 'test')
        assert tuple(plant.tick()) == tuple(simulation.step(load(n), forces))
    assert not log.lines


def test_a_force_beyond_the_limit_of_its_actuator_is_clamped_and_counted(log):
    plant = lsd(log)
    assert plant.take(('carrier', *CLUTCHES), (300.0, 900.0, 901.0), 'test')
    assert plant.tick().clutch_force == (900.0, 900.0)
    assert log.lines == ['WARN demands are clamped: test: beyond 900 N']
    assert plant.inputs.clamped == plant.clamping.count == 1


def test_the_limit_of_an_actuator_may_change_while_it_runs(log):
    plant = lsd(log)
    plant.take(CLUTCHES, (500.0, 500.0), 'test')
    plant.adopt(plant.prepared({'lsd.clutch.front.actuator_limit': 50.0}))
    assert plant.tick().clutch_force == (50.0, 500.0)   # what is held is within it, too
    assert not log.lines
    plant.take(('front_clutch',), (60.0,), 'test')
    assert plant.tick().clutch_force == (50.0, 500.0)
    assert log.lines == ['WARN demands are clamped: test: beyond 50 N']
    plant.adopt(plant.prepared({'lsd.clutch.front.actuator_limit': 1e6}))
    plant.take(('front_clutch',), (60.0,), 'test')
    assert plant.tick().clutch_force == (60.0, 500.0)


def test_a_stale_force_becomes_zero_and_the_force_follows_with_its_lag(log):
    plant = lsd(log, torque_timeout=0.1, lsd__clutch__rear__actuator_time_constant=0.05)
    plant.take(CLUTCHES, (200.0, 200.0), 'test')
    forces = [plant.tick().clutch_force for _ in range(17)]
    assert [front for front, _ in forces] == [200.0] * 11 + [0.0] * 6
    rise = 1.0 - math.exp(-0.01 / 0.05)
    rear = 0.0
    for n, (_, force) in enumerate(forces):
        rear += ((200.0 if n < 11 else 0.0) - rear) * rise
        assert force == pytest.approx(rear, rel=1e-12)
    plant.notice()
    assert log.lines == ['WARN demands are too old and count as zero: front_clutch, rear_clutch']


def test_a_force_never_grows_stale_in_lockstep(lockstep):
    lockstep.take(CLUTCHES, (200.0, 100.0), 'test')
    for _ in range(500):
        assert lockstep.tick().clutch_force == (200.0, 100.0)


@pytest.mark.parametrize('value', [-5.0, float('inf'), float('-inf')])
def test_a_force_that_must_not_be_is_refused_by_name_and_the_torques_with_it(lockstep, value):
    lockstep.take(LSD_NAMES, (3.0, 2.0, 1.0, 40.0, 50.0), 'test')
    lockstep.tick()
    before = in_force(lockstep)
    assert not lockstep.take(('carrier', 'rear_clutch'), (7.0, value), 'a test', sparse=True)
    assert in_force(lockstep) == before
    assert lockstep.refusing.reason.startswith(f'a test: the force on rear_clutch is {value:g}')


def test_nan_is_no_command_only_where_it_is_said_to_be(lockstep):
    lockstep.take(LSD_NAMES, (3.0, 2.0, 1.0, 40.0, 50.0), 'test')
    nan = float('nan')
    assert lockstep.take(('front', 'rear', *CLUTCHES), (nan, 4.0, 60.0, nan), 'test', sparse=True)
    snapshot = lockstep.tick()
    assert snapshot.torque == (3.0, 2.0, 4.0) and snapshot.clutch_force == (60.0, 50.0)
    assert not lockstep.take(('front_clutch',), (nan,), 'test')
    assert lockstep.refusing.reason == 'test: the force on front_clutch is nan'


def test_a_reset_opens_the_clutches_at_once_whatever_their_lag(log):
    plant = lsd(log, lsd__clutch__front__actuator_time_constant=1.0)
    plant.take(CLUTCHES, (200.0, 100.0), 'test')
    assert all(plant.tick().clutch_force)
    plant.reset()
    assert plant.simulation.snapshot().clutch_force == (0.0, 0.0)
    assert plant.tick().clutch_force == (0.0, 0.0)
    assert plant.inputs.silent() == list(LSD_NAMES)


def test_a_mechanism_without_actuators_knows_no_forces(log):
    plant = Plant({}, log)
    assert not plant.simulation.mechanism.actuators
    assert not plant.take(('left', 'left_clutch'), (1.0, 1.0), 'test')
    assert plant.tick().torque == (0.0, 0.0, 0.0)
    assert plant.refusing.reason == "test: 'left_clutch' is not one of pinion, left, right"


# Reset


@pytest.mark.parametrize('variant', VARIANTS)
def test_after_a_reset_a_run_repeats_bit_for_bit(variant, log):
    plant, names = Plant({'variant': variant}, log), NAMES[variant_named(variant).mechanism.name]

    def run():
        result = []
        for n in range(100):
            assert plant.take(names, load(n), 'test', stamp=n + 1)
            result.append(tuple(plant.tick()))
        return result
    first = run()
    plant.reset()
    assert plant.inputs.silent() == [
        port.name for port in plant.inputs.ports]
    assert plant.simulation.snapshot() == Plant({'variant': variant}, log).simulation.snapshot()
    assert run() == first
    assert plant.ticks == 200


# Parameters


@pytest.mark.parametrize('bad, why', [
    ({'lsd.pressure_angle': 9.0}, r'lsd.pressure_angle: 9.0 is not allowed'),
    ({'lsd.clutch.front.radius': 1e6}, r'lsd.clutch.front'),
    ({'torque_limit': -1.0}, r'torque_limit: -1.0 is not allowed'),
    ({'substeps': 0}, r'substeps: 0 is not allowed'),
    ({'rate': 100.0}, r'rate: it cannot be changed while it runs'),
    ({'loss_law': 'paper'}, r'loss_law: it cannot be changed while it runs'),
    ({'symmetric.inertia.left': 1.0}, r'symmetric.inertia.left: there is no such parameter')])
def test_a_change_with_one_impossible_parameter_changes_nothing(lockstep, bad, why):
    lockstep.take(('carrier',), (3.0,), 'test')
    lockstep.tick()
    before = in_force(lockstep)
    with pytest.raises(ValueError, match=why):
        lockstep.prepared({'lsd.clutch.rear.preload': 50.0, 'torque_limit': 7.0, 'substeps': 3,
                           'initial_velocity.front': 1.0, **bad})
    assert in_force(lockstep) == before


def test_a_change_is_in_force_as_it_is_adopted_and_not_before(log):
    plant = Plant({'variant': 'lsd_ode', 'initial_velocity.front': 50.0,
                   'initial_velocity.rear': 40.0}, log)
    changes = {'lsd.crown_radius.rear': 0.07, 'lsd.clutch.rear.radius': 0.07, 'substeps': 3,
               'torque_limit': 7.0, 'torque_timeout': 0.1, 'power_flow_deadband': 2.0,
               'initial_velocity.rear': 1.0}
    before, values = in_force(plant), plant.values
    prepared = plant.prepared(changes)
    assert in_force(plant) == before and plant.values == values
    snapshot = plant.simulation.snapshot()
    plant.adopt(prepared)
    assert plant.values == {**values, **changes}
    simulation, inputs = plant.simulation, plant.inputs
    assert (simulation.substeps, simulation.power_flow_deadband) == (3, 2.0)
    assert simulation.initial_velocity == (50.0, 1.0)
    assert (inputs.limits[:3], inputs.timeout) == ((7.0,) * 3, 0.1 * 200.0)
    after = simulation.snapshot()
    assert after.position == snapshot.position
    assert after.velocity[1:3] == pytest.approx(snapshot.velocity[1:3], rel=1e-14)


# Conditions


def test_a_condition_is_logged_once_when_it_begins_and_once_when_it_is_over(log):
    condition = Condition('demands are clamped', log)
    for _ in range(3):
        condition.happened('beyond 1 N m')
        condition.settle()
    condition.happened('beyond 2 N m', times=4)
    assert condition.active and condition.reason == 'beyond 2 N m'
    for _ in range(3):
        condition.settle()
    assert not condition.active
    begin = 'WARN demands are clamped: beyond 1 N m'
    assert log.lines == [begin]
    for _ in range(10):
        condition.settle()
    assert log.lines == [begin, 'INFO over: demands are clamped (7 times since it began)']
    condition.happened('beyond 1 N m')
    assert log.lines[2:] == [begin]


def test_a_condition_that_comes_and_goes_is_one_line_in_ten_seconds_with_the_count_of_its_spell(
        log):
    condition = Condition('ticks are missed', log)
    for second in range(300):   # comes and goes for two minutes, then twice more
        if second % 3 == 0 and second < 120 or second in (200, 250):
            condition.happened('2 since the last report', times=2)
        condition.settle()
        assert condition.active == (second % 3 == 0 and second < 120 or second in (200, 250))
    assert log.lines == [
        'WARN ticks are missed: 2 since the last report',
        'INFO over: ticks are missed (80 times since it began)',
        'WARN ticks are missed: 2 since the last report',
        'INFO over: ticks are missed (2 times since it began)',
        'WARN ticks are missed: 2 since the last report',
        'INFO over: ticks are missed (2 times since it began)']
    assert condition.count == 84


def test_what_is_not_over_at_the_end_is_told_once_with_its_count(log):
    condition = Condition('ticks are missed', log)
    condition.end()   # it never began
    assert log.lines == []
    for times in (2, 3):
        condition.happened(f'{times} since the last report', times)
    condition.end()
    condition.end()
    assert log.lines == ['WARN ticks are missed: 2 since the last report',
                         'INFO at the end: ticks are missed (5 times since it began)']


def test_conditions_of_a_plant_begin_and_end_once(log):
    plant = Plant({'rate': 100.0, 'torque_timeout': 0.05}, log)
    for torque in (float('nan'), 1e9, 1.0):
        for _ in range(3):
            plant.take(('left',), (torque,), 'test')
    for _ in range(3):
        for _ in range(10):
            plant.tick()
        plant.notice()
        plant.settle()
    for _ in range(8):
        plant.notice()
        plant.settle()
    assert log.lines == [
        'WARN messages are refused: test: the torque on left is nan',
        'WARN demands are clamped: test: beyond 100000 N m',
        'WARN demands are too old and count as zero: left',
        'INFO over: messages are refused (3 times since it began)',
        'INFO over: demands are clamped (3 times since it began)']
    plant.reset()
    for _ in range(11):
        plant.notice()
        plant.settle()
    assert log.lines[5:] == [
        'INFO over: demands are too old and count as zero (11 times since it began)']


# Gears and bearings that give energy back


def cruise(variant, loss_law, log, seconds=4):
    """Return a ``Plant`` after a governor held 20 rad/s against 100 N m on each wheel."""
    mechanism = variant_named(variant).mechanism.name
    names, outputs = NAMES[mechanism], NAMES[mechanism][1:]
    plant = Plant({'variant': variant, 'rate': 1000.0, 'loss_law': loss_law,
                   'torque_timeout': 0.0,
                   **{f'{mechanism}.inertia.{shaft}': 1.0 for shaft in outputs},
                   **{f'initial_velocity.{shaft}': 20.0 for shaft in outputs}}, log)
    integral, snapshot = 200.0 / (3.517 if mechanism == 'symmetric' else 1.0), None
    for n in range(seconds * 1000):
        error = 20.0 - (snapshot.velocity[0] if snapshot else 20.0)
        integral += 10.0 * error * 0.001
        plant.take(names, (10.0 * error + integral, -100.0, -100.0), 'test')
        snapshot = plant.tick()
        if (n + 1) % 1000 == 0:
            plant.notice()
            plant.settle()
    assert 15.0 < snapshot.velocity[0] < 25.0
    return plant


def test_a_governed_cruise_under_the_law_of_the_paper_warns_until_power_runs_all_one_way(log):
    plant = cruise('symmetric_ode', 'paper', log)
    line, = log.lines
    assert line.startswith('WARN gears and bearings give energy back, as motors: ')
    assert line.endswith(" J since the last report: the paper's law of losses does that where "
                         'power does not run all one way; loss_law: passive does not')
    total = plant.simulation.total
    given = -sum(total.gears + total.bearings)
    assert plant.motoring.active and plant.motoring.count == 4
    assert float(plant.motoring.reason.split()[0]) == pytest.approx(given / 4, rel=0.05)
    plant.take(('pinion',), (80.0,), 'test')   # more than the losses
    for _ in range(11):
        for _ in range(100):
            plant.tick()
        plant.notice()
        plant.settle()
    assert log.lines[1:] == ['INFO over: gears and bearings give energy back, as motors '
                             '(4 times since it began)']


@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_a_governed_cruise_under_the_passive_law_never_warns(variant, log):
    assert cruise(variant, 'passive', log).motoring.count == 0
    assert not log.lines


@pytest.mark.parametrize('variant', VARIANTS)
def test_whatever_the_load_the_passive_law_never_warns(variant, log):
    plant, names = Plant({'variant': variant}, log), NAMES[variant_named(variant).mechanism.name]
    for n in range(500):
        plant.take(names, load(7 * n), 'test')
        plant.tick()
        plant.notice()
    assert plant.motoring.count == 0


def test_a_reset_begins_the_books_anew(log):
    plant = cruise('symmetric_ode', 'paper', log, seconds=1)
    plant.take(('pinion',), (80.0,), 'test')
    for _ in range(3000):
        plant.tick()
    plant.notice()
    total = plant.simulation.total
    assert sum(total.gears + total.bearings) > 0.0 and plant.motoring.count == 1
    plant.reset()   # takes what was lost out of the books, which is no gain
    plant.notice()
    assert plant.motoring.count == 1


def test_what_was_given_back_is_the_change_of_both_totals_beyond_rounding():
    layout = Layout.of(SYMMETRIC)

    def total(gears, bearings, scale):
        entries = [0.0] * (layout.scale + 1)
        entries[layout.gears], entries[layout.bearings] = gears, bearings
        entries[layout.scale] = scale
        return Energy(tuple(entries), layout)
    begin = total((10.0, 1.0, 1.0), (1.0, 1.0), 1000.0)
    assert given_back(begin, begin) == 0.0
    # the bearings take what the gears give, or nearly
    assert given_back(begin, total((8.0, 1.0, 1.0), (2.0, 2.0), 1100.0)) == 0.0
    assert given_back(begin, total((8.0, 1.0, 1.0), (2.0, 1.5), 1100.0)) == 0.5
    assert given_back(begin, total((10.0 - 1e-10, 1.0, 1.0), (1.0, 1.0), 1100.0)) == 0.0
    assert given_back(begin, total((10.0, 3.0, 1.0), (1.0, 1.0), 1100.0)) == 0.0
