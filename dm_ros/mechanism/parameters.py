# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The parameters of the two mechanisms: frozen, validated values.

Each class is a table, one row a parameter: the field is the symbol of the paper, the row
gives the public name, the default (Tables 1 and 2 of the paper), the unit, the range and
a description. Everything that speaks of parameters reads these rows: the equations use the
symbols; the node, the parameter files and the messages of errors use the names.

All quantities are SI: rad, rad/s, N m, kg m^2, N m s/rad.
"""

from dataclasses import dataclass, field, fields
import math
import re
from typing import NamedTuple

ASSUMED = 'assumed: the paper gives no value'


class Row(NamedTuple):
    """What is known of one parameter besides its symbol and its value."""

    name: str          # below the prefix of the mechanism
    unit: str          # '1' for a ratio
    low: float
    high: float
    description: str
    kind: type = float
    above_low: bool = False   # the low end itself is not allowed
    choices: tuple = ()       # of a str
    pattern: tuple = ()       # of a str without choices: a regular expression, and it in words
    read_only: bool = False   # of the node: not to be changed while it runs

    @property
    def allowed(self):
        """Return what is allowed in words, such as ``in (0, 1]``."""
        if self.kind is str:
            return self.pattern[1] if self.pattern else f'one of {", ".join(self.choices)}'
        if self.kind is bool:
            return 'true or false'
        number = 'an integer in ' if self.kind is int else 'in '
        return f'{number}{"(" if self.above_low else "["}{self.low:g}, {self.high:g}]'

    def checked(self, full_name, value):
        """Return ``value`` as the kind of this row; raise ValueError where it is not allowed."""
        if self._fits(value):
            return self.kind(value)
        raise ValueError(f'{full_name}: {value!r} is not allowed, it must be {self.allowed}')

    def strictly_checked(self, full_name, value):
        """Return ``value`` as ``checked`` does, with the types of ROS 2: 5 is not a double."""
        if type(value) is not self.kind:
            words = {float: 'a double, such as 5.0', int: 'an integer', bool: 'a boolean',
                     str: 'a string'}
            raise ValueError(f'{full_name}: {value!r} is not allowed, it must be '
                             f'{words[self.kind]}')
        return self.checked(full_name, value)

    def _fits(self, value):
        if self.kind is str:
            if self.pattern:
                return isinstance(value, str) and re.fullmatch(self.pattern[0], value) is not None
            return value in self.choices
        if self.kind is bool or isinstance(value, (bool, str)):
            return type(value) is self.kind
        try:
            exact = self.kind(value)
            return (exact == value and self.low <= exact <= self.high
                    and not (self.above_low and exact == self.low))
        except (TypeError, ValueError, OverflowError):
            return False


def row(name, default, unit, low, high, description, **more):
    """Return a dataclass field with its ``Row``, whose members are named there."""
    return field(default=default,
                 metadata={'row': Row(name, unit, low, high, description, **more)})


def inertia(shaft, default):
    return row(f'inertia.{shaft}', default, 'kg m^2', 0.0, 1e6,
               f'moment of inertia of the {in_words(shaft)}', above_low=True)


def viscosity(shaft, default, against):
    return row(f'viscosity.{shaft}', default, 'N m s/rad', 0.0, 1e6,
               f'viscous drag of the {in_words(shaft)} against the {against}')


def in_words(shaft):
    return f'{shaft} shaft' if shaft in ('left', 'right', 'front', 'rear') else shaft


def efficiency(part, default):
    return row(f'efficiency.{part}', default, '1', 0.0, 1.0,
               f'efficiency of the {part.replace("_", " ")}', above_low=True)


def mesh_sign_speed():
    return row('mesh_sign_speed', 0.02, 'rad/s', 1e-3, 1e2,
               'passive law: speed of a shaft at which its mesh takes three quarters of its loss')


def pressure_angle(source=''):
    return row('pressure_angle', math.radians(20.0), 'rad', 0.0, 1.5,
               f'gearing angle; 0 takes away the load-proportional friction{source}')


def satellite_count(default):
    return row('satellite_count', default, '1', 1, 64, 'number of satellites', kind=int)


class Parameters:
    """What all tables of parameters have in common: names, checks, changes."""

    prefix = ''

    def __post_init__(self):
        for symbol, (name, entry) in self.rows().items():
            object.__setattr__(self, symbol, entry.checked(name, getattr(self, symbol)))
        self._check_mechanism()

    @classmethod
    def rows(cls):
        """Return ``{symbol: (full name, Row)}`` in the order of the table."""
        prefix = f'{cls.prefix}.' if cls.prefix else ''
        return {f.name: (prefix + f.metadata['row'].name, f.metadata['row'])
                for f in fields(cls)}

    @classmethod
    def part_of(cls, values):
        """Return those of the values, by full name, that belong to this table."""
        names = {name for name, _ in cls.rows().values()}
        return {name: value for name, value in values.items() if name in names}

    def named(self):
        """Return ``{full name: value}``, such as ``{'symmetric.inertia.left': 1.8e-4, ...}``."""
        return {name: getattr(self, symbol) for symbol, (name, _) in self.rows().items()}

    def changed(self, values):
        """
        Return parameters with the given values, by full name, in place of these.

        :param values: mapping from full name to value, all or none of it is taken.
        :raises ValueError: names the parameter, its value and what is allowed.
        """
        symbols = {name: symbol for symbol, (name, _) in self.rows().items()}
        unknown = [name for name in values if name not in symbols]
        if unknown:
            among = f' among {self.prefix}.*' if self.prefix else ''
            raise ValueError(f'{unknown[0]}: there is no such parameter{among}')
        mine = {symbol: getattr(self, symbol) for symbol in symbols.values()}
        return type(self)(**{**mine, **{symbols[name]: v for name, v in values.items()}})

    def _check_mechanism(self):
        """Refuse values that are each allowed but make an impossible mechanism."""


def clutch(shaft, symbol):
    """Return the row of one clutch parameter, given by its symbol without the shaft number."""
    surfaces, radius, preload = {'front': (1, 0.040, 100.0), 'rear': (9, 0.060, 100.0),
                                 'left': (0, 0.050, 0.0), 'right': (0, 0.050, 0.0)}[shaft]
    name, source = f'clutch.{shaft}', '' if shaft in ('front', 'rear') else f' ({ASSUMED})'
    return {
        'n_F': row(f'{name}.friction_surfaces', surfaces, '1', 0, 1000,
                   f'number of friction surfaces of the {shaft} clutch', kind=int),
        'mu': row(f'{name}.friction_coefficient', 0.15, '1', 0.0, 10.0,
                  f'friction coefficient of the {shaft} clutch{source}'),
        'c_f': row(f'{name}.slip_steepness', 4.0, 's/rad', 0.0, 1e4,
                   f'steepness of the {shaft} clutch friction over slip, tanh(c_f slip){source}'),
        'R_F': row(f'{name}.radius', radius, 'm', 0.0, 10.0,
                   f'mean friction radius of the {shaft} clutch ({ASSUMED})', above_low=True),
        'N': row(f'{name}.preload', preload, 'N', 0.0, 1e6,
                 f'axial preload of the {shaft} clutch, for each satellite ({ASSUMED})'),
        'c': row(f'{name}.coast_factor', 1.0, '1', 0.0, 1.0,
                 f'share of its load-proportional friction that the {shaft} clutch has while the '
                 'shaft drives; 1: a 2-way, 0: a 1-way differential'),
        'tau': row(f'{name}.actuator_time_constant', 0.0, 's', 0.0, 1e3,
                   f'lag of the force on the {shaft} clutch; 0 for none'),
        'A': row(f'{name}.actuator_limit', 1e6, 'N', 0.0, 1e9,
                 f'a larger force on the {shaft} clutch is clamped to this'),
    }[symbol]


class ClutchedParameters(Parameters):
    """What both mechanisms have in common: clutches between the crown gears and the carrier."""

    shafts = ()   # names of the shafts with a clutch

    @property
    def f(self):
        """Friction factors f_k of (55) at full slip, as a pair."""
        return (self.n_F1 * self.mu_1 * self.R_F1 / self.R_1,
                self.n_F2 * self.mu_2 * self.R_F2 / self.R_2)

    def _check_mechanism(self):
        """
        Refuse clutches that lock the mechanism by its own gear moments.

        With signed factors x_k = +-tan(alpha) f_k the moments M solve (I + W diag(x)) M = r.
        For every inertia and both directions of flow the determinant stays positive, so that
        exactly one sign pattern of M is a solution, while |x_k| < eta_kG eta_0B: the
        homogeneous carrier equation then asks for M_1 and M_2 of opposite signs and the
        homogeneous satellite equation for equal ones. At the limit an inertia-free mechanism
        locks in reverse flow.
        """
        for shaft, f, eta in zip(self.shafts, self.f, (self.eta_1G, self.eta_2G)):
            gain, limit = math.tan(self.alpha) * f, eta * self.eta_0B
            if gain and not gain < limit:
                raise ValueError(
                    f'{self.prefix}.clutch.{shaft}: the clutch locks itself, tan(pressure_angle) '
                    f'friction_surfaces friction_coefficient radius/{self.gear_radius} = '
                    f'{gain:.4g} must be below {shaft}_mesh carrier_bearing efficiency = '
                    f'{limit:.4g}')


@dataclass(frozen=True)
class SymmetricParameters(ClutchedParameters):
    """
    The symmetric differential with final drive; the defaults are those of Table 1.

    Clutches between the side gears and the carrier, which the paper does not have, come with
    their friction surfaces.

    :raises ValueError: names the parameter, its value and what is allowed; also for clutches
        so strong that the mechanism locks itself.
    """

    prefix = 'symmetric'
    shafts = ('left', 'right')
    gear_radius = 'side_gear_radius'

    g_F: float = row('final_drive_ratio', 3.517, '1', -1e3, 1e3,
                     'pinion speed over carrier speed, not 0; '
                     'negative when the ring gear sits on the other side')
    g_2s: float = row('satellite_ratio', 0.5, '1', 1e-3, 1e3,
                      'satellite radius over side gear radius')
    n_s: int = satellite_count(2)
    I_0: float = inertia('carrier', 0.1)
    I_1: float = inertia('left', 1.8e-4)
    I_2: float = inertia('right', 1.8e-4)
    I_3: float = inertia('pinion', 1.56e-4)
    I_s: float = inertia('satellite', 4.0e-5)
    l_0: float = viscosity('carrier', 5e-3, 'housing')
    l_1: float = viscosity('left', 1e-3, 'carrier')
    l_2: float = viscosity('right', 1e-3, 'carrier')
    l_3: float = viscosity('pinion', 1e-3, 'housing')
    l_s: float = viscosity('satellite', 1e-3, 'carrier')
    eta_3B: float = efficiency('pinion_bearing', 0.995)
    eta_FG: float = efficiency('final_drive', 0.975)
    eta_0B: float = efficiency('carrier_bearing', 0.995)
    eta_1G: float = efficiency('left_mesh', 0.99)
    eta_2G: float = efficiency('right_mesh', 0.99)
    sign_speed: float = mesh_sign_speed()
    alpha: float = pressure_angle(f' ({ASSUMED})')
    R: float = row('side_gear_radius', 0.03, 'm', 0.0, 10.0,
                   f'radius of the side gears ({ASSUMED}); it counts where there are clutches',
                   above_low=True)
    n_F1: int = clutch('left', 'n_F')
    n_F2: int = clutch('right', 'n_F')
    mu_1: float = clutch('left', 'mu')
    mu_2: float = clutch('right', 'mu')
    c_f1: float = clutch('left', 'c_f')
    c_f2: float = clutch('right', 'c_f')
    R_F1: float = clutch('left', 'R_F')
    R_F2: float = clutch('right', 'R_F')
    N_1: float = clutch('left', 'N')
    N_2: float = clutch('right', 'N')
    c_1: float = clutch('left', 'c')
    c_2: float = clutch('right', 'c')
    tau_1: float = clutch('left', 'tau')
    tau_2: float = clutch('right', 'tau')
    A_1: float = clutch('left', 'A')
    A_2: float = clutch('right', 'A')

    g_12 = 1.0   # ratio between the output shafts at stopped carrier

    @property
    def R_1(self):
        """Radius of the left side gear, m."""
        return self.R

    @property
    def R_2(self):
        """Radius of the right side gear, m."""
        return self.R

    @property
    def has_clutches(self):
        """Whether there are clutches: whether any surface rubs."""
        return self.n_F1 > 0 or self.n_F2 > 0

    @property
    def rated_efficiency(self):
        """Efficiency (37), with its erratum: eta_2G beside eta_1G, not eta_1G twice."""
        return self.eta_3B * self.eta_FG * self.eta_0B * (self.eta_1G + self.eta_2G) / 2

    def _check_mechanism(self):
        if self.g_F == 0.0:
            raise ValueError('symmetric.final_drive_ratio: 0.0 is not allowed, it must not be 0')
        super()._check_mechanism()


def crown_radius(shaft, default):
    return row(f'crown_radius.{shaft}', default, 'm', 0.0, 10.0,
               f'radius of the {shaft} crown gear ({ASSUMED})', above_low=True)


@dataclass(frozen=True)
class SelfLockingParameters(ClutchedParameters):
    """
    The asymmetric self-locking differential; the defaults are those of Table 2.

    The crown radii, the friction radii and the preloads are assumed: the paper names none.

    :raises ValueError: names the parameter, its value and what is allowed; also for clutches
        so strong that the mechanism locks itself.
    """

    prefix = 'lsd'
    shafts = ('front', 'rear')
    gear_radius = 'crown_radius'

    R_1: float = crown_radius('front', 0.040)
    R_2: float = crown_radius('rear', 0.060)
    g_2s: float = row('satellite_ratio', 10 / 24, '1', 1e-3, 1e3,
                      'satellite radius over rear crown gear radius')
    n_s: int = satellite_count(4)
    I_0: float = inertia('carrier', 2.9e-2)
    I_1: float = inertia('front', 4.8e-3)
    I_2: float = inertia('rear', 5.8e-3)
    I_s: float = inertia('satellite', 6.0e-3)
    l_0: float = viscosity('carrier', 5e-3, 'housing')
    l_1: float = viscosity('front', 1e-3, 'carrier')
    l_2: float = viscosity('rear', 1e-3, 'carrier')
    l_s: float = viscosity('satellite', 1e-3, 'carrier')
    eta_0B: float = efficiency('carrier_bearing', 0.995)
    eta_1G: float = efficiency('front_mesh', 0.99)
    eta_2G: float = efficiency('rear_mesh', 0.99)
    sign_speed: float = mesh_sign_speed()
    alpha: float = pressure_angle()
    n_F1: int = clutch('front', 'n_F')
    n_F2: int = clutch('rear', 'n_F')
    mu_1: float = clutch('front', 'mu')
    mu_2: float = clutch('rear', 'mu')
    c_f1: float = clutch('front', 'c_f')
    c_f2: float = clutch('rear', 'c_f')
    R_F1: float = clutch('front', 'R_F')
    R_F2: float = clutch('rear', 'R_F')
    N_1: float = clutch('front', 'N')
    N_2: float = clutch('rear', 'N')
    c_1: float = clutch('front', 'c')
    c_2: float = clutch('rear', 'c')
    tau_1: float = clutch('front', 'tau')
    tau_2: float = clutch('rear', 'tau')
    A_1: float = clutch('front', 'A')
    A_2: float = clutch('rear', 'A')

    has_clutches = True

    @property
    def g_12(self):
        """Ratio between the output shafts at stopped carrier, R_2/R_1."""
        return self.R_2 / self.R_1

    @property
    def rated_efficiency(self):
        """Efficiency as (37), without final drive; the gears weigh by their torque, 1 : g_12."""
        return self.eta_0B * (self.eta_1G + self.g_12 * self.eta_2G) / (1 + self.g_12)
