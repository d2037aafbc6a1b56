# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Parameters are those of the paper, and no impossible one is let in."""

import dataclasses
import itertools
import math

from mechanisms import BOTH, random_self_locking, UncheckedParameters
import numpy as np
import pytest

from dm_ros import SelfLockingParameters, SymmetricParameters
from dm_ros.mechanism.clutched import full_friction
from dm_ros.mechanism.self_locking import SelfLockingOde
from dm_ros.settings import NodeParameters

TABLE_1 = {
    'symmetric.final_drive_ratio': 3.517,
    'symmetric.satellite_ratio': 0.5,
    'symmetric.satellite_count': 2,
    'symmetric.inertia.carrier': 0.1,
    'symmetric.inertia.left': 1.8e-4,
    'symmetric.inertia.right': 1.8e-4,
    'symmetric.inertia.pinion': 1.56e-4,
    'symmetric.inertia.satellite': 4.0e-5,
    'symmetric.viscosity.carrier': 5e-3,
    'symmetric.viscosity.left': 1e-3,
    'symmetric.viscosity.right': 1e-3,
    'symmetric.viscosity.pinion': 1e-3,
    'symmetric.viscosity.satellite': 1e-3,
    'symmetric.efficiency.pinion_bearing': 0.995,
    'symmetric.efficiency.final_drive': 0.975,
    'symmetric.efficiency.carrier_bearing': 0.995,
    'symmetric.efficiency.left_mesh': 0.99,
    'symmetric.efficiency.right_mesh': 0.99,
}
ASSUMED = {
    'lsd.crown_radius.front': 0.040,
    'lsd.crown_radius.rear': 0.060,
    'lsd.clutch.front.radius': 0.040,
    'lsd.clutch.rear.radius': 0.060,
    'lsd.clutch.front.preload': 100,
    'lsd.clutch.rear.preload': 100,
}
PLATES = {   # the paper's symmetric differential has no clutches
    'symmetric.pressure_angle': 20 * math.pi / 180,
    'symmetric.side_gear_radius': 0.03,
    **{f'symmetric.clutch.{side}.{name}': value for side in ('left', 'right')
       for name, value in (('friction_coefficient', 0.15), ('slip_steepness', 4),
                           ('radius', 0.05), ('preload', 0))}
}
NO_PLATES = {f'symmetric.clutch.{side}.friction_surfaces': 0 for side in ('left', 'right')}
ACTUATED = {   # clutches as the paper has them, without any lag
    f'{clutch}.{name}': value
    for clutch in ('lsd.clutch.front', 'lsd.clutch.rear', 'symmetric.clutch.left',
                   'symmetric.clutch.right')
    for name, value in (('coast_factor', 1), ('actuator_time_constant', 0),
                        ('actuator_limit', 1e6))
}
TABLE_2 = {
    'lsd.satellite_ratio': 10 / 24,
    'lsd.satellite_count': 4,
    'lsd.inertia.carrier': 2.9e-2,
    'lsd.inertia.front': 4.8e-3,
    'lsd.inertia.rear': 5.8e-3,
    'lsd.inertia.satellite': 6.0e-3,
    'lsd.viscosity.carrier': 5e-3,
    'lsd.viscosity.front': 1e-3,
    'lsd.viscosity.rear': 1e-3,
    'lsd.viscosity.satellite': 1e-3,
    'lsd.efficiency.carrier_bearing': 0.995,
    'lsd.efficiency.front_mesh': 0.99,
    'lsd.efficiency.rear_mesh': 0.99,
    'lsd.pressure_angle': 20 * math.pi / 180,
    'lsd.clutch.front.friction_surfaces': 1,
    'lsd.clutch.rear.friction_surfaces': 9,
    'lsd.clutch.front.friction_coefficient': 0.15,
    'lsd.clutch.rear.friction_coefficient': 0.15,
    'lsd.clutch.front.slip_steepness': 4,
    'lsd.clutch.rear.slip_steepness': 4,
}
SIGN_SPEED = 0.02   # rad/s, of the passive law, which is not the paper's
NAN, INF = math.nan, math.inf
TABLES = [SymmetricParameters, SelfLockingParameters, NodeParameters]


def owner(name):
    return next(t for t in TABLES if name.startswith(t.prefix))()


@pytest.mark.parametrize('table, values', [
    (SymmetricParameters, TABLE_1 | PLATES | NO_PLATES),
    (SelfLockingParameters, TABLE_2 | ASSUMED)])
