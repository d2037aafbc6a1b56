# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What an exported FMU does is what ``Simulation`` does, and no importer can break it."""

from concurrent.futures import ThreadPoolExecutor
import math
from pathlib import Path
import shutil

from importers import build, exported, extracted, Instance
from mechanisms import by_elimination
import numpy as np
from properties import random_case
import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.files.columns import as_row, column_names
from dm_ros.mechanism.variants import SYMMETRIC, variants_of
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.tools.simulate import main as simulate

fmpy = pytest.importorskip('fmpy')
validation = pytest.importorskip('fmpy.validation')
from fmpy.fmi1 import FMICallException  # noqa: E402, I100

VERSIONS = '2.0', '3.0'
DT = 0.001   # s
CLUTCHED = ('symmetric.clutch.left.friction_surfaces: 4\n'
            'symmetric.clutch.right.friction_surfaces: 6\n'
            'symmetric.clutch.right.preload: 200.0')
LOCKED = 'lsd.clutch.front.friction_coefficient', 10.0   # with the other defaults it locks itself


def outputs(instance, simulation):
    return instance.get(*column_names(simulation)[1:])


def reported(simulation):
    return list(as_row(simulation.snapshot())[1:])


def inputs(simulation, row):
    """Return the inputs by name for a row of torques and forces."""
    mechanism = simulation.mechanism
    return dict(zip((*mechanism.inputs, *mechanism.clutch_moments), map(float, row)))


