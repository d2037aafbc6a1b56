# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The figures of the comparison, in the arrangement of the paper's."""

import numpy as np

from dm_ros.files.plot import COLORS
from dm_ros.mechanism.variants import SELF_LOCKING, SYMMETRIC, variants_of
from dm_ros.tools.comparison.measures import all_moments, difference, relative_rms
from dm_ros.tools.comparison.runs import RATE, RATES

AXES = ('carrier', 'left', 'right', 'front', 'rear')
VARIANT_COLORS = {'symmetric_ode': '#222222', 'symmetric_dae': '#d1441f',
                  'lsd_lagged': '#d1441f', 'lsd_ode': '#222222', 'lsd_dae': '#1f6fb5'}
SYMBOLS = {'front_mesh': 'M₁', 'rear_mesh': 'M₂', 'front_clutch': 'F₁', 'rear_clutch': 'F₂'}
DPI = 110


def new_figure(title, width, height):
    """Return a figure without pyplot: no display, and nothing is left behind."""
    from matplotlib.figure import Figure
    figure = Figure(figsize=(width, height), dpi=DPI, layout='constrained')
    figure.suptitle(title, fontweight='bold', fontsize=12)
    return figure


def draw(ax, title, unit, time, curves, held=False):
    """Draw curves by name, each in its colour, with a legend that hides none."""
    ax.set_title(title, loc='left', fontsize=10)
    scale = 1.0
    largest = max(np.abs(values).max() for values in curves.values())
    if 0.0 < largest < 1e-3:   # rounding, in readable numbers
        power = int(np.floor(np.log10(largest)))
        scale, unit = 10.0**-power, unit.replace(', ', f', $10^{{{power}}}$ ')
    ax.set_ylabel(unit)
    for name, values in curves.items():
        change, _, base = name.rpartition(' ')
        label = f'{change} {SYMBOLS.get(base, base)}'.strip()
        how = {'color': COLORS.get(base), 'linewidth': 1.1, 'label': label}
        if held:   # from the end of the preceding tick on
            ax.step(time, values * scale, where='pre', **how)
        else:
            ax.plot(time, values * scale, **how)
    ax.axhline(0.0, color='0.6', linewidth=0.6, zorder=0)
    legend(ax)
    finish(ax, time)


def legend(ax):
    """Put the legend above the panel, at its right."""
    handles, _ = ax.get_legend_handles_labels()
    ax.legend(loc='lower right', bbox_to_anchor=(1.0, 0.985), ncols=len(handles), frameon=False,
              fontsize=8.5, handlelength=1.3, columnspacing=1.0, borderaxespad=0.2)


def finish(ax, time):
    ax.grid(alpha=0.25)
    ax.spines[['top', 'right']].set_visible(False)
    ax.set_xlim(0.0, time[-1])
    ax.set_xlabel('time, s')


def draw_index(ax, title, record):
    """Draw the power-flow index."""
    ax.set_title(title, loc='left', fontsize=10)
    ax.step(record.time, record.power_flow, where='pre', color='#222222', linewidth=1.1)
    ax.fill_between(record.time, -1.5, 1.5, where=record.power_flow < 0, step='pre',
                    color='#d1441f', alpha=0.12, linewidth=0)
    ax.set_ylim(-1.5, 1.5)
    ax.set_yticks([-1, 1], ['−1 reverse', '+1 direct'])
    finish(ax, record.time)


def main_speeds(record):
    return {name: values for name, values in record.velocity.items() if name in AXES}


def deltas(to, base):
    return {f'Δ {name}': values - base[name] for name, values in to.items()}


def figure_3(runs):
    """Draw loads, speeds of all elements and index of the symmetric differential."""
    r = runs.records['symmetric_ode', RATE]
    figure = new_figure('Figure 3: symmetric differential, variant 1', 10, 8.2)
    a, b, c = figure.subplots(3, height_ratios=[1.0, 1.5, 0.5])
    draw(a, '(a) external load', 'torque, N m', r.time, r.torque, held=True)
    draw(b, '(b) angular speeds of the elements', 'speed, rad/s', r.time, r.velocity)
    draw_index(c, '(c) power-flow index', r)
    return figure


def figure_4(runs):
    """Draw the root mean square of the relative difference of the symmetric variants."""
    first, second = (runs.records[variant, RATE] for variant in variants_of(SYMMETRIC))
    figure = new_figure('Figure 4: the two symmetric variants, root mean square of the '
                        'relative difference', 10, 3.6)
    ax = figure.subplots()
    values = relative_rms(second, first)
    ax.plot(first.time, np.where(values > 0.0, values, np.nan), color='#222222', linewidth=0.7)
    eps = np.finfo(float).eps
    ax.axhline(eps, color='#1f6fb5', linewidth=1.0, linestyle='--')
    ax.annotate(f'rounding of one number, {eps:.1e}', (1.0, eps), (0, -4),
                ('axes fraction', 'data'), 'offset points', ha='right', va='top',
                color='#1f6fb5', fontsize=8.5)
    ax.set_yscale('log')
    ax.set_ylim(1e-17, max(1e-9, 3 * values.max()))
    ax.set_ylabel('relative difference')
    finish(ax, first.time)
    return figure


