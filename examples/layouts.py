# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Write the layouts of config/layouts for PlotJuggler, Foxglove and Lichtblick."""

import argparse
import json
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from dm_ros.files.published import FRAME, Published
from dm_ros.mechanism.variants import equipped, MECHANISMS

FOLDER = Path(__file__).parents[1] / 'config' / 'layouts'
STREAMER = 'ROS2 Topic Subscriber'   # the name of a plugin of PlotJuggler
# as they are drawn by the URDF: carrier, both outputs and their meshes, the others
GREY, FIRST, SECOND, ORANGE, VIOLET = '#8c8c91', '#4073b3', '#4d9973', '#e69933', '#8c66a6'
LIGHT_FIRST, LIGHT_SECOND = '#8fb8e6', '#99d1b8'


class Curve(NamedTuple):
    """One number of a JointState that a node publishes."""

    topic: str   # its last word
    name: str    # of a joint, moment or clutch, without prefix
    field: str
    colour: str


class Chart(NamedTuple):
    """Curves over time that share an axis."""

    title: str   # with the unit
    curves: list
    limits: tuple = ()   # of the axis; none for those of what is seen
    steps: bool = False


def charts(mechanism):
    """Return the ``Chart`` s of a mechanism, the most important ones first."""
    first, second = mechanism.outputs
    colours = {'carrier': GREY, first: FIRST, second: SECOND, 'pinion': VIOLET,
               'satellite': ORANGE, 'final_drive': VIOLET,
               f'{first}_mesh': FIRST, f'{second}_mesh': SECOND,
               f'{first}_clutch': LIGHT_FIRST, f'{second}_clutch': LIGHT_SECOND}

    def curves(topic, field, names):
        return [Curve(topic, name, field, colours[name]) for name in names]
    shafts = [shaft for shaft in mechanism.shafts if shaft != 'satellite']
    clutches = mechanism.clutch_moments
    result = [
        Chart('Speeds, rad/s', curves('joint_states', 'velocity', shafts)),
        Chart('Slip on the carrier, rad/s', curves('clutches', 'velocity', clutches)) if clutches
        else Chart('Satellites on the carrier, rad/s',
                   curves('joint_states', 'velocity', ['satellite'])),
        Chart('Torques, N m', curves('joint_states', 'effort', mechanism.inputs)),
        Chart('Internal moments, N m', curves('internal_moments', 'effort', mechanism.moments)),
        Chart('Power flow, +1 direct, -1 reverse', [
            Curve('power_flow_stamped', 'power_flow', 'position', ORANGE)], (-1.5, 1.5), True)]
    if clutches:
        result.append(Chart('Forces on the clutches, N', curves('clutches', 'effort', clutches)))
    return result


# PlotJuggler


def series(curve, node, prefix):
    """Return the name that PlotJuggler gives to the numbers of a joint."""
    return f'{node}/{curve.topic}/{prefix}{curve.name}/{curve.field}'


def plotjuggler(mechanism, node, prefix):
    """Return a layout as text: two tabs, each a column of plots."""
    root = Element('root')
    area = SubElement(root, 'tabbed_widget', name='Main Window', parent='main_window')
    shown = charts(mechanism)
    for title, some in (('Motion and torques', shown[:4]), ('Power flow and clutches', shown[4:])):
        tab = SubElement(area, 'Tab', tab_name=title if len(some) > 1 else 'Power flow',
                         containers='1')
        column = SubElement(SubElement(tab, 'Container'), 'DockSplitter', orientation='-',
                            count=str(len(some)),
                            sizes=';'.join(f'{1 / len(some):.6g}' for _ in some))
        for chart in some:
            plot = SubElement(SubElement(column, 'DockArea', name=chart.title), 'plot',
                              style='Steps' if chart.steps else 'Lines', mode='TimeSeries',
                              flip_x='false', flip_y='false')
            low, high = map(str, chart.limits or (-1, 1))
            SubElement(plot, 'range', left='0', right='10', bottom=low, top=high)
            SubElement(plot, 'limitY', {'min': low, 'max': high} if chart.limits else {})
            for curve in chart.curves:
                SubElement(plot, 'curve', name=series(curve, node, prefix), color=curve.colour)
    SubElement(area, 'currentTabIndex', index='0')
    SubElement(root, 'use_relative_time_offset', enabled='1')
    plugin = SubElement(SubElement(root, 'Plugins'), 'plugin', ID=STREAMER)
    topics = [f'{node}/{topic}' for topic in Published(mechanism).names]
    for name, value in (
            ('use_header_stamp', 'true'), ('discard_large_arrays', 'false'),
            ('max_array_size', '100'), ('boolean_strings_to_number', 'false'),
            ('remove_suffix_from_strings', 'false'), ('selected_topics', ';'.join(topics))):
        SubElement(plugin, name, value=value)
    SubElement(root, 'previouslyLoaded_Streamer', name=STREAMER)
    ElementTree.indent(root)
    return f'<?xml version="1.0" encoding="UTF-8"?>\n{ElementTree.tostring(root, "unicode")}\n'


