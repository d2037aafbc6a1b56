# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The one registry: which mechanisms there are, and which variants of each."""

from typing import Callable, NamedTuple

from dm_ros.mechanism import loads, self_locking, symmetric
from dm_ros.mechanism.parameters import SelfLockingParameters, SymmetricParameters
from dm_ros.mechanism.ports import port_table, speed


class Mechanism(NamedTuple):
    """What everybody knows of a mechanism, whatever its formulation."""

    name: str           # before the names of its parameters
    title: str
    source: str         # of the default parameters, in the paper
    variant: str        # the one to take if nothing speaks for another
    parameters: type    # the table of its parameters
    ports: tuple        # of ``Port``, its inputs; the driving shaft comes first
    shafts: tuple       # names of all shafts: the carrier, the two outputs, others
    outputs: tuple      # names of the two output shafts
    gears: tuple        # names of the gear meshes, each with an internal moment
    bearings: tuple     # names of the bearings that lose
    clutches: tuple     # names of the shafts with a clutch against the carrier
    actuators: tuple    # of ``Port``, the forces on the clutches, in their order; each a moment
    load: Callable      # reference load: time in s -> torques on the ports, N m

    @property
    def inputs(self):
        """Names of the shafts with a port."""
        return tuple(port.name for port in self.ports)

    @property
    def clutch_moments(self):
        """Names of the clutches as internal moments, which are those of their actuators too."""
        return tuple(port.name for port in self.actuators)

    @property
    def half_shafts(self):
        """Names of the shafts whose port takes a speed, by an elastic shaft."""
        return tuple(port.name for port in self.ports if port.kind == 'speed')

    @property
    def moments(self):
        """Names of the internal moments."""
        return self.gears + self.clutch_moments


class Variant(NamedTuple):
    """One formulation of a mechanism."""

    name: str
    mechanism: Mechanism
    formulation: type   # makes the responses of a set of parameters
    section: str        # of the paper
    unknowns: str       # what its equations are solved for, as many as their matrix has rows


SYMMETRIC = Mechanism(
    name='symmetric', title='symmetric differential', source='Table 1', variant='symmetric_ode',
    parameters=SymmetricParameters, ports=symmetric.PORTS, shafts=symmetric.SHAFTS,
    outputs=symmetric.OUTPUTS, gears=symmetric.GEARS, bearings=symmetric.BEARINGS, clutches=(),
    actuators=(), load=loads.symmetric)
SELF_LOCKING = Mechanism(
    name='lsd', title='self-locking differential', source='Table 2', variant='lsd_ode',
    parameters=SelfLockingParameters, ports=self_locking.PORTS, shafts=self_locking.SHAFTS,
    outputs=self_locking.OUTPUTS, gears=self_locking.GEARS, bearings=self_locking.BEARINGS,
    clutches=self_locking.CLUTCHES, actuators=self_locking.ACTUATORS, load=loads.self_locking)
MECHANISMS = {mechanism.name: mechanism for mechanism in (SYMMETRIC, SELF_LOCKING)}
WITH_CLUTCHES = {**MECHANISMS, SYMMETRIC.name: SYMMETRIC._replace(
    clutches=symmetric.CLUTCHES, actuators=symmetric.ACTUATORS)}

CATALOGUE = {variant.name: variant for variant in (
    Variant('symmetric_ode', SYMMETRIC, symmetric.SymmetricOde, '3.3, variant 1', 'ε₁ ε₂'),
    Variant('symmetric_dae', SYMMETRIC, symmetric.SymmetricDae, '3.4, variant 2',
            'ε₀ ε₁ ε₂ ε₃ εₛ M_F M₁ M₂'),
    Variant('lsd_lagged', SELF_LOCKING, self_locking.SelfLockingLagged, '4.5, variant 1', 'ε₁ ε₂'),
    Variant('lsd_ode', SELF_LOCKING, self_locking.SelfLockingOde, '4.6, variant 2',
            'ε₁ ε₂ M₁ M₂'),
    Variant('lsd_dae', SELF_LOCKING, self_locking.SelfLockingDae, '4.7, variant 3',
            'ε₀ ε₁ ε₂ εₛ M₁ M₂'),
)}
VARIANTS = tuple(CATALOGUE)


# the tables of the parameters of ports, of all mechanisms
PORT_TABLES = {shaft: port_table(shaft)
               for mechanism in MECHANISMS.values() for shaft in mechanism.inputs}


def equipped(mechanism, parameters, speeds=()):
    """
    Return a ``Mechanism`` with what it has beside its gears.

    :param parameters: its table, which may give it clutches.
    :param speeds: names of the shafts whose port takes a speed instead of a torque.
    """
    if parameters.has_clutches:
        mechanism = WITH_CLUTCHES[mechanism.name]
    if speeds:
        mechanism = mechanism._replace(ports=tuple(
            speed(port.name) if port.name in speeds else port for port in mechanism.ports))
    return mechanism


def variant_named(name):
    """Return the ``Variant`` of a name; raise ValueError for one that there is not."""
    if name not in CATALOGUE:
        raise ValueError(f'variant: {name!r} is not one of {", ".join(VARIANTS)}')
    return CATALOGUE[name]


def variants_of(mechanism):
    """Return the names of the variants of a ``Mechanism``, in the order of the paper."""
    return tuple(v.name for v in CATALOGUE.values() if v.mechanism is mechanism)
