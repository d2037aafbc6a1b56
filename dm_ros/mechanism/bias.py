# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Torque bias: how far the clutches of a self-locking differential shift torque, in closed form.

At full slip tanh is 1, and (59), (60), without acceleration and viscous drag, are linear. With
sigma_k = +1 where shaft k outruns the carrier and -1 where it lags, x_k = tan(alpha) f_k and the
preload friction S_k = n_s N_k R_k f_k::

    clutch:   F_k = sigma_k (x_k |M_k| + S_k)
    direct:   M_2 = g_12 M_1,   eta_0B T_0 = sum(M_k - F_k),   -T_k = eta_kG M_k - F_k
    reverse:  eta_2G M_2 = g_12 eta_1G M_1,   -T_0 = sum(eta_0B eta_kG M_k + F_k),
              T_k = M_k + F_k

An actuator's force A_k adds f_k R_k A_k to S_k; in reverse flow, where the shafts drive, x_k is
scaled by the coast factor. With both values of sigma this gives the limits of the split; all
splits between them are held by friction, with the shafts locked.
"""

import math
from typing import NamedTuple

from dm_ros.mechanism.clutched import actuated, full_friction, proportional_friction
from dm_ros.mechanism.power_flow import DIRECT


class Split(NamedTuple):
    """Torque between the carrier and the output shafts, N m or shares of what both get."""

    front: float
    rear: float

    @property
    def share(self):
        """The two as shares of their sum; one may be negative where preload turns it round."""
        return Split(self.front / (self.front + self.rear), self.rear / (self.front + self.rear))


class Bias(NamedTuple):
    """The limits of the split: driven by the carrier, the shaft that lags gets most."""

    front_lagging: Split
    rear_lagging: Split


def torque_bias(p, torque=math.inf, direction=DIRECT, forces=(0.0, 0.0)):
    """
    Return the ``Bias`` of a self-locking differential.

    :param p: ``SelfLockingParameters``.
    :param torque: magnitude of the torque on the carrier, N m, above 0; infinite for the limit
        of a torque beside which the preload is nothing; the split is that of 1 N m then.
    :param direction: +1 for what a driving carrier gives to the shafts, -1 for what driving
        shafts give to a braking carrier.
    :param forces: axial forces of the actuators on both clutches, N.
    :raises ValueError: where the torque cannot turn the shafts against preload and forces.
    """
    if not torque > 0.0:
        raise ValueError(f'torque: {torque!r} is not allowed, it must be above 0 N m')
    return Bias(_split(p, torque, direction, forces, (-1, 1)),
                _split(p, torque, direction, forces, (1, -1)))


def _split(p, torque, direction, forces, sigma):
    preload = actuated(p, full_friction(p)[1], forces)
    if math.isinf(torque):
        torque, preload = 1.0, (0.0, 0.0)
    eta, g = (p.eta_1G, p.eta_2G), (1.0, p.g_12)   # M_k = g_k M_1
    if direction != DIRECT:
        g = 1.0, p.g_12 * p.eta_1G / p.eta_2G
    moving = sum(s * S_k for s, S_k in zip(sigma, preload))
    rest = p.eta_0B * torque + moving if direction == DIRECT else torque - moving
    driving, coasting = proportional_friction(p)
    x = driving if rest * direction > 0.0 else coasting
    if direction == DIRECT:
        gear = sum(g_k * (1 - s * x_k * math.copysign(1, rest))
                   for g_k, s, x_k in zip(g, sigma, x))
    else:
        gear = sum(g_k * (p.eta_0B * eta_k + s * x_k * math.copysign(1, rest))
                   for g_k, s, x_k, eta_k in zip(g, sigma, x, eta))
    M = [g_k * rest / gear for g_k in g]
    F = [s * (x_k * abs(M_k) + S_k) for s, x_k, M_k, S_k in zip(sigma, x, M, preload)]
    split = (Split(*(eta_k * M_k - F_k for eta_k, M_k, F_k in zip(eta, M, F)))
             if direction == DIRECT else Split(*(M_k + F_k for M_k, F_k in zip(M, F))))
    if not split.front + split.rear > 0.0:
        raise ValueError(
            f'torque: {torque:g} N m does not turn the shafts against preload and forces')
    return split


class Friction(NamedTuple):
    """Friction of both clutches at full slip: x_k = tan(alpha) f_k, and its upper limit."""

    front: float
    rear: float
    front_limit: float
    rear_limit: float

    @property
    def admissible(self):
        """Whether neither is negative nor locks the mechanism by its own moments."""
        return 0.0 <= self.front < self.front_limit and 0.0 <= self.rear < self.rear_limit


def friction_for(p, front, rear):
    """
    Return the ``Friction`` with which a large driving torque splits to the given limits.

    :param p: ``SelfLockingParameters``, of which the clutches do not matter.
    :param front: largest share of the front, in (0, 1).
    :param rear: largest share of the rear; front + rear is above 1.
    :raises ValueError: for shares that are none, or leave nothing for friction.
    """
    if not (0.0 < front < 1.0 and 0.0 < rear < 1.0 and front + rear > 1.0):
        raise ValueError(f'shares: {front!r} to the front and {rear!r} to the rear are not '
                         'allowed, each must be in (0, 1) and their sum above 1')
    a, b = front / (1 - front), rear / (1 - rear)
    # eta_1G + x_1 = a g_12 (eta_2G - x_2) and g_12 (eta_2G + x_2) = b (eta_1G - x_1)
    return Friction((p.eta_1G * (a * b + 1) - 2 * a * p.g_12 * p.eta_2G) / (a * b - 1),
                    (p.eta_2G * (a * b + 1) - 2 * b * p.eta_1G / p.g_12) / (a * b - 1),
                    p.eta_1G * p.eta_0B, p.eta_2G * p.eta_0B)
