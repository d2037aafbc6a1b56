# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
Other tools that step the same mechanism: scipy, MuJoCo, python-control.

Each class steps in ``run(rows)``, the loop that is timed, over what ``rows(load)`` makes of the
torques beforehand. ``record(rows)`` steps likewise and returns the speeds of the carrier and
the two output shafts after each tick, (ticks, 3).
"""

import dataclasses

import numpy as np
from reference import slip_shares, three_shafts
from scipy.integrate import solve_ivp

from dm_ros.mechanism import clutched
from dm_ros.mechanism.parameters import SymmetricParameters
from dm_ros.mechanism.power_flow import DIRECT, power_flow, REVERSE
from dm_ros.mechanism.self_locking import SelfLockingOde
from dm_ros.mechanism.symmetric import kinematics, SymmetricOde
from dm_ros.motion.exponentials import held_propagator

try:
    import mujoco
except ImportError:
    mujoco = None
try:
    import control
except ImportError:
    control = None


def silence():
    """Let MuJoCo warn of nothing: a step that goes wrong shows in its error."""
    if mujoco:
        mujoco.set_mju_user_warning(lambda message: None)


def lossless(p):
    """Return the parameters with all efficiencies 1, which is all that MuJoCo knows."""
    return dataclasses.replace(
        p, **{f.name: 1.0 for f in dataclasses.fields(p) if f.name.startswith('eta_')})


def is_symmetric(p):
    return isinstance(p, SymmetricParameters)


class Clutches:
    """The equations of a self-locking differential, as this package has them."""

    def __init__(self, p):
        self._coefficients = {
            d: clutched.coefficients(p, SelfLockingOde(p).response(d), direction=d)
            for d in (DIRECT, REVERSE)}
        self._preload = clutched.full_friction(p)[1]

    def under(self, T, direction=DIRECT):
        """Return the function (w, s) -> point of ``clutched`` under held torques."""
        k = self._coefficients[direction]
        u = clutched.held(k, T, self._preload)
        return lambda w, s: clutched.evaluate(k, u, w, s)


class MatrixPair:
    """Phi x + Gamma u in numpy, without index and losses, and no more than that."""

    def __init__(self, p, dt):
        response = SymmetricOde(lossless(p)).response(DIRECT)
        self._Phi, self._Gamma, _, _ = held_propagator(response.A, response.B, dt)
        self._x = np.zeros(2)

    def rows(self, load):
        return list(np.array(load))

    def run(self, rows):
        Phi, Gamma, x = self._Phi, self._Gamma, self._x
        for u in rows:
            x = Phi @ x + Gamma @ u
        self._x = x

    def record(self, rows):
        speeds = []
        for u in rows:
            self.run([u])
            speeds.append(self._x)
        w_1, w_2 = np.array(speeds).T
        return np.column_stack([(w_1 + w_2) / 2, w_1, w_2])


class SolveIvp:
    """``solve_ivp`` (LSODA) begun anew in each tick, with the index of power flow."""

    RTOL = ATOL = 1e-6

    def __init__(self, p, dt):
        self._dt, self._state, self._direction = dt, (0.0, 0.0), DIRECT
        if is_symmetric(p):
            self._shares = 0.5, 0.5
            self._powers = p.g_F
            self._right_side = self._linear(p)
        else:
            self._shares = slip_shares(p)
            self._powers = 1.0
            self._right_side = self._clutch(p)
        self._p = p

    def _linear(self, p):
        response = {d: SymmetricOde(p).response(d) for d in (DIRECT, REVERSE)}
        S = np.array([[0.5, 0.5], [1.0, -1.0]])   # to carrier and slip
        matrices = {d: ((S @ r.A @ np.linalg.inv(S)).tolist(), (S @ r.B).tolist())
                    for d, r in response.items()}

        def right_side(T, direction):
            ((a, b), (c, d)), (e, f) = matrices[direction]
            T_3, T_1, T_2 = T
            u = e[0] * T_3 + e[1] * T_1 + e[2] * T_2
            v = f[0] * T_3 + f[1] * T_1 + f[2] * T_2
            return lambda t, y: (a * y[0] + b * y[1] + u, c * y[0] + d * y[1] + v)
        return right_side

    def _clutch(self, p):
        clutches = Clutches(p)

        def right_side(T, direction):
            point = clutches.under(T, direction)
            return lambda t, y: point(float(y[0]), float(y[1]))[:2]
        return right_side

    def rows(self, load):
        return load

    def run(self, rows):
        dt, (w, s), direction = self._dt, self._state, self._direction
        (a_1, a_2), ratio, right_side = self._shares, self._powers, self._right_side
        for T in rows:
            direction = power_flow(T[0] * ratio * w, T[1] * (w + a_1 * s) + T[2] * (w - a_2 * s),
                                   0.0, direction)
            w, s = solve_ivp(right_side(T, direction), (0.0, dt), (w, s), 'LSODA',
                             rtol=self.RTOL, atol=self.ATOL).y[:, -1].tolist()
        self._state, self._direction = (w, s), direction

    def record(self, rows):
        states = []
        for T in rows:
            self.run([T])
            states.append(self._state)
        w, s = np.array(states).T
        if is_symmetric(self._p):
            return np.column_stack([w, w + s / 2, w - s / 2])
        return three_shafts(self._p, w, s)


class Control:
    """python-control: discrete systems of both directions, ``dynamics`` and ``output``."""

    missing = None if control else 'python-control is not installed'

    def __init__(self, p, dt):
        self._g_F = p.g_F
        self._systems, self._state, self._direction = {}, np.zeros(2), DIRECT
        for direction in (DIRECT, REVERSE):
            response = SymmetricOde(p).response(direction)
            Phi, Gamma, _, _ = held_propagator(response.A, response.B, dt)
            self._systems[direction] = control.ss(Phi, Gamma, kinematics(p), np.zeros((5, 3)), dt)

    def rows(self, load):
        return list(np.array(load))

    def run(self, rows):
        g_F, systems, x, direction = self._g_F, self._systems, self._state, self._direction
        for u in rows:
            direction = power_flow(u[0] * g_F * (x[0] + x[1]) / 2, u[1] * x[0] + u[2] * x[1],
                                   0.0, direction)
            system = systems[direction]
            x = system.dynamics(0.0, x, u)
            self.speeds = system.output(0.0, x, u)
        self._state, self._direction = x, direction

    def record(self, rows):
        speeds = []
        for u in rows:
            self.run([u])
            speeds.append(self.speeds[:3])
        return np.array(speeds)


def shaft_terms(p):
    """
    Return the lossless mechanism as ``(inertias, viscosities, torques)``.

    Each is a list of (coefficient or position in the inputs, (c_0, c_s)), where c_0 omega_0 +
    c_s (omega_1 - omega_2) is the speed that it goes with.
    """
    if is_symmetric(p):
        front, rear = (1.0, 0.5), (1.0, -0.5)
        satellite, pinion = (0.0, -1 / (2 * p.g_2s)), (p.g_F, 0.0)
        driven = pinion
    else:
        a_1, a_2 = slip_shares(p)
        front, rear = (1.0, a_1), (1.0, -a_2)
        satellite, driven = (0.0, -1 / (p.g_2s * (1 + p.g_12))), (1.0, 0.0)
    carrier = (1.0, 0.0)
    inertias = [(p.I_0, carrier), (p.I_1, front), (p.I_2, rear), (p.n_s * p.I_s, satellite)]
    viscosities = [(p.l_0, carrier), (p.l_1, (0.0, front[1])), (p.l_2, (0.0, rear[1])),
                   (p.n_s * p.l_s, satellite)]
    if is_symmetric(p):
        inertias.append((p.I_3, pinion))
        viscosities.append((p.l_3, pinion))
    return inertias, viscosities, [(0, driven), (1, front), (2, rear)]


OPTION = ('<option timestep="{dt}" integrator="{integrator}" gravity="0 0 0">'
          '<flag contact="disable" gravity="disable" {flag}/></option>')


class TwoHinges:
    """
    MuJoCo in minimal coordinates: a carrier hinge and in it a hinge that turns with the slip.

    The inner body and the armature of its hinge are chosen such that the mass matrix is that
    of the lossless mechanism; the viscous drag is the damping of the two hinges, and the drag
    is diagonal in these coordinates.
    """

    missing = None if mujoco else 'MuJoCo is not installed'

    def __init__(self, p, dt, integrator, friction=None):
        self._p = p = lossless(p)
        xml = self._xml(p, dt, integrator)
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        self._friction = friction
        self._clutches = None if friction is None else Clutches(p)
        self._a = slip_shares(p)

    def _xml(self, p, dt, integrator):
        inertias, viscosities, _ = shaft_terms(p)
        M, D = (sum(k * np.outer(c, c) for k, c in terms) for terms in (inertias, viscosities))
        self._side = side = 1.0 if M[0, 1] >= 0 else -1.0   # of the slip, for a body that can be
        inner = float(max(abs(M[0, 1]), 1e-12))
        outer, armature = float(M[0, 0]) - inner, float(M[1, 1]) - inner
        drag_0, drag_s = np.diag(D).tolist()

        def body(name, joint, inertia, within=''):
            return (f'<body><joint name="{name}" type="hinge" axis="0 0 1" {joint}/><inertial '
                    f'pos="0 0 0" mass="1" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/>'
                    f'{within}</body>')
        slip = body('slip', f'armature="{armature!r}" damping="{drag_s!r}"', inner)
        carrier = body('carrier', f'damping="{drag_0!r}"', outer, slip)
        self.mass_matrix = M * np.array([[1, side], [side, 1]])
        flag = 'constraint="disable"'
        return (f'<mujoco>{OPTION.format(dt=dt, integrator=integrator, flag=flag)}'
                f'<worldbody>{carrier}</worldbody></mujoco>')

    def rows(self, load):
        _, _, torques = shaft_terms(self._p)
        G = np.array([[c[0], self._side * c[1]] for _, c in torques])
        rows = list(np.array(load) @ G)
        return rows if self._friction is None else list(zip(rows, load))

    def speeds(self):
        w, s = self.data.qvel.tolist()
        s *= self._side
        a_1, a_2 = self._a
        return w, w + a_1 * s, w - a_2 * s

    def run(self, rows):
        if self._friction is not None:
            return self._run_with_friction(rows)
        step, model, data, applied = mujoco.mj_step, self.model, self.data, self.data.qfrc_applied
        for row in rows:
            applied[:] = row
            step(model, data)

    def _slip(self, qvel):
        """Return the function (w, s) of the speeds now, and one that applies the clutches."""
        side, (a_1, a_2) = self._side, self._a

        def apply(force, point):
            w, s = qvel.tolist()
            _, _, F_1, F_2, *_ = point(w, side * s)
            force[1] -= side * (a_1 * F_1 - a_2 * F_2)
        return apply

    def _run_with_friction(self, rows):
        step, model, data, clutches = mujoco.mj_step, self.model, self.data, self._clutches
        applied, apply = data.qfrc_applied, self._slip(data.qvel)
        if self._friction == 'before':
            for row, T in rows:
                point = clutches.under(T)
                applied[:] = row
                apply(applied, point)
                step(model, data)
            return
        passive, point = data.qfrc_passive, None

        def callback(model, data):
            apply(passive, point)
        mujoco.set_mjcb_passive(callback)
        try:
            for row, T in rows:
                point = clutches.under(T)
                applied[:] = row
                step(model, data)
        finally:
            mujoco.set_mjcb_passive(None)

    def record(self, rows):
        speeds = []
        for row in rows:
            self.run([row])
            speeds.append(self.speeds())
        return np.array(speeds)


class TwoHingesRead(TwoHinges):
    """The same, and the speeds and angles are read into Python numbers after each step."""

    def run(self, rows):
        step, model, data, applied = mujoco.mj_step, self.model, self.data, self.data.qfrc_applied
        qvel, qpos = data.qvel, data.qpos
        for row in rows:
            applied[:] = row
            step(model, data)
            self.read = data.time, qvel.tolist(), qpos.tolist()


class AllHinges(TwoHinges):
    """MuJoCo with a hinge for each shaft, tied together by equality constraints of tendons."""

    # as stiff as MuJoCo lets a constraint be: time constant of two steps, impedance near 1
    TIED = 'solref="{} 1" solimp="0.9999 0.9999 0.001"'

    def _xml(self, p, dt, integrator):
        if is_symmetric(p):
            names = ('carrier', 'left', 'right', 'pinion', 'satellite')
            inertias = p.I_0, p.I_1, p.I_2, p.I_3, p.n_s * p.I_s
            viscosities = p.l_0, 0.0, 0.0, p.l_3, p.n_s * p.l_s
            constraints = [
                {'carrier': 2.0, 'left': -1.0, 'right': -1.0},
                {'carrier': p.g_F, 'pinion': -1.0},
                {'left': 1.0, 'right': -1.0, 'satellite': 2 * p.g_2s}]
            self._driven = names.index('pinion')
        else:
            names = ('carrier', 'front', 'rear', 'satellite')
            inertias = p.I_0, p.I_1, p.I_2, p.n_s * p.I_s
            viscosities = p.l_0, 0.0, 0.0, p.n_s * p.l_s
            constraints = [
                {'carrier': 1 + p.g_12, 'front': -1.0, 'rear': -p.g_12},
                {'front': 1.0, 'rear': -1.0, 'satellite': p.g_2s * (1 + p.g_12)}]
            self._driven = 0
        self._hinges = len(names)
        bodies = ''.join(
            f'<body><joint name="{name}" type="hinge" axis="0 0 1" damping="{drag!r}"/><inertial '
            f'pos="0 0 0" mass="1" diaginertia="{inertia!r} {inertia!r} {inertia!r}"/></body>'
            for name, inertia, drag in zip(names, inertias, viscosities))
        tendons = [(f'tie_{k}', '', terms) for k, terms in enumerate(constraints)]
        # the side gears run inside the carrier
        tendons += [(f'drag_{k}', f'damping="{drag!r}"', {name: 1.0, 'carrier': -1.0})
                    for k, (name, drag) in enumerate(zip(names[1:3], (p.l_1, p.l_2)))]
        fixed = ''.join(
            f'<fixed name="{name}" {more}>'
            + ''.join(f'<joint joint="{j}" coef="{c!r}"/>' for j, c in terms.items())
            + '</fixed>' for name, more, terms in tendons)
        ties = ''.join(f'<tendon tendon1="tie_{k}" {self.TIED.format(2 * dt)}/>'
                       for k in range(len(constraints)))
        return (f'<mujoco>{OPTION.format(dt=dt, integrator=integrator, flag="")}'
                f'<worldbody>{bodies}</worldbody><tendon>{fixed}</tendon>'
                f'<equality>{ties}</equality></mujoco>')

    def rows(self, load):
        rows = np.zeros((len(load), self._hinges))
        rows[:, [self._driven, 1, 2]] = np.array(load)
        rows = list(rows)
        return rows if self._friction is None else list(zip(rows, load))

    def speeds(self):
        return self.data.qvel.tolist()[:3]

    def _slip(self, qvel):
        def apply(force, point):
            w_0, w_1, w_2, *_ = qvel.tolist()
            _, _, F_1, F_2, *_ = point(w_0, w_1 - w_2)
            force[0] += F_1 + F_2
            force[1] -= F_1
            force[2] -= F_2
        return apply
