# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A driveline as the node ``driveline`` drives it."""

from dataclasses import dataclass
from functools import cache
import math
from typing import NamedTuple

from dm_ros.driveline.driveline import Driveline
from dm_ros.driveline.layouts import LAYOUTS
from dm_ros.driven import Driven
from dm_ros.mechanism.parameters import row
from dm_ros.settings import LoopParameters

FRAME = r'[A-Za-z][A-Za-z0-9_/.-]*', 'a letter and then letters, digits and any of _ / . -'


@dataclass(frozen=True)
class DrivelineNodeParameters(LoopParameters):
    """What the node ``driveline`` has beside the vehicle; raises as ``LoopParameters``."""

    layout: str = row('layout', 'awd', '', 0, 0, 'which wheels are driven', kind=str,
                      read_only=True, choices=tuple(LAYOUTS))
    planar: bool = row('planar', False, '', 0, 0,
                       'whether the body moves sideways and yaws too, and can be steered',
                       kind=bool, read_only=True)
    initial_speed: float = row('initial_speed', 0.0, 'm/s', -1e3, 1e3,
                               'of the body at the start and after a reset')
    odom_frame_id: str = row('odom_frame_id', 'odom', '', 0, 0, 'frame in which the car moves',
                             kind=str, read_only=True, pattern=FRAME)
    base_frame_id: str = row('base_frame_id', 'base_link', '', 0, 0,
                             'frame of the car: on the ground below its centre of mass',
                             kind=str, read_only=True, pattern=FRAME)


@cache
def rows_of(layout):
    """Return ``{full name: Row}`` of the parameters of a car with a layout."""
    return Driveline(layout).parameter_rows


def all_rows():
    """Return ``{full name: Row}`` of every parameter that a node of any layout has."""
    rows = dict(DrivelineNodeParameters.rows().values())
    for layout in LAYOUTS:
        rows |= rows_of(layout)
    return rows


def passed_over(values):
    """
    Return in one line what of the values belongs to other layouts alone, None without any.

    :param values: ``{full name: value}``, also with names of no layout, such as those that every
        ROS 2 node has.
    """
    settings = DrivelineNodeParameters().changed(DrivelineNodeParameters.part_of(values))
    counting = rows_of(settings.layout).keys() | settings.named().keys()
    of_others = all_rows().keys() - counting
    others = [name for name in values if name in of_others]
    if not others:
        return None
    return (f'{len(others)} parameter{"s" if len(others) > 1 else ""} of another layout than '
            f'{settings.layout} count{"" if len(others) > 1 else "s"} for nothing: '
            f'{", ".join(others)}')


def make_driveline(values, dt=None):
    """
    Return the ``Driveline`` that a node with the given parameters would run.

    :param values: ``{full name: value}``; those of other layouts count for nothing.
    :param dt: length of a tick, s; None for that of the parameter ``rate``.
    """
    settings = DrivelineNodeParameters().changed(DrivelineNodeParameters.part_of(values))
    rows = rows_of(settings.layout)
    car = Driveline(settings.layout, settings.planar, 1 / settings.rate if dt is None else dt,
                    {name: value for name, value in values.items() if name in rows})
    car.reset(settings.initial_speed)
    return car


def node_ports(car):
    """Return the ``Port`` s of a ``Driveline`` as a node has them: all but the wind."""
    straight = {} if car.planar else {
        'low': 0.0, 'high': 0.0, 'note': 'the body cannot turn unless it is planar'}
    return tuple([port._replace(**straight) if port.name == 'steer' else port
                  for port in car.ports if port.name != 'wind'])


def step_arguments(car):
    """Return a function of a value for each of ``node_ports``: the arguments of ``car.step``."""
    wheels, clutches = len(car.wheels), car.clutches
    first_other = wheels + len(clutches)

    def arguments(held):
        torque, *others = held
        steer, grade, *road = others[first_other:]
        return (torque, others[:wheels], dict(zip(clutches, others[wheels:first_other])), steer,
                grade, road[:wheels], road[wheels:])
    return arguments


def port_limits(car, settings):
    """Return ``{port: most}`` of those of ``node_ports`` beyond which a demand is clamped."""
    return {**{port.name: settings.torque_limit for port in car.ports if port.unit == 'N m'},
            **dict(zip([f'{clutch}_clutch' for clutch in car.clutches], car.force_limits))}


class PreparedDriveline(NamedTuple):
    """A change of parameters that may be adopted: what holds then."""

    settings: DrivelineNodeParameters
    car: Driveline | None   # None where the vehicle stays as it is


