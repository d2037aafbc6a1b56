# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What the README and the pages of doc/ say is what the code does: tables, versions, commands."""

from fnmatch import fnmatch
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

import pytest
import yaml

from dm_ros import Simulation, VARIANTS
from dm_ros.mechanism.parameters import SelfLockingParameters, SymmetricParameters
from dm_ros.mechanism.ports import port_table
from dm_ros.settings import NodeParameters

ROOT = Path(__file__).parents[1]
README = (ROOT / 'README.md').read_text()
DOC = {path.stem: path.read_text() for path in (ROOT / 'doc').glob('*.md')}


def test_the_readme_is_short():
    assert len(README.encode()) <= 8192


def parameter_table():
    """Return the lines of the table of parameters."""
    lines = ['| name | default | unit | allowed | |', '|---|---|---|---|---|']
    for table in (NodeParameters(), port_table('<input shaft>')(), SymmetricParameters(),
                  SelfLockingParameters()):
        for symbol, (name, entry) in table.rows().items():
            value = getattr(table, symbol)
            default = f'{value:.10g}' if entry.kind is float else f'{value}' or "''"
            if entry.kind is float and not re.search(r'[.e]', default):
                default += '.0'
            allowed = entry.allowed.removeprefix('in ')
            words = entry.description + (' (read-only)' if entry.read_only else '')
            unit = '' if entry.unit == '1' else entry.unit
            lines.append(f'| `{name}` | `{default}` | {unit} | {allowed} | {words} |')
    return lines


def test_the_table_of_parameters_is_that_of_the_code():
    lines = parameter_table()
    assert '\n'.join(lines) in DOC['parameters'], '\n'.join(lines)


def test_the_table_of_variants_is_that_of_the_code():
    for variant in VARIANTS:
        simulation = Simulation(variant)
        inputs = ', '.join(f'`{name}`' for name in simulation.inputs)
        line = re.search(rf'^\| `{variant}` \|.*$', README, re.MULTILINE).group()
        assert f'| {inputs} |' in line


def test_all_shafts_and_moments_are_named_in_their_order():
    for variant in VARIANTS:
        simulation = Simulation(variant)
        cells = [', '.join(f'`{name}`' for name in names)
                 for names in (simulation.inputs, simulation.shafts, simulation.moments)]
        assert f'| {" | ".join(cells)} |' in DOC['interface']


def test_the_topics_and_services_are_those_that_the_policy_grants():
    # which are those of the node: test_security_policy.py
    policy = ElementTree.parse(ROOT / 'config' / 'sros2_policy.xml').getroot()
    granted = [element.text for element in policy.iter() if element.tag in ('topic', 'service')
               and element.text.startswith('~/')
               and not re.search('parameter|type_description', element.text)]   # of every node
    told = re.findall(r'^\| (?:in|out|srv) \| `(~/[^`]+)` \|', README, re.MULTILINE)
    one_for_all = [{re.sub('^(~/[a-z_]+)/.*', r'\1/<name>', name) for name in names}
                   for names in (granted, told)]
    assert one_for_all[0] == one_for_all[1]


@pytest.fixture
def bench(monkeypatch):
    """Return what imports a file of bench/."""
    monkeypatch.syspath_prepend(ROOT / 'bench')
    yield __import__
    for path in (ROOT / 'bench').glob('*.py'):
        sys.modules.pop(path.stem, None)


def head(names):
    """Return the head of a Markdown table as the benchmarks print it."""
    return f'| {" | ".join(names)} |\n|---|' + '---:|' * (len(names) - 1)


def test_the_tables_of_costs_and_errors_are_those_of_the_bench(bench):
    page, step = DOC['performance'], bench('step')
    for names in (step.COSTS, step.TARGETS, step.REFERENCE_LOAD, step.HARD_LOAD):
        assert head(names) in page
    costs = page.split(head(step.COSTS))[1].split('\n\n')[0].strip().splitlines()
    assert [line.split(' | ')[0].removeprefix('| ') for line in costs] == [
        row.name for row in step.all_rows()]
    assert step.LEGEND.format(passes=15, ticks=10_000, tolerance=step.SolveIvp.RTOL,
                              slow=step.SLOW_PASSES) in page


def test_the_table_of_the_loop_is_that_of_the_bench(bench):
    loop = bench('loop')
    assert head(loop.HEAD) in DOC['performance']
    assert loop.LEGEND in DOC['performance']


def test_the_changelog_begins_with_the_version_of_the_package():
    version = ElementTree.parse(ROOT / 'package.xml').getroot().findtext('version')
    changelog = (ROOT / 'CHANGELOG.rst').read_text()
    assert re.search(r'^(\d+\.\d+\.\d+) \(', changelog, re.MULTILINE).group(1) == version


