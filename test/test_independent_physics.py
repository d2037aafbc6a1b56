# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
The lossless mechanisms against MuJoCo, which is told of rotors, meshes and torques alone.

Each shaft is a rigid body on a hinge. The side gears turn in the carrier, whose satellite turns
about an axis across it, as in the real thing. The meshes are equality constraints between two
hinges that roll on each other, so that speeds, inertia seen at a shaft and internal moments are
what MuJoCo makes of it: no equation of this package or of the paper is used. With all
efficiencies 1 the direction of power flow does not matter.

MuJoCo's Euler steps are of first order and its constraints are soft by a few steps: the
difference must fall with the step, and what an extrapolation to no step leaves must be small.
"""

import dataclasses
from functools import cache
from math import tanh
import os

import numpy as np
import pytest

from dm_ros import SelfLockingParameters, Simulation, SymmetricParameters
from dm_ros.mechanism.variants import variant_named

if os.environ.get('CI'):   # there it must not be skipped
    import mujoco
else:
    mujoco = pytest.importorskip('mujoco')

TICK = 0.01    # s, in which torques are held
SECONDS = 1.5


def lossless(p, **changes):
    """Return the parameters with all efficiencies 1."""
    return dataclasses.replace(
        p, **{f.name: 1.0 for f in dataclasses.fields(p) if f.name.startswith('eta_')}, **changes)


def body(name, axis, inertia, damping, inside=''):
    """Return a rotor about the axis x or z as a thin disc, with a viscous bearing."""
    about = ' '.join(repr(inertia if axis == a else inertia / 2) for a in 'xyz')
    direction = {'x': '1 0 0', 'z': '0 0 1'}[axis]
    return (f'<body name="{name}"><joint name="{name}" type="hinge" axis="{direction}" '
            f'damping="{damping!r}"/><inertial pos="0 0 0" mass="1" diaginertia="{about}"/>'
            f'{inside}</body>')


def mesh(name, other, ratio, step):
    """Return the constraint: the angle of a gear is the ratio times that of the other gear."""
    # as stiff as MuJoCo takes it: a time constant of two steps, impedance near 1
    return (f'<joint joint1="{name}" joint2="{other}" polycoef="0 {ratio!r} 0 0 0" '
            f'solref="{2 * step!r} 1" solimp="0.9999 0.9999 0.001"/>')


class Rotors:
    """A differential in MuJoCo: carrier, two side gears and the satellites as one rotor."""

    def __init__(self, p, names, radii, step, integrator):
        """Take names of side gears; radii over that of the satellite; the solver step, s."""
        self.names, self.g_F = names, getattr(p, 'g_F', None)
        # the satellites turn alike, so one rotor stands for all; it turns with the carrier too
        spin = p.n_s * p.I_s
        inside = (body('satellite', 'x', spin, p.n_s * p.l_s)
                  + body(names[0], 'z', p.I_1, p.l_1) + body(names[1], 'z', p.I_2, p.l_2))
        bodies = body('carrier', 'z', p.I_0 - spin / 2, p.l_0, inside)
        # opposite sides of a satellite roll on the two side gears
        meshes = (mesh(names[0], 'satellite', -1 / radii[0], step)
                  + mesh(names[1], 'satellite', 1 / radii[1], step))
        if self.g_F:
            bodies += body('pinion', 'x', p.I_3, p.l_3)
            meshes += mesh('pinion', 'carrier', p.g_F, step)
        self.model = mujoco.MjModel.from_xml_string(
            f'<mujoco><option timestep="{step!r}" integrator="{integrator}" gravity="0 0 0">'
            '<flag contact="disable"/></option>'
            f'<worldbody>{bodies}</worldbody><equality>{meshes}</equality></mujoco>')
        self.data = mujoco.MjData(self.model)
        self.steps = round(TICK / step)

    def advance(self, torques):
        """Hold the torques on input and side gears for a tick."""
        for name, torque in zip(('pinion' if self.g_F else 'carrier', *self.names), torques,
                                strict=True):
            axis = 3 if name == 'pinion' else 5   # torque about x or z, from outside
            self.data.xfrc_applied[self.data.body(name).id, axis] = torque
        mujoco.mj_step(self.model, self.data, self.steps)
        mujoco.mj_forward(self.model, self.data)   # the constraint forces at the end of the tick

    def speeds(self):
        """Return the speeds in the order of ``Simulation.shafts``, rad/s."""
        def of(name):
            return float(self.data.joint(name).qvel[0])
        carrier = of('carrier')
        return [carrier, *(carrier + of(name) for name in self.names),
                *([of('pinion')] if self.g_F else []), of('satellite')]

    def mesh_moments(self):
        """Return the moments on the carrier's ring gear, if there is one, and the side gears."""
        forces = self.data.efc_force
        return [*([-self.g_F * forces[2]] if self.g_F else []), *forces[:2]]


