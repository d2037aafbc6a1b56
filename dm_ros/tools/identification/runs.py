# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""Runs of a measured drive with many sets of parameters, all stepped together."""

import numpy as np

from dm_ros.ensemble import Ensemble
from dm_ros.mechanism.variants import variant_named
from dm_ros.settings import NodeParameters
from dm_ros.tools.progress import progress

BLOCK = 500   # ticks that are recorded at once


class Runs:
    """
    What a variant would have shown in a drive, at the times of the measurements.

    :param values: ``{full name: value}`` of what is not fitted.
    :param drive: a ``MeasuredDrive``; dt: length of a tick, s.
    """

    def __init__(self, variant, values, drive, dt):
        self.drive = drive
        self._variant, self._values, self._dt = variant, values, dt
        self._mechanism = variant_named(variant).mechanism
        self._columns = [self._mechanism.shafts.index(shaft) for shaft in drive.speeds]
        self._inputs = np.array(list(drive.table.held(dt)))
        place = np.clip(drive.times / dt, 0.0, len(self._inputs))
        before = np.floor(place).astype(int)
        after = np.minimum(before + 1, len(self._inputs))
        # only what lies around a measurement is kept
        self._kept, index = np.unique((before, after), return_inverse=True)
        self._before, self._after = index.reshape(2, -1)
        self._share = (place - before)[:, None, None]

    def speeds(self, changes, what='fit'):
        """
        Return the speeds as an array (sets, measured shafts, times), rad/s.

        Between the ends of two ticks they are taken to be linear in time.

        :param changes: of ``{full name: value}``, one for each set, beside ``values``.
        :param what: words before the progress bar.
        :return: NaN for a set that makes an impossible mechanism, or whose run leaves the range
            of numbers.
        """
        sets = [self._values | change for change in changes]
        result = np.full((len(sets), len(self._columns), len(self.drive.times)), np.nan)
        for members, ensemble in self._ensembles(sets, list(range(len(sets)))):
            result[members] = self._run(ensemble, what)
        return result

    def _ensembles(self, sets, members):
        """Yield (members, ensemble) of all that can be."""
        nodes = [NodeParameters().changed(NodeParameters.part_of(sets[m])) for m in members]
        tables = [self._mechanism.parameters.part_of(sets[m]) for m in members]
        try:
            yield members, Ensemble(
                self._variant, tables, self._dt, loss_law=nodes[0].loss_law,
                substeps=nodes[0].substeps, power_flow_deadband=nodes[0].deadband,
                initial_velocity=[node.initial_velocity(self._mechanism.outputs)
                                  for node in nodes])
        except ValueError:   # one of them is impossible
            if len(members) > 1:
                for member in members:
                    yield from self._ensembles(sets, [member])

    def _run(self, ensemble, what):
        """Return the speeds of one ensemble, (sets, measured shafts, times)."""
        torques, forces = np.split(self._inputs, [len(self._mechanism.ports)], axis=1)
        kept, last = [], self._kept[-1]
        if self._kept[0] == 0:
            kept.append(ensemble.velocity[None, :, self._columns])
        with progress(total=last) as bar:
            bar.set_description(what, refresh=False)
            for begin in range(0, last, BLOCK):
                end = min(begin + BLOCK, last)
                told = ensemble.run(
                    torques[begin:end], forces[begin:end] if forces.size else None, ['velocity'])
                here = self._kept[(self._kept > begin) & (self._kept <= end)] - begin - 1
                kept.append(told['velocity'][here][..., self._columns])
                bar.update(end - begin)
        kept = np.concatenate(kept)
        at_times = kept[self._before] * (1 - self._share) + kept[self._after] * self._share
        return at_times.transpose(1, 2, 0)
