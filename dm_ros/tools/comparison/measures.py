# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""What is measured of the runs of the comparison: numbers, without words."""

from typing import NamedTuple

import numpy as np

LOCKED = 0.5             # rad/s: with less slip the shafts count as locked
SLIDING = 2.0            # rad/s: with more slip they count as sliding
CLEAR = 0.02             # s, how far from a change of state a tick of steady sliding is
TRANSITION = 0.1         # s after a change of direction
MOST_LAG = 5             # ticks


def rms(values):
    """Return the root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def three_speeds(record):
    """Return the speeds of the carrier and the two output shafts, (ticks, 3)."""
    return np.column_stack(list(record.velocity.values())[:3])


def all_moments(record):
    """Return the internal moments, (ticks, moments)."""
    return np.column_stack(list(record.moment.values()))


class Difference(NamedTuple):
    """How far a run is from another."""

    speed: float          # rad/s, largest of the carrier and the two outputs
    speed_rms: float
    moment: float         # N m, largest of the internal moments
    moment_rms: float
    relative_speed: float     # RMS of the difference over RMS of the speeds
    relative_moment: float    # RMS of the difference over RMS of the moments
    other_index: int      # ticks with another index


def difference(record, exact):
    """Return the ``Difference`` of a ``Record`` from an ``Exact``."""
    speeds, moments = three_speeds(record), all_moments(record)
    speed, moment = speeds - exact.speed, moments - exact.moment
    return Difference(
        float(np.abs(speed).max()), rms(speed), float(np.abs(moment).max()), rms(moment),
        share(rms(speed), rms(exact.speed)), share(rms(moment), rms(exact.moment)),
        int((record.power_flow != exact.power_flow).sum()))


def share(part, whole):
    """Return part/whole, 0 for nothing of nothing."""
    return part / whole if whole else float(part != 0.0)


def order(runs, variant, quantity):
    """Return with which power of the step the error falls, between the two highest rates."""
    low, high = sorted(runs.exact)[-2:]
    errors = [getattr(difference(runs.records[variant, rate], runs.exact[rate]), quantity)
              for rate in (low, high)]
    return float(np.log(errors[0] / errors[1]) / np.log(high / low)) if all(errors) else np.nan


def relative_rms(record, base):
    """
    Return the RMS over speeds and index of the relative difference, for each tick (Figure 4).

    A quotient counts as zero where the speed is at rest: below 1e-9 of its largest.
    """
    def signals(r):
        return np.column_stack([*r.velocity.values(), r.power_flow])
    change, of = signals(record) - signals(base), signals(base)
    moves = np.abs(of) > 1e-9 * np.abs(of).max(axis=0)
    quotient = np.divide(change, of, out=np.zeros_like(of), where=moves)
    return np.sqrt(np.mean(quotient**2, axis=1))


def switches(index):
    """Return the ticks at which the index is another than in the tick before."""
    return np.flatnonzero(np.diff(index)) + 1


def near(ticks, count, width):
    """Return a mask of ``count`` ticks: those less than ``width`` after one of ``ticks``."""
    mask = np.zeros(count, bool)
    for tick in ticks:
        mask[tick:tick + width] = True
    return mask


def gear_share(record):
    """Return M_1/(M_1 + M_2) of the ticks where the sum exceeds a tenth of its largest."""
    M_1, M_2 = all_moments(record)[:, :2].T
    total = M_1 + M_2
    mask = np.abs(total) > 0.1 * np.abs(total).max()
    return M_1[mask] / total[mask], mask


def longest_stretch(mask):
    """Return the length of the longest row of ticks that are in a mask."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask, [0]]).astype(int)))
    return int((edges[1::2] - edges[::2]).max(initial=0))


def steady_sliding(record, exact, rate):
    """Return the ticks that are in steady sliding in both, far from any change of state."""
    sliding = exact.power_flow == record.power_flow
    for index, slip in ((record.power_flow, record.slip),
                        (exact.power_flow, exact.speed[:, 1] - exact.speed[:, 2])):
        sliding &= np.abs(slip) > SLIDING
        sliding[switches(index)] = False
    width = max(MOST_LAG, round(CLEAR * rate))
    # a tick is clear when all that are around it slide
    around = np.convolve(~sliding, np.ones(2 * width + 1), 'same') > 0.5
    around[:width] = around[-width:] = True
    return np.flatnonzero(~around)


def lags(record, exact, rate):
    """
    Return by how many ticks each moment lags behind the exact one in steady sliding.

    The lag is the shift of the exact signal that brings the two nearest to each other, in the
    mean square, between ticks by a parabola. NaN where the load has too little steady sliding.
    """
    ticks = steady_sliding(record, exact, rate)
    if len(ticks) < 20:
        return np.full(exact.moment.shape[1], np.nan)
    shifts = np.arange(-MOST_LAG, MOST_LAG + 1)
    found = []
    for ours, theirs in zip(all_moments(record).T, exact.moment.T, strict=True):
        misfit = np.array([np.mean((ours[ticks] - theirs[ticks - k])**2) for k in shifts])
        best = min(max(int(misfit.argmin()), 1), len(shifts) - 2)
        before, here, after = misfit[best - 1:best + 2]
        bend = before - 2 * here + after
        found.append(shifts[best] + (before - after) / (2 * bend) if bend > 0.0 else np.nan)
    return np.array(found)
