# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Everything that a layout shows is in a message that the node publishes."""

import json
from pathlib import Path
import re
from xml.etree import ElementTree

from diagnostic_msgs.msg import DiagnosticArray
import pytest
from sensor_msgs.msg import JointState

from dm_ros.mechanism.variants import MECHANISMS

FOLDER = Path(__file__).parents[2] / 'config' / 'layouts'


def series(topic, message):
    """Return the names that PlotJuggler gives to the numbers of a JointState."""
    return {f'{topic}/{name}/{field}' for field in ('position', 'velocity', 'effort')
            for name, _ in zip(message.name, getattr(message, field))}


@pytest.fixture
def published(ros):
    """Return what starts a node and returns the messages of a tick on some topics."""
    def call(name, topics):
        ros.differential(MECHANISMS[name].variant, mode='lockstep')
        heard = {topic: ros.listen(JointState, topic) for topic in topics}
        ros.publisher(JointState, '/differential/torques').publish(JointState())
        ros.until(lambda: all(heard.values()))
        return {topic: messages[0] for topic, messages in heard.items()}
    return call


@pytest.mark.parametrize('name', MECHANISMS)
def test_plotjuggler_has_every_curve(published, name):
    root = ElementTree.parse(FOLDER / f'plotjuggler_{name}.xml').getroot()
    topics = root.find('Plugins/plugin/selected_topics').get('value').split(';')
    there = set().union(*(series(topic, message)
                          for topic, message in published(name, topics).items()))
    wanted = [curve.get('name') for curve in root.iter('curve')]
    assert wanted and set(wanted) <= there
    assert {topic for topic in topics if any(c.startswith(f'{topic}/') for c in wanted)} == set(
        topics)


@pytest.mark.parametrize('name', MECHANISMS)
def test_foxglove_has_every_path_at_the_index_of_its_label(published, ros, name):
    panels = json.loads((FOLDER / f'foxglove_{name}.json').read_text())['configById']
    paths = [path for config in panels.values() for path in config.get('paths', ())]
    parts = [re.fullmatch(r'([\w/]+)\.(\w+)\[(\d+)\]', path['value']).groups() for path in paths]
    messages = published(name, {topic for topic, _, _ in parts})
    for path, (topic, field, index) in zip(paths, parts, strict=True):
        assert messages[topic].name[int(index)] == path['label']
        assert len(getattr(messages[topic], field)) > int(index)
    diagnostics = ros.listen(DiagnosticArray, '/diagnostics')
    ros.until(lambda: diagnostics)
    shown = panels['DiagnosticStatusPanel!node']
    assert (shown['selectedHardwareId'], shown['selectedName']) in [
        (status.hardware_id, status.name) for status in diagnostics[0].status]