class DrivelinePlant(Driven):
    """
    A driveline as the node runs it.

    Its ports are those of the ``Driveline`` but the wind. A demand for the input or a clutch that
    is too old counts as zero; brakes, steering, slope and road stay what they were, since a car
    whose brakes let go is no safe state.

    :param values: ``{full name: value}`` of the parameters that differ from their defaults.
    :param log: has ``warning`` and ``info``; conditions are logged there.
    :raises ValueError: names the parameter, its value and what is allowed.
    """

    grouped = 'commands'
    driving = ('input',)

    def __init__(self, values, log):
        settings = DrivelineNodeParameters().changed(DrivelineNodeParameters.part_of(values))
        car = make_driveline(values)
        ports = node_ports(car)
        super().__init__(settings, car, ports, {port.topic: port.name for port in ports}, log)
        self._arguments = step_arguments(car)
        self.reset()
        self.adopt(PreparedDriveline(settings, None))

    @property
    def title(self):
        """What it is, in a word."""
        return f'{self.settings.layout}{" planar" * self.settings.planar}'

    @property
    def words(self):
        """What the log tells of it at the start, in parts."""
        clutches = self.simulation.clutches
        return [f'forces on {", ".join(clutches)}'] if clutches else []

    @property
    def values(self):
        """``{full name: value}`` of all parameters, its own and those of the vehicle."""
        return {**self.settings.named(), **self.simulation.parameters}

    @property
    def rows(self):
        """``{full name: Row}`` of all parameters."""
        return {**dict(self.settings.rows().values()), **self.simulation.parameter_rows}

    def _step(self, held):
        return self.simulation.step(*self._arguments(held))

    def _reset_simulation(self):
        self.simulation.reset(self.settings.initial_speed)

    def prepared(self, changes):
        """
        Return what ``adopt`` takes, all of the changes or none; nothing is touched yet.

        It may be called from another thread: what it makes takes some milliseconds.

        :param changes: ``{full name: value}``.
        :raises ValueError: names the parameter, its value and what is allowed.
        """
        changes = self.checked(changes)
        settings = self.settings.changed(self.settings.part_of(changes))
        before, car = self.simulation, None
        vehicle = {**before.parameters, **{name: value for name, value in changes.items()
                                           if name in before.parameters}}
        if vehicle != dict(before.parameters):
            car = Driveline(settings.layout, settings.planar, before.dt, vehicle)
            if car.clutches != before.clutches:
                raise ValueError(f'{", ".join(changes)}: clutches cannot come or go while it runs')
        return PreparedDriveline(settings, car)

    def adopt(self, prepared):
        """Put into force what ``prepared`` returned; the car goes on as it moves."""
        self.settings = prepared.settings
        if prepared.car:
            prepared.car.follow(self.simulation)
            self.simulation = prepared.car
        limits = port_limits(self.simulation, self.settings)
        self.limit(tuple([limits.get(port.name, math.inf) for port in self.inputs.ports]))

    def _notice_coarse(self, count):
        """Count them alone: ticks in which a clutch, a brake or the grip jumps often are."""
        self.coarse.count += count

    def told_of_loop(self):
        """Return ``{key: value}`` of what is driven, for diagnostics."""
        return {'layout': self.title, **super().told_of_loop()}

    def told_of_inputs(self):
        """Return ``{key: value}`` of the forces of the actuators, for diagnostics."""
        car = self.simulation
        return {f'force on {clutch}_clutch [N]': f'{force:g}'
                for clutch, force in zip(car.clutches, car.clutch_force)}

    def told_of_energy(self):
        """Return complaints and ``{key: value}`` of the energy, for diagnostics."""
        total, losses = self.simulation.energy, self.simulation.losses
        return [], {
            'work of the input [J]': f'{total.input:.6g}',
            'work of gravity and wind [J]': f'{total.gravity + total.wind:.6g}',
            'stored [J]': f'{self.simulation.stored_energy:.6g}',
            'lost [J]': f'{total.lost:.6g}',
            **{f'lost in {what} [J]': f'{sum(losses[name] for name in names):.6g}'
               for what, names in self.simulation.kinds_of_loss.items()},
            'added by changes of load [J]': f'{total.parametric:.3g}',
            'added by changes of brakes, road and parameters [J]': f'{total.jumps:.3g}',
            'taken by the error of the step [J]': f'{total.numerical:.3g}'}
