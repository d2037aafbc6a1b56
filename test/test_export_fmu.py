# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What ``export_fmu`` writes: a description made from the tables, sources, binaries."""

import importlib.util
from pathlib import Path
import shutil
import subprocess
from xml.etree import ElementTree
import zipfile

from importers import exported
import pytest

from dm_ros import Simulation, VARIANTS
from dm_ros.files.columns import column_names
from dm_ros.fmu import binary
from dm_ros.fmu.description import exponents
from dm_ros.mechanism.variants import variant_named
from dm_ros.settings import NodeParameters
from dm_ros.tools.export_fmu import main

VERSIONS = '2.0', '3.0'
ROOT = Path(__file__).parents[1]
BEGIN = {'.so': b'\x7fELF', '.dll': b'MZ', '.dylib': b'\xcf\xfa\xed\xfe'}


@pytest.fixture
def without_compiler(monkeypatch, tmp_path):
    """Let there be no compiler: an export takes no time then."""
    monkeypatch.delenv('CC', raising=False)
    monkeypatch.setenv('PATH', str(tmp_path / 'none'))


def read(path, name):
    with zipfile.ZipFile(path) as file:
        return file.read(name)


def names(path):
    with zipfile.ZipFile(path) as file:
        return file.namelist()


def described(path):
    """Return ``{name: (attributes, those of its type)}`` of the variables of an FMU."""
    root = ElementTree.fromstring(read(path, 'modelDescription.xml'))
    return {v.get('name'): {**v.attrib, 'type': v[0].tag if len(v) else v.tag,
                            **(v[0].attrib if len(v) else {})}
            for v in root.find('ModelVariables')}


@pytest.mark.parametrize('version', VERSIONS)
@pytest.mark.parametrize('variant', VARIANTS)
def test_its_variables_are_those_of_the_tables(without_compiler, tmp_path, variant, version):
    path = tmp_path / 'out.fmu'
    assert main(['--variant', variant, '--fmi', version, '--out', str(path)]) == 0
    variables = described(path)
    simulation = Simulation(variant)
    mechanism = variant_named(variant).mechanism
    of = {causality: [name for name, v in variables.items() if v['causality'] == causality]
          for causality in ('independent', 'input', 'parameter', 'output')}
    assert sum(map(len, of.values())) == len(variables)
    assert of['independent'] == (['time'] if version == '3.0' else [])
    assert of['input'] == [*mechanism.inputs, *mechanism.clutch_moments]
    assert of['output'] == column_names(simulation)[1:]
    rows = dict(mechanism.parameters.rows().values())
    more = ['substeps', 'power_flow_deadband',
            *(f'initial_velocity.{shaft}' for shaft in mechanism.outputs)]
    assert of['parameter'] == [*rows, *more]
    assert simulation.parameters.named() == {
        name: row.kind(variables[name]['start']) for name, row in rows.items()}
    for name, row in (rows | {name: dict(NodeParameters.rows().values())[name]
                              for name in more}).items():
        v = variables[name]
        assert v['description'] == row.description
        is_real = v['type'] in ('Real', 'Float64')
        assert is_real is (row.kind is float) and (not is_real or v['unit'] == row.unit)
        assert row.kind(v['min']) == row.low
        surfaces = name.endswith('friction_surfaces') and not simulation.clutches
        assert row.kind(v['max']) == (0 if surfaces else row.high)
        assert v['variability'] == (
            'fixed' if surfaces or name.startswith('initial') else 'tunable')


@pytest.mark.parametrize('unit, expected', [
    ('N m', {'kg': 1, 'm': 2, 's': -2}), ('N m s/rad', {'kg': 1, 'm': 2, 's': -1, 'rad': -1}),
    ('kg m^2', {'kg': 1, 'm': 2}), ('s/rad', {'s': 1, 'rad': -1}), ('1', {}),
    ('W', {'kg': 1, 'm': 2, 's': -3}), ('rad', {'rad': 1})])
def test_units_are_told_in_those_of_the_standard(unit, expected):
    assert exponents(unit) == expected


def test_equal_input_gives_equal_bytes_and_any_other_another_token(tmp_path):
    paths = [tmp_path / f'{n}.fmu' for n in range(3)]
    for path, dt in zip(paths, ('0.001', '0.001', '0.002')):
        assert main(['--variant', 'lsd_ode', '--dt', dt, '--out', str(path)]) == 0
    one, same, other = (path.read_bytes() for path in paths)
    assert one == same != other
    guids = [ElementTree.fromstring(read(path, 'modelDescription.xml')).get('guid')
             for path in paths]
    assert guids[0] == guids[1] != guids[2]


def test_the_tick_is_that_of_the_option_or_of_the_file_or_a_millisecond(tmp_path):
    file = tmp_path / 'p.yaml'
    file.write_text('/**: {ros__parameters: {variant: lsd_ode, rate: 400.0}}')
    for words, expected in (
            (['--variant', 'lsd_ode'], '0.001'), (['--params', str(file)], '0.0025'),
            (['--params', str(file), '--dt', '0.01'], '0.01')):
        path = tmp_path / 'out.fmu'
        assert main([*words, '--fmi', '3.0', '--out', str(path)]) == 0
        root = ElementTree.fromstring(read(path, 'modelDescription.xml'))
        assert root.find('CoSimulation').get('fixedInternalStepSize') == expected
        assert root.find('DefaultExperiment').get('stepSize') == expected


