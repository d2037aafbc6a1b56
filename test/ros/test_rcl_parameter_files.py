# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Parameter files mean to the tools what they mean to rcl, or are refused."""

import random

import pytest
import rclpy
from rclpy.parameter import Parameter

from dm_ros.files.parameter_file import read_parameter_file

KINDS = {Parameter.Type.BOOL: bool, Parameter.Type.INTEGER: int, Parameter.Type.DOUBLE: float,
         Parameter.Type.STRING: str}
SCALARS = """
5 05 010 08 09.5 08e1 -05 +05 00 0o10 0x10 -0X1f 0x1p3 0x.8 0b11 1_000 1e3 1E3 .5 5. 1.e1 - . 1e
9223372036854775807 9223372036854775808 0xffffffffffffffff 0777777777777777777777777
1e999 1e-999 1e-310 0e-999 inf -.inf .Inf .iNF nan .NaN -.nan y NO on tRue ~ null "5" '05' 5#c
""".split()


@pytest.fixture
def rcl(tmp_path, monkeypatch):
    """Return a function: the parameters that rcl gives to a node, None where it refuses."""
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')

    def read(text):
        path = tmp_path / 'rcl.yaml'
        path.write_text(text)
        context = rclpy.Context()
        try:
            rclpy.init(args=['--ros-args', '--params-file', str(path)], context=context)
        except RuntimeError:
            return None
        try:
            node = rclpy.create_node('differential', context=context,
                                     automatically_declare_parameters_from_overrides=True)
            found = node.get_parameters_by_prefix('qos_overrides')
            node.destroy_node()
            return {f'qos_overrides.{name}': (KINDS.get(parameter.type_, list), parameter.value)
                    for name, parameter in found.items()}
        finally:
            context.shutdown()
    return read


@pytest.fixture
def tool(tmp_path):
    """Return a function: the parameters that the tools read, None where they refuse."""
    def read(text):
        path = tmp_path / 'tool.yaml'
        path.write_text(text)
        try:
            return {name: (type(value), value)
                    for name, value in read_parameter_file(path).items()}
        except ValueError as error:
            assert '\n' not in str(error)
            return None
    return read


def drawn(count):
    """Return texts that are nearly numbers, the same in each run."""
    source = random.Random(5)
    return [''.join(source.choices('0123456789.eExX+-abfnip', k=source.randint(1, 6)))
            for _ in range(count)]


def test_a_scalar_has_the_type_and_value_that_rcl_gives_it(rcl, tool):
    texts = SCALARS + drawn(300)
    different = {}
    for text in texts:
        file = f'/**:\n  ros__parameters:\n    qos_overrides:\n      a: {text}\n'
        answers = rcl(file), tool(file)
        if str(answers[0]) != str(answers[1]):   # a nan is not equal to itself
            different[text] = answers
    assert not different
    for text in ('>-\n        05', '|-\n        1.5', '|\n        1.5', '>-\n        yes'):
        file = f'/**:\n  ros__parameters:\n    qos_overrides:\n      a: {text}\n'
        assert rcl(file) == tool(file) is not None


Q = 'qos_overrides'


@pytest.mark.parametrize('text', [
    f'/**: {{R: {{{Q}: {{a: 1}}, {Q}: {{b: 2}}}}}}',
    f'/**: {{R: {{{Q}: {{a: 1}}, {Q}.b: 2}}}}',
    f'/**: {{R: {{{Q}.a: 1}}}}\n/**: {{R: {{{Q}.a: 2}}}}',
    f'/**: {{R: {{{Q}.a: 1, {Q}.b: 3}}}}\ndifferential: {{R: {{{Q}.a: 2}}}}',
    f'differential: {{R: {{{Q}.a: 1}}}}\n/**: {{R: {{{Q}.a: 2}}}}',
    f'/**: {{R: {{{Q}.a: 1}}}}\n---\n/**: {{R: {{{Q}.a: 2}}}}',
    f'/**: {{x: {{R: {{{Q}.a: 1}}}}, R: {{{Q}.b: 1}}}}',
    f'/: {{differential: {{R: {{{Q}.a: 1}}}}}}', f'/**/*: {{R: {{{Q}.a: 1}}}}',
    f'/**: {{R: {{{Q}.a: [05, 6]}}}}', '/**: {R: {}}', '/**: {}'])
def test_what_sections_add_up_to_is_what_rcl_makes_of_them(rcl, tool, text):
    text = text.replace('R:', 'ros__parameters:')
    assert rcl(text) == tool(text) is not None


@pytest.mark.parametrize('text', [
    f'/**: {{R: {{{Q}.a: 1}}, R: {{{Q}.b: 2}}}}',
    f'/**: {{R: {{{Q}.a: 1}}, differential: {{R: {{{Q}.a: 2}}}}}}',
    f'/**: {{R: {{{Q}: {{}}, rate: 1.0}}}}', '/**: {R: {"": 1}}', '"": {R: {rate: 1.0}}',
    '/differential/: {R: {rate: 1.0}}', '//differential: {R: {rate: 1.0}}',
    '/diff*: {R: {rate: 1.0}}', '/**: {R: {[rate]: 1.0}}', '/**: {R: {? {rate: 1} : 1.0}}',
    f'/**: {{R: {{{Q}.a: [1, x]}}}}', f'/**: {{R: {{{Q}.a: [1, 2.0]}}}}'])
def test_what_rcl_refuses_is_refused(rcl, tool, text):
    text = text.replace('R:', 'ros__parameters:')
    assert rcl(text) is tool(text) is None


@pytest.mark.parametrize('parameters, meaning', [
    (f'{Q}.a: 1, {Q}.a: 2', {f'{Q}.a': (int, 2)}),
    (f'{Q}.a: 1, {Q}: {{a: 2}}', {f'{Q}.a': (int, 2)}),
    (f'{Q}.a: 1, {Q}.a: {{b: 2}}', {f'{Q}.a.b': (int, 2)}),
    (f'{Q}.a: !!float 5', {f'{Q}.a': (int, 5)}),
    (f'{Q}.a: !!str 5', {f'{Q}.a': (str, '5')})])
def test_what_rcl_takes_but_nobody_can_have_meant_is_refused(rcl, tool, parameters, meaning):
    """As doc/parameters.md says; the first halves show that it says so rightly."""
    text = f'/**: {{ros__parameters: {{{parameters}}}}}'
    assert rcl(text) == meaning
    assert tool(text) is None