PAGES = [ROOT / 'README.md', ROOT / 'examples' / 'README.md',
         *sorted((ROOT / 'doc').glob('*.md'))]


@pytest.mark.parametrize('page', PAGES, ids=lambda page: f'{page.parent.name}-{page.stem}')
def test_every_file_that_is_linked_is_there(page):
    text = re.sub(r'^    .*$', '', page.read_text(), flags=re.MULTILINE)   # no code
    for link in re.findall(r'\]\(([^)#:]+)\)', text):
        assert (page.parent / link).exists(), link
        assert page.parent.name != 'doc' or '/' not in link, f'{link}: no page of rosdoc2'


def test_the_readme_links_to_every_page():
    for name in DOC:
        assert f'](doc/{name}.md)' in README, name


def test_the_index_of_the_pages_has_every_page():
    index = (ROOT / 'doc' / 'index.rst').read_text()
    assert sorted(re.findall(r'^   /doc/(.*)$', index, re.MULTILINE)) == sorted(DOC)


@pytest.mark.parametrize('page', ['physics', 'faults'])
def test_every_test_that_a_page_names_is_there(page):
    names = re.findall(r'`(test_\w+)`', DOC[page])
    tests = ''.join(path.read_text() for path in (ROOT / 'test').rglob('test_*.py'))
    assert len(names) > 5
    for name in names:
        assert f'def {name}' in tests, name


def test_the_page_on_faults_counts_the_random_sequences_as_they_are():
    told = re.findall(r'takes ([\d,]+)\s(?:sequences of the `Plant`\s)?and ([\d,]+)',
                      DOC['faults'])
    for path, numbers in zip(('test_fuzz.py', 'long/test_fuzz_long.py'), told, strict=True):
        run = re.findall(r'run\(\w+Machine, ([\d_]+)\)', (ROOT / 'test' / path).read_text())
        assert [int(number) for number in run] == [int(n.replace(',', '')) for n in numbers]


@pytest.mark.parametrize('page', PAGES, ids=lambda page: f'{page.parent.name}-{page.stem}')
def test_every_path_that_is_named_is_there(page):
    text = page.read_text()
    for path in re.findall(r'`((?:dm_ros|doc|test|config|examples|bench)/[\w./]*)`', text):
        assert (ROOT / path).exists(), path


def test_every_make_target_that_is_named_is_there():
    targets = set(re.findall(r'^([a-z-]+):', (ROOT / 'Makefile').read_text(), re.MULTILINE))
    for page in PAGES:
        assert set(re.findall(r'`make ([a-z][a-z-]*)', page.read_text())) <= targets, page


def test_what_the_targets_make_is_cleaned_and_ignored():
    makefile = (ROOT / 'Makefile').read_text().replace('\\\n', '')
    cleaned = re.search(r'^clean:.*\n\trm -rf (.*)$', makefile, re.MULTILINE).group(1).split()
    ignored = [line.strip('/') for line in (ROOT / '.gitignore').read_text().split()]
    for name in cleaned:
        assert any(fnmatch(name, pattern) for pattern in ignored), name
    for pattern in set(ignored) - {'__pycache__'}:
        assert any(fnmatch(name, pattern) for name in cleaned), pattern
    removed = set(' '.join(re.findall(r'^\trm -rf ([^$\n]*)$', makefile, re.MULTILINE)).split())
    assert removed <= set(cleaned)


def test_every_dependency_of_setup_has_its_rosdep_key():
    root = ElementTree.parse(ROOT / 'package.xml').getroot()
    keys = {e.text for e in root if e.tag.endswith('depend')}
    imported = set()
    for source in (ROOT / 'dm_ros').rglob('*.py'):
        imported |= set(re.findall(r'^ *(?:import|from) (\w+)', source.read_text(), re.MULTILINE))
    assert {'rclpy', 'numpy', 'sensor_msgs', 'tqdm'} <= imported
    of_rosdep = {'numpy': 'python3-numpy', 'scipy': 'python3-scipy', 'yaml': 'python3-yaml',
                 'tqdm': 'python3-tqdm', 'matplotlib': 'python3-matplotlib'}
    for module in imported:
        if module in of_rosdep or module.endswith('_msgs') or module in ('rclpy', 'std_srvs'):
            assert of_rosdep.get(module, module) in keys, module


def test_the_parameter_files_are_yaml_with_the_wildcard_of_ros():
    for name in ('symmetric', 'lsd'):
        content = yaml.safe_load((ROOT / 'config' / f'{name}.yaml').read_text())
        assert list(content) == ['/**']
        assert list(content['/**']) == ['ros__parameters']
