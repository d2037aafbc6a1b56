# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The coefficients of parameters in plain floats: those of the paper's equations, C as Python."""

from dataclasses import astuple, replace
import struct

from mechanisms import by_elimination, eliminated
import numpy as np
from properties import random_case
import pytest

from dm_ros import core, SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.mechanism import symmetric
from dm_ros.mechanism.clutched import LinearResponse
from dm_ros.mechanism.kinetic import kinetic_form
from dm_ros.mechanism.self_locking import kinematics, slip_coordinates
from dm_ros.mechanism.variants import CATALOGUE
from dm_ros.motion.models import LOSS_LAWS, PAPER, PASSIVE
from dm_ros.motion.packing import packed

CASES = range(200)
module = core._chosen('')
built = pytest.mark.skipif(module is None, reason='the core in C is not built')


def responses(p, direction):
    """Return the responses of all formulations of the mechanism of parameters."""
    return [variant.formulation(p).response(direction) for variant in CATALOGUE.values()
            if variant.mechanism.parameters is type(p)]


def as_formulated(p, r):
    """Return a response in (omega_0, slip) in the speeds of the formulations, without loss."""
    if not hasattr(p, 'g_F'):
        return r
    S, back = symmetric.TO_SLIP, np.linalg.inv(symmetric.TO_SLIP)
    return LinearResponse(back @ r.A @ S, back @ r.B, back @ r.C, r.P @ S, r.Q, r.W)


def distance(one, other):
    """Return the largest difference of two responses, over the largest entry of its column."""
    worst = 0.0
    for a, b in zip(one, other):
        scale = np.maximum(np.abs(a), np.abs(b)).max(axis=0)
        worst = max(worst, (np.abs(a - b) / np.where(scale > 0.0, scale, 1.0)).max())
    return worst


@pytest.mark.parametrize('direction', [1, -1])
@pytest.mark.parametrize('kind', [SymmetricParameters, SelfLockingParameters])
def test_one_elimination_is_every_formulation_of_the_paper(kind, direction):
    p = kind()
    found = as_formulated(p, eliminated(p, direction))
    assert max(distance(found, other) for other in responses(p, direction)) < 1e-13


@pytest.mark.parametrize('direction', [1, -1])
def test_the_elimination_is_as_near_to_the_formulations_as_they_are_to_each_other(direction):
    for n in CASES:
        p = random_case(n, clutched=n % 4 == 0).arguments['parameters']
        found, others = as_formulated(p, eliminated(p, direction)), responses(p, direction)
        apart = max(distance(a, b) for a in others for b in others)
        assert max(distance(found, other) for other in others) <= 4 * apart + 1e-13, n


@pytest.mark.parametrize('n', range(20))
def test_the_energy_is_that_of_all_shafts(n):
    p = random_case(n).arguments['parameters']
    inertias = [p.I_0, p.I_1, p.I_2, p.n_s * p.I_s]
    if isinstance(p, SymmetricParameters):
        inertias.insert(3, p.I_3)
        shafts = symmetric.kinematics(p) @ np.linalg.inv(symmetric.TO_SLIP)
    else:
        shafts = kinematics(p) @ np.linalg.inv(slip_coordinates(p))
    form = shafts.T @ np.diag(inertias) @ shafts
    m_ww, m_ws, m_ss = kinetic_form(p)
    scale = np.sqrt(form[0, 0] * form[1, 1])
    assert m_ww == pytest.approx(form[0, 0], rel=1e-13)
    assert m_ss == pytest.approx(form[1, 1], rel=1e-13)
    assert m_ws == pytest.approx(form[0, 1], abs=1e-13 * scale)


def made(simulation):
    """Return how many models C makes of the parameters of a simulation, and the bytes of it."""
    mechanism, run = simulation.mechanism, simulation._ticker.run
    setup = struct.pack('7d', len(mechanism.gears) == 3, simulation.loss_law == PASSIVE,
                        simulation.variant == 'lsd_lagged', bool(mechanism.clutches),
                        run.substeps, run.dt, 0.0)
    model = bytearray(module.MODEL)
    numbers = np.array(astuple(simulation.parameters), float)
    return module.make_all(setup, numbers, model, 0, 1), bytes(model)