def drive(simulation, ticks, seed=14):
    """Return a row of torques and forces for each tick, that hold for some ticks."""
    count, rng = len(simulation.clutches), np.random.default_rng(seed)
    rows = rng.normal(size=(ticks // 7 + 1, 3 + count)) * ([120.0] * 3 + [400.0] * count)
    rows[:, 3:] = np.abs(rows[:, 3:])
    return np.repeat(rows, 7, axis=0)[:ticks].tolist()


def step(simulation, row):
    """Advance a simulation by a row of torques and forces."""
    simulation.step(row[:3], row[3:] or (0.0, 0.0))


def refused(instance, call, words):
    """Assert that a call is refused with words, as an error of the standard."""
    with pytest.raises(FMICallException) as caught:
        call()
    assert caught.value.status == 3   # fmi2Error, fmi3Error
    heard = instance.heard()
    assert all(word in heard for word in words.split(' ... ')), heard


@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('variant', VARIANTS)
def test_fmpy_finds_no_fault_in_any_variant(variant, version):
    assert not validation.validate_fmu(str(exported(variant, version)))


@pytest.mark.parametrize('version', VERSIONS)
def test_fmpy_finds_no_fault_in_clutches_and_other_options(version):
    more = CLUTCHED + '\nsubsteps: 3\npower_flow_deadband: 5.0\ninitial_velocity.left: -7.5'
    assert not validation.validate_fmu(str(exported('symmetric_dae', version, more,
                                                    '--dt', '0.0025')))


@pytest.mark.parametrize('law', LOSS_LAWS)
@pytest.mark.parametrize('variant, more', [*((variant, '') for variant in VARIANTS),
                                           ('symmetric_ode', CLUTCHED)])
@by_elimination()
def test_every_tick_has_the_bits_of_a_simulation_of_random_mechanisms(variant, more, law):
    """Under the paper's law: of one with coefficients in plain floats, not by a formulation."""
    version = VERSIONS[len(variant) % 2]
    path = exported(variant, version, f'loss_law: {law}\n{more}')
    place, seen = VARIANTS.index(variant), 0
    for n in range(place, 40 * len(VARIANTS), len(VARIANTS)):
        case = random_case(n if not more else variants_of(SYMMETRIC).index(variant) + 2 * n,
                           clutched=bool(more))
        assert case.variant == variant
        arguments = {**case.arguments, 'dt': DT, 'loss_law': law}
        try:
            simulation = Simulation(variant, **arguments)
        except ValueError:
            continue   # no finite solution under this law
        if bool(simulation.clutches) != bool(more or variant.startswith('lsd')):
            continue
        instance = Instance(path, version)
        parameters = {name: value for name, value in simulation.parameters.named().items()}
        speeds = zip(simulation.outputs, simulation.initial_velocity)
        instance.start(**parameters, substeps=simulation.substeps,
                       power_flow_deadband=simulation.power_flow_deadband,
                       **{f'initial_velocity.{shaft}': speed for shaft, speed in speeds})
        assert outputs(instance, simulation) == reported(simulation)
        forces = np.abs(np.random.default_rng(n).normal(size=2) * 1e3).tolist()
        for tick, torques in enumerate(case.load):
            row = [*torques, *(forces if simulation.clutches else ())]
            instance.set(inputs(simulation, row))
            step(simulation, row)
            instance.step(tick * DT, DT)
            assert outputs(instance, simulation) == reported(simulation)
        instance.fmu.terminate()
        instance.fmu.freeInstance()
        seen += 1
    assert seen > 20


@pytest.mark.parametrize('variant', VARIANTS)
def test_under_the_law_of_the_paper_it_has_the_values_of_every_formulation(variant):
    instance = Instance(exported(variant, '2.0', 'loss_law: paper')).start()
    simulation, found, expected = Simulation(variant, DT, loss_law='paper'), [], []
    for tick, row in enumerate(drive(simulation, 500)):
        instance.set(inputs(simulation, row))
        instance.step(tick * DT, DT)
        step(simulation, row)
        found.append(outputs(instance, simulation))
        expected.append(reported(simulation))
    scale = np.abs(expected).max(axis=0)
    assert (np.abs(np.subtract(found, expected)).max(axis=0) <= 1e-12 * scale).all()


@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('law', LOSS_LAWS)
def test_fmpy_simulates_what_simulate_does(tmp_path, version, law):
    """Rows hold for whole communication steps, which are ten ticks."""
    times = np.arange(0.0, 0.5, 0.01)
    rows = np.random.default_rng(14).normal(size=(len(times), 5)) * ([150.0] * 3 + [300.0] * 2)
    rows[:, 3:] = np.abs(rows[:, 3:])
    names = ['carrier', 'front', 'rear', 'front_clutch', 'rear_clutch']
    table, out = tmp_path / 'in.csv', tmp_path / 'out.csv'
    np.savetxt(table, np.column_stack([times, rows]), '%.17g', ',', comments='',
               header='time,' + ','.join(names))
    assert simulate(['--variant', 'lsd_ode', '--loss-law', law, '--torques', str(table),
                     '--dt', str(DT), '--out', str(out)]) == 0
    expected = np.genfromtxt(out, delimiter=',', names=True, deletechars='')[::10]
    signals = np.array([(t, *row) for t, row in zip(times, rows)],
                       [(name, float) for name in ('time', *names)])
    found = fmpy.simulate_fmu(extracted(exported('lsd_ode', version, f'loss_law: {law}')),
                              stop_time=0.49, output_interval=0.01, input=signals)
    assert len(found) == len(expected) == 50
    for name in found.dtype.names[1:]:
        scale = np.abs(expected[name]).max()
        assert np.abs(found[name] - expected[name]).max() <= (
            0.0 if law == 'passive' else 1e-12) * scale, name


def test_libcosim_runs_it_to_the_same_bits():
    pytest.importorskip('libcosimpy')
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave
    log_output_level(CosimLogLevel.WARNING)
    simulation = Simulation('lsd_ode', DT)
    execution = CosimExecution.from_step_size(step_size=int(1e9 * DT))   # ns
    slaves = [execution.add_local_slave(CosimLocalSlave(
        fmu_path=str(exported('lsd_ode')), instance_name=name)) for name in ('idle', 'driven')]
    references = {v.name.decode(): v.reference for v in execution.slave_variables(slaves[1])}
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    assert execution.add_manipulator(manipulator) and execution.add_observer(observer)
    reals = [name for name in column_names(simulation)[1:] if name != 'power_flow']
    for row in drive(simulation, 60):
        names = inputs(simulation, row)
        assert manipulator.slave_real_values(slaves[1], [references[name] for name in names],
                                             list(names.values()))
        assert execution.step()
        step(simulation, row)
        found = dict(zip(reals, observer.last_real_values(
            slaves[1], [references[name] for name in reals])))
        found['power_flow'], = observer.last_integer_values(slaves[1], [references['power_flow']])
        assert [found[name] for name in column_names(simulation)[1:]] == reported(simulation)
    assert not any(observer.last_real_values(slaves[0], [references['velocity.front']]))


@pytest.mark.parametrize('version', VERSIONS)
@by_elimination()
def test_what_the_file_sets_are_its_start_values(version):
    more = CLUTCHED + ('\nsymmetric.inertia.left: 0.02\nsymmetric.satellite_count: 4\nsubsteps: 2'
                       '\npower_flow_deadband: 50.0\ninitial_velocity.right: 12.0'
                       '\nloss_law: paper')
    instance = Instance(exported('symmetric_ode', version, more), version).start()
    simulation = Simulation(
        'symmetric_ode', DT, {'symmetric.inertia.left': 0.02, 'symmetric.satellite_count': 4,
                              'symmetric.clutch.left.friction_surfaces': 4,
                              'symmetric.clutch.right.friction_surfaces': 6,
                              'symmetric.clutch.right.preload': 200.0}, substeps=2,
        power_flow_deadband=50.0, initial_velocity=(0.0, 12.0), loss_law='paper')
    named = simulation.parameters.named()
    assert instance.get(*named) == list(named.values())
    assert instance.get('substeps', 'power_flow_deadband', 'initial_velocity.right') == [
        2, 50.0, 12.0]
    for tick, row in enumerate(drive(simulation, 50)):
        instance.set(inputs(simulation, row))
        instance.step(tick * DT, DT)
        step(simulation, row)
        assert outputs(instance, simulation) == reported(simulation)


@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode', 'lsd_lagged'])
def test_a_tunable_parameter_changes_while_it_runs_as_in_a_simulation(variant, version):
    instance, simulation = Instance(exported(variant, version), version).start(), Simulation(
        variant, DT)
    prefix = simulation.mechanism.name
    changes = {20: {f'{prefix}.inertia.carrier': 0.5, f'{prefix}.satellite_count': 3},
               40: {f'{prefix}.efficiency.carrier_bearing': 0.9}, 60: {'substeps': 3},
               80: {'power_flow_deadband': 30.0}}
    for tick, row in enumerate(drive(simulation, 100)):
        if change := changes.get(tick):
            instance.set(change)
            if tick < 60:
                simulation.parameters = change
            for name, value in change.items() if tick >= 60 else ():
                setattr(simulation, name, value)
            assert outputs(instance, simulation) == reported(simulation)
        instance.set(inputs(simulation, row))
        instance.step(tick * DT, DT)
        step(simulation, row)
        assert outputs(instance, simulation) == reported(simulation)


@pytest.mark.parametrize('version', VERSIONS)
def test_a_step_of_many_ticks_is_as_many_steps_of_one(version):
    simulation = Simulation('lsd_ode', DT)
    one, many = (Instance(exported('lsd_ode', version), version).start() for _ in '12')
    for n, row in enumerate(drive(simulation, 30)):
        for instance in (one, many):
            instance.set(inputs(simulation, row))
        many.step(n * 0.01, 0.01)
        for k in range(10):
            one.step(n * 0.01 + k * DT, DT)
        assert outputs(one, simulation) == outputs(many, simulation)


@pytest.mark.parametrize('version', VERSIONS)
def test_sizes_that_drift_by_rounding_are_the_nominal(version):
    simulation = Simulation('symmetric_ode', DT)
    nominal, drifting = (Instance(exported('symmetric_ode', version), version).start()
                         for _ in '12')
    time, sizes = 0.0, set()
    for n, row in enumerate(drive(simulation, 200)):
        for instance in (nominal, drifting):
            instance.set(inputs(simulation, row))
        nominal.step(n / 100, 0.01)
        later = time + 0.1 - 0.09
        sizes.add(later - time)
        drifting.step(time, later - time)
        time = later
        assert outputs(nominal, simulation) == outputs(drifting, simulation)
    assert len(sizes) > 5 and time != 2.0
    drifting.step(time, 0.01 + 0.0009 * DT)


@pytest.mark.parametrize('version', VERSIONS)
def test_other_sizes_and_times_are_refused_and_the_state_stays(version):
    simulation = Simulation('symmetric_ode', DT)
    instance = Instance(exported('symmetric_ode', version), version).start(start=3.0, stop=3.1)
    row = inputs(simulation, (30.0, -10.0, -4.0))
    instance.set(row)
    instance.step(3.0, 0.01)
    before = outputs(instance, simulation)
    for length in (0.0105, 0.0005, 0.0, -DT, math.nan, math.inf, 1e300, DT * 1.002):
        refused(instance, lambda length=length: instance.step(3.01, length),
                'a step of ... whole multiple of 0.001 s')
    for at in (3.0, 3.02, 0.01, math.nan):
        refused(instance, lambda at=at: instance.step(at, DT), 'at 3.01 s')
    refused(instance, lambda: instance.step(3.01, 0.1), 'the stop time is 3.1 s')
    assert outputs(instance, simulation) == before
    instance.step(3.01, 0.01)
    for _ in range(20):
        simulation.step(row.values())
    assert outputs(instance, simulation) == reported(simulation)
    if version == '3.0':
        assert instance.get('time') == [3.0 + 0.02]


BAD = [
    ({'pinion': math.nan}, 'pinion: nan is not allowed, it must be a finite number'),
    ({'left': math.inf}, 'left: inf is not allowed'),
    ({'pinion': 5.0, 'right': -math.inf}, 'right: -inf is not allowed'),
    ({'left_clutch': -1.0}, 'left_clutch: -1 is not allowed, it must be a finite number that is '
                            'not below 0'),
    ({'symmetric.inertia.left': 0.0}, 'symmetric.inertia.left: 0 is not allowed, it must be in '
                                      '(0, 1e+06]'),
    ({'symmetric.inertia.left': math.nan}, 'symmetric.inertia.left: nan'),
    ({'symmetric.efficiency.left_mesh': 1.01}, 'must be in (0, 1]'),
    ({'symmetric.satellite_count': 65}, 'an integer in [1, 64]'),
    ({'substeps': 0}, 'substeps: 0 is not allowed'),
    ({'velocity.left': 1.0}, 'velocity.left: it cannot be set'),
]


@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('values, words', BAD)
def test_a_bad_value_is_an_error_with_words_and_nothing_changes(values, words, version):
    instance = Instance(exported('symmetric_ode', version, CLUTCHED), version).start(left=3.0)
    simulation = Simulation('symmetric_ode', DT, {
        'symmetric.clutch.left.friction_surfaces': 4,
        'symmetric.clutch.right.friction_surfaces': 6, 'symmetric.clutch.right.preload': 200.0})
    instance.step(0.0, DT)
    before = instance.get(*(name for name in instance.variables if name != 'time'))
    refused(instance, lambda: instance.set(values), words)
    assert instance.get(*(name for name in instance.variables if name != 'time')) == before
    instance.step(DT, DT)
    for _ in '12':
        simulation.step((0.0, 3.0, 0.0))
    assert outputs(instance, simulation) == reported(simulation)


@pytest.mark.parametrize('version', VERSIONS)
def test_parameters_that_make_no_mechanism_are_refused_together(version):
    """Each is in its range, so they are refused when it is to go on with them."""
    name, value = LOCKED
    simulation = Simulation('lsd_ode', DT)
    row = (100.0, -50.0, -20.0)
    instance = Instance(exported('lsd_ode', version), version).start(
        **inputs(simulation, row))
    with pytest.raises(ValueError, match='locks itself'):
        simulation.parameters = {name: value}
    instance.set({name: value})
    refused(instance, lambda: instance.step(0.0, DT), f'{name} 10: not allowed ... locks itself')
    assert instance.get(name) == [simulation.parameters.named()[name]]
    instance.step(0.0, DT)
    simulation.step(row)
    assert outputs(instance, simulation) == reported(simulation)
    instance.set({name: value})   # what is allowed in the end may come one after the other
    instance.set({'lsd.clutch.front.friction_surfaces': 0})
    instance.step(DT, DT)
    simulation.parameters = {name: value, 'lsd.clutch.front.friction_surfaces': 0}
    simulation.step(row)
    assert outputs(instance, simulation) == reported(simulation)


@pytest.mark.parametrize('version', VERSIONS)
def test_the_final_drive_ratio_must_not_be_0(version):
    instance = Instance(exported('symmetric_dae', version), version)
    instance.enter()
    instance.set({'symmetric.final_drive_ratio': 0.0})
    refused(instance, instance.fmu.exitInitializationMode, 'final drive ratio is 0')


@pytest.mark.parametrize('version', VERSIONS)
def test_what_began_without_clutches_cannot_get_any(version):
    instance = Instance(exported('symmetric_ode', version), version)
    assert 'left_clutch' not in instance.variables
    name = 'symmetric.clutch.left.friction_surfaces'
    assert instance.variables[name].variability == 'fixed'
    refused(instance, lambda: instance.set({name: 2}), 'exported without clutches cannot get any')


@pytest.mark.parametrize('version', VERSIONS)
def test_initial_speeds_cannot_change_while_it_runs(version):
    instance = Instance(exported('lsd_ode', version), version).start(
        **{'initial_velocity.front': 5.0})
    assert instance.get('velocity.front', 'velocity.rear') == [5.0, 0.0]
    refused(instance, lambda: instance.set({'initial_velocity.front': 6.0}),
            'initial_velocity.front: it cannot change while it runs')


@pytest.mark.parametrize('version', VERSIONS)
def test_torques_beyond_the_range_of_numbers_are_refused_and_the_state_stays(version):
    simulation = Simulation('lsd_ode', DT)
    instance = Instance(exported('lsd_ode', version), version).start()
    with pytest.raises(ValueError, match='range of floating point'):
        simulation.step((1e308, 1e308, 1e308))
    instance.set(inputs(simulation, (1e308, 1e308, 1e308, 0.0, 0.0)))
    refused(instance, lambda: instance.step(0.0, 0.01), 'out of the range of floating point')
    instance.set(inputs(simulation, (10.0, 0.0, 0.0, 0.0, 0.0)))
    instance.step(0.0, DT)
    simulation.step((10.0, 0.0, 0.0))
    assert outputs(instance, simulation) == reported(simulation)


@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode', 'lsd_lagged'])
def test_a_state_that_is_put_back_goes_on_bit_for_bit(variant, version):
    """Also in another instance, from bytes, and with parameters that changed since."""
    simulation = Simulation(variant, DT)
    rows = drive(simulation, 60)
    name = f'{simulation.mechanism.name}.viscosity.carrier'

    def go_on(instance, ticks):
        found = []
        for n in ticks:
            instance.set(inputs(simulation, rows[n]))
            instance.step(n * DT, DT)
            found.append(outputs(instance, simulation))
        return found

    instance = Instance(exported(variant, version), version).start()
    go_on(instance, range(20))
    instance.set({name: 0.7})
    go_on(instance, range(20, 30))
    kept = instance.fmu.getFMUState()
    stored = instance.fmu.serializeFMUState(kept)
    expected = go_on(instance, range(30, 60))
    instance.set({name: 0.1})
    instance.fmu.setFMUState(kept)
    assert instance.get(name) == [0.7]
    assert go_on(instance, range(30, 60)) == expected
    instance.fmu.reset()
    instance.fmu.setFMUState(kept)
    assert go_on(instance, range(30, 60)) == expected
    instance.fmu.freeFMUState(kept)
    other = Instance(exported(variant, version), version)
    state = other.fmu.deserializeFMUState(stored)
    other.fmu.setFMUState(state)
    assert go_on(other, range(30, 60)) == expected
    assert other.fmu.serializeFMUState(state) == stored
    other.fmu.freeFMUState(state)


@pytest.mark.parametrize('version', VERSIONS)
def test_bytes_that_are_no_state_are_refused(version):
    instance = Instance(exported('symmetric_ode', version), version).start()
    stored = instance.fmu.serializeFMUState(instance.fmu.getFMUState())
    refused(instance, lambda: instance.fmu.deserializeFMUState(stored[:-1]), 'a state has')
    other = Instance(exported('symmetric_dae', version), version).start()
    foreign = other.fmu.serializeFMUState(other.fmu.getFMUState())
    rng, taken = np.random.default_rng(5), 0
    for n in range(200):
        spoilt = bytearray(stored)
        where = rng.integers(0, len(stored) // 8) * 8
        spoilt[where:where + 8] = rng.choice([math.nan, -1.0, 1e300, math.inf, 0.5]).tobytes()
        state = instance.fmu.deserializeFMUState(foreign if n == 0 else bytes(spoilt))
        try:
            instance.fmu.setFMUState(state)
            instance.get(*(name for name in instance.variables if name != 'time'))
            instance.step(0.0, DT)
            taken += 1
        except FMICallException:
            assert instance.heard()
        instance.fmu.freeFMUState(state)
        assert n or not taken
    good = instance.fmu.deserializeFMUState(stored)
    instance.fmu.setFMUState(good)
    instance.step(0.0, DT)


@pytest.mark.parametrize('version', VERSIONS)
def test_a_reset_instance_begins_like_a_new_one(version):
    simulation = Simulation('lsd_ode', DT)
    instance = Instance(exported('lsd_ode', version), version).start(
        **{'lsd.inertia.front': 0.3, 'initial_velocity.rear': 4.0, 'carrier': 50.0})
    instance.step(0.0, 0.05)
    if version == '2.0':
        instance.fmu.terminate()
    instance.fmu.reset()
    instance.start(start=1.0)
    assert instance.get('lsd.inertia.front', 'carrier') == [
        simulation.parameters.named()['lsd.inertia.front'], 0.0]
    for n, row in enumerate(drive(simulation, 30)):
        instance.set(inputs(simulation, row))
        instance.step(1.0 + n * DT, DT)
        step(simulation, row)
        assert outputs(instance, simulation) == reported(simulation)


@pytest.mark.parametrize('version', VERSIONS)
def test_many_instances_in_many_threads_do_not_disturb_each_other(version):
    path = exported('symmetric_ode', version)
    extracted(path)   # once, before the threads

    def run(n):
        simulation = Simulation('symmetric_ode', DT, {'symmetric.inertia.left': 0.001 * (n + 1)})
        instance = Instance(path, version).start(**simulation.parameters.named())
        for tick, row in enumerate(drive(simulation, 100, n)):
            instance.set(inputs(simulation, row))
            instance.step(tick * DT, DT)
            step(simulation, row)
            if outputs(instance, simulation) != reported(simulation):
                return False
        return True

    with ThreadPoolExecutor(8) as pool:
        assert all(pool.map(run, range(32)))


def test_importers_of_fmi_2_may_take_integers_for_reals():
    """As fmi_adapter does, for which all variables are reals."""
    instance = Instance(exported('lsd_ode'))
    count, flow = (instance.variables[name].valueReference
                   for name in ('lsd.satellite_count', 'power_flow'))
    instance.fmu.setReal([count], [5.0])
    assert instance.get('lsd.satellite_count') == [5]
    assert list(instance.fmu.getReal([count, flow])) == [5.0, 1.0]
    refused(instance, lambda: instance.fmu.setReal([count], [2.5]),
            'lsd.satellite_count: 2.5 is not allowed, it must be an integer in [1, 64]')


@pytest.mark.parametrize('version', VERSIONS)
def test_calls_out_of_order_are_errors(version):
    instance = Instance(exported('lsd_dae', version), version)
    name = f'fmi{version[0]}'
    refused(instance, lambda: instance.step(0.0, DT), f'{name}DoStep is not allowed before')
    refused(instance, instance.fmu.exitInitializationMode, 'ExitInitializationMode is not allowed')
    instance.start()
    refused(instance, instance.enter, 'is not allowed once the initialization mode has ended')
    instance.fmu.terminate()
    refused(instance, lambda: instance.step(0.0, DT), 'is not allowed after the end')
    refused(instance, lambda: instance.set({'carrier': 1.0}), 'is not allowed after the end')
    assert instance.get('velocity.front') == [0.0]


@pytest.mark.parametrize('version', VERSIONS)
def test_what_is_not_of_this_fmu_is_no_instance(version):
    folder = extracted(exported('lsd_ode', version))
    description = fmpy.read_model_description(folder)
    description.guid = description.instantiationToken = '{another}'
    words = []
    with pytest.raises(Exception, match='instantiate'):
        fmpy.instantiate_fmu(folder, description, 'CoSimulation',
                             logger=lambda *message: words.append(message[-1].decode()))
    assert 'is not that of this FMU' in words[0]


@pytest.mark.parametrize('version', VERSIONS)
def test_its_sources_compile_by_fmpy_to_the_same_bits(tmp_path, version):
    path = exported('lsd_ode', version)
    folder = tmp_path / 'fmu'
    shutil.copytree(extracted(path), folder)
    shutil.rmtree(folder / 'binaries')
    build(folder)
    simulation = Simulation('lsd_ode', DT)
    instance = Instance(path, version, str(folder)).start()
    for tick, row in enumerate(drive(simulation, 30)):
        instance.set(inputs(simulation, row))
        instance.step(tick * DT, DT)
        step(simulation, row)
        assert outputs(instance, simulation) == reported(simulation)
    assert Path(folder, 'binaries').is_dir()

