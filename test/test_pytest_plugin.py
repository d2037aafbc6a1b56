# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the pytest plugin gives to the tests of a controller."""

import csv

# loaded for good: what a run of pytest in this process loads, it forgets at its end
import matplotlib.backends.backend_agg  # noqa: F401
import matplotlib.figure  # noqa: F401
import pytest

from dm_ros import Simulation
from dm_ros.files.bag import has_rosbags
from dm_ros.files.recorded_drive import read_drive
from dm_ros.mechanism.variants import variant_named
from dm_ros.motion.models import LOSS_LAWS
from dm_ros.testing import DirectDifferential

pytest_plugins = ['pytester']

TORQUES = (300.0, -100.0, -150.0)


def test_a_direct_run_is_the_simulation_with_the_law_between_the_ticks(direct_differential):
    vehicle = direct_differential('lsd_ode', rate=500.0)
    record = vehicle.run(lambda snapshot: (300.0 - snapshot.velocity[0], -100.0, -140.0),
                         seconds=0.2)
    simulation = Simulation('lsd_ode', 1 / 500.0)
    snapshot = simulation.snapshot()
    for n in range(100):
        snapshot = simulation.step((300.0 - snapshot.velocity[0], -100.0, -140.0))
        assert record.velocity['rear'][n] == snapshot.velocity[2]
        assert record.moment['rear_clutch'][n] == snapshot.moment[3]
    assert len(record) == 100
    assert record.time[-1] == 0.2


def test_a_law_may_return_torques_or_torques_and_forces(direct_differential):
    def law(snapshot):
        slip = abs(snapshot.velocity[1] - snapshot.velocity[2])
        return TORQUES if snapshot.time < 0.05 else (TORQUES, (100.0 * slip, 50.0))

    vehicle, simulation = direct_differential('lsd_ode'), Simulation('lsd_ode', 1e-3)
    record, snapshot = vehicle.run(law, seconds=0.1), simulation.snapshot()
    for n in range(100):
        demand = law(snapshot)
        snapshot = simulation.step(*demand) if len(demand) == 2 else simulation.step(demand)
        assert record.velocity['rear'][n] == snapshot.velocity[2]
        assert record.clutch_force['front'][n] == snapshot.clutch_force[0]
    assert set(record.clutch_force['rear']) == {0.0, 50.0}
    assert record.clutch_force['front'][-1] > 0.0


def test_a_law_whose_forces_do_not_fit_is_refused_and_named(direct_differential):
    for variant, forces, why in (('lsd_ode', (1.0,), 'front_clutch, rear_clutch'),
                                 ('lsd_ode', (-1.0, 0.0), 'the force on front_clutch is -1')):
        with pytest.raises(ValueError, match=why):
            direct_differential(variant).run(lambda _, f=forces: (TORQUES, f), seconds=0.1)
    with pytest.raises(ValueError, match='torques: .* must be 3 numbers'):
        direct_differential('lsd_ode').run(lambda _: (1.0, 2.0), seconds=0.1)


def test_a_direct_run_goes_by_the_law_of_losses_that_is_asked_for(direct_differential):
    torques, ends = (5.0, -10.0, -10.0), set()
    for loss_law in LOSS_LAWS:
        vehicle = direct_differential(loss_law=loss_law)
        record = vehicle.run(lambda snapshot: torques, seconds=0.2)
        simulation = Simulation('symmetric_ode', 1e-3, loss_law=loss_law)
        for n in range(200):
            assert record.velocity['left'][n] == simulation.step(torques).velocity[1]
        ends.add(record.velocity['left'][-1])
    assert len(ends) == 2
    with pytest.raises(ValueError, match="loss_law: 'torsen' is not one of passive, paper"):
        direct_differential(loss_law='torsen')


def test_a_run_ends_when_its_condition_holds_or_its_time_is_over(direct_differential):
    vehicle = direct_differential('symmetric_ode', rate=100.0)
    record = vehicle.run(lambda snapshot: (10.0, 0.0, 0.0), seconds=10.0,
                         until=lambda snapshot: snapshot.velocity[3] > 20.0)
    assert record.velocity['pinion'][-1] > 20.0 >= record.velocity['pinion'][-2]
    assert len(vehicle.run(lambda snapshot: (0.0, 0.0, 0.0), seconds=0.5)) == 50
    assert len(vehicle.record) == len(record) + 50
    with pytest.raises(ValueError, match='seconds, until'):
        vehicle.run(lambda snapshot: (0.0, 0.0, 0.0))


def test_slip_is_the_difference_of_the_output_shafts():
    record = DirectDifferential('symmetric_dae').run(lambda _: (1.0, -3.0, 1.0), seconds=0.1)
    assert record.slip[-1] == record.velocity['left'][-1] - record.velocity['right'][-1] != 0.0


def test_a_failing_test_leaves_its_record_and_a_passing_one_does_not(pytester):
    pytester.makepyfile(test_it="""
        import pytest

        @pytest.mark.parametrize('limit', [1e9, 0.0])
        def test_speed(direct_differential, limit):
            vehicle = direct_differential('lsd_ode')
            record = vehicle.run(lambda snapshot: (300.0, -100.0, -150.0), seconds=0.05)
            assert record.velocity['carrier'].max() < limit
    """)
    result = pytester.runpytest_inprocess(   # hypothesis, not needed, takes longer than the rest
        '-p', 'no:hypothesispytest', '--differential-records', 'left')
    result.assert_outcomes(passed=1, failed=1)
    left = sorted((pytester.path / 'left').iterdir())
    *left, bag = left if has_rosbags() else (*left, None)
    assert [path.suffix for path in left] == ['.csv', '.png']
    with open(left[0], newline='') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 50
    assert float(rows[-1]['torque.rear']) == -150.0
    assert left[1].read_bytes().startswith(b'\x89PNG')
    if bag:
        drive = read_drive(bag, variant_named('lsd_ode').mechanism, 1.0)
        assert list(drive.table.held(1e-3)) == [(*TORQUES, 0.0, 0.0)] * 50


def test_the_plugin_loads_neither_ros_nor_matplotlib_where_no_test_wants_it(pytester):
    pytester.makepyfile(test_it="""
        import sys

        def test_nothing():
            assert not {'rclpy', 'matplotlib'} & set(sys.modules)
    """)
    pytester.runpytest_subprocess('-p', 'no:hypothesispytest').assert_outcomes(passed=1)