@built
@pytest.mark.parametrize('loss_law', LOSS_LAWS)
def test_c_makes_the_model_that_python_makes_to_the_last_bit(loss_law):
    with by_elimination():
        for n in CASES:
            case = random_case(n, clutched=n % 4 == 0)
            simulation = Simulation(case.variant, **{**case.arguments, 'loss_law': loss_law,
                                                     'ports': ()})
            ticker = simulation._ticker
            assert made(simulation) == (1, packed(ticker.model, ticker.run)), (n, case)


@built
@pytest.mark.parametrize('change', [
    {'mu_1': 10.0}, {'I_0': 1e-300, 'I_1': 1e-300, 'I_2': 1e-300, 'I_s': 1e-300}])
@pytest.mark.parametrize('variant', ['symmetric_ode', 'lsd_ode'])
def test_c_refuses_what_makes_no_mechanism(variant, change):
    p = CATALOGUE[variant].mechanism.parameters(**(
        {'n_F1': 9, 'n_F2': 9} if variant == 'symmetric_ode' else {}))
    simulation = Simulation(variant, parameters=p)
    assert made(simulation)[0] == 1
    for name, value in change.items():
        object.__setattr__(p, name, value)
    assert made(simulation)[0] == 0
    with pytest.raises(ValueError):
        Simulation(variant, parameters=replace(p))


@built
def test_the_tables_have_as_many_numbers_as_c_reads():
    for kind, count in ((SymmetricParameters, 37), (SelfLockingParameters, 33)):
        numbers = np.zeros(count - 1)
        assert len(astuple(kind())) == count
        setup = struct.pack('7d', kind is SymmetricParameters, 1, 0, 0, 1, 1e-3, 0)
        with pytest.raises(ValueError, match='bytes'):
            module.make_all(setup, numbers, bytearray(module.MODEL), 0, 1)


def anywhere(rng, kind):
    """Return values of all over the ranges of a table, small ones too, and some at their ends."""
    values = {}
    for symbol, (_, row) in kind.rows().items():
        if rng.random() < 0.6:
            continue
        if row.kind is int:
            values[symbol] = int(rng.integers(row.low, min(row.high, 12) + 1))
        elif rng.random() < 0.2:
            values[symbol] = row.high if row.above_low else float(rng.choice([row.low, row.high]))
        else:
            sign = -1.0 if row.low < 0.0 and rng.random() < 0.5 else 1.0
            least = max(row.low, 1e-100)
            values[symbol] = float(sign * min(least * (row.high / least) ** rng.random(),
                                              row.high))
    return values


@built
def test_c_makes_and_refuses_what_python_does_all_over_the_ranges():
    rng, refused, count = np.random.default_rng(0), 0, 600
    for n in range(count):
        variant = str(rng.choice(list(CATALOGUE)))
        kind = CATALOGUE[variant].mechanism.parameters
        values = anywhere(rng, kind)
        surfaces = {symbol: values.get(symbol, 0) for symbol in ('n_F1', 'n_F2')}
        unchecked = Simulation(variant, parameters=kind(mu_1=0.0, mu_2=0.0, **surfaces))
        for symbol, value in (vars(kind()) | surfaces | values).items():
            object.__setattr__(unchecked.parameters, symbol, value)
        is_made, model = made(unchecked)
        try:
            ticker = Simulation(variant, parameters=kind(**(surfaces | values)))._ticker
        except ValueError:
            refused += 1
            assert not is_made, (n, variant, values)
            continue
        assert is_made and model == packed(ticker.model, ticker.run), (n, variant, values)
    assert 0 < refused < count


@built
def test_a_step_so_long_that_it_has_no_numbers_is_refused_by_both():
    p = SymmetricParameters()
    with pytest.raises(ValueError, match='no finite solution'):
        Simulation('symmetric_ode', 1e200, p, loss_law=PAPER)
    setup = struct.pack('7d', 1, 0, 0, 0, 1, 1e200, 0)
    assert module.make_all(setup, np.array(astuple(p), float), bytearray(module.MODEL), 0, 1) == 0
