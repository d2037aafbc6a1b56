# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Parameter files as ROS 2 reads them, without ROS, and the text of the default files.

ROS 2 has its own notion of a YAML parameter file: ``1e-3`` is a double (to PyYAML it is a
string), ``5`` is no double, a name may be nested or dotted. This reader sees what a node
``/differential`` would see, and refuses what the node would refuse; also what ROS 2 lets through
without a word and nobody can have meant, such as a name given twice.
"""

import json
import re
import sys
import textwrap

import yaml

from dm_ros.settings import known_rows, tables

NODE = '/differential'
TYPE_NAMES = {bool: 'a bool', int: 'an integer', float: 'a double', str: 'a string',
              list: 'a list'}
# what every ROS 2 node takes beside its own parameters
ROS_PARAMETERS = re.compile(r'use_sim_time|start_type_description_service|qos_overrides\..+')

BOOLS = {**dict.fromkeys('y Y yes Yes YES true True TRUE on On ON'.split(), True),
         **dict.fromkeys('n N no No NO false False FALSE off Off OFF'.split(), False)}
# strtol and strtod of C: 010 is 8, 08 is a double, 0x1p3 as well
INTEGER = re.compile(r'[-+]?(0[xX][0-9a-fA-F]+|0[0-7]*|[1-9][0-9]*)')
DOUBLE = re.compile(r'[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?')
HEXADECIMAL = re.compile(r'[-+]?0[xX]([0-9a-fA-F]+\.?[0-9a-fA-F]*|\.[0-9a-fA-F]+)'
                         r'([pP][-+]?[0-9]+)?')
NOT_FINITE = re.compile(r'[-+]?(?i:inf|infinity|nan)|[-+]?\.(inf|Inf|INF)|\.(nan|NaN|NAN)')
# a key of a section: names of namespaces and of a node, or what stands for any
SECTION = re.compile(r'/|/?(\*\*?|\w+)(/(\*\*?|\w+))*', re.ASCII)


def read_parameter_file(path, node=NODE, rows=None):
    """
    Return the parameters that a file gives to a node ``/differential``, or of another full name.

    :param rows: ``{full name: Row}`` of all parameters that such a node may have, each of which
        is checked alone; None for those of ``/differential``, checked together too.
    :return: ``{full name: value}``, only those in the file.
    :raises ValueError: one line, ``file: name: what``, for a file that cannot be read, an
        unknown name, a value that is not allowed, or values that make an impossible mechanism.
    """
    try:
        values = {}
        for name_of_node, parameters in _sections(_documents(path)):
            if is_for_node(name_of_node, node):
                values.update(_flat(parameters))
        known = known_rows() if rows is None else rows
        for name, row in known.items():
            if name in values:
                _check_type(name, values[name], row.kind)
                row.checked(name, values[name])
        for table in tables() if rows is None else ():
            table().changed(table.part_of(values))
        _check_other_names(values, known)
    except ValueError as error:
        raise ValueError(f'{path}: {error}') from None
    return values


def missing(path, node=NODE):
    """Return in one line that a file is for other nodes alone, None where it is not."""
    names = [name for name, _ in _sections(_documents(path))]
    if not names or any(is_for_node(name, node) for name in names):
        return None
    return f'{path}: nothing in it is for {node}, but for {", ".join(names)}'


def _documents(path):
    """Return the root nodes of a YAML file; nothing is constructed from them."""
    try:
        with open(path, encoding='utf-8') as file:
            text = file.read()
        for event in yaml.parse(text, Loader=yaml.SafeLoader):
            if isinstance(event, yaml.AliasEvent):   # few of them can stand for billions
                raise ValueError(f'line {event.start_mark.line + 1}: '
                                 f'ROS 2 knows no YAML aliases such as *{event.anchor}')
            if getattr(event, 'tag', None):   # it heeds !!str alone and passes over all others
                raise ValueError(f'line {event.start_mark.line + 1}: '
                                 'ROS 2 goes by the form of a value, not by its YAML tag')
        return [root for root in yaml.compose_all(text, Loader=yaml.SafeLoader) if root]
    except OSError as error:
        raise ValueError(error.strerror) from None
    except UnicodeDecodeError:
        raise ValueError('not a text file in UTF-8') from None
    except yaml.MarkedYAMLError as error:
        raise ValueError(f'line {error.problem_mark.line + 1}: not YAML: '
                         f'{" ".join(error.problem.split())}') from None
    except yaml.YAMLError as error:
        raise ValueError(f'not YAML: {" ".join(str(error).split())}') from None
    except RecursionError:
        raise ValueError('nested too deeply') from None


def _sections(roots, above=''):
    """Yield (name of a node, its ros__parameters) in the order of the file."""
    for root in roots:
        if not isinstance(root, yaml.MappingNode):
            raise ValueError(f'{above or "the file"}: there is no ros__parameters, a parameter '
                             'file has sections such as "/**: ros__parameters:"')
        ended = False
        for key, value in root.value:
            name, line = _key(key), key.start_mark.line + 1
            if ended:
                raise ValueError(f'{name}: nothing may follow the ros__parameters of a node, '
                                 f'line {line}')
            if name == 'ros__parameters':
                if not above:
                    raise ValueError('ros__parameters: it must be below a node, such as "/**:"')
                ended = True
                yield above, value
            elif SECTION.fullmatch(name):
                yield from _sections([value], f'{above}/{name}'.replace('//', '/'))
            else:
                raise ValueError(f'{name}: it cannot be the name of a node, line {line}')


def _key(node):
    """Return the text of a key."""
    if not isinstance(node, yaml.ScalarNode) or not node.value:
        raise ValueError(f'line {node.start_mark.line + 1}: a name is expected before the colon')
    return node.value


def is_for_node(section, node):
    """Return whether ROS 2 applies a section to a node: ** is any namespaces, * is one."""
    words = {'**': r'(/\w+)*', '*': r'/\w+'}
    pattern = ''.join(words.get(token, '/' + re.escape(token))
                      for token in section.split('/') if token)
    return re.fullmatch(pattern, node) is not None


def _flat(parameters, above=''):
    """Return ``{dotted name: value}`` of a mapping with nested and dotted names alike."""
    if not isinstance(parameters, yaml.MappingNode):
        raise ValueError(f'{above or "ros__parameters"}: '
                         'names with values are expected below it')
    if above and not parameters.value:
        raise ValueError(f'{above}: there is no name below it')
    flat, single = {}, set()
    for key, node in parameters.value:
        name = f'{above}.{_key(key)}' if above else _key(key)
        if isinstance(node, yaml.MappingNode):
            below = _flat(node, name)
        elif isinstance(node, yaml.SequenceNode):
            below = {name: _list(name, node)}
        else:
            below = {name: _scalar(name, node)}
        mine = below.keys() if isinstance(node, yaml.MappingNode) else {name}
        for twice in sorted(flat.keys() & mine | single & {name}):
            raise ValueError(f'{twice}: given twice, again in line {key.start_mark.line + 1}; '
                             'a node would take the last without a word')
        if not isinstance(node, yaml.MappingNode):
            single.add(name)
        flat.update(below)
    return flat


def _list(name, node):
    """Return the values of a list; ROS 2 has only those of one type."""
    if not all(isinstance(element, yaml.ScalarNode) for element in node.value):
        raise ValueError(f'{name}: a list has single values alone')
    values = [_scalar(name, element) for element in node.value]
    if len(set(map(type, values))) > 1:
        raise ValueError(f'{name}: {values!r} has values of several types')
    return values


def _scalar(name, node):
    """Return the value of a scalar with the type that ROS 2 gives it."""
    text = node.value
    if node.style in ('"', "'"):
        return text
    if not text:
        raise ValueError(f'{name}: there is no value')
    if text in BOOLS:
        return BOOLS[text]
    if INTEGER.fullmatch(text):
        digits = text.lstrip('+-')
        base = 16 if digits[:2] in ('0x', '0X') else 8 if digits[0] == '0' else 10
        value = int(text, base)
        if -2**63 <= value < 2**63:
            return value
    if NOT_FINITE.fullmatch(text):
        return float(text.replace('.', ''))
    if DOUBLE.fullmatch(text) or HEXADECIMAL.fullmatch(text):
        return _double(text)
    return text


def _double(text):
    """Return a double; what is beyond the range of doubles is a string to ROS 2."""
    is_hexadecimal = 'x' in text.lower()
    try:
        value = float.fromhex(text) if is_hexadecimal else float(text)
    except OverflowError:
        return text
    digits = re.split('[pP]' if is_hexadecimal else '[eE]', text)[0]
    is_zero = not re.search('[1-9a-fA-F]', digits)
    return value if is_zero or sys.float_info.min <= abs(value) <= sys.float_info.max else text


def _check_type(name, value, kind):
    """Refuse a value of another type than the parameter's: ROS 2 converts none."""
    if type(value) is kind:
        return
    hint = f', write {value}.0' if (type(value), kind) == (int, float) else ''
    raise ValueError(f'{name}: {value!r} is {TYPE_NAMES[type(value)]}, '
                     f'it must be {TYPE_NAMES[kind]}{hint}')


