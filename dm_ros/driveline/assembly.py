# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a driveline is made of: elements, and elastic shafts that connect their flanges.

A layout is a function that is given an ``Assembly`` and says what there is, see ``layouts``.
"""

from math import inf
from typing import NamedTuple

from dm_ros.driveline.body import Wheel
from dm_ros.driveline.differential import Differential
from dm_ros.driveline.parameters import (
    AxleParameters,
    below,
    Shaft,
    ShaftParameters,
    StepParameters,
    VehicleParameters,
)
from dm_ros.mechanism.parameters import SelfLockingParameters

INPUT = 'input'


class Flange(NamedTuple):
    """Where an element can be connected; its torque is positive when it accelerates it."""

    element: str
    port: str = ''

    def __str__(self):
        return f'{self.element}.{self.port}' if self.port else self.element


class Connection(NamedTuple):
    """An elastic shaft from flange a to flange b, which turn alike when it is not twisted."""

    name: str
    a: Flange
    b: Flange
    p: ShaftParameters


class Assembly:
    """
    The elements of a driveline, in the order in which they were added.

    :param parameters: mapping from full names to values that differ from the defaults.
    :param dt: length of a tick, s.
    :raises ValueError: here and in all methods: names what is wrong.
    """

    def __init__(self, parameters, dt):
        self._given, self._dt = parameters, dt
        self._tables, self._flanges = {}, {}
        self.inertias = {}         # kg m^2
        self.differentials = []
        self.wheels = []
        self.connections = []
        self.vehicle = self._table(VehicleParameters())
        self.numerics = self._table(StepParameters())

    def input(self):
        """Add the input, on which the torque of the gearbox acts; return its flange."""
        return self.inertia(INPUT, self.vehicle.I_in)

    def inertia(self, name, inertia):
        """Add what turns with an inertia, kg m^2; return its flange, for any connections."""
        if not 0.0 < inertia < inf:
            raise ValueError(f'layout: the inertia of {name} is {inertia}, it must be a number of '
                             'kg m^2 above 0')
        flange = self._flange(name)
        self.inertias[name] = inertia
        return flange

    def differential(self, name, kind=SelfLockingParameters, **defaults):
        """
        Add a differential between axles; return what has its flanges by the names of its ports.

        :param kind: table of its parameters, which are ``driveline.<name>.*``; it decides on the
            mechanism.
        :param defaults: by symbol, that differ from those of the table.
        """
        return self._differential(name, name, kind, defaults)

    def axle(self, name, kind=AxleParameters, **defaults):
        """Add a differential in an axle, likewise; its shafts are ``<name>_axle_<shaft>``."""
        return self._differential(name, f'{name}_axle', kind, defaults)

    def wheel(self, name, x, y, is_front, is_steered=False):
        """
        Add a wheel with its brake and its tyre; return its flange.

        :param x: of its contact before the centre of mass, m; y: to the left of it.
        :param is_front: whether it carries the front of the body, in equal parts with all others
            that do, or the rear.
        """
        flange = self._flange(name)
        self.wheels.append(Wheel(name, x, y, is_front, is_steered))
        return flange

    def connect(self, name, a, b, shaft):
        """
        Connect flange a to flange b by an elastic shaft.

        :param shaft: a ``Shaft``; connections of one kind share its parameters.
        """
        for flange in (a, b):
            if flange not in self._flanges.values():
                raise ValueError(f'layout: {name}: there is no flange {flange}')
        if name in [connection.name for connection in self.connections]:
            raise ValueError(f'layout: there are two connections {name}')
        if not isinstance(shaft, Shaft):
            raise ValueError(f'layout: {name}: {shaft!r} is no Shaft')
        kind = below(ShaftParameters, f'shaft.{shaft.name}')
        self.connections.append(Connection(
            name, a, b, self._table(kind(shaft.stiffness, shaft.damping, shaft.gap))))

    def finish(self):
        """
        Check that it is whole and that all parameters given are some of its own.

        From now on the input is the first of the inertias.
        """
        if INPUT not in self.inertias:
            raise ValueError('layout: there is no input')
        for end, words in ((True, 'front'), (False, 'rear')):
            if not any(wheel.is_front == end for wheel in self.wheels):
                raise ValueError(f'layout: no wheel carries the {words} of the body')
        self.inertias = {INPUT: self.inertias.pop(INPUT), **self.inertias}
        known = self.parameters()
        for name in self._given:
            if name not in known:
                raise ValueError(f'{name}: there is no such parameter in this layout')

    def parameters(self):
        """Return ``{full name: value}`` of all parameters in force."""
        return {name: value for table in self._tables.values()
                for name, value in table.named().items()}

    def rows(self):
        """Return ``{full name: Row}`` of all parameters."""
        return {name: row for table in self._tables.values()
                for name, row in table.rows().values()}

    def _differential(self, name, shafts_name, kind, defaults):
        table = self._table(below(kind, name)(**defaults))
        differential = Differential(name, shafts_name, table, self._dt)
        self.differentials.append(differential)
        return differential.flanges(lambda port: self._flange(name, port))

    def _flange(self, element, port=''):
        flange = Flange(element, port)
        if str(flange) in self._flanges:
            raise ValueError(f'layout: there are two elements {element}')
        self._flanges[str(flange)] = flange
        return flange

    def _table(self, table):
        """Return a table with what is given of it; a second one of a kind must be equal."""
        names = {name for name, _ in table.rows().values()}
        table = table.changed({name: value for name, value in self._given.items()
                               if name in names})
        first, *_ = names
        before = self._tables.setdefault(frozenset(names), table)
        if before.named() != table.named():
            raise ValueError(f'layout: {first.rpartition(".")[0]}: two kinds have one name')
        return table