@pytest.mark.parametrize('version', VERSIONS)
def test_without_a_compiler_it_has_its_sources_alone(without_compiler, tmp_path, capsys, version):
    path = tmp_path / 'out.fmu'
    assert main(['--variant', 'lsd_ode', '--fmi', version, '--out', str(path)]) == 0
    assert 'binaries: none, as there is no C compiler' in capsys.readouterr().err
    found = names(path)
    assert not [name for name in found if name.startswith('binaries')]
    assert {'sources/fmu.c', f'sources/fmi{version[0]}.c', 'sources/variables.h',
            'documentation/index.html', 'documentation/licenses/license.txt'} <= set(found)
    assert ('sources/buildDescription.xml' in found) == (version == '3.0')


@pytest.mark.parametrize('version', VERSIONS)
def test_the_sources_compile_without_a_warning(tmp_path, version):
    if not (command := binary.compiler()):
        pytest.skip('there is no C compiler')
    with zipfile.ZipFile(exported('symmetric_ode', version)) as file:
        file.extractall(tmp_path)
    subprocess.run([*command, '-std=c99', '-Wall', '-Wextra', '-Werror', '-O2',
                    '-fsyntax-only', '-Iheaders', *(
                        path.name for path in (tmp_path / 'sources').glob('*.c'))],
                   cwd=tmp_path / 'sources', check=True)


@pytest.mark.skipif(not shutil.which('cmake'), reason='cmake is not installed')
def test_its_cmake_file_makes_the_library(tmp_path):
    with zipfile.ZipFile(exported('lsd_ode', '3.0')) as file:
        file.extractall(tmp_path)
    for words in (['-S', 'sources', '-B', 'build'], ['--build', 'build', '--config', 'Release']):
        subprocess.run(['cmake', *words], cwd=tmp_path, check=True, capture_output=True)
    assert list((tmp_path / 'build').glob('dm_ros_lsd_ode.*'))


@pytest.mark.skipif(not importlib.util.find_spec('ziglang'), reason='ziglang is not installed')
@pytest.mark.parametrize('version, target, place, machine', [
    ('2.0', 'x86_64-windows', 'win64/dm_ros_lsd_ode.dll', None),
    ('3.0', 'aarch64-linux', 'aarch64-linux/dm_ros_lsd_ode.so', 183)])
def test_ziglang_makes_binaries_for_others(version, target, place, machine):
    path = exported('lsd_ode', version, '', '--target', target)
    library = read(path, f'binaries/{place}')
    assert library.startswith(BEGIN[Path(place).suffix])
    assert f'fmi{version[0]}DoStep'.encode() in library
    assert machine is None or library[18] == machine
    here = [name for name in names(path) if name.startswith('binaries')]
    assert len(here) == 1 + bool(binary.compiler())


def test_a_target_without_ziglang_is_refused_with_words(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(binary, 'find_spec', lambda name: None)
    assert main(['--variant', 'lsd_ode', '--target', 'x86_64-windows',
                 '--out', str(tmp_path / 'out.fmu')]) == 2
    assert capsys.readouterr().err == (
        'export_fmu: error: --target: x86_64-windows needs the package ziglang: '
        'pip install ziglang\n')
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('words, text, message', [
    ([], '', '--variant: it is needed where no FILE has the parameter variant'),
    (['--variant', 'lsd_ode', '--dt', '0'], '', 'dt: 0.0 is not allowed'),
    (['--variant', 'lsd_ode'], 'port.front.kind: speed',
     'port.front.kind: speed is not allowed, an FMU takes torques alone'),
    (['--variant', 'lsd_ode'], 'lsd.inertia.front: -1.0', 'lsd.inertia.front: -1.0 is not'),
    (['--variant', 'lsd_ode', '--out', 'none/out.fmu'], '', 'none/out.fmu: No such file')])
def test_bad_input_is_named_and_leaves_no_file(without_compiler, tmp_path, capsys, monkeypatch,
                                               words, text, message):
    monkeypatch.chdir(tmp_path)
    if text:
        Path('p.yaml').write_text(f'/**: {{ros__parameters: {{{text}}}}}')
        words = [*words, '--params', 'p.yaml']
    assert main(['--out', 'out.fmu', *words]) == 2
    err = capsys.readouterr().err
    assert err.startswith('export_fmu: error: ') and message in err and err.count('\n') == 1
    assert not list(tmp_path.glob('*.fmu'))


def test_a_compiler_that_is_not_there_or_fails_is_named(monkeypatch, tmp_path, capsys):
    for compiler, message in (('no-such-cc', 'CC: there is no command no-such-cc'),
                              ('false', 'false failed for ')):
        monkeypatch.setenv('CC', compiler)
        assert main(['--variant', 'lsd_ode', '--out', str(tmp_path / 'out.fmu')]) == 2
        assert f'export_fmu: error: {message}' in capsys.readouterr().err


def test_the_parameters_of_another_mechanism_are_told(without_compiler, tmp_path, capsys):
    file, path = ROOT / 'config' / 'symmetric.yaml', tmp_path / 'out.fmu'
    assert main(['--variant', 'lsd_ode', '--params', str(file), '--out', str(path)]) == 0
    assert 'export_fmu: warning: ' in capsys.readouterr().err