def _check_other_names(values, known):
    for name, value in values.items():
        if name not in known and not ROS_PARAMETERS.fullmatch(name):
            raise ValueError(f'{name}: there is no such parameter')
        if name in ('use_sim_time', 'start_type_description_service'):
            _check_type(name, value, bool)


WIDTH = 100   # of a line
HEADER = """\
# The defaults of the {title}, {source} of the paper.
#
# A ROS 2 parameter file: copy it, change values or leave them out, and hand it over with
#   ros2 run dm_ros differential --ros-args -p variant:={variant} --params-file FILE
#   ros2 run dm_ros simulate --variant {variant} --params FILE --torques IN.csv
# A double needs its decimal point: 5.0, not 5. Comments: symbol, unit, meaning.
/**:
  ros__parameters:
"""


def default_text(mechanism):
    """Return the text of the parameter file with the defaults of a ``Mechanism``."""
    table = mechanism.parameters
    tree = {}
    for symbol, (name, row) in table.rows().items():
        *groups, leaf = name.split('.')
        branch = tree
        for group in groups:
            branch = branch.setdefault(group, {})
        unit = '' if row.unit == '1' else f', {row.unit}'
        branch[leaf] = _number(getattr(table(), symbol)), f'{symbol}{unit}: {row.description}'
    return HEADER.format(**mechanism._asdict()) + ''.join(_lines(tree, '    '))


