# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The layouts are shaped as PlotJuggler, Foxglove and Lichtblick read them."""

import json
from pathlib import Path
import re
import sys
from xml.etree import ElementTree

import pytest

sys.path.insert(0, str(Path(__file__).parents[1] / 'examples'))

from layouts import charts, layouts

from dm_ros.files.published import FRAME
from dm_ros.mechanism.variants import equipped, MECHANISMS

FOLDER = Path(__file__).parents[1] / 'config' / 'layouts'
# what the loaders know, and what a panel must be given
PANELS = {
    'Plot': {'paths', 'showLegend', 'legendDisplay', 'showPlotValuesInLegend', 'showXAxisLabels',
             'showYAxisLabels', 'isSynced', 'xAxisVal', 'sidebarDimension'},
    '3D': {'cameraState', 'followMode', 'followTf', 'scene', 'transforms', 'topics', 'layers'},
    'DiagnosticSummary': {'minLevel', 'pinnedIds', 'hardwareIdFilter', 'topicToRender'},
    'DiagnosticStatusPanel': {'topicToRender', 'selectedHardwareId', 'selectedName'}}
COLOUR = re.compile('#[0-9a-f]{6}')
each_mechanism = pytest.mark.parametrize('name', MECHANISMS)


def curves(name):
    """Return all curves that a layout should show."""
    mechanism = equipped(MECHANISMS[name], MECHANISMS[name].parameters())
    return [curve for chart in charts(mechanism) for curve in chart.curves]


def foxglove(name):
    return json.loads((FOLDER / f'foxglove_{name}.json').read_text())


def test_the_installed_layouts_are_those_that_the_script_writes():
    made = layouts()   # after a change: python examples/layouts.py
    assert {path.name for path in FOLDER.iterdir()} == set(made)
    for name, text in made.items():
        assert (FOLDER / name).read_text() == text


def test_node_and_prefix_are_in_all_names():
    for name, text in layouts('/rear/node', 'rear_').items():
        assert '/differential' not in text and '/rear/node/' in text
        assert ('/rear_' if name.endswith('xml') else f'rear_{FRAME}') in text
        if name.endswith('json'):
            assert '"/rear/robot_description"' in text


@each_mechanism
def test_plotjuggler_finds_each_part_where_its_loader_looks_for_it(name):
    root = ElementTree.parse(FOLDER / f'plotjuggler_{name}.xml').getroot()
    assert root.tag == 'root'
    area, = root.findall('tabbed_widget')
    assert area.attrib == {'name': 'Main Window', 'parent': 'main_window'}
    assert [tab.tag for tab in area[:-1]] == ['Tab'] * (len(area) - 1)
    assert 0 <= int(area.find('currentTabIndex').get('index')) < len(area) - 1
    found = []
    for tab in area.findall('Tab'):
        assert tab.get('tab_name') and tab.get('containers') == '1'
        container, = tab
        # for placeholders of curves that have not come yet it looks just one splitter deep
        splitter, = container
        assert (container.tag, splitter.tag) == ('Container', 'DockSplitter')
        assert splitter.get('orientation') in '|-'
        sizes = list(map(float, splitter.get('sizes').split(';')))
        assert len(sizes) == len(splitter) == int(splitter.get('count'))
        assert sum(sizes) == pytest.approx(1)
        for dock in splitter:
            assert dock.tag == 'DockArea' and dock.get('name')
            plot, = dock
            assert plot.get('mode') == 'TimeSeries' and plot.get('style') in ('Lines', 'Steps')
            assert {'left', 'right', 'bottom', 'top'} == set(plot.find('range').attrib)
            assert set(plot.find('limitY').attrib) in (set(), {'min', 'max'})
            for curve in plot.findall('curve'):
                assert COLOUR.fullmatch(curve.get('color'))
                found.append(curve.get('name'))
    assert found == [f'/differential/{c.topic}/{c.name}/{c.field}' for c in curves(name)]


@each_mechanism
def test_plotjuggler_offers_to_stream_all_topics_by_their_stamps(name):
    root = ElementTree.parse(FOLDER / f'plotjuggler_{name}.xml').getroot()
    plugin = root.find('Plugins/plugin')
    assert root.find('previouslyLoaded_Streamer').get('name') == plugin.get('ID')
    assert plugin.find('use_header_stamp').get('value') == 'true'
    selected = plugin.find('selected_topics').get('value').split(';')
    assert {f'/differential/{curve.topic}' for curve in curves(name)} == set(selected)


def leaves(mosaic):
    """Return the panels of a mosaic."""
    if isinstance(mosaic, str):
        return [mosaic]
    assert set(mosaic) == {'direction', 'first', 'second', 'splitPercentage'}
    assert mosaic['direction'] in ('row', 'column') and 0 < mosaic['splitPercentage'] < 100
    return leaves(mosaic['first']) + leaves(mosaic['second'])


@each_mechanism
def test_foxglove_accepts_the_file_and_knows_every_panel(name):
    layout = foxglove(name)
    assert layout['playbackConfig'] == {'speed': 1}
    assert layout['globalVariables'] == layout['userNodes'] == {}
    panels = layout['configById']
    shown = leaves(layout['layout'])
    assert sorted(shown) == sorted(panels) and len(set(shown)) == len(shown)
    for panel, config in panels.items():
        kind, _, number = panel.partition('!')
        assert number and PANELS[kind] <= set(config), panel
    assert {panel.partition('!')[0] for panel in panels} == set(PANELS)


@each_mechanism
def test_foxglove_plots_each_curve_over_the_stamps(name):
    found = []
    for panel, config in foxglove(name)['configById'].items():
        if not panel.startswith('Plot!'):
            continue
        assert config['xAxisVal'] == 'timestamp' and config['lichtblickPanelTitle']
        for path in config['paths']:
            assert path['enabled'] and path['timestampMethod'] == 'headerStamp'
            assert COLOUR.fullmatch(path['color'])
            topic, field = re.fullmatch(r'/differential/(\w+)\.(\w+)\[\d+\]',
                                        path['value']).groups()
            found.append((topic, path['label'], field))
    assert found == [(c.topic, c.name, c.field) for c in curves(name)]


@each_mechanism
def test_the_gears_are_seen_in_the_frame_of_the_housing(name):
    config = foxglove(name)['configById']['3D!gears']
    assert config['followTf'] == FRAME
    (number, layer), = config['layers'].items()
    assert layer['instanceId'] == number and layer['layerId'] == 'foxglove.Urdf'
    assert (layer['sourceType'], layer['topic']) == ('topic', '/robot_description')
    assert 0.1 < config['cameraState']['distance'] < 2.0   # m, of gears
