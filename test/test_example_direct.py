# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The worked example without topics, and the stability limit of doc/coupling.md."""

from dataclasses import replace
from functools import cache
import math
from pathlib import Path
import re
import sys

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'examples'))

import brake_lock
import car
import coupling
import half_shafts

from dm_ros.energy import AuditedSimulation
from dm_ros.mechanism.variants import variant_named
from dm_ros.testing import DirectDifferential

ROOT = Path(__file__).parents[1]
OPEN, BRAKE, PLATES, ELS = brake_lock.CASES
NO_PRELOAD = replace(PLATES, parameters=(*PLATES.parameters,
                                         *brake_lock.on_both_sides(preload=0.0)))
EACH_CASE = pytest.mark.parametrize('case', brake_lock.CASES,
                                    ids=[case.name for case in brake_lock.CASES])
PAGE = (ROOT / 'doc' / 'coupling.md').read_text()
EXAMPLE = (ROOT / 'doc' / 'example.md').read_text()


def table_after(heading, page=PAGE):
    """Return the rows of the first table of a page whose head begins so, as words."""
    rows = page.split(heading, 1)[1].split('\n\n', 1)[0].splitlines()[2:]
    return [[cell.strip() for cell in row.strip('|').split('|')] for row in rows]


@cache
def on_ice(case, ice=brake_lock.ICE, seconds=5.0, other=brake_lock.ASPHALT):
    """Return the ``Run`` of a case with a grip under the left and the other wheel, kept."""
    p = brake_lock.CarParameters(grip=(ice, other))
    return brake_lock.run(case, seconds, direct=True, p=p)


@cache
def on_half_shafts(case, p=half_shafts.CAR, seconds=5.0, rate=brake_lock.RATE):
    """Return the ``Run`` of a case with speed ports, kept."""
    return brake_lock.run(case, seconds, True, p, brake_lock.SPEED, rate)


def test_the_lock_brings_torque_to_the_wheel_on_asphalt():
    free, braked = (on_ice(case, seconds=3.0) for case in (OPEN, BRAKE))
    assert free.car['speed'][-1] < 0.25 < 1.5 < braked.car['speed'][-1]
    # the torque of the tyre on the right shaft is what drives the car, a load: negative
    assert -free.record.torque['right'][-1] < 120.0 < 380.0 < -braked.record.torque['right'][-1]
    # the open differential halves; what the brake takes on the left is given to the right
    moment = braked.record.moment
    assert moment['left_mesh'][-1] == pytest.approx(moment['right_mesh'][-1], rel=0.01)


@pytest.mark.parametrize(('ice', 'spins'), [(0.12, False), (0.08, True), (0.0, True)])
def test_the_plates_multiply_what_the_ice_bears_and_add_their_preload(ice, spins):
    """The page: a side bears 62 N m and 0.44 of its gear, so one gets 2.57 L + 220 N m."""
    record = on_ice(PLATES, ice).record
    assert (record.slip.max() > 20.0) == spins   # rad/s
    slipping = record.slip > 2.0
    assert slipping[-1]
    moment = {name: values[slipping] for name, values in record.moment.items()}
    assert moment['left_clutch'] == pytest.approx(61.6 + 0.44 * moment['left_mesh'], rel=0.01)
    taken, given = (moment[f'{side}_mesh'] - moment[f'{side}_clutch']
                    for side in ('left', 'right'))
    assert given == pytest.approx(2.57 * taken + 220.0, rel=0.01)
    # at last the wheels hardly speed up, and the tyres have it all
    left, right = (-record.torque[side][-1] for side in ('left', 'right'))
    assert right == pytest.approx(2.57 * left + 220.0, rel=0.03)


def test_the_plates_just_hold_the_wheel_and_the_brake_lock_gives_the_same_on_any_ice():
    assert on_ice(PLATES).record.slip.max() < 6.5            # rad/s
    assert on_ice(PLATES, ice=0.11).record.slip.max() > 40.0
    for ice in (brake_lock.ICE, 0.08, 0.04, 0.0):
        record = on_ice(BRAKE, ice).record
        assert -record.torque['right'][record.time > 1.0] == pytest.approx(400.0, abs=12.0)
    force = on_ice(ELS, ice=0.0).record.clutch_force['left']
    assert force[-1] == pytest.approx(brake_lock.LimitedSlip().limit, rel=1e-6)


def test_plates_help_either_wheel_alike():
    left = on_ice(PLATES, seconds=2.0)
    right = on_ice(PLATES, brake_lock.ASPHALT, seconds=2.0, other=brake_lock.ICE)
    assert left.car['speed'][-1] == pytest.approx(right.car['speed'][-1], rel=1e-6)


