# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What doc/coupling.md says of speed ports, and the wheel that its examples turn."""

import math
from pathlib import Path
import sys

import numpy as np
import pytest
from scipy.linalg import expm
from test_example_direct import table_after

sys.path.insert(0, str(Path(__file__).parents[1] / 'examples'))

import coupling_speed as coupling
from wheel import Wheel

from dm_ros import Simulation

STIFFNESS, ENDS, LIGHT, COUPLINGS, BOOKS = map(table_after, (
    '| half-shaft, N m/rad', '| at the inner ends', '| light gears, rate', '| tyre of 1400',
    '| energy in the first second'))


@pytest.mark.parametrize('slope', [0.0, 1e-9, 30.0, 1400.0, 1e7])
def test_a_wheel_turns_as_its_equation_says_whatever_the_tick(slope):
    inertia, road, torque, dt, start = 1.3, 7.0, -40.0, 0.005, 9.0
    wheel, halves = (Wheel(inertia, slope, road, start) for _ in range(2))
    for _ in range(2):
        halves.turn(torque, dt / 2)
    assert halves.speed == pytest.approx(wheel.turn(torque, dt), rel=1e-13)
    decay = math.exp(-slope * dt / inertia)
    if slope < 1.0:   # next to no tyre
        assert wheel.speed == pytest.approx(start + torque / inertia * dt, rel=1e-9)
    else:
        rest = road + torque / slope
        assert wheel.speed == pytest.approx(rest + (start - rest) * decay, rel=1e-13)


@pytest.mark.parametrize('ticks_late', [0, 1])
@pytest.mark.parametrize(('row', 'case'), list(zip(STIFFNESS, coupling.LIMITS, strict=True)))
def test_beside_a_gear_that_is_held_the_damping_has_two_limits(row, case, ticks_late):
    rate, stiffness = case
    assert (float(row[0]), float(row[1])) == (stiffness, rate)
    said, measured = row[2 + 2 * ticks_late:4 + 2 * ticks_late]
    limits = coupling.damping_formula(stiffness, rate, ticks_late)
    assert said == coupling.in_words(limits)
    if limits is None:
        assert measured == 'none' and coupling.damping_limits(stiffness, rate, ticks_late) is None
        return
    assert list(map(float, measured.split(' to '))) == pytest.approx(limits, rel=0.01)
    least, greatest = limits
    for damping, grows in ((0.99 * least, True), (1.01 * least, False),
                           (0.99 * greatest, False), (1.01 * greatest, True)):
        assert coupling.grows((stiffness, damping), rate, coupling.HELD, ticks_late) == grows


def test_the_limits_are_those_of_the_page_in_short():
    for rate, stiffness in coupling.LIMITS:
        least, greatest = coupling.damping_formula(stiffness, rate, 0)
        assert stiffness / rate == pytest.approx(2 * least)          # c dt = 2 d
        assert greatest / rate == pytest.approx(2 * coupling.INERTIA)   # d dt = 2 I
    least, greatest = coupling.damping_formula(1.0, 1000.0, 1)       # far from c dt^2 = I/4
    assert (1.0 / 1000.0, greatest / 1000.0) == pytest.approx((2 * least / 3, coupling.INERTIA))
    # the default port and the default rate: not beside a heavy gear, one tick late
    assert not coupling.grows((1e4, 100.0), 200.0, coupling.HELD)
    assert coupling.grows((1e4, 100.0), 200.0, coupling.HELD, 1)


@pytest.mark.parametrize(('slope', 'damping', 'rate'), [(20.0, 10.0, 1000.0), (300.0, 5.0, 200.0)])
def test_a_tyre_beside_the_wheel_widens_both_limits(slope, damping, rate):
    stiffness = 2 * (damping + slope) * rate
    greatest = slope / math.tanh(slope / (2 * coupling.INERTIA * rate))
    for factor, grows in ((0.99, False), (1.01, True)):
        for port in ((factor * stiffness, damping), (1e3, factor * greatest)):
            assert coupling.grows(port, rate, coupling.HELD, slope=slope) == grows


@pytest.mark.parametrize(('row', 'case'), list(zip(ENDS, coupling.HEAVY, strict=True)))
def test_what_turns_at_the_inner_ends_moves_the_limit(row, case):
    (name, formula, *measured), (what, inner, engine) = row, case
    assert name == what
    if formula:
        expected = coupling.stiffness_formula(10.0, 1000.0, inner)
        assert (float(formula), float(measured[0])) == pytest.approx(
            (expected, expected), rel=0.01)
    for ticks_late, stiffness in enumerate(map(float, measured)):
        for factor, grows in ((0.98, False), (1.02, True)):
            assert coupling.grows((factor * stiffness, 10.0), 1000.0, inner, ticks_late,
                                  engine=engine) == grows