def test_defaults_are_those_of_the_paper(table, values):
    values = {**values, **table.part_of(ACTUATED), f'{table.prefix}.mesh_sign_speed': SIGN_SPEED}
    assert table().named() == pytest.approx(values, rel=1e-15)
    for name, value in table().named().items():
        assert type(value) is (int if name.endswith(('count', 'surfaces')) else float), name


def test_ratio_of_the_crown_gears_and_the_preload_friction_are_those_of_the_paper():
    p = SelfLockingParameters()
    assert p.g_12 == pytest.approx(60 / 40, rel=1e-15)
    assert p.f == pytest.approx((0.15, 1.35), rel=1e-15)
    assert full_friction(p)[1] == pytest.approx((2.4, 32.4), rel=1e-15)


def test_just_what_the_paper_does_not_name_is_described_as_assumed():
    rows = dict(SelfLockingParameters.rows().values()) | dict(SymmetricParameters.rows().values())
    assumed = {name for name, row in rows.items() if 'assumed' in row.description}
    assert assumed == set(ASSUMED | PLATES)


@pytest.mark.parametrize('table', TABLES)
def test_every_default_is_allowed_and_every_name_and_symbol_is_unique(table):
    names = [name for name, _ in table.rows().values()]
    assert len(set(names)) == len(names)
    for symbol, (name, row) in table.rows().items():
        value = getattr(table(), symbol)
        assert row.checked(name, value) == value
        assert row.description


@pytest.mark.parametrize('table', TABLES)
def test_parameters_are_frozen(table):
    p = table()
    for field in dataclasses.fields(p):
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(p, field.name, getattr(p, field.name))


POSITIVE, NOT_NEGATIVE = (0, -1e-9, INF, -INF, NAN, 1e7), (-1e-9, INF, NAN, 1e7)
NO_NUMBERS = (True, False, '1', '0.5', None, [1.0], 1j)
REFUSED = [
    *[(f'{m}.efficiency.{part}', v, 'in (0, 1]')
      for m, part in [('symmetric', 'final_drive'), ('lsd', 'front_mesh')]
      for v in (0, 1.1, -0.5, INF, NAN, *NO_NUMBERS)],
    *[(f'{m}.inertia.{shaft}', v, 'in (0, 1e+06]')
      for m, shaft in [('symmetric', 'pinion'), ('lsd', 'satellite')]
      for v in (*POSITIVE, *NO_NUMBERS)],
    *[(f'{m}.viscosity.carrier', v, 'in [0, 1e+06]')
      for m in ('symmetric', 'lsd') for v in (*NOT_NEGATIVE, *NO_NUMBERS)],
    *[(f'{m}.satellite_count', v, 'an integer in [1, 64]')
      for m in ('symmetric', 'lsd') for v in (0, -1, 2.5, 65, INF, NAN, *NO_NUMBERS)],
    *[('lsd.clutch.rear.friction_surfaces', v, 'an integer in [0, 1000]') for v in (-1, 0.5, NAN)],
    *[('lsd.clutch.rear.friction_coefficient', v, 'in [0, 10]') for v in (*NOT_NEGATIVE, '0.1')],
    *[('lsd.clutch.front.preload', v, 'in [0, 1e+06]') for v in NOT_NEGATIVE],
    *[('lsd.clutch.front.slip_steepness', v, 'in [0, 10000]') for v in NOT_NEGATIVE],
    *[('lsd.clutch.front.radius', v, 'in (0, 10]') for v in POSITIVE],
    *[('lsd.crown_radius.rear', v, 'in (0, 10]') for v in POSITIVE],
    *[('lsd.pressure_angle', v, 'in [0, 1.5]') for v in (-0.1, 1.6, NAN)],
    *[('lsd.satellite_ratio', v, 'in [0.001, 1000]') for v in POSITIVE],
    *[('symmetric.final_drive_ratio', v, 'in [-1000, 1000]') for v in (1001, -INF, NAN, True)],
    ('symmetric.final_drive_ratio', 0.0, 'must not be 0'),
    *[('variant', v, 'symmetric_ode, symmetric_dae, lsd_lagged') for v in ('lsd', '', 1, None)],
    *[('rate', v, 'in [0.1, 10000]') for v in (0, -200, NAN, '200')],
    *[('substeps', v, 'an integer in [1, 1000]') for v in (0, 1.5, True)],
]


