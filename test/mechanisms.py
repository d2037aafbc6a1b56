# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the tests of the physics share: random mechanisms and references from first principles."""

from contextlib import contextmanager
import dataclasses
import math
from unittest import mock

import numpy as np

from dm_ros import SelfLockingParameters, SymmetricParameters
from dm_ros.mechanism import clutched, elimination, passive, symmetric
from dm_ros.mechanism.clutched import LinearResponse
from dm_ros.mechanism.self_locking import SelfLockingOde
from dm_ros.mechanism.variants import SYMMETRIC, variant_named
from dm_ros.motion import adaptive, models
from dm_ros.motion.adaptive import PAPER, PASSIVE
from dm_ros.motion.held_torque import held_torque_step_by_floats

BOTH = (1, -1)   # directions of power flow


def is_symmetric(variant):
    """Return whether a variant is one of the symmetric differential."""
    return variant_named(variant).mechanism is SYMMETRIC


def eliminated(p, direction):
    """Return the ``LinearResponse`` of ``elimination``."""
    clutches = p.has_clutches
    e_0, e_s, M_1, M_2, M_F = map(np.array, elimination.rows(
        p, passive.coefficients(p, clutches), direction))
    e, M = np.array([e_0, e_s]), np.array([M_F, M_1, M_2] if hasattr(p, 'g_F') else [M_1, M_2])
    return LinearResponse(e[:, :2], e[:, 2:5], -e[:, 5:], M[:, :2], M[:, 2:5], -M[:, 5:])


@contextmanager
def by_elimination():
    """Let simulations under the paper's law have the coefficients that C makes."""
    with mock.patch.multiple(
            models, responses_of=lambda _, p: {d: eliminated(p, d) for d in BOTH},
            held_torque_step=lambda A, B, h: held_torque_step_by_floats(
                A.ravel().tolist(), B.tolist(), h)), \
            mock.patch.object(symmetric, 'in_slip', lambda response: response):
        yield


class Flow:
    """A differential in one direction under held torques, as ``clutched`` has it."""

    law = PAPER

    def __init__(self, p, T, direction, friction=None, response=None):
        """
        Take friction that does not follow M, or None for that of the preload beside it.

        :param response: in (w, s); None for that of ``SelfLockingOde``.
        """
        response = response or SelfLockingOde(p).response(direction)
        self.k = clutched.coefficients(p, response, friction is None, direction)
        self.u = clutched.held(self.k, tuple(T), friction or clutched.full_friction(p)[1])

    def point(self, w, s):
        """Return (dw/dt, ds/dt, F_1, F_2, M_1, M_2, ...)."""
        return self.law.evaluate(self.k, self.u, w, s)

    def jacobian(self, w, s):
        """Return (J_ww, J_ws, J_sw, J_ss) and what friction grows with."""
        return self.law.jacobian(self.k, self.u, self.point(w, s))

    def step(self, y, h, **options):
        """Return the adaptive step from y over h."""
        return adaptive.step(self.law, self.k, self.u, tuple(y), h, **options)

    def last_resort(self, y, h):
        """Return the speeds and their integral after the step of any length."""
        return self.law.last_resort(self.law, self.k, self.u, tuple(y), self.jacobian(*y)[0], h)


class PassiveFlow(Flow):
    """A differential of either mechanism under the passive law and held torques."""

    law = PASSIVE

    def __init__(self, p, T, friction=None):
        """Take friction that does not follow M, or None for that of the preload beside it."""
        self.k = passive.coefficients(p, p.has_clutches, friction is None)
        preload = clutched.full_friction(p)[1] if p.has_clutches else (0.0, 0.0)
        self.u = passive.held(self.k, tuple(T), friction or preload)

    def lost(self, w, s):
        """Return the power that each element takes, W."""
        return passive.lost_powers(self.k, self.u, self.point(w, s))


class UncheckedParameters(SelfLockingParameters):
    """Self-locking parameters that may lock the mechanism."""

    def _check_mechanism(self):
        pass


def lossless(p):
    """Return the parameters with all efficiencies 1."""
    return dataclasses.replace(
        p, **{f.name: 1.0 for f in dataclasses.fields(p) if f.name.startswith('eta_')})