def test_the_table_of_the_grips_says_what_the_command_says():
    rows = table_after('| grip of the ice', EXAMPLE)
    assert [float(ice) for ice, *_ in rows] == [brake_lock.ICE, 0.08, 0.04, 0.0]
    for ice, *speeds in rows:
        assert speeds == [f'{on_ice(case, float(ice)).car["speed"][-1]:.2f}'
                          for case in (OPEN, BRAKE, NO_PRELOAD, PLATES, ELS)], ice


def test_the_limited_slip_beats_the_brake_lock_and_spends_no_brake():
    free, braked, run = (on_ice(case, seconds=3.0) for case in (OPEN, BRAKE, ELS))
    assert run.car['speed'][-1] > 1.5 * braked.car['speed'][-1] > 15 * free.car['speed'][-1]
    assert run.record.slip.max() < 6.5 and run.record.slip.min() > -0.1   # rad/s
    assert not run.car['left_brake'].any() and not run.car['right_brake'].any()
    assert run.heat['brakes'] == 0.0
    assert 1e3 < run.heat['clutches'] < braked.heat['brakes']   # J
    left, right = run.record.clutch_force.values()
    assert 0.0 < left.max() < brake_lock.LimitedSlip().limit
    assert left == pytest.approx(right, rel=1e-6)   # one slip for both clutches
    # it settles, and does not hunt
    assert abs(run.record.slip[run.record.time > 1.5] - run.record.slip[-1]).max() < 0.3
    assert np.ptp(left[-500:]) < 100.0   # N


def test_the_axle_of_the_limited_slip_is_open_without_its_controller():
    run, free = (on_ice(case, seconds=3.0) for case in (replace(ELS, controller=None), OPEN))
    assert run.car['speed'][-1] == pytest.approx(free.car['speed'][-1], abs=0.03)
    assert run.record.slip[-1] == pytest.approx(free.record.slip[-1], rel=0.01)
    assert run.heat['clutches'] == 0.0


def test_the_limited_slip_helps_either_wheel_alike_and_does_nothing_on_an_even_road():
    ice, asphalt = brake_lock.ICE, brake_lock.ASPHALT
    left, right, even = (on_ice(ELS, grip, 1.5, other) for grip, other in (
        (ice, asphalt), (asphalt, ice), (asphalt, asphalt)))
    assert left.car['speed'][-1] == pytest.approx(right.car['speed'][-1], rel=1e-3)
    assert even.car['speed'][-1] > left.car['speed'][-1]
    assert not any(force.any() for force in even.record.clutch_force.values())


@pytest.mark.parametrize('case', [PLATES, ELS], ids=['plates', 'els'])
def test_the_heat_of_the_clutches_is_that_of_the_books(case):
    books = DirectDifferential(brake_lock.VARIANT, brake_lock.RATE)
    books.simulation = AuditedSimulation(brake_lock.VARIANT, 1.0 / brake_lock.RATE,
                                         parameters=brake_lock.parameters_of(case))
    law, car = brake_lock.law_of(books, case)
    run = brake_lock.as_run(case, books.run(law, 1.5), car)
    assert run.heat['clutches'] == pytest.approx(
        sum(books.simulation.total.clutches), rel=2e-3)


def test_a_force_on_a_clutch_grows_beyond_the_dead_band_up_to_its_limit_and_opens_again():
    law = brake_lock.LimitedSlip(threshold=1.5, gain=4000.0, limit=10_000.0)
    for sign in (1.0, -1.0):
        forces = [law.force(sign * slip) for slip in (0.0, 1.5, 2.0, 3.5, 4.0, 1e3, 1.0)]
        assert forces == [0.0, 0.0, 2000.0, 8000.0, 10_000.0, 10_000.0, 0.0]


@pytest.mark.parametrize('slip', [math.nan, math.inf, -math.inf])
def test_a_clutch_whose_slip_nobody_knows_is_open(slip):
    assert brake_lock.LimitedSlip().force(slip) == 0.0


def test_the_page_of_the_example_says_what_the_command_says():
    lines = brake_lock.report([on_ice(case) for case in brake_lock.CASES])
    for case, line in zip(brake_lock.CASES, lines[2:6]):
        name, car, slip, _, tyre, _, brakes, clutches = line.split()
        assert name == case.name
        assert f'| {case.title} | {car} | {slip} | {tyre} | {brakes} | {clutches} |' in EXAMPLE
    # what the text says of the force and of the share of the brake lock
    force, share = lines[5].split()[5], float(lines[5].split()[1]) / float(lines[3].split()[1])
    assert f'up to {force} kN' in EXAMPLE and f'{share:.1f} times' in EXAMPLE


# On half-shafts, by speed ports

WITHIN = 1.0   # %
# where half-shafts of a usual stiffness differ by more, from the time on when they have wound up
BEYOND = {('open', 'tyre on asphalt'): 1.1, ('plates', 'slip'): 2.4, ('plates', 'heat'): 1.8}