@pytest.mark.parametrize('name, value, allowed', REFUSED)
def test_impossible_value_is_refused_with_its_name_and_what_is_allowed(name, value, allowed):
    with pytest.raises(ValueError) as refusal:
        owner(name).changed({name: value})
    message = str(refusal.value)
    assert message.startswith(f'{name}: {value!r} is not allowed')
    assert allowed in message


def test_negative_ratio_and_whole_floats_are_taken():
    p = SymmetricParameters().changed({'symmetric.final_drive_ratio': -3.5,
                                       'symmetric.satellite_count': 3.0,
                                       'symmetric.inertia.left': np.float64(1e-3)})
    assert (p.g_F, p.n_s, p.I_1) == (-3.5, 3, 1e-3)
    assert (type(p.n_s), type(p.I_1)) == (int, float)


def test_unknown_name_is_refused_by_name():
    for name in ('symmetric.inertia.front', 'lsd.inertia.front', 'I_0', ''):
        with pytest.raises(ValueError, match=f'^{name}: there is no such parameter among symm'):
            SymmetricParameters().changed({name: 1.0})


def test_change_takes_all_or_nothing():
    p = SymmetricParameters()
    good = {'symmetric.inertia.left': 2e-4, 'symmetric.viscosity.left': 2e-3}
    changed, before = p.changed(good), p.named()
    assert changed.named() == before | good != before
    for bad in ({'symmetric.inertia.right': 0.0}, {'symmetric.no': 1.0}):
        with pytest.raises(ValueError):
            p.changed(good | bad)
    assert p.named() == before == p.changed({}).named()


def test_order_of_a_change_does_not_matter_where_only_the_whole_is_possible():
    stronger = {'lsd.clutch.rear.friction_coefficient': 0.5,
                'lsd.clutch.rear.friction_surfaces': 4}
    p = SelfLockingParameters()
    with pytest.raises(ValueError):
        p.changed({'lsd.clutch.rear.friction_coefficient': 0.5})
    for items in itertools.permutations(stronger.items()):
        assert p.changed(dict(items)).mu_2 == 0.5


@pytest.mark.parametrize('shaft, change', [
    ('rear', {'lsd.clutch.rear.friction_coefficient': 0.31}),
    ('rear', {'lsd.pressure_angle': 0.64}),
    ('rear', {'lsd.clutch.rear.radius': 0.13}),
    ('front', {'lsd.clutch.front.friction_surfaces': 19}),
    ('front', {'lsd.clutch.front.friction_surfaces': 18, 'lsd.efficiency.front_mesh': 0.98})])
def test_clutch_that_locks_the_mechanism_is_refused_by_name(shaft, change):
    with pytest.raises(ValueError) as refusal:
        SelfLockingParameters().changed(change)
    message = str(refusal.value)
    assert message.startswith(f'lsd.clutch.{shaft}: the clutch locks itself')
    assert 'must be below' in message and 'efficiency = ' in message


def determinants(p):
    """Return det(I + W diag(+-tan(alpha) f_1, +-tan(alpha) f_2)), a row a direction of flow."""
    phi = np.array(full_friction(p)[0])
    signs = np.array(list(itertools.product((1, -1), repeat=2)))[:, None, :]
    return np.array([np.linalg.det(np.eye(2) + SelfLockingOde(p).response(d).W * phi * signs)
                     for d in BOTH])


@pytest.mark.parametrize('share', [None, 0.9, 0.999])
def test_determinants_of_all_sign_patterns_are_positive_for_admissible_parameters(share):
    rng = np.random.default_rng(1)
    for _ in range(150):
        p = random_self_locking(rng, share)
        inertias = {f'I_{k}': getattr(p, f'I_{k}') * 10.0 ** rng.uniform(-6, 0) for k in '012s'}
        for any_inertia in (p, dataclasses.replace(p, **inertias)):
            assert (determinants(any_inertia) > 0).all()


def test_light_carrier_and_satellites_lock_in_reverse_flow_just_beyond_the_limit():
    rng = np.random.default_rng(2)
    for _ in range(20):
        p = random_self_locking(rng, 1.001, UncheckedParameters)
        with pytest.raises(ValueError, match='locks itself'):
            SelfLockingParameters(**dataclasses.asdict(p))
        light = dataclasses.replace(p, I_0=p.I_0 * 1e-6, I_s=p.I_s * 1e-6)
        direct, reverse = determinants(light)
        assert (direct > 0).all() and (reverse < 0).any()