def symmetric_rotors(p, step, integrator):
    return Rotors(p, ('left', 'right'), (1 / p.g_2s, 1 / p.g_2s), step, integrator)


def self_locking_rotors(p, step, integrator):
    r_s = p.g_2s * p.R_2
    return Rotors(p, ('front', 'rear'), (p.R_1 / r_s, p.R_2 / r_s), step, integrator)


def preload_friction(p, model):
    """Return what applies the clutch moments under the preload, between shaft and carrier."""
    clutches = [(int(model.joint(name).dofadr[0]), *values) for name, *values in (
        ('front', p.n_F1 * p.mu_1 * p.R_F1 * p.n_s * p.N_1, p.c_f1),
        ('rear', p.n_F2 * p.mu_2 * p.R_F2 * p.n_s * p.N_2, p.c_f2))]

    def apply(model, data):
        for hinge, moment, steepness in clutches:
            # the hinge of a side gear turns against the carrier: its speed is the slip
            data.qfrc_passive[hinge] -= moment * tanh(steepness * data.qvel[hinge])
    return apply


def mujoco_run(rotors, load, friction=None):
    """Return speeds and mesh moments at the end of each tick."""
    speeds, moments = [], []
    mujoco.set_mjcb_passive(friction)
    try:
        for torques in load:
            rotors.advance(torques)
            speeds.append(rotors.speeds())
            moments.append(rotors.mesh_moments())
    finally:
        mujoco.set_mjcb_passive(None)
    return np.array(speeds), np.array(moments)


def our_run(variant, p, load, substeps):
    """Return speeds and mesh moments at the end of each tick, as ``mujoco_run``."""
    simulation = Simulation(variant, TICK, p, substeps=substeps)
    snapshots = [simulation.step(torques) for torques in load]
    meshes = [n for n, name in enumerate(simulation.moments) if 'clutch' not in name]
    return (np.array([s.velocity for s in snapshots]),
            np.array([[s.moment[n] for n in meshes] for s in snapshots]))


def held(variant):
    """Return the torques of each tick."""
    load = variant_named(variant).mechanism.load
    return [load(n * TICK) for n in range(round(SECONDS / TICK))]


def largest(run, other):
    """Return the largest differences of speeds, rad/s, and of mesh moments, N m."""
    return np.array([np.abs(a - b).max() for a, b in zip(run, other, strict=True)])


def extrapolated(coarse, fine):
    """Return what runs of first order, one with half the step of the other, lead to."""
    return [2 * b - a for a, b in zip(coarse, fine, strict=True)]


SYMMETRIC = {
    'defaults': lossless(SymmetricParameters()),
    'uneven': lossless(SymmetricParameters(), g_F=-4.1, g_2s=0.7, n_s=4, I_1=4e-3, I_2=9e-3,
                       I_3=2e-3, I_s=1e-3, l_1=0.02, l_2=0.05, l_3=4e-3, l_s=0.01)}