def _spread(rng, p, starts):
    """Return values up to five times the defaults or down to a fifth of them."""
    return {f.name: getattr(p, f.name) * 5.0 ** rng.uniform(-1, 1)
            for f in dataclasses.fields(p) if f.name.startswith(starts)}


def _efficiencies(rng, p):
    return {f.name: rng.uniform(0.85, 1.0)
            for f in dataclasses.fields(p) if f.name.startswith('eta_')}


def random_symmetric(rng):
    """Return random admissible parameters of the symmetric differential, g_F of either sign."""
    p = SymmetricParameters()
    return SymmetricParameters(
        **_spread(rng, p, ('I_', 'l_')), **_efficiencies(rng, p), n_s=int(rng.integers(1, 5)),
        g_F=float(rng.choice([-1, 1])) * rng.uniform(1.5, 6), g_2s=rng.uniform(0.3, 1.2))


def random_self_locking(rng, share=None, kind=SelfLockingParameters):
    """
    Return random parameters of the self-locking differential.

    :param share: of the limit tan(alpha) f_k < eta_kG eta_0B at which both clutches stand;
        None for random shares below 0.95.
    """
    p = SelfLockingParameters()
    values = {**_spread(rng, p, ('I_', 'l_', 'R_', 'N_')), **_efficiencies(rng, p),
              'n_s': int(rng.integers(1, 6)), 'g_2s': rng.uniform(0.2, 1.0)}
    radii = values['R_1'], values['R_2']
    return kind(**{**values, **_clutches(rng, values, radii, share)})


def _clutches(rng, values, radii, share=None):
    """Return random clutches for a mechanism with the given efficiencies and gear radii."""
    clutches = {'alpha': rng.uniform(0.15, 0.6),
                'n_F1': int(rng.integers(1, 6)), 'n_F2': int(rng.integers(1, 10)),
                'c_f1': rng.uniform(1, 8), 'c_f2': rng.uniform(1, 8)}
    for k, radius in zip('12', radii):
        gain = rng.uniform(0, 0.95) if share is None else share
        limit = values[f'eta_{k}G'] * values['eta_0B']
        clutches[f'R_F{k}'] = radius * rng.uniform(0.7, 1.4)
        clutches[f'mu_{k}'] = (gain * limit * radius / clutches[f'R_F{k}']
                               / clutches[f'n_F{k}'] / math.tan(clutches['alpha']))
    return clutches


def random_clutched_symmetric(rng):
    """Return random admissible parameters of the symmetric differential with clutches."""
    p, R = random_symmetric(rng), rng.uniform(0.01, 0.1)
    return dataclasses.replace(
        p, R=R, N_1=rng.uniform(0, 500), N_2=rng.uniform(0, 500),
        **_clutches(rng, vars(p), (R, R)))


def mirrored_symmetric(p):
    """Return the symmetric differential with left and right exchanged."""
    return dataclasses.replace(p, **_exchanged(p))


PAIRS = [(f'{name}_1', f'{name}_2') for name in ('I', 'l', 'mu', 'N', 'c')] + [
    ('eta_1G', 'eta_2G'), ('n_F1', 'n_F2'), ('c_f1', 'c_f2'), ('R_F1', 'R_F2')]


def _exchanged(p, more=()):
    pairs = PAIRS + [*more]
    return {a: getattr(p, b) for a, b in pairs} | {b: getattr(p, a) for a, b in pairs}


def mirrored_self_locking(p):
    """Return the self-locking differential with front and rear exchanged."""
    # g_2s is the satellite radius over the rear crown radius, and the rear is now the front
    return dataclasses.replace(p, **_exchanged(p, [('R_1', 'R_2')]), g_2s=p.g_2s * p.R_2 / p.R_1)


def symmetric_speeds(p, w_1, w_2):
    """Return (omega_0, omega_1, omega_2, omega_3, omega_s), (5)-(7)."""
    w_0 = (w_1 + w_2) / 2
    return np.array([w_0, w_1, w_2, p.g_F * w_0, (w_2 - w_1) / (2 * p.g_2s)])