def row_of(p, after, case, found):
    """Return whether the page has a row of the table of differences."""
    assert half_shafts.row(p, after, case, found) in EXAMPLE.splitlines()
    return {name: value for name, value in found.items() if not math.isnan(value)}


@EACH_CASE
def test_the_car_on_half_shafts_does_the_same_within_a_percent_once_they_have_wound_up(case):
    run, reference = on_half_shafts(case), on_ice(case)
    whole = row_of(half_shafts.CAR, 0.0, case, half_shafts.differences(run, reference))
    assert whole['speed of the car'] < 0.4 and max(whole.values()) < 6.0
    after = half_shafts.SETTLED
    found = row_of(half_shafts.CAR, after, case,
                   half_shafts.differences(run, reference, after))
    for name, value in found.items():
        assert value < BEYOND.get((case.name, name), WITHIN), name
    assert half_shafts.relative(run, reference, after)['speed of the car'] < 0.5


@EACH_CASE
def test_on_stiffer_half_shafts_all_is_the_same_within_a_percent_at_all_times(case):
    found = row_of(half_shafts.STIFF, 0.0, case, half_shafts.differences(
        on_half_shafts(case, half_shafts.STIFF), on_ice(case)))
    assert max(found.values()) < WITHIN
    # it is the stiffness, not the exchange: ten times as stiff, a fifth at most
    soft = half_shafts.differences(on_half_shafts(case), on_ice(case))
    assert all(found[name] < 0.2 * soft[name] for name in ('tyre on ice', 'tyre on asphalt'))


@pytest.mark.parametrize('case', [BRAKE, ELS], ids=['brake', 'els'])
def test_finer_ticks_and_finer_steps_of_the_wheels_change_next_to_nothing(monkeypatch, case):
    run = on_half_shafts(case, seconds=0.8)
    fine = half_shafts.differences(
        run, on_half_shafts(case, seconds=0.8, rate=half_shafts.FINE))
    assert 0.0 < max(fine.values()) < 0.3
    monkeypatch.setattr(car.CarOnHalfShafts, 'STEP', car.CarOnHalfShafts.STEP / 4)
    steps = half_shafts.differences(run, brake_lock.run(
        case, 0.8, True, coupling=brake_lock.SPEED))
    assert 0.0 < max(steps.values()) < 1e-3


def test_the_slip_of_the_plates_magnifies_whatever_differs():
    p = replace(half_shafts.CAR, engine_torque=1.001 * half_shafts.CAR.engine_torque)
    run, other = on_ice(PLATES), brake_lock.run(PLATES, 5.0, True, p)
    assert f'{100 * (other.slip[-1] / run.slip[-1] - 1):.0f} % more slip' in EXAMPLE
    heat, more = (each.heat['clutches'] for each in (run, other))
    assert f'{100 * (more / heat - 1):.0f} % more heat' in EXAMPLE


@cache
def with_each_coupling(rate):
    """Return the ``Run`` of the brake lock at a rate, Hz, by torque ports and by speed ports."""
    return [brake_lock.run(BRAKE, 1.5, True, None, coupling, rate) for coupling in brake_lock.CARS]


@pytest.mark.parametrize('row', table_after('| rate, Hz | turns', EXAMPLE))
def test_at_low_rates_the_car_on_half_shafts_is_stable_where_the_other_one_chatters(row):
    rate = float(row[0])
    runs, references = with_each_coupling(rate), with_each_coupling(half_shafts.FINE)
    assert half_shafts.rate_row(rate, runs, references) == f'| {" | ".join(row)} |'
    held, free = (half_shafts.turns(run.car['right_tyre']) for run in runs)
    assert (held > 0.5) == (rate <= 200.0) and (free < 0.03) == (rate >= 100.0)
    if rate >= 100.0:
        found = half_shafts.differences(runs[1], references[1])
        assert found['speed of the car'] < 0.6 and found['slip'] < 5.0


def test_a_wheel_of_the_car_on_half_shafts_gets_the_torque_of_its_half_shaft_turned_round():
    vehicle = car.CarOnHalfShafts(1e-3, car.CarParameters(grip=(0.0, 0.0)))
    vehicle.see((0.0, 0.0, 0.0), (0.0, 5.0, 5.0))
    assert vehicle.answer((0.0, 0.0)) == (0.0, 0.0, 0.0)   # no tick had passed
    for n in range(1, 11):
        vehicle.see((0.0, 0.0, 0.0), (0.0, -20.0, 30.0))
        _, left, right = vehicle.answer((0.0, 0.0))
        assert (left, right) == pytest.approx((n * 0.02, n * -0.03), rel=1e-12)


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
