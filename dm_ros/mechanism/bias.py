# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Torque bias: how far the clutches of a differential shift torque, in closed form.

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

The symmetric differential has the same equations with g_12 = 1. T_0 is what the final drive gives
to its carrier then: g_F T_3 eta_3B eta_FG in direct flow, (40), and g_F T_3/(eta_3B eta_FG) in
reverse flow, (38)-(39).
"""

import math
from typing import NamedTuple

from dm_ros.mechanism.clutched import actuated, full_friction, proportional_friction
from dm_ros.mechanism.parameters import SymmetricParameters
from dm_ros.mechanism.power_flow import DIRECT


def _shares(split):
    """Return a split as shares of its sum; one may be negative where preload turns it round."""
    return type(split)(*(side / sum(split) for side in split))


class Split(NamedTuple):
    """Torque between the carrier and the output shafts, N m or shares of what both get."""

    front: float
    rear: float
    share = property(_shares)


class Bias(NamedTuple):
    """The limits of the split: driven by the carrier, the shaft that lags gets most."""

    front_lagging: Split
    rear_lagging: Split


class AxleSplit(NamedTuple):
    """The ``Split`` of a symmetric differential."""

    left: float
    right: float
    share = property(_shares)


class AxleBias(NamedTuple):
    """The ``Bias`` of a symmetric differential."""

    left_lagging: AxleSplit
    right_lagging: AxleSplit


def torque_bias(p, torque=math.inf, direction=DIRECT, forces=(0.0, 0.0)):
    """
    Return the limits of the split: ``Bias``, or ``AxleBias`` of a symmetric differential.

    :param p: ``SelfLockingParameters`` or ``SymmetricParameters``.
    :param torque: magnitude of the torque on the carrier, N m, above 0; infinite for the limit
        of a torque beside which the preload is nothing; the split is that of 1 N m then. On the
        carrier of a symmetric differential it is the torque of the pinion times the final drive
        ratio, less what pinion bearing and final drive lose.
    :param direction: +1 for what a driving carrier gives to the shafts, -1 for what driving
        shafts give to a braking carrier.
    :param forces: axial forces of the actuators on both clutches, N.
    :raises ValueError: where the torque cannot turn the shafts against preload and forces.
    """
    if not torque > 0.0:
        raise ValueError(f'torque: {torque!r} is not allowed, it must be above 0 N m')
    split, bias = _kinds(p)
    return bias(*(split(*_outputs(p, torque, direction, forces, sigma))
                  for sigma in ((-1, 1), (1, -1))))


def _kinds(p):
    """Return the types of split and limits that parameters have."""
    return (AxleSplit, AxleBias) if isinstance(p, SymmetricParameters) else (Split, Bias)


def _outputs(p, torque, direction, forces, sigma):
    friction = actuated(p, full_friction(p)[1], forces)
    if math.isinf(torque):
        torque, friction = 1.0, (0.0, 0.0)
    outputs = _linear(p, torque, direction, friction, sigma,
                      math.copysign(1, _rest(p, torque, direction, friction, sigma)))
    if not sum(outputs) > 0.0:
        raise ValueError(
            f'torque: {torque:g} N m does not turn the shafts against preload and forces')
    return outputs


def _rest(p, torque, direction, friction, sigma):
    """Return what is left for the gears, N m; below 0 the friction drives them."""
    moving = sum(s * S_k for s, S_k in zip(sigma, friction))
    return p.eta_0B * torque + moving if direction == DIRECT else torque - moving


def _linear(p, torque, direction, friction, sigma, sign=1):
    """
    Return what both shafts get, N m: linear in torque and friction together.

    :param friction: that does not follow M, N m.
    :param sign: +1 where M_k has the sign of the drive, else -1.
    """
    eta, g = (p.eta_1G, p.eta_2G), (1.0, p.g_12)   # M_k = g_k M_1
    driving, coasting = proportional_friction(p)
    x = [sign * s * x_k for s, x_k in
         zip(sigma, driving if sign * direction > 0 else coasting)]   # F_k = x_k M_k + s S_k
    rest = _rest(p, torque, direction, friction, sigma)
    if direction == DIRECT:
        M_1 = rest / sum(g_k * (1 - x_k) for g_k, x_k in zip(g, x))
    else:
        g = 1.0, p.g_12 * p.eta_1G / p.eta_2G
        M_1 = rest / sum(g_k * (p.eta_0B * eta_k + x_k) for g_k, x_k, eta_k in zip(g, x, eta))
    M = [g_k * M_1 for g_k in g]
    F = [x_k * M_k + s * S_k for s, x_k, M_k, S_k in zip(sigma, x, M, friction)]
    if direction == DIRECT:
        return [eta_k * M_k - F_k for eta_k, M_k, F_k in zip(eta, M, F)]
    return [M_k + F_k for M_k, F_k in zip(M, F)]


def forces_for(p, side, share, torque, direction=DIRECT, pressed=(1.0, 1.0)):
    """
    Return the axial forces on both clutches, N, with which a share can go to one side.

    :param p: ``SelfLockingParameters`` or ``SymmetricParameters``.
    :param side: name of the output shaft.
    :param share: of what both output shafts get, in [0, 1].
    :param torque: magnitude of the torque on the carrier, N m, as in ``torque_bias``, finite.
    :param direction: as in ``torque_bias``; -1 for the share that comes from that side.
    :param pressed: the proportion of both forces: (0.0, 1.0) presses the second clutch alone.
    :return: the smallest such forces, zeros where the clutches do it by themselves; None where
        no forces in this proportion do it: without friction, or where the share tends to less as
        they grow. The limits of the actuators do not count.
    :raises ValueError: for another side or share, or as ``torque_bias``.
    """
    sides = p.shafts
    if side not in sides:
        raise ValueError(f'side: {side!r} is not one of {", ".join(sides)}')
    if not 0.0 <= share <= 1.0:
        raise ValueError(f'share: {share!r} is not allowed, it must be in [0, 1]')
    if not 0.0 < torque < math.inf:
        raise ValueError(f'torque: {torque!r} is not allowed, it must be a number of N m above 0')
    index = sides.index(side)
    low, high = sorted(split.share[index] for split in torque_bias(p, torque, direction))
    if low <= share <= high:
        return 0.0, 0.0
    if share < low:   # more to the other side
        index, share = 1 - index, 1 - share
    sigma = [direction, direction]
    sigma[index] = -direction   # the shaft that lags gets most, and gives least
    # with shares in [0, 1] M has the sign of the drive, so the outputs are linear in the force
    plain = _linear(p, torque, direction, full_friction(p)[1], sigma)
    more = _linear(p, 0.0, direction, actuated(p, (0.0, 0.0), pressed), sigma)
    gain = more[index] - share * sum(more)
    if not gain > 0.0:
        return None
    force = (share * sum(plain) - plain[index]) / gain
    if not sum(plain) + force * sum(more) > 0.0:
        return None
    return force * pressed[0], force * pressed[1]


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
