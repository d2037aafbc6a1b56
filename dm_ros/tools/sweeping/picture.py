# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A picture of a sweep: each metric over each parameter that was varied."""

import numpy as np

FEW = 5000   # sets that are drawn as points; more as how many there are in a place
COLOR = '#1f6fb5'


def draw(file, columns, names, title):
    """
    Draw a result as PNG.

    :param file: binary; columns: ``{Axis: values}`` of what was varied.
    :param names: ``{metric: values}``; title: what stands above.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(1.5 + 3.2 * len(columns), 1.0 + 2.4 * len(names)), dpi=120,
                    layout='constrained')
    figure.suptitle(title, fontweight='bold')
    axes = figure.subplots(len(names), len(columns), sharex='col', sharey='row', squeeze=False)
    for line, (metric, y) in zip(axes, names.items()):
        for ax, (axis, x) in zip(line, columns.items()):
            _draw(ax, x, y, axis.is_log)
        line[0].set_ylabel(metric)
    for ax, axis in zip(axes[-1], columns):
        unit = '' if axis.row.unit == '1' else f', {axis.row.unit}'
        ax.set_xlabel('.\n'.join(axis.name.rsplit('.', 1)) + unit)
    figure.savefig(file, format='png')


def _draw(ax, x, y, is_log):
    ax.grid(alpha=0.25)
    ax.spines[['top', 'right']].set_visible(False)
    if is_log:
        ax.set_xscale('log')
    good = np.isfinite(y)
    if good.sum() > FEW and np.ptp(x[good]) > 0.0 and np.ptp(y[good]) > 0.0:
        ax.hexbin(x[good], y[good], gridsize=60, bins='log', mincnt=1, cmap='viridis',
                  xscale='log' if is_log else 'linear', linewidths=0.1)
    else:
        ax.plot(x[good], y[good], '.', color=COLOR, markersize=4 if len(x) < 500 else 2)
