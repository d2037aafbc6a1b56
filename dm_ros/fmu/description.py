# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""modelDescription.xml and buildDescription.xml of an FMU, for FMI 2.0 and 3.0."""

from collections import Counter
import re
from xml.etree.ElementTree import Element, indent, SubElement, tostring

from dm_ros.fmu.variables import LARGEST

VERSIONS = '2.0', '3.0'
COPYRIGHT = 'dm_ros developers'
LICENCE = 'Apache-2.0'
TYPES = {('2.0', float): 'Real', ('2.0', int): 'Integer',
         ('3.0', float): 'Float64', ('3.0', int): 'Int32'}
# units of the tables in those of the standard
BASES = {'N': {'kg': 1, 'm': 1, 's': -2}, 'W': {'kg': 1, 'm': 2, 's': -3},
         **{name: {name: 1} for name in ('kg', 'm', 's', 'rad')}, '1': {}}
STOP = 10.0   # s, of the default experiment
# what is zero at the start whatever the parameters
AT_REST = 'position', 'torque', 'power_flow', 'clutch_force'


def exponents(unit):
    """Return the exponents of the base units in a unit of the tables, such as ``N m s/rad``."""
    found = Counter()
    for side, sign in zip(unit.split('/'), (1, -1)):
        for word in side.split():
            name, power = re.fullmatch(r'([A-Za-z]+|1)(?:\^(\d))?', word).groups()
            for base, exponent in BASES[name].items():
                found[base] += sign * exponent * int(power or 1)
    return {base: exponent for base, exponent in found.items() if exponent}


def text_of(root):
    """Return XML as bytes."""
    indent(root)
    return tostring(root, 'UTF-8', xml_declaration=True) + b'\n'


def number(value):
    """Return a number as XML has it."""
    return repr(value)


def attributes(variable):
    """Return what stands at the type of a variable: unit, range and start."""
    found = {'unit': variable.unit} if variable.kind is float else {}
    if variable.causality in ('input', 'parameter'):
        kind = variable.kind
        if variable.low > -LARGEST:
            found['min'] = number(kind(variable.low))
        if variable.high < LARGEST:
            found['max'] = number(kind(variable.high))
        found['start'] = number(kind(variable.start))
    return found


def roles(variable):
    """Return causality, variability and initial of a variable."""
    found = {'causality': variable.causality, 'variability': 'continuous'}
    if variable.kind is int:
        found['variability'] = 'discrete'
    if variable.causality == 'parameter':
        found['variability'] = 'fixed' if variable.is_fixed else 'tunable'
    elif variable.causality == 'output':
        found['initial'] = 'calculated'
    return found


def add_variable(parent, version, reference, variable):
    """Add a variable; its place among all is its value reference."""
    common = {'name': variable.name, 'valueReference': str(reference),
              'description': variable.description, **roles(variable)}
    kind = TYPES[version, variable.kind]
    if version == '2.0':
        SubElement(SubElement(parent, 'ScalarVariable', common), kind, attributes(variable))
        return
    SubElement(parent, kind, {**common, **attributes(variable)})


def add_structure(root, version, variables):
    """
    Add which output depends on what.

    After a step they depend on no input: those were in force in the step before. At the start
    velocities and moments depend on the parameters, all others on nothing.
    """
    structure = SubElement(root, 'ModelStructure')
    # the indices of FMI 2.0 begin at 1, behind the time that it has not: they are references too
    parameters = ' '.join(str(n) for n, variable in enumerate(variables)
                          if variable.causality == 'parameter')
    outputs = [(n, variable) for n, variable in enumerate(variables)
               if variable.causality == 'output']
    groups = (('Output', 'Outputs', lambda variable: ''),
              ('InitialUnknown', 'InitialUnknowns', lambda variable: '' if variable.name.split(
                  '.')[0] in AT_REST else parameters))
    for single, several, dependencies in groups:
        parent = SubElement(structure, several) if version == '2.0' else structure
        for n, variable in outputs:
            SubElement(parent, *(('Unknown', {'index': str(n)}) if version == '2.0'
                                 else (single, {'valueReference': str(n)})),
                       dependencies=dependencies(variable))


def model_description(simulation, version, variables, identifier, token, package, sources):
    """
    Return modelDescription.xml as bytes.

    :param token: guid or instantiation token; package: name and version of what made it.
    :param sources: names of the files to compile.
    """
    is_2 = version == '2.0'
    mechanism = simulation.mechanism
    root = Element('fmiModelDescription', {
        'fmiVersion': version, 'modelName': simulation.variant,
        'guid' if is_2 else 'instantiationToken': token,
        'description': f'{mechanism.title}, variant {simulation.variant}, loss law '
                       f'{simulation.loss_law}, ticks of {simulation.dt!r} s',
        'generationTool': package, 'version': package.split()[-1], 'copyright': COPYRIGHT,
        'license': LICENCE, 'variableNamingConvention': 'structured'})
    state = 'FMUstate' if is_2 else 'FMUState'
    interface = SubElement(root, 'CoSimulation', {
        'modelIdentifier': identifier, 'canHandleVariableCommunicationStepSize': 'true',
        f'canGetAndSet{state}': 'true', f'canSerialize{state}': 'true',
        **({'canNotUseMemoryManagementFunctions': 'true'} if is_2
           else {'fixedInternalStepSize': number(simulation.dt)})})
    if is_2:
        files = SubElement(interface, 'SourceFiles')
        for name in sources:
            SubElement(files, 'File', name=name)
    units = SubElement(root, 'UnitDefinitions')
    for unit in sorted({variable.unit for variable in variables}):
        SubElement(SubElement(units, 'Unit', name=unit), 'BaseUnit', {
            base: str(exponent) for base, exponent in exponents(unit).items()})
    SubElement(SubElement(root, 'LogCategories'), 'Category', name='logStatusError',
               description='what is refused, in words')
    SubElement(root, 'DefaultExperiment', startTime='0.0', stopTime=number(STOP),
               stepSize=number(simulation.dt))
    all_variables = SubElement(root, 'ModelVariables')
    for reference, variable in enumerate(variables):
        # FMI 2.0 needs no variable of time, and FMI Library takes it for one without a start
        if not is_2 or variable.causality != 'independent':
            add_variable(all_variables, version, reference, variable)
    add_structure(root, version, variables)
    return text_of(root)


def build_description(identifier, sources, options):
    """Return buildDescription.xml of FMI 3.0 as bytes: the files to compile, and how."""
    root = Element('fmiBuildDescription', fmiVersion='3.0')
    configuration = SubElement(root, 'BuildConfiguration', modelIdentifier=identifier)
    files = SubElement(configuration, 'SourceFileSet', language='C99', compilerOptions=options)
    for name in sources:
        SubElement(files, 'SourceFile', name=name)
    SubElement(configuration, 'Library', name='m')
    return text_of(root)
