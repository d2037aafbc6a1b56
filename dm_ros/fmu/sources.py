# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The C sources of an FMU: those of the core and of the standard's functions, and its tables."""

from pathlib import Path
import re

from dm_ros.fmu.description import build_description
from dm_ros.mechanism.variants import SYMMETRIC, variant_named
from dm_ros.motion.models import PASSIVE

CORE = Path(__file__).parents[1] / 'sources'
FOR_PYTHON = re.compile(rb'#include [<"][Pp]ython\.h')   # what of the core is no part of a model
OPTIONS = '-std=c99', '-O2', '-ffp-contract=off'   # equal bits: no fused multiply-add
HEADER = """/* Made by export_fmu, from the tables of parameters and ports. */

#ifndef DM_ROS_VARIABLES_H
#define DM_ROS_VARIABLES_H

#define TOKEN "{token}"

/* Where variables begin in the table. */
enum {{
    AT_INPUTS = {inputs}, FORCES = {forces}, AT_PARAMETERS = {parameters},
    AT_SUBSTEPS = {substeps}, AT_DEADBAND, AT_INITIAL,
    AT_OUTPUTS = {outputs}, VARIABLES = {count}
}};

static const setup RUN = {{
    {run}
}};

static const variable TABLE[VARIABLES] = {{
{rows}
}};

#endif
"""


def source_files(version):
    """Return ``{name: bytes}`` of the files of an FMU of any differential."""
    fmi = CORE / 'fmi'
    files = {path.name: path for path in CORE.glob('*.[ch]')}
    files |= {name: fmi / name
              for name in ('fmu.h', 'fmu.c', f'fmi{version[0]}.c', 'CMakeLists.txt')}
    files |= {f'headers/{path.name}': path for path in (fmi / 'headers').iterdir()
              if path.name.startswith(f'fmi{version[0]}') or path.name == 'LICENSE'}
    texts = {name: path.read_bytes() for name, path in sorted(files.items())}
    return {name: text for name, text in texts.items()
            if not FOR_PYTHON.search(text)}


def compiled(files):
    """Return the names of those files that are compiled."""
    return sorted(name for name in files if name.endswith('.c'))


def literal(value):
    """Return a number as a double of C."""
    return repr(float(value))


def row_of(variable):
    """Return the line of the table for a variable."""
    causality = {'independent': 'TIME'}.get(variable.causality, variable.causality.upper())
    words = [f'"{variable.name}"', causality, str(int(variable.kind is int)),
             str(int(variable.is_fixed)), literal(variable.low), literal(variable.high),
             str(int(variable.above_low)), literal(variable.start), f'"{variable.allowed}"']
    return f'    {{{", ".join(words)}}},'


def variables_header(simulation, variables, token):
    """Return variables.h as bytes: what the C of an FMU has to know of its variables."""
    mechanism = simulation.mechanism
    names = [variable.name for variable in variables]
    causalities = [variable.causality for variable in variables]
    formulation = variant_named(simulation.variant).formulation
    run = {'is_symmetric': mechanism.name == SYMMETRIC.name,
           'is_passive': simulation.loss_law == PASSIVE,
           'is_lagged': getattr(formulation, 'lagged', False),
           'has_clutches': bool(simulation.clutches), 'substeps': simulation.substeps,
           'dt': simulation.dt, 'deadband': simulation.power_flow_deadband}
    return HEADER.format(
        token=token, inputs=causalities.index('input'), forces=len(mechanism.actuators),
        parameters=causalities.index('parameter'), substeps=names.index('substeps'),
        outputs=causalities.index('output'), count=len(variables),
        run=', '.join(f'.{name} = {literal(value)}' for name, value in run.items()),
        rows='\n'.join(map(row_of, variables))).encode()


def sources(simulation, version, variables, identifier, token, files):
    """Return ``{name: bytes}`` of all that is in the folder of sources."""
    made = {'variables.h': variables_header(simulation, variables, token),
            'identifier.cmake': f'set(identifier {identifier})\n'.encode()}
    if version == '3.0':
        made['buildDescription.xml'] = build_description(
            identifier, compiled(files), ' '.join(OPTIONS))
    return files | made
