# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The picture of a fit: each measured speed with that of the run, and what is left of it."""

import numpy as np

from dm_ros.files.plot import BESIDE, COLORS, require_matplotlib


def draw(file, fit, drive, title):
    """
    Draw a ``Fit`` to a ``MeasuredDrive`` as PNG into a binary file.

    :raises ValueError: where matplotlib is missing.
    """
    require_matplotlib()
    from matplotlib.figure import Figure

    count = len(drive.speeds)
    figure = Figure(figsize=(10, 3.2 * count + 0.8), dpi=120, layout='constrained')
    figure.suptitle(title, fontweight='bold')
    axes = figure.subplots(2 * count, sharex=True, height_ratios=[2, 1.2] * count)
    columns = zip(drive.speeds.items(), fit.speeds, fit.residuals, fit.noise,
                  axes[::2], axes[1::2], strict=True)
    for (shaft, measured), run, residuals, noise, above, below in columns:
        color = COLORS.get(shaft)
        above.plot(drive.times, measured, '.', color='0.65', markersize=3, label='measured')
        above.plot(drive.times, run, color=color, linewidth=1.1, label='fitted')
        above.set_ylabel(f'{shaft}, rad/s')
        above.legend(**BESIDE)
        below.axhspan(-2 * noise, 2 * noise, color='0.93', linewidth=0, label='twice the rms')
        below.axhline(0.0, color='0.6', linewidth=0.6)
        below.plot(drive.times, residuals, '.', color=color, markersize=3)
        below.set_ylabel('residual, rad/s')
        below.legend(**BESIDE)
        largest = np.nanmax(np.abs(residuals), initial=3 * noise)
        below.set_ylim(-1.1 * largest, 1.1 * largest)
    for ax in axes:
        ax.grid(alpha=0.25)
        ax.spines[['top', 'right']].set_visible(False)
    axes[-1].set_xlabel('time, s')
    figure.align_ylabels(axes)
    figure.savefig(file, format='png')
