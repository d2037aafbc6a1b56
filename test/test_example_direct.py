# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The worked example without topics, and the stability limit of doc/coupling.md."""

from pathlib import Path
import re
import sys

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'examples'))

import brake_lock
import coupling

from dm_ros.mechanism.variants import variant_named
from dm_ros.testing import DirectDifferential

ROOT = Path(__file__).parents[1]
OPEN, BRAKE, LSD = brake_lock.CASES
PAGE = (ROOT / 'doc' / 'coupling.md').read_text()


def table_after(heading):
    """Return the rows of the first table of doc/coupling.md whose head begins so, as words."""
    rows = PAGE.split(heading, 1)[1].split('\n\n', 1)[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip('|').split('|')] for row in rows]


def test_the_lock_brings_torque_to_the_wheel_on_asphalt():
    runs = {case.name: brake_lock.run(case, 3.0, direct=True) for case in brake_lock.CASES}
    speeds = {name: run.car['speed'][-1] for name, run in runs.items()}
    assert speeds['open'] < 0.25
    assert speeds['brake'] > speeds['lsd'] > 1.5
    # the torque of the tyre on the right shaft is what drives the car, a load: negative
    tyre = {name: -list(run.record.torque.values())[2][-1] for name, run in runs.items()}
    assert tyre['open'] < 120.0 < 200.0 < tyre['lsd'] < tyre['brake']
    # the open differential halves; what the brake takes on the left is given to the right
    moment = runs['brake'].record.moment
    assert moment['left_mesh'][-1] == pytest.approx(moment['right_mesh'][-1], rel=0.01)


def test_the_page_of_the_example_says_what_the_command_says():
    lines = brake_lock.report(
        [brake_lock.run(case, 5.0, direct=True) for case in brake_lock.CASES])
    page = (ROOT / 'doc' / 'example.md').read_text()
    for line in lines[2:5]:
        _, car, slip, _, tyre = line.split()
        assert f'| {car} | {slip} | {tyre} |' in page


def test_the_asymmetric_axle_locks_better_towards_its_stronger_side():
    def final_speed(grip):
        p = brake_lock.CarParameters(grip=grip)
        differential = DirectDifferential('lsd_ode', 1000.0,
                                          parameters=brake_lock.parameters_of(LSD, p))
        law, car = brake_lock.law_of(differential, LSD, p=p)
        differential.run(law, seconds=2.0)
        return car.speed
    ice, asphalt = brake_lock.CarParameters().grip
    assert final_speed((ice, asphalt)) > 1.2 * final_speed((asphalt, ice))


def test_a_demand_on_the_brake_is_limited_and_ends_with_the_slip():
    lock = brake_lock.BrakeLock(1e-3)
    demands = [lock.brakes((60.0, 0.0)) for _ in range(2000)]
    assert demands[-1] == (lock.LIMIT, 0.0)
    demands = [lock.brakes((1.0, 0.0)) for _ in range(2000)]
    assert demands[-1] == (0.0, 0.0)


@pytest.mark.parametrize('row', table_after('| rate, Hz | wheel inertia in the shaft'))
def test_the_stability_limit_is_where_the_page_says(row):
    rate, inertia, formula, measured = map(float, row)
    assert formula == pytest.approx(
        2 * coupling.slip_inertia(coupling.GEAR.I_1 + inertia) * rate, rel=1e-3)
    assert measured == pytest.approx(formula, rel=0.01)
    parameters = coupling.attached(inertia)
    assert not coupling.grows(coupling.tyre(0.98 * formula), rate, parameters)
    assert coupling.grows(coupling.tyre(1.02 * formula), rate, parameters)


@pytest.mark.parametrize(('row', 'car'), list(zip(
    table_after('| at 1000 Hz | formula'), coupling.CARS, strict=True)))
def test_the_limit_of_a_whole_axle_is_that_of_its_inertia_matrix(row, car):
    name, variant, changes, shafts = car
    assert row[0] == name
    table = variant_named(variant).mechanism.parameters()
    formula = coupling.slope_formula(1000.0, table.changed(changes), shafts)
    assert float(row[1]) == pytest.approx(formula, rel=1e-3)
    for factor, grows in ((0.98, False), (1.02, True)):
        load = coupling.tyre(factor * formula, shafts)
        assert coupling.grows(load, 1000.0, changes, variant) == grows


def test_substeps_do_not_move_the_limit():
    formula, parameters = 2 * coupling.slip_inertia(1.00018) * 1000.0, coupling.attached(1.0)
    for substeps in (1, 10, 100):
        for factor, grows in ((0.98, False), (1.02, True)):
            assert coupling.grows(coupling.tyre(factor * formula), 1000.0, parameters,
                                  substeps=substeps) == grows


@pytest.mark.parametrize('row', table_after('| ticks late'))
def test_a_torque_that_comes_late_lowers_the_limit(row):
    ticks = int(row[0])
    formula = coupling.late_formula(1000.0, 1.0, ticks)
    assert [float(cell) for cell in row[1:]] == pytest.approx([formula, formula], rel=0.01)
    for factor, grows in ((0.98, False), (1.02, True)):
        load = coupling.late(coupling.tyre(factor * formula), ticks)
        assert coupling.grows(load, 1000.0, coupling.attached(1.0)) == grows


@pytest.mark.parametrize('rate', [100.0, 1000.0, 10000.0])
def test_a_wheel_heavier_than_its_shaft_cannot_be_given_by_torque_at_any_rate(rate):
    own = coupling.slip_inertia(coupling.GEAR.I_1)
    assert not coupling.grows(coupling.wheel_by_topic(0.97 * own, rate), rate)
    assert coupling.grows(coupling.wheel_by_topic(1.03 * own, rate), rate)


def test_an_elastic_half_shaft_wants_damping_between_two_limits():
    c, rate, parameters = 1e4, 1000.0, coupling.attached(0.1)
    low, high = c / rate / 2, 2 * coupling.slip_inertia(coupling.GEAR.I_1 + 0.1) * rate
    for damping, grows in ((0.9 * low, True), (1.1 * low, False),
                           (0.98 * high, False), (1.02 * high, True)):
        assert coupling.grows(coupling.half_shaft(c, damping), rate, parameters) == grows


@pytest.mark.parametrize('slope', [1e3, 1e4, 1e6, 1e8])
def test_a_linearised_tyre_is_stable_however_steep(slope):
    load = coupling.linearised(slope, 1.0, 1000.0)
    assert not coupling.grows(load, 1000.0, coupling.attached(1.0))


def test_the_car_of_the_example_is_within_its_limit_and_chatters_beyond():
    parameters = coupling.GEAR.changed(coupling.OPEN_CAR)
    slope = coupling.car_slope(coupling.CAR)
    assert f'{slope:.0f} N m s/rad' in PAGE
    assert slope < coupling.slope_formula(brake_lock.RATE, parameters)
    assert coupling.chatter(brake_lock.RATE) < 0.01
    assert slope > coupling.slope_formula(200.0, parameters, (0.0, 1.0))
    assert coupling.chatter(200.0) > 0.5


def test_every_file_that_the_pages_link_is_there():
    for page in ('doc/coupling.md', 'doc/example.md', 'doc/lockstep.md', 'doc/testing.md'):
        for link in re.findall(r'\]\(([^)#:]+)\)', (ROOT / page).read_text()):
            assert (ROOT / page).parent.joinpath(link).exists(), f'{page}: {link}'
