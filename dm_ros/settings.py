# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a run has beside its mechanism, and the simulation that it makes of both."""

from dataclasses import dataclass

from dm_ros.mechanism.parameters import Parameters, row
from dm_ros.mechanism.variants import MECHANISMS, PORT_TABLES, variant_named, VARIANTS
from dm_ros.motion.models import LOSS_LAWS, PASSIVE
from dm_ros.motion.simulation import Simulation

PREFIX = (r'([A-Za-z][A-Za-z0-9_/.-]*)?',
          'nothing, or a letter and then letters, digits and any of _ / . -')


def initial_velocity(shaft):
    return row(f'initial_velocity.{shaft}', 0.0, 'rad/s', -1e6, 1e6,
               f'speed of the {shaft} shaft at the start and after a reset')


@dataclass(frozen=True)
class LoopParameters(Parameters):
    """
    What a node has whatever it drives.

    :raises ValueError: names the parameter, its value and what is allowed.
    """

    mode: str = row('mode', 'realtime', '', 0, 0,
                    'what advances time: the clock, or each grouped message by one tick',
                    kind=str, read_only=True, choices=('realtime', 'lockstep'))
    rate: float = row('rate', 200.0, 'Hz', 0.1, 1e4, 'ticks in a second', read_only=True)
    torque_timeout: float = row('torque_timeout', 0.5, 's', 0.0, 1e6,
                                'a torque older than this becomes zero; 0 holds for ever')
    torque_limit: float = row('torque_limit', 1e5, 'N m', 0.0, 1e9,
                              'larger demands are clamped to this and counted')
    real_time_factor: float = row('real_time_factor', 1.0, '1', 0.0, 1e3,
                                  'speed of simulated time against the steady clock',
                                  above_low=True)
    publish_clock: bool = row('publish_clock', False, '', 0, 0,
                              'drive /clock with simulated time', kind=bool, read_only=True)
    joint_prefix: str = row('joint_prefix', '', '', 0, 0,
                            'before every name in JointState messages, in and out', kind=str,
                            read_only=True, pattern=PREFIX)
    realtime_priority: int = row('realtime_priority', 0, '1', 0, 99,
                                 'SCHED_FIFO priority of the loop, 0 for none',
                                 kind=int, read_only=True)


@dataclass(frozen=True)
class NodeParameters(LoopParameters):
    """What the node ``differential`` has beside its mechanism; raises as ``LoopParameters``."""

    variant: str = row('variant', 'symmetric_ode', '', 0, 0, 'the mechanism and its formulation',
                       kind=str, read_only=True, choices=VARIANTS)
    loss_law: str = row('loss_law', PASSIVE, '', 0, 0,
                        'passive: no gear or bearing gives energy back; paper: as it has them',
                        kind=str, read_only=True, choices=LOSS_LAWS)
    substeps: int = row('substeps', 1, '1', 1, 1000, 'solver steps in a tick', kind=int)
    deadband: float = row('power_flow_deadband', 0.0, 'W', 0.0, 1e9,
                          'power (paper: difference of powers) within which the index stays')
    energy_audit: bool = row('energy_audit', True, '', 0, 0,
                             'keep the energy balance, for /diagnostics', kind=bool,
                             read_only=True)
    initial_left: float = initial_velocity('left')
    initial_right: float = initial_velocity('right')
    initial_front: float = initial_velocity('front')
    initial_rear: float = initial_velocity('rear')

    def initial_velocity(self, shafts):
        """Return the initial speeds of some output shafts, rad/s, as a tuple."""
        named = self.named()
        return tuple(named[f'initial_velocity.{shaft}'] for shaft in shafts)


def tables():
    """Return the tables of all parameters there are: of mechanisms, of ports, of the node."""
    return (*(mechanism.parameters for mechanism in MECHANISMS.values()), *PORT_TABLES.values(),
            NodeParameters)


def known_rows():
    """Return ``{full name: Row}`` of every parameter there is."""
    return {name: entry
            for table in tables() for name, entry in table.rows().values()}


def names_for(mechanism):
    """Return the full names of all parameters that a run of a ``Mechanism`` has."""
    of_others = {f'initial_velocity.{shaft}' for other in MECHANISMS.values()
                 for shaft in other.outputs if shaft not in mechanism.outputs}
    return [name for table in (NodeParameters, mechanism.parameters,
                               *(PORT_TABLES[shaft] for shaft in mechanism.inputs))
            for name, _ in table.rows().values() if name not in of_others]


def passed_over(values, *mechanisms):
    """
    Return in one line what of the values belongs to other mechanisms alone, None without any.

    :param values: ``{full name: value}``, also with names of no mechanism, such as those that
        every ROS 2 node has; mechanisms: those that run.
    """
    counting = {name for mechanism in mechanisms for name in names_for(mechanism)}
    names = [name for name in values if name in known_rows() and name not in counting]
    if not names:
        return None
    return (f'{len(names)} parameter{"s" if len(names) > 1 else ""} of another mechanism than the '
            f'{" and the ".join(mechanism.title for mechanism in mechanisms)} '
            f'count{"" if len(names) > 1 else "s"} for nothing: {", ".join(names)}')


def port_parameters(inputs, values):
    """Return ``{shaft: PortParameters}`` of some input shafts, from values by full name."""
    return {shaft: PORT_TABLES[shaft]().changed(PORT_TABLES[shaft].part_of(values))
            for shaft in inputs}


def speed_ports(tables):
    """Return ``ports`` as a ``Simulation`` takes them, of what ``port_parameters`` returned."""
    return {shaft: (table.stiffness, table.damping) for shaft, table in tables.items()
            if table.kind == 'speed'}


def make_simulation(variant, values, dt=None, kind=Simulation):
    """
    Return the simulation that a node with the given parameters would run.

    :param values: ``{full name: value}``, as ``read_parameter_file`` returns them.
    :param dt: length of a tick, s; None for that of the parameter ``rate``.
    :param kind: ``Simulation``, or ``AuditedSimulation`` for one with energy books.
    """
    node = NodeParameters().changed(NodeParameters.part_of(values))
    mechanism = variant_named(variant).mechanism
    return kind(
        variant, 1 / node.rate if dt is None else dt, mechanism.parameters.part_of(values),
        loss_law=node.loss_law, substeps=node.substeps, power_flow_deadband=node.deadband,
        initial_velocity=node.initial_velocity(mechanism.outputs),
        ports=speed_ports(port_parameters(mechanism.inputs, values)))
