# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A brake, with the rolling resistance of its wheel: Coulomb friction that deflects its pads first.

The state y is the deflection of the pads over ``pad``, in [-1, 1]; at rest it is a spring::

    dy/dt = (omega - alpha(y) |omega| y)/pad
    T = T_cap (y + c_b/(1 + (omega/w_low)^2) (1 - y^2) omega),    T_cap = brake + C_rr F_z R

with alpha = 0 while omega y <= 0 or abs(y) < 0.7, then z^2 (3 - 2 z), z = (abs(y) - 0.7)/0.3, and
1 from abs(y) = 1. T brakes the wheel. It stores T_cap pad y^2/2, and loses the damping and
T_cap alpha abs(omega) y^2.
"""

ELASTIC = 0.7   # |y| up to which the pads only deflect


def friction(pad, c_b, w_low, omega, y):
    """Return (T/T_cap, dy/dt) and what is lost over T_cap, rad/s."""
    slide, q = _slide(omega, y), omega / w_low
    viscous = c_b / (1.0 + q * q) * (1.0 - y * y) * omega
    rate = slide * abs(omega) * y
    return y + viscous, (omega - rate) / pad, rate * y + viscous * omega


def slopes(pad, c_b, w_low, omega, y):
    """Return what T/T_cap grows with per omega and per y, and what dy/dt grows with likewise."""
    slide, q = _slide(omega, y), omega / w_low
    z = min(1.0, (abs(y) - ELASTIC) / (1.0 - ELASTIC)) if slide else 0.0
    slide_y = 6.0 * z * (1.0 - z) / (1.0 - ELASTIC) * (1.0 if y > 0.0 else -1.0)
    fade, speed = 1.0 + q * q, abs(omega)
    return (c_b * (1.0 - y * y) * (1.0 - q * q) / (fade * fade),
            1.0 - 2.0 * c_b * y * omega / fade,
            (1.0 - slide * y * (1.0 if omega > 0.0 else -1.0)) / pad,
            -speed * (slide + slide_y * y) / pad)


def _slide(omega, y):
    """Return alpha."""
    if omega * y <= 0.0:
        return 0.0
    size = abs(y)
    if size < ELASTIC:
        return 0.0
    if size >= 1.0:
        return 1.0
    z = (size - ELASTIC) / (1.0 - ELASTIC)
    return z * z * (3.0 - 2.0 * z)
