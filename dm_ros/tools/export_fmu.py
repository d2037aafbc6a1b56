# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Export a differential as an FMU for co-simulation, with its sources and a binary."""

import argparse
import sys

from dm_ros.ending import run_command
from dm_ros.files.output import replacing
from dm_ros.files.parameter_file import read_parameter_file
from dm_ros.fmu.archive import fmu
from dm_ros.fmu.binary import compiler, compiler_for, TARGETS, this_platform
from dm_ros.fmu.description import VERSIONS
from dm_ros.mechanism.variants import VARIANTS
from dm_ros.settings import make_simulation
from dm_ros.tools.passed_over import warn

TICK = 0.001   # s
EPILOG = """\
Its inputs are the torques on the input shafts by their names (symmetric: pinion, left, right; lsd:
carrier, front, rear) in N m, and where there are clutches the forces on them, <clutch>_clutch, in
N. Its outputs have the names of the columns of simulate. The parameters of the mechanism, substeps
and power_flow_deadband are tunable; initial_velocity.<shaft> is set before it runs. A
communication step must be a whole multiple of S, which rounding may miss by 1/1000 of S.

The binary for this machine comes from the C compiler, CC or else cc, gcc or clang; without any the
FMU has its sources alone. Binaries for other platforms come from the package ziglang of PyPI.
doc/fmu.md tells how it gets into Simulink, CarMaker, OMSimulator and fmi_adapter.

Of FILE, a ROS 2 parameter file, these count: variant, the parameters of the mechanism, loss_law,
rate, substeps, power_flow_deadband, initial_velocity. Ports must take torques. A driveline, as
simulate --driveline runs it, cannot be exported.
"""


def parser():
    """Return the parser of the command line."""
    result = argparse.ArgumentParser('export_fmu', description=__doc__, epilog=EPILOG,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    result.add_argument('--variant', choices=VARIANTS,
                        help='the mechanism and its formulation; default: variant of FILE')
    result.add_argument('--params', metavar='FILE', help='a ROS 2 parameter file')
    result.add_argument('--fmi', choices=VERSIONS, default=VERSIONS[0],
                        help='version of the standard; default: %(default)s')
    result.add_argument('--dt', type=float, metavar='S',
                        help=f'length of a tick; default: 1/rate of FILE, else {TICK:g}')
    result.add_argument('--target', choices=TARGETS, action='append', default=[],
                        help='a platform that gets a binary too; may be given several times')
    result.add_argument('--out', metavar='OUT.fmu', required=True, help='where it goes')
    return result


def exported(arguments, values):
    """Return the ``Simulation`` that the FMU is made of; raise ValueError where it cannot be."""
    variant = arguments.variant or values.get('variant')
    if variant is None:
        raise ValueError('--variant: it is needed where no FILE has the parameter variant')
    dt = TICK if arguments.dt is None and 'rate' not in values else arguments.dt
    simulation = make_simulation(variant, values, dt)
    for shaft in simulation.mechanism.half_shafts:
        raise ValueError(f'{arguments.params}: port.{shaft}.kind: speed is not allowed, an FMU '
                         'takes torques alone')
    return simulation


def run(arguments):
    """Do what the command line says; raise ValueError or OSError where it cannot be done."""
    values = read_parameter_file(arguments.params) if arguments.params else {}
    simulation = exported(arguments, values)
    warn('export_fmu', arguments.params, values, simulation.mechanism)
    compilers = {this_platform(): command} if (command := compiler()) else {}
    compilers |= {target: compiler_for(target) for target in arguments.target}
    if arguments.target:
        print(f'export_fmu: compiling for {", ".join(arguments.target)}: for the first time that '
              'may take minutes', file=sys.stderr, flush=True)
    content = fmu(simulation, arguments.fmi, compilers)
    with replacing(arguments.out, 'wb') as file:
        file.write(content)
    binaries = ', '.join(sorted(compilers)) or 'none, as there is no C compiler'
    print(f'export_fmu: {arguments.out}: FMI {arguments.fmi}, {simulation.variant}, ticks of '
          f'{simulation.dt:g} s, {len(content)} bytes, binaries: {binaries}', file=sys.stderr)


def main(args=None):
    """Run the tool ``export_fmu`` and return its exit code."""
    arguments = parser().parse_args(args)
    return run_command('export_fmu', lambda: run(arguments), arguments.out)


if __name__ == '__main__':
    sys.exit(main())
