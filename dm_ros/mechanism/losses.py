# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What each element of a differential loses, under the paper's law: one formula an element.

The losses are what (38)-(40), (52), (59) and (60) take from the moments, times the speed of the
shaft, with the paper's symbols and its sign of M. All are linear in products of two of speed,
moment and torque. Given the products at an instant the formulas return powers, W; given their
integrals over a time, energies, J. A loss is negative where the moment at a mesh or a bearing
does not have the sign that fits the direction of power flow.

w is the speed of the carrier omega_0 and s the slip omega_1 - omega_2.
"""

from dataclasses import dataclass, replace

from dm_ros.mechanism.power_flow import DIRECT


def lost_in_bearing(eta):
    """Return the share of its load that a bearing of an efficiency loses."""
    return 1 / eta - 1


@dataclass(frozen=True, slots=True)
class SymmetricLosses:
    """The coefficients of ``symmetric``, for one flow of power."""

    drag_w: float      # of carrier and pinion against the housing, per w^2
    drag_s: float      # of side gears and satellites in the carrier, per s^2
    pinion_w: float    # drag of the pinion at its speed, per w^2
    carrier_w: float   # drag that reacts on the carrier, per w
    carrier_s: float
    mesh_F: float      # shares lost
    mesh_1: float
    mesh_2: float
    pinion_F: float    # what of its load the pinion bearing loses: of M_F, T_3 and drag
    pinion_T: float
    pinion_L: float
    carrier_1: float   # what of its load the carrier bearing loses: of M_1, M_2, M_F and drag
    carrier_2: float
    carrier_F: float
    carrier_L: float

    def of_reported(self, direction):
        """Return those for the moments as they are reported, in one sign for both directions."""
        return replace(self, **{name: direction * getattr(self, name) for name in (
            'mesh_F', 'mesh_1', 'mesh_2', 'pinion_F', 'carrier_1', 'carrier_2', 'carrier_F')})


def symmetric_losses(p, direction):
    """Return the ``SymmetricLosses`` of parameters."""
    direct, reverse = (1.0, 0.0) if direction == DIRECT else (0.0, 1.0)
    bearing_3, bearing_0 = lost_in_bearing(p.eta_3B), lost_in_bearing(p.eta_0B)
    return SymmetricLosses(
        *symmetric_drag(p), 1 - p.eta_FG, 1 - p.eta_1G, 1 - p.eta_2G,
        bearing_3 * direct, -bearing_3 * reverse, bearing_3,
        bearing_0 * direct, bearing_0 * direct, bearing_0 * reverse, bearing_0)


def symmetric_drag(p):
    """Return the first five of ``SymmetricLosses``."""
    g_3 = p.l_3 * p.g_F * p.g_F
    return (p.l_0 + g_3, (p.l_1 + p.l_2 + p.n_s * p.l_s / (p.g_2s * p.g_2s)) / 4, g_3, p.l_0,
            (p.l_1 - p.l_2) / 2)


def symmetric(k, ww, ws, ss, M_F_w, M_1_w1, M_2_w2, M_1_w, M_2_w, T_3_w3):
    """
    Return what drag, final drive, left and right mesh, pinion and carrier bearing lose.

    ``M_1_w1`` is the product of M_1 and omega_1, and so on.
    """
    return (k.drag_w * ww + k.drag_s * ss,
            k.mesh_F * M_F_w, k.mesh_1 * M_1_w1, k.mesh_2 * M_2_w2,
            k.pinion_L * k.pinion_w * ww + k.pinion_F * M_F_w + k.pinion_T * T_3_w3,
            k.carrier_L * (k.carrier_w * ww - k.carrier_s * ws)
            + k.carrier_1 * M_1_w + k.carrier_2 * M_2_w + k.carrier_F * M_F_w)


def symmetric_with_clutches(k, ww, ws, ss, F_1_w, F_1_s, F_2_w, F_2_s, M_F_w, M_1_w, M_1_s,
                            M_2_w, M_2_s, T_3_w3):
    """
    Return what ``symmetric`` does and what the left and the right clutch lose.

    ``F_1_w`` is the product of F_1 and w, and so on.
    """
    *others, carrier = symmetric(k, ww, ws, ss, M_F_w, M_1_w + M_1_s / 2, M_2_w - M_2_s / 2,
                                 M_1_w, M_2_w, T_3_w3)
    return (*others, carrier - k.carrier_L * (F_1_w + F_2_w), F_1_s / 2, -F_2_s / 2)


@dataclass(frozen=True, slots=True)
class SelfLockingLosses:
    """The coefficients of ``self_locking``, for one direction of power flow."""

    k_1: float         # omega_1 - omega_0 over the slip
    k_2: float         # omega_0 - omega_2 over the slip
    drag_w: float      # of the carrier against the housing, per w^2
    drag_s: float      # of crown gears and satellites in the carrier, per s^2
    carrier_s: float   # drag that reacts on the carrier, per s
    mesh_1: float      # shares lost
    mesh_2: float
    bearing_0: float
    direct: float      # 1 in direct flow, otherwise 0
    reverse: float


def self_locking_losses(p, direction):
    """Return the ``SelfLockingLosses`` of parameters."""
    direct = float(direction == DIRECT)
    k_1, k_2 = p.g_12 / (1 + p.g_12), 1 / (1 + p.g_12)
    return SelfLockingLosses(
        k_1, k_2, p.l_0,
        p.l_1 * k_1 * k_1 + p.l_2 * k_2 * k_2 + p.n_s * p.l_s * (k_2 / p.g_2s) * (k_2 / p.g_2s),
        p.l_1 * k_1 - p.l_2 * k_2, 1 - p.eta_1G, 1 - p.eta_2G, lost_in_bearing(p.eta_0B), direct,
        1.0 - direct)


def self_locking(k, ww, ws, ss, F_1_w, F_1_s, F_2_w, F_2_s, M_1_w, M_1_s, M_2_w, M_2_s, T_0_w):
    """
    Return what drag, front and rear mesh, carrier bearing, front and rear clutch lose.

    ``F_1_w`` is the product of F_1 and w, and so on.
    """
    return (k.drag_w * ww + k.drag_s * ss,
            k.mesh_1 * (M_1_w + k.k_1 * M_1_s), k.mesh_2 * (M_2_w - k.k_2 * M_2_s),
            k.bearing_0 * (k.drag_w * ww - k.carrier_s * ws - F_1_w - F_2_w
                           + k.direct * (M_1_w + M_2_w) - k.reverse * T_0_w),
            k.k_1 * F_1_s, -k.k_2 * F_2_s)