# Foxglove and Lichtblick


def path(curve, node, names):
    """Return the path of a number in a message; arrays of a JointState are by index."""
    return f'{node}/{curve.topic}.{curve.field}[{names[curve.topic].index(curve.name)}]'


def plot(chart, node, names):
    """Return the configuration of a Plot panel."""
    result = {
        'paths': [{'value': path(curve, node, names), 'enabled': True, 'label': curve.name,
                   'color': curve.colour, 'timestampMethod': 'headerStamp', 'showLine': True,
                   'lineSize': 1.5} for curve in chart.curves],
        'showLegend': True, 'legendDisplay': 'left', 'showPlotValuesInLegend': True,
        'showXAxisLabels': True, 'showYAxisLabels': True, 'isSynced': True,
        'xAxisVal': 'timestamp', 'sidebarDimension': 190,
        'lichtblickPanelTitle': chart.title, 'foxglovePanelTitle': chart.title}
    if chart.limits:
        result['minYValue'], result['maxYValue'] = chart.limits
    return result


def column(panels):
    """Return the mosaic of panels of one height below each other."""
    first, *rest = panels
    return {'direction': 'column', 'splitPercentage': 100 / len(panels), 'first': first,
            'second': column(rest)} if rest else first


def foxglove(mechanism, node, prefix):
    """Return a layout as text: the gears and diagnostics on the left, plots on the right."""
    names = Published(mechanism).names
    namespace = node.rpartition('/')[0]
    gears, summary, details = '3D!gears', 'DiagnosticSummary!node', 'DiagnosticStatusPanel!node'
    panels = {
        gears: {
            'cameraState': {
                'perspective': True, 'distance': 0.6, 'phi': 60, 'thetaOffset': 55,
                'target': [0, 0, 0], 'targetOffset': [0, 0, 0],
                'targetOrientation': [0, 0, 0, 1], 'fovy': 45, 'near': 0.01, 'far': 100},
            'followMode': 'follow-pose', 'followTf': f'{prefix}{FRAME}',
            'scene': {'transforms': {'showLabel': False, 'axisScale': 0}}, 'transforms': {},
            'topics': {},
            'layers': {'gears': {
                'instanceId': 'gears', 'layerId': 'foxglove.Urdf', 'label': 'Gears',
                'visible': True, 'frameLocked': True, 'sourceType': 'topic', 'framePrefix': '',
                'topic': f'{namespace}/robot_description', 'displayMode': 'auto',
                'fallbackColor': '#ffffff', 'order': 1}}},
        summary: {'minLevel': 0, 'pinnedIds': [], 'hardwareIdFilter': '',
                  'topicToRender': '/diagnostics', 'sortByLevel': True},
        details: {'topicToRender': '/diagnostics', 'selectedHardwareId': node,
                  'selectedName': f'{node}: loop'}}
    plots = [f'Plot!{chart.curves[0].topic}{n}' for n, chart in enumerate(charts(mechanism))]
    panels |= {name: plot(chart, node, names) for name, chart in zip(plots, charts(mechanism))}
    left = {'direction': 'column', 'splitPercentage': 50, 'first': gears,
            'second': {'direction': 'column', 'splitPercentage': 40, 'first': summary,
                       'second': details}}
    half = (len(plots) + 1) // 2
    right = {'direction': 'row', 'splitPercentage': 50, 'first': column(plots[:half]),
             'second': column(plots[half:])}
    return json.dumps({
        'configById': panels, 'globalVariables': {}, 'userNodes': {},
        'playbackConfig': {'speed': 1},
        'layout': {'direction': 'row', 'splitPercentage': 30, 'first': left, 'second': right}},
        indent=2) + '\n'


def layouts(node='/differential', prefix=''):
    """Return ``{name of a file: its text}`` for a node of that full name."""
    result = {}
    for name, mechanism in MECHANISMS.items():
        mechanism = equipped(mechanism, mechanism.parameters())
        result[f'plotjuggler_{name}.xml'] = plotjuggler(mechanism, node, prefix)
        result[f'foxglove_{name}.json'] = foxglove(mechanism, node, prefix)
    return result


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--node', default='/differential',
                        help='its full name; default: %(default)s')
    parser.add_argument('--joint-prefix', default='', help='as the node has it; default: none')
    parser.add_argument('--out', type=Path, default=FOLDER, help='folder; default: %(default)s')
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    for name, text in layouts(arguments.node, arguments.joint_prefix).items():
        (arguments.out / name).write_text(text)


if __name__ == '__main__':
    main()
