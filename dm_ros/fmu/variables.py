# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The variables of an FMU, made of the tables of parameters and ports, for its XML and its C."""

import sys
from typing import NamedTuple

from dm_ros.files.columns import column_names
from dm_ros.mechanism.parameters import in_words
from dm_ros.settings import NodeParameters

LARGEST = sys.float_info.max
FRICTION_SURFACES = 'n_F1', 'n_F2'
# what a column of a record is: unit, and what it is of something
COLUMNS = {
    'velocity': ('rad/s', 'speed of the {}'),
    'position': ('rad', 'angle of the {}, the integral of its speed'),
    'torque': ('N m', 'torque on the {} in the last tick'),
    'moment': ('N m', 'internal moment of the {}'),
    'power_flow': ('1', 'index of power flow: +1 direct, -1 reverse'),
    'clutch_force': ('N', 'axial force in force on the {} clutch'),
}


class Variable(NamedTuple):
    """One variable; its value reference is its place among all."""

    name: str
    causality: str         # of the standard: independent, input, parameter or output
    unit: str              # '1' for a ratio
    description: str
    kind: type = float     # or int
    is_fixed: bool = False   # a parameter that cannot be set any more once it runs
    start: float = 0.0     # of inputs and parameters
    low: float = -LARGEST
    high: float = LARGEST
    above_low: bool = False   # the low end itself is not allowed
    allowed: str = ''      # in words


def of_port(port):
    """Return the variable of a ``Port``."""
    bounded = port.low == 0.0
    return Variable(port.name, 'input', port.unit, f'{port.kind} on the {in_words(port.name)}, '
                    'held in a step', low=0.0 if bounded else -LARGEST,
                    allowed='a finite number that is not below 0' if bounded
                    else 'a finite number')


def of_row(name, row, value, is_fixed=False):
    """Return the variable of a parameter, with its value as the start."""
    return Variable(name, 'parameter', row.unit, row.description, row.kind, is_fixed, value,
                    row.low, row.high, row.above_low, row.allowed)


def of_parameters(simulation):
    """Yield the variables of the parameters of a mechanism, in the order of their table."""
    p = simulation.parameters
    for symbol, (name, row) in p.rows().items():
        variable = of_row(name, row, getattr(p, symbol))
        if symbol in FRICTION_SURFACES and not simulation.clutches:
            variable = variable._replace(
                is_fixed=True, high=0, allowed='0, what was exported without clutches cannot get '
                'any: export it with friction_surfaces in the parameter file')
        yield variable


def of_run(simulation):
    """Return the variables of what a run has beside its mechanism, the initial speeds last."""
    rows = dict(NodeParameters.rows().values())
    values = {'substeps': simulation.substeps,
              'power_flow_deadband': simulation.power_flow_deadband}
    speeds = {f'initial_velocity.{shaft}': speed
              for shaft, speed in zip(simulation.outputs, simulation.initial_velocity)}
    return [*(of_row(name, rows[name], value) for name, value in values.items()),
            *(of_row(name, rows[name], speed, is_fixed=True) for name, speed in speeds.items())]


def of_column(name):
    """Return the variable of a column of a record."""
    kind, _, what = name.partition('.')
    unit, words = COLUMNS[kind]
    description = words.format(in_words(what).replace('_', ' '))
    return Variable(name, 'output', unit, description,
                    int if kind == 'power_flow' else float)


def variables(simulation):
    """Return all variables of an FMU of a ``Simulation`` on torques."""
    mechanism = simulation.mechanism
    return [Variable('time', 'independent', 's', 'simulated time'),
            *map(of_port, mechanism.ports), *map(of_port, mechanism.actuators),
            *of_parameters(simulation), *of_run(simulation),
            *map(of_column, column_names(simulation)[1:])]