# without pressure angle the preload alone presses the clutches
SELF_LOCKING = {
    'defaults': lossless(SelfLockingParameters(), alpha=0.0),
    'uneven': lossless(SelfLockingParameters(), alpha=0.0, R_1=0.05, R_2=0.045, g_2s=0.6, n_s=3,
                       I_1=9e-3, I_2=3e-3, I_s=2e-3, n_F1=4, n_F2=3, c_f1=2.0, N_1=200.0,
                       l_1=0.02, l_2=0.05, l_s=0.01)}


@cache
def symmetric_run(name, integrator, step):
    """Return the run of MuJoCo beside which each variant stands."""
    p = SYMMETRIC[name]
    return mujoco_run(symmetric_rotors(p, step, integrator), held('symmetric_ode'))


@cache
def self_locking_run(name, integrator, step):
    """Return the run of MuJoCo beside which each variant stands."""
    p = SELF_LOCKING[name]
    rotors = self_locking_rotors(p, step, integrator)
    return mujoco_run(rotors, held('lsd_ode'), preload_friction(p, rotors.model))


@pytest.mark.parametrize('variant', ['symmetric_ode', 'symmetric_dae'])
@pytest.mark.parametrize('name', SYMMETRIC)
class TestSymmetric:
    """Speeds reach some hundred rad/s and moments some ten N m."""

    def runs(self, variant, name, integrator, *steps):
        return our_run(variant, SYMMETRIC[name], held(variant), 1), [
            symmetric_run(name, integrator, step) for step in steps]

    def test_difference_to_euler_halves_with_its_step_and_extrapolates_to_none(
            self, variant, name):
        ours, (coarse, fine) = self.runs(variant, name, 'Euler', 2.5e-4, 1.25e-4)
        ratio = largest(coarse, ours) / largest(fine, ours)
        assert (np.abs(ratio - 2.0) < 0.05).all()
        speed, moment = largest(extrapolated(coarse, fine), ours)
        assert speed < 2e-4 and moment < 1e-5

    def test_difference_to_runge_kutta_falls_fourfold_and_is_next_to_nothing(self, variant, name):
        ours, (coarse, fine) = self.runs(variant, name, 'RK4', 2.5e-4, 1.25e-4)
        # the stages are of fourth order, the soft constraints of second
        assert 3.5 < largest(coarse, ours)[0] / largest(fine, ours)[0] < 4.5
        speed, moment = largest(fine, ours)
        assert speed < 1e-6 and moment < 1e-6


@pytest.mark.parametrize('variant', ['lsd_lagged', 'lsd_ode', 'lsd_dae'])
@pytest.mark.parametrize('name', SELF_LOCKING)
class TestSelfLockingWithPreloadAlone:
    """The shafts lock and slip, speeds reach some hundred rad/s and moments a hundred N m."""

    def runs(self, variant, name, integrator, *steps):
        # substeps: beyond our own tolerance
        return our_run(variant, SELF_LOCKING[name], held(variant), 20), [
            self_locking_run(name, integrator, step) for step in steps]

    def test_difference_to_euler_halves_with_its_step_and_extrapolates_to_none(
            self, variant, name):
        ours, (coarse, fine) = self.runs(variant, name, 'Euler', 1e-4, 5e-5)
        ratio = largest(coarse, ours) / largest(fine, ours)
        assert (np.abs(ratio - 2.0) < 0.1).all()
        speed, moment = largest(extrapolated(coarse, fine), ours)
        assert speed < 5e-4 and moment < 5e-4

    def test_runge_kutta_comes_near(self, variant, name):
        ours, (run,) = self.runs(variant, name, 'RK4', 5e-5)
        speed, moment = largest(run, ours)
        assert speed < 1e-4 and moment < 1e-4


def test_a_wrong_inertia_would_show():
    p, load = SYMMETRIC['defaults'], held('symmetric_ode')
    wrong = dataclasses.replace(p, I_s=1.01 * p.I_s)
    run = symmetric_run('defaults', 'RK4', 1.25e-4)
    assert largest(run, our_run('symmetric_ode', wrong, load, 1))[0] > 0.01
