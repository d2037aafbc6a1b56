# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What a fit found, as text for a reader, as data for a program, as a file for the next run."""

import math

from dm_ros.files.parameter_file import written

INTERVAL = '95 % interval'


def as_text(fit, worth, title):
    """Return lines: the estimates with their intervals, the correlations, the residuals."""
    rows = [('parameter', 'unit', 'start', 'estimate', INTERVAL)]
    rows += [(f'{n} {e.name}', '' if e.unit == '1' else e.unit, f'{e.start:.6g}',
              f'{e.value:.6g}', f'{e.low:.6g} to {e.high:.6g}')
             for n, e in enumerate(worth.estimates, 1)]
    lines = [title, '', *_aligned(rows, left=2)]
    if len(worth.estimates) > 1:
        lines += ['', 'correlation of their errors', '', *_aligned([
            ('', *map(str, range(1, len(worth.estimates) + 1))),
            *((str(n), *(f'{share:+.3f}' for share in row))
              for n, row in enumerate(worth.correlation, 1))])]
    lines += ['', *_aligned([
        ('residuals of', 'rms, rad/s', 'measurements', 'worth'),
        *((f'velocity.{shaft}', f'{noise:.4g}', str(worth.measured[shaft]),
           f'{worth.independent[shaft]:.0f}')
          for shaft, noise in zip(worth.measured, fit.noise))], left=1)]
    return '\n'.join(lines) + '\n'


def _aligned(rows, left=1):
    widths = [max(map(len, column)) for column in zip(*rows)]
    return ['  '.join(cell.ljust(width) if index < left else cell.rjust(width)
                      for index, (cell, width) in enumerate(zip(row, widths))).rstrip()
            for row in rows]


def as_data(fit, worth, title):
    """Return what can be written as JSON; a number without end is None."""
    return {
        'title': title, 'converged': fit.converged, 'runs': fit.runs,
        'parameters': {e.name: {
            'unit': e.unit, 'start': e.start, 'estimate': e.value, 'low': e.low, 'high': e.high,
            'alone_low': e.alone_low, 'alone_high': e.alone_high} for e in worth.estimates},
        'correlation': [[share if math.isfinite(share) else None for share in row]
                        for row in worth.correlation.tolist()],
        'residuals': {f'velocity.{shaft}': {
            'rms': noise, 'measurements': worth.measured[shaft],
            'independent': worth.independent[shaft]}
            for shaft, noise in zip(worth.measured, fit.noise.tolist())},
        'warnings': list(worth.warnings)}


def as_parameter_file(values, worth, title):
    """Return the text of a parameter file: the values of a run, with the estimates in it."""
    return written(
        values | {e.name: e.value for e in worth.estimates},
        {e.name: f'{INTERVAL}: {e.low:.6g} to {e.high:.6g}' for e in worth.estimates},
        [title, *(f'warning: {line}' for line in worth.warnings)])