@pytest.mark.parametrize(('row', 'case'), list(zip(LIGHT, coupling.LIGHT, strict=True)))
def test_light_gears_have_no_limit_but_of_a_damping_that_is_next_to_none(row, case):
    rate, damping = case
    assert (float(row[0]), float(row[1])) == case
    counts = [sum(coupling.grows((c, damping), rate, {}, ticks_late)
                  for c in coupling.STIFFNESSES) for ticks_late in (0, 1)]
    assert list(map(int, row[2:])) == counts
    assert (sum(counts) == 0) == (damping >= light_damping(coupling.carried({}), rate))


def light_damping(inner, rate):
    """Return the damping that the page gives for light gears, N m s/rad."""
    return 5 * inner**2 * rate / coupling.INERTIA


def largest_factor(stiffness, damping, rate, inner, ticks_late):
    """Return by how much a tick multiplies the fastest growing motion of one half-shaft."""
    step = expm(np.array([[0.0, -1.0, 1.0],   # of twist, inner and outer speed
                          [stiffness / inner, -damping / inner, damping / inner],
                          [0.0, 0.0, 0.0]]) / rate)
    impulse = inner * (step[1] - [0.0, 1.0, 0.0])
    tick = np.zeros((3 + ticks_late,) * 2)
    tick[:3, :3] = step
    if ticks_late:
        tick[3, :3], tick[2, 3] = impulse, -1.0 / coupling.INERTIA
    else:
        tick[2, :3] -= impulse / coupling.INERTIA
    factors = np.linalg.eigvals(tick)
    return abs(factors[abs(factors - 1.0) > 1e-9]).max()   # not of turning all together


@pytest.mark.parametrize('inner', [0.00017, 0.05, 0.1, 0.25])
def test_the_damping_that_the_page_gives_for_light_gears_is_enough(inner):
    assert all(largest_factor(stiffness, light_damping(inner, rate), rate, inner, ticks_late) < 1.0
               for rate in (5.0, 20.0, 200.0, 1000.0) for ticks_late in (0, 1)
               for stiffness in np.geomspace(1.0, 1e6, 100))


@pytest.mark.parametrize(('ticks_late', 'softest', 'heaviest'), [(0, 2.0, 1.0), (1, 0.45, 0.5)])
def test_the_conditions_of_the_page_are_enough_whatever_turns_at_the_inner_end(
        ticks_late, softest, heaviest):
    for inner in np.geomspace(1e-3, 1e5, 49):
        for d_dt in 0.99 * heaviest * np.geomspace(1e-3, 1.0, 8):
            for c_dt in 0.99 * softest * d_dt * np.array([0.01, 0.1, 0.5, 1.0]):
                assert largest_factor(c_dt, d_dt, 1.0, inner, ticks_late) < 1.0


@pytest.mark.parametrize(('rate', 'chatters'), [(20.0, True), (200.0, False)])
@pytest.mark.parametrize('ticks_late', [0, 1])
def test_the_clutches_of_a_self_locking_differential_tie_wheel_to_wheel(
        rate, chatters, ticks_late):
    wheels = {'front': Wheel(speed=5.011), 'rear': Wheel(speed=5.003)}
    simulation = Simulation('lsd_ode', 1.0 / rate, ports=dict.fromkeys(wheels, (1e4, 100.0)),
                            initial_velocity=(5.0, 5.0))
    torques = [snapshot.torque for _, snapshot in zip(
        range(600), coupling.exchange(simulation, wheels, ticks_late))]
    last = abs(np.diff(torques[-100:], axis=0)).max()   # N m
    assert last > 10.0 if chatters else last < 1e-4


@pytest.mark.parametrize(('row', 'case'), list(zip(
    COUPLINGS, coupling.couplings().items(), strict=True)))
def test_a_stiff_tyre_is_stable_on_a_speed_port_where_the_torque_port_is_not(row, case):
    name, unstable = case
    assert row == [name, *('grows' if unstable(rate, ticks_late) else 'dies out'
                           for rate in (200.0, 1000.0) for ticks_late in (0, 1))]


def test_the_books_close_with_half_shafts_and_what_the_exchange_makes_is_in_none():
    columns = [coupling.books(rate) for rate in (200.0, 1000.0)]
    assert [row[0] for row in BOOKS] == list(columns[0])
    for row in BOOKS:
        assert row[1:] == [coupling.joules(books[row[0]]) for books in columns]
    for books in columns:
        work = books['work of the engine']
        assert abs(books['missing in these books']) < 1e-9 * work
        assert abs(books['taken by the error of the step']) < 1e-6 * work
        # (T dt)^2/(2 I) a tick, so it falls with the tick
    slow, fast = (books['made by the exchange'] for books in columns)
    assert slow == pytest.approx(5 * fast, rel=0.01)
