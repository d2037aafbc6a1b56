# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of a driveline: vehicle, tyres, brakes, elastic shafts, differentials, step.

All quantities are SI. No value of a vehicle is from the paper; all of them are assumed.
"""

from dataclasses import dataclass
from typing import NamedTuple

from dm_ros.mechanism.parameters import (
    inertia,
    Parameters,
    row,
    SymmetricParameters,
)

ASSUMED = '(assumed)'
PREFIX = 'driveline'
DAMPING_LIMIT = 0.75   # of tyre.damping tyre.low_speed: with more a force could exceed mu F_z


@dataclass(frozen=True)
class VehicleParameters(Parameters):
    """
    Body, wheels, tyres, brakes and what turns before the input shaft.

    :raises ValueError: names the parameter, its value and what is allowed; also where damping
        would make a tyre or a brake stronger than its friction.
    """

    prefix = PREFIX

    m: float = row('mass', 1600.0, 'kg', 0.0, 1e6, f'of the vehicle {ASSUMED}', above_low=True)
    I_z: float = row('yaw_inertia', 2500.0, 'kg m^2', 0.0, 1e8,
                     f'of the vehicle about its centre of mass {ASSUMED}', above_low=True)
    a: float = row('front_distance', 1.25, 'm', 0.0, 100.0,
                   f'from the centre of mass forward to the front axle {ASSUMED}', above_low=True)
    b: float = row('rear_distance', 1.40, 'm', 0.0, 100.0,
                   f'from the centre of mass back to the rear axle {ASSUMED}', above_low=True)
    track: float = row('track', 1.55, 'm', 0.0, 100.0,
                       f'between the left and the right wheels {ASSUMED}', above_low=True)
    h: float = row('height', 0.55, 'm', 0.0, 100.0,
                   f'of the centre of mass above the ground {ASSUMED}')
    load_time: float = row('load_time', 0.05, 's', 1e-4, 1e2,
                           f'time constant of the load transfer {ASSUMED}')
    roll_share: float = row('roll_share', 0.55, '1', 0.0, 1.0,
                            f'of the lateral load transfer, that of the front axle {ASSUMED}')
    drag_area: float = row('drag_area', 0.70, 'm^2', 0.0, 1e3,
                           f'drag coefficient times frontal area {ASSUMED}')
    air: float = row('air', 1.2, 'kg/m^3', 0.0, 1e2, f'density of the air {ASSUMED}')
    I_in: float = row('input_inertia', 1.8, 'kg m^2', 0.0, 1e6,
                      'before the input shaft: an engine of 0.15 kg m^2 behind a gear of 3.5 '
                      f'{ASSUMED}', above_low=True)
    R: float = row('wheel_radius', 0.32, 'm', 0.0, 10.0, f'radius of the wheels {ASSUMED}',
                   above_low=True)
    I_w: float = row('wheel_inertia', 1.0, 'kg m^2', 0.0, 1e6, f'of each wheel {ASSUMED}',
                     above_low=True)
    C_rr: float = row('rolling_resistance', 0.012, '1', 0.0, 1.0,
                      f'its force over the wheel load {ASSUMED}')
    K_x: float = row('tyre.stiffness', 20.0, '1', 0.0, 1e4,
                     f'longitudinal: force per slip and per load {ASSUMED}', above_low=True)
    K_y: float = row('tyre.cornering_stiffness', 12.0, '1', 0.0, 1e4,
                     f'lateral: force per slip and per load {ASSUMED}', above_low=True)
    ell: float = row('tyre.deflection_length', 0.02, 'm', 0.0, 1.0,
                     'of the carcass under its load; times a stiffness it is a relaxation length '
                     f'{ASSUMED}', above_low=True)
    C: float = row('tyre.shape', 1.4, '1', 0.1, 2.0, f'factor of the magic formula {ASSUMED}')
    k_mu: float = row('tyre.load_sensitivity', 0.10, '1', 0.0, 1.0,
                      'share by which the grip falls where the load is twice the reference '
                      f'{ASSUMED}')
    load_0: float = row('tyre.load_reference', 3900.0, 'N', 0.0, 1e7,
                        f'wheel load at which a tyre has the grip of the road {ASSUMED}',
                        above_low=True)
    c_d: float = row('tyre.damping', 2.0, 's/m', 0.0, 1e3,
                     f'of the carcass at low speed, over the grip {ASSUMED}')
    v_low: float = row('tyre.low_speed', 0.25, 'm/s', 0.0, 1e2,
                       f'speed at which a quarter of this damping is left {ASSUMED}',
                       above_low=True)
    pad: float = row('brake.pad_twist', 0.004, 'rad', 0.0, 1.0,
                     f'of the wheel against the caliper at full moment {ASSUMED}', above_low=True)
    c_b: float = row('brake.damping', 4.0, 's/rad', 0.0, 1e3,
                     f'of the pads at low speed, over the capacity {ASSUMED}')
    w_low: float = row('brake.low_speed', 0.25, 'rad/s', 0.0, 1e2,
                       f'speed at which half of this damping is left {ASSUMED}', above_low=True)

    @property
    def L(self):
        """Wheelbase, m."""
        return self.a + self.b

    def _check_mechanism(self):
        for product, limit, name in (
                (self.c_d * self.v_low, DAMPING_LIMIT, 'tyre'),
                (self.c_b * self.w_low, 1.0, 'brake')):
            if product > limit:
                raise ValueError(
                    f'{self.prefix}.{name}.damping: damping times low_speed is {product:.4g}, it '
                    f'must not be above {limit:g}, where the {name} would exceed its friction')


@dataclass(frozen=True)
class ShaftParameters(Parameters):
    """
    One kind of elastic shafts.

    :raises ValueError: names the parameter, its value and what is allowed.
    """

    stiffness: float = row('stiffness', 1e4, 'N m/rad', 0.0, 1e9, f'of the shaft {ASSUMED}',
                           above_low=True)
    damping: float = row('damping', 25.0, 'N m s/rad', 0.0, 1e6, f'of the shaft {ASSUMED}')
    gap: float = row('gap', 0.0, 'rad', 0.0, 1.0, f'full backlash; 0 for none {ASSUMED}')


class Shaft(NamedTuple):
    """One kind of elastic shafts: the defaults of the parameters ``driveline.shaft.<name>.*``."""

    name: str
    stiffness: float   # N m/rad
    damping: float     # N m s/rad
    gap: float = 0.0   # rad


@dataclass(frozen=True)
class StepParameters(Parameters):
    """
    How the ticks are made.

    :raises ValueError: names the parameter, its value and what is allowed.
    """

    prefix = PREFIX

    max_parts: int = row('max_parts', 4, '1', 1, 1024,
                         'equal parts into which a tick may be cut for accuracy', kind=int)
    jacobian_ticks: int = row('jacobian_ticks', 0, '1', 0, 1000,
                              'ticks that one Jacobian serves; 0: each part has its own', kind=int)
    tolerance: float = row('tolerance', 2e-3, '1', 1e-12, 1.0,
                           'error of a part, over 1 rad/s, 0.01 rad of twist, 0.1 of slip, '
                           '0.3 m/s of the body, 1 of a pad and 1 m/s^2')


@dataclass(frozen=True)
class AxleParameters(SymmetricParameters):
    """
    A differential in an axle: Table 1, with a joint at each side gear and a flange at the pinion.

    :raises ValueError: as ``SymmetricParameters``.
    """

    I_1: float = inertia('left', 4.18e-3)      # 1.8e-4 of Table 1, 4e-3 of the joint (assumed)
    I_2: float = inertia('right', 4.18e-3)
    I_3: float = inertia('pinion', 5.156e-3)   # 1.56e-4 of Table 1, 5e-3 of the flange (assumed)

    def _check_mechanism(self):
        if self.g_F == 0.0:
            raise ValueError(f'{self.prefix}.final_drive_ratio: 0.0 is not allowed, it must not '
                             'be 0')
        super()._check_mechanism()


def below(kind, name):
    """Return a table of parameters, a class, whose names stand below ``driveline.<name>``."""
    return type(kind.__name__, (kind,), {'prefix': f'{PREFIX}.{name}'})