def figure_7(runs):
    """Draw the self-locking differential and how far its variants are apart."""
    lagged, ode, dae = (runs.records[variant, RATE] for variant in variants_of(SELF_LOCKING))
    figure = new_figure('Figure 7: self-locking differential, variant 2, and its differences '
                        'to the others', 12, 10)
    (a, b), (c, d), (f, g) = figure.subplots(3, 2, height_ratios=[1.35, 1.0, 1.0])
    draw(a, '(a) angular speeds', 'speed, rad/s', ode.time, main_speeds(ode))
    draw(b, '(b) friction and gear moments', 'moment, N m', ode.time, ode.moment)
    draw(c, '(c) load', 'torque, N m', ode.time, ode.torque, held=True)
    draw_index(d, '(d) power-flow index', ode)
    for ax, title, other in ((f, '(f) variant 2 − variant 1', lagged),
                             (g, '(g) variant 2 − variant 3', dae)):
        draw(ax, title, 'difference, rad/s', ode.time,
             deltas(main_speeds(ode), other.velocity))
    return figure


def figure_8(runs):
    """Draw what changes when the proportional friction is taken away."""
    base, without = runs.records['lsd_ode', RATE], runs.without
    figure = new_figure('Figure 8: without proportional friction (alpha = 0), '
                        'less with it, variant 2', 10, 7)
    a, b = figure.subplots(2)
    draw(a, '(a) angular speeds', 'difference, rad/s', base.time,
         deltas(main_speeds(without), base.velocity))
    draw(b, '(b) internal torques', 'difference, N m', base.time,
         deltas(without.moment, base.moment))
    return figure


def figure_lag(runs):
    """Draw the error of the variants over the rate, and the lag of a clutch moment."""
    figure = new_figure('What the lag of variant 1 costs (no figure of the paper)', 12, 4.2)
    left, right = figure.subplots(1, 2, width_ratios=[1.0, 1.25])
    left.set_xscale('log')
    for variant in ('lsd_lagged', 'lsd_ode'):
        for quantity, unit, style in (('speed_rms', 'speeds, rad/s', '-o'),
                                      ('moment_rms', 'moments, N m', '--s')):
            errors = [getattr(difference(runs.records[variant, rate], runs.exact[rate]), quantity)
                      for rate in RATES]
            left.plot(RATES, errors, style, color=VARIANT_COLORS[variant], linewidth=1.2,
                      markersize=4, label=f'{variant}, {unit}')
            if all(errors):   # not at rest
                left.set_yscale('log')
    left.set(xlabel='rate, Hz', ylabel='RMS difference')
    left.set_title('to the exact solution', loc='left', fontsize=10)
    left.set_xticks(RATES, ['100', '1,000', '10,000'])
    left.minorticks_off()
    left.grid(alpha=0.25)
    left.spines[['top', 'right']].set_visible(False)
    left.legend(frameon=False, fontsize=8.5, loc='upper left', ncols=2,
                bbox_to_anchor=(0.0, -0.17))

    rate = RATES[0]
    lagged, exact = runs.records['lsd_lagged', rate], runs.exact[rate]
    window = slice(*window_of(lagged, exact, rate))
    time = lagged.time[window]
    for name, color, curve in (
            ('exact', '#222222', exact.moment[window, 3]),
            (f'lsd_lagged at {rate} Hz', VARIANT_COLORS['lsd_lagged'],
             lagged.moment['rear_clutch'][window])):
        right.plot(time, curve, '-o', color=color, linewidth=1.1, markersize=2.5, label=name)
    right.set_title('rear clutch moment', loc='left', fontsize=10)
    right.set_ylabel('moment, N m')
    legend(right)
    finish(right, time)
    right.set_xlim(time[0], time[-1])
    return figure


def window_of(lagged, exact, rate):
    """Return first and last tick of the half second in which the rear clutch is worst met."""
    ticks = len(exact.power_flow)
    width = min(ticks, max(2, rate // 2))
    error = np.cumsum(np.concatenate([[0.0], (all_moments(lagged)[:, 3] - exact.moment[:, 3])**2]))
    start = int(np.argmax(error[width:] - error[:-width]))
    return start, start + width


FIGURES = {   # file: (mechanism, how it is drawn, what is seen)
    'figure-3.png': (SYMMETRIC, figure_3, """
        As in the paper the torques on left and right are in phase, the left a little larger, and
        the carrier gets nearly the opposite of their sum; so the outputs run apart in opposite
        directions, and what is left over swings the carrier to and fro. The final drive ratio
        is positive here, hence the sign of the pinion."""),
    'figure-4.png': (SYMMETRIC, figure_4, """
        At each tick over the speeds of all five elements and the index, relative to variant 1.
        Peaks stand where a speed passes through zero, so that next to nothing is divided by;
        less than 1e-9 of the largest speed counts as rest and is left out."""),
    'figure-7.png': (SELF_LOCKING, figure_7, """
        M₁ and M₂ are the gear moments, F₁ and F₂ the clutch moments of front and rear; M is
        positive when the mechanism drives the shaft, in both directions of flow. Mind the
        scale of (g). The paper has no part (e)."""),
    'figure-8.png': (SELF_LOCKING, figure_8, """
        The same load with the pressure angle 0, which leaves the preload friction alone. To get
        the curves without proportional friction, add these to Figure 7. Where ΔM and ΔF of a
        shaft coincide, its mesh had to carry the moment of its clutch on top of the load."""),
    'lag.png': (SELF_LOCKING, figure_lag, """
        Left: the difference to the exact solution without lag. Right: the half second in which
        the rear clutch moment of the lagged variant is furthest from it."""),
}