def self_locking_speeds(p, w_1, w_2):
    """Return (omega_0, omega_1, omega_2, omega_s), (53)."""
    g = p.R_2 / p.R_1
    return np.array([(w_1 + g * w_2) / (1 + g), w_1, w_2, (w_2 - w_1) / (p.g_2s * (1 + g))])


def _weighted_squares(weights, speeds):
    return 0.5 * sum(c * w**2 for c, w in zip(weights, speeds, strict=True))


def symmetric_energy(p, w_1, w_2):
    """Return the kinetic energy of carrier, side gears, pinion and spinning satellites, J."""
    return _weighted_squares([p.I_0, p.I_1, p.I_2, p.I_3, p.n_s * p.I_s],
                             symmetric_speeds(p, w_1, w_2))


def symmetric_dissipation(p, w_1, w_2):
    """Return Rayleigh's function of the viscous drag, half the lost power, W."""
    w_0, w_1, w_2, w_3, w_s = symmetric_speeds(p, w_1, w_2)
    return _weighted_squares([p.l_0, p.l_1, p.l_2, p.l_3, p.n_s * p.l_s],
                             [w_0, w_1 - w_0, w_2 - w_0, w_3, w_s])


def self_locking_energy(p, w_1, w_2):
    """Return the kinetic energy of carrier, crown gears and spinning satellites, J."""
    return _weighted_squares([p.I_0, p.I_1, p.I_2, p.n_s * p.I_s],
                             self_locking_speeds(p, w_1, w_2))


def self_locking_dissipation(p, w_1, w_2):
    """Return Rayleigh's function of the viscous drag, half the lost power, W."""
    w_0, w_1, w_2, w_s = self_locking_speeds(p, w_1, w_2)
    return _weighted_squares([p.l_0, p.l_1, p.l_2, p.n_s * p.l_s],
                             [w_0, w_1 - w_0, w_2 - w_0, w_s])


def form(quadratic, p):
    """Return the matrix of a quadratic form, 1/2 w' H w = quadratic(p, *w), by polarization."""
    a, b, both = (quadratic(p, *w) for w in ((1, 0), (0, 1), (1, 1)))
    return np.array([[2 * a, both - a - b], [both - a - b, 2 * b]])


def lagrange(p, energy, dissipation, power, w):
    """
    Return (e_1, e_2) of a lossless differential from Lagrange's equations.

    d/dt dT/dw = Q - dD/dw with the kinetic energy T, Rayleigh's function D and the generalized
    torques Q, which do the virtual work ``power(w_1, w_2)``, linear in the speeds.
    """
    Q = np.array([power(1.0, 0.0), power(0.0, 1.0)])
    return np.linalg.solve(form(energy, p), Q - form(dissipation, p) @ w)


def symmetric_lagrange(p, w, T, F=(0.0, 0.0)):
    """Return (e_1, e_2) of the lossless symmetric one under T = (T_1, T_2, T_3) and F."""
    def power(w_1, w_2):
        w_0, w_1, w_2, w_3, _ = symmetric_speeds(p, w_1, w_2)
        return (T[0] * w_1 + T[1] * w_2 + T[2] * w_3
                - F[0] * (w_1 - w_0) - F[1] * (w_2 - w_0))
    return lagrange(p, symmetric_energy, symmetric_dissipation, power, w)


def self_locking_lagrange(p, w, T, F):
    """Return (e_1, e_2) of the lossless self-locking one under T = (T_0, T_1, T_2) and F."""
    def power(w_1, w_2):
        w_0, w_1, w_2, _ = self_locking_speeds(p, w_1, w_2)
        return (T[0] * w_0 + T[1] * w_1 + T[2] * w_2
                - F[0] * (w_1 - w_0) - F[1] * (w_2 - w_0))
    return lagrange(p, self_locking_energy, self_locking_dissipation, power, w)


def relative_difference(a, b):
    """Return the largest difference of two arrays over the largest entry."""
    a, b = np.asarray(a), np.asarray(b)
    return np.abs(a - b).max() / max(np.abs(a).max(), np.abs(b).max())
