# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""A model as the core in C has it: its numbers one after the other, see core/differential.h."""

from dataclasses import astuple
from itertools import chain
import struct

from dm_ros.mechanism.power_flow import DIRECT, REVERSE
from dm_ros.motion import coupled
from dm_ros.motion.models import ClutchedModel, PassiveModel, SymmetricModel

LAW = 2 * 59   # numbers of the largest of the laws
LOSSES = 23    # numbers of the larger losses under the paper's law
SHAFTS = 3 * 6   # numbers of as many half-shafts as there may be


def packed(model, run):
    """
    Return a model of ``models`` and its ``Run`` as bytes.

    The dead band is zero, it is no part of a model here.
    """
    p, clutches = model.parameters, len(run.actuators)
    is_passive = isinstance(model, PassiveModel)
    if clutches:
        of_clutches = (p.f, (p.R_1, p.R_2), (p.c_1, p.c_2), [a.limit for a in run.actuators],
                       [a.rise for a in run.actuators])
    else:
        of_clutches = ((0.0, 0.0),) * 5
    head = [bool(model.g_F), is_passive, model.lagged, bool(clutches), run.substeps, run.dt, 0.0,
            model.h, getattr(model, 'tolerance', 0.0), model.g_12, model.k_1, model.k_2,
            model.g_F, model.g_2s, p.sign_speed, *model.form, *model.phi, *model.preload,
            *chain.from_iterable(of_clutches)]
    law = _law(model)
    numbers = [*head, *law, *[0.0] * (LAW - len(law))]
    return struct.pack(f'{len(numbers)}d', *numbers)


def packed_coupling(model):
    """Return a ``CoupledModel`` as bytes, see core/coupled.h."""
    inner, mechanism, shafts = model.inner, model.mechanism, list(chain(*model.half_shafts))
    elements = 1 + len(mechanism.gears + mechanism.bearings + mechanism.clutches)
    law = _law(inner)
    numbers = [bool(inner.g_F), isinstance(inner, PassiveModel), elements, model.h,
               inner.tolerance, coupled.MOST_TRIALS, *inner.form, len(model.half_shafts),
               *shafts, *[0.0] * (SHAFTS - len(shafts)), *law, *[0.0] * (LAW - len(law))]
    return struct.pack(f'{len(numbers)}d', *numbers)


def _law(model):
    """Return the numbers of the law of losses."""
    if isinstance(model, PassiveModel):
        return list(astuple(model.k))
    flows = DIRECT, REVERSE
    if isinstance(model, SymmetricModel):
        return [number for flow in flows for number in _exact(model.exact[flow])]
    assert isinstance(model, ClutchedModel)
    numbers = [number for flow in flows for number in astuple(model.coefficients[flow])]
    for flow in flows:
        lost = astuple(model.losses[flow])
        if model.g_F:
            lost += *astuple(model.final_drives[flow]), model.g_F
        numbers += *lost, *[0.0] * (LOSSES - len(lost))
    return numbers


def _exact(exact):
    step, moments, lost, second = exact
    return (*astuple(step), *astuple(moments), *astuple(lost), *second)
