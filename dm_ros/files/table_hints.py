# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a table of torques may have meant where it is refused, or runs otherwise than it seems."""

import re
from statistics import median

TIMES = {'time', 'timestamp', 'stamp', 't', 'sec', 'seconds'}
UNITS = {'s', 'sec', 'seconds', 'ms', 'us', 'ns', 'n', 'm', 'nm'}
KINDS = {'torque', 'trq', 'moment', 'effort', 'load', 't', 'shaft', 'wheel'}
SEPARATORS = {';': 'semicolons', '\t': 'tabs', '|': 'bars', ' ': 'spaces'}
LONG = 3600.0       # s; of a file that is longer, rows a second apart may be a millisecond apart
EPOCH_UNITS = ((1e17, 'ns'), (1e14, 'us'), (1e11, 'ms'))   # the year 5138 has 1e11 s
GAP_UNITS = ((5e5, 'ns'), (500.0, 'us'), (2.0, 'ms'))      # s between rows, for 2 Hz to 2 kHz
DIVISORS = {'ms': '1000', 'us': '1e6', 'ns': '1e9'}


def of_header(names, needed, optional):
    """Return a hint on a header with an unknown column, '' for none."""
    for separator, words in SEPARATORS.items():
        if any(len({part.strip(' "') for part in name.split(separator)}
                   & {*needed, *optional}) > 1 for name in names):
            return f'; it has {words}, write commas, and decimal points'
    missing = [name for name in needed if name not in names]
    absent = [name for name in optional if name not in names]
    unknown = [name for name in names if name not in (*needed, *optional)]
    for name in unknown:
        words = re.findall('[a-z]+', name.lower())
        for meant in (*missing, *absent):
            if words[:1] and words[0] in TIMES and not {*words[1:]} - UNITS and meant == 'time':
                return f'; write time for {name!r}, in s'
            if meant in words and not {*words} - {meant} - KINDS - UNITS:
                return f'; write {meant} for {name!r}'
    if missing:
        return ''
    return f'; --ignore-columns "{",".join(dict.fromkeys(unknown))}" passes over what is unknown'


def of_cells(row, header):
    """Return a hint on a row that has more cells than the header, '' for none."""
    if len(row) > len(header) and all(re.fullmatch(r'\s*[-+]?\d+\s*', cell) for cell in row):
        return '; if commas are its decimal signs, write points'
    return ''


def of_number(name, cell, row, is_first):
    """Return a hint on a cell that is no number, '' for none; row: with all cells."""
    if re.fullmatch(r'\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*', cell):
        return '; write a decimal point, not a comma'
    if is_first and not any(map(_is_number, row)):
        return '; if this row has the units, take it out'
    if name == 'time' and re.search(r'\d[:/T-]\d', cell):
        return '; a time is in seconds'
    return ''


def _is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


def of_times(times, begin):
    """
    Return a hint on times that look like another unit than s, '' for none.

    :param times: from 0 on, s; begin: what the file calls time 0.
    """
    unit = next((unit for least, unit in EPOCH_UNITS if begin >= least), None)
    if unit is None and len(times) >= 10:
        gap = median(after - before for before, after in zip(times, times[1:]))
        unit = next((unit for least, unit in GAP_UNITS if gap >= least), None)
        if unit is None and gap >= 1.0 and times[-1] >= LONG:
            unit = 'ms'
    return f'; if its times are in {unit}, divide them by {DIVISORS[unit]}' if unit else ''