def written(values, comments, header):
    """
    Return the text of a parameter file.

    :param values: ``{full name: value}``; comments: ``{full name: text}`` of some of them.
    :param header: lines that stand above.
    """
    lines = [f'# {line}\n' for line in header] + ['/**:\n', '  ros__parameters:\n']
    for name, value in values.items():
        text = _number(value) if type(value) in (int, float) else json.dumps(value)
        comment = f'  # {comments[name]}' if name in comments else ''
        lines.append(f'    {name}: {text}{comment}\n')
    return ''.join(lines)


def _lines(tree, indent):
    for name, entry in tree.items():
        if isinstance(entry, dict):
            yield f'{indent}{name}:\n'
            yield from _lines(entry, indent + '  ')
            continue
        value, comment = entry
        line = f'{indent}{name}: {value}'
        if len(f'{line}  # {comment}') <= WIDTH:
            yield f'{line}  # {comment}\n'
        else:
            mark = f'{indent}# '
            yield textwrap.fill(comment, WIDTH, initial_indent=mark, subsequent_indent=mark)
            yield f'\n{line}\n'


def _number(value):
    """Return a number as text that both ROS 2 and YAML 1.1 read alike: 4.0e-05, not 4e-05."""
    text = repr(value)
    return text.replace('e', '.0e') if 'e' in text and '.' not in text else text
