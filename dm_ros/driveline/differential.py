# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A differential as an element of a driveline: the passive law between three flanges."""

from dataclasses import astuple
from functools import partial
from operator import itemgetter
import struct
from types import SimpleNamespace

from dm_ros import core
from dm_ros.mechanism import clutched, elimination, passive
from dm_ros.mechanism.kinetic import kinetic_form
from dm_ros.mechanism.parameters import SymmetricParameters
from dm_ros.mechanism.variants import equipped, SELF_LOCKING, SYMMETRIC
from dm_ros.motion.actuators import actuators_of
from dm_ros.motion.models import no_solution


def in_python(k):
    """Return functions of (u, w, s, point) at a state: the point, its slopes, what is lost."""
    def slopes(u, w, s, point):
        return passive.jacobian(k, u, point)[0], *passive.torque_slopes(k, u, point)
    return (partial(passive.evaluate, k), slopes,
            lambda u, w, s, point: passive.lost_powers(k, u, point))


def in_c(k):
    """Return the same in C, to the same bits; it takes less time to find a point anew there."""
    bytes_of_k = struct.pack(f'{len(astuple(k))}d', *astuple(k))
    return (partial(core.passive_point, bytes_of_k),
            lambda u, w, s, point: core.passive_slopes(bytes_of_k, u, w, s),
            lambda u, w, s, point: core.passive_lost(bytes_of_k, u, w, s))


class Differential:
    """
    One differential, with the law, the names and the signs that it has alone.

    Its state is (w, s), the speeds of the carrier and the slip of the outputs.

    :param name: before the names of its moments and clutches; shafts_name: before its shafts.
    :param p: its table of parameters; dt: length of a tick, s.
    :raises ValueError: for parameters whose equations have no finite solution.
    """

    def __init__(self, name, shafts_name, p, dt):
        self.name, self.parameters = name, p
        mechanism = self.mechanism = equipped(
            SYMMETRIC if isinstance(p, SymmetricParameters) else SELF_LOCKING, p)
        self.ports = mechanism.inputs
        self.shafts = tuple([f'{shafts_name}_{shaft}' for shaft in mechanism.shafts])
        self.shaft_of = {port: f'{shafts_name}_{port}' for port in self.ports}
        self.moments = tuple([f'{name}_{moment}' for moment in mechanism.moments])
        self.clutches = tuple([f'{name}_{clutch}' for clutch in mechanism.clutches])
        self.actuators = actuators_of(p, mechanism.clutches, dt)
        self.form = kinetic_form(p)
        k = self.k = passive.coefficients(p, bool(mechanism.clutches))
        if not (elimination.is_finite(p, k) and passive.has_solutions(k)):
            raise no_solution(p)
        self.evaluate, self.slopes, self._lost = (in_c if core.passive_point else in_python)(k)
        self.ratio = k.g_F or 1.0   # speed of the input shaft over that of the carrier
        self.k_1, self.k_2 = k.k_1, k.k_2
        self._spin = k.k_2 / p.g_2s
        self._preload = clutched.full_friction(p)[1] if mechanism.clutches else (0.0, 0.0)
        outputs, clutches = mechanism.outputs, mechanism.clutches
        losses = ('drag', 'final_drive', *[f'{output}_mesh' for output in outputs],
                  'pinion_bearing', 'carrier_bearing', *[f'{output}_clutch' for output in outputs])
        mine = [n for n in range(len(losses)) if (
            n in (0, 2, 3, 5) or (n in (1, 4) and k.g_F) or (n in (6, 7) and clutches))]
        self.losses = tuple([f'{name}_{losses[n]}' for n in mine])
        self._losses = itemgetter(*mine)

    def friction(self, forces):
        """Return (S_1, S_2), N m: friction at full slip of preload and axial forces, N."""
        if not any(forces):
            return self._preload
        return clutched.actuated(self.parameters, self._preload, forces)

    def port_rows(self):
        """Return what the speeds of the ``ports`` grow with, per w and per s."""
        return (self.ratio, 0.0), (1.0, self.k_1), (1.0, -self.k_2)

    def all_speeds(self, w, s):
        """Return the speeds of all ``shafts``, or their angles from the integrals."""
        spin = (0.0 - s) * self._spin
        if self.k.g_F:
            return w, w + self.k_1 * s, w - self.k_2 * s, self.k.g_F * w, spin
        return w, w + self.k_1 * s, w - self.k_2 * s, spin

    def lost_powers(self, u, w, s, point):
        """Return what each of ``losses`` takes, W, at a ``passive`` point under what is held."""
        return self._losses(self._lost(u, w, s, point))

    def internal_moments(self, point):
        """Return the ``moments``, N m."""
        _, _, F_1, F_2, M_1, M_2, M_F, *_ = point
        meshes = (M_F + 0.0, M_1 + 0.0, M_2 + 0.0) if self.k.g_F else (M_1 + 0.0, M_2 + 0.0)
        return (*meshes, F_1 + 0.0, F_2 + 0.0) if self.clutches else meshes

    def flanges(self, make):
        """Return what has the name of each port as an attribute, made of this name."""
        return SimpleNamespace(**{port: make(port) for port in self.ports})
