# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
What a differential keeps to whatever is asked of it, checked shortly and, in ``long``, at length.

``Tally``        random cases: one of the variants with random admissible parameters, spread over
                 many powers of ten, a random rate, start and load; case n is always the same
``check_state``  one random state under the passive law
``endure``       one load for a long time at 100 Hz
``Twins``        random cases by the core in C and by Python
"""

import dataclasses
import itertools
import math
from typing import NamedTuple
from unittest import mock

from mechanisms import (
    form,
    is_symmetric,
    mirrored_self_locking,
    mirrored_symmetric,
    PassiveFlow,
    random_clutched_symmetric,
    random_self_locking,
    random_symmetric,
    relative_difference,
    self_locking_energy,
    symmetric_energy,
)
import numpy as np

from dm_ros import core, SelfLockingParameters, Simulation, SymmetricParameters, VARIANTS
from dm_ros.mechanism import clutched, passive, self_locking, symmetric
from dm_ros.mechanism.self_locking import SelfLockingDae
from dm_ros.mechanism.symmetric import SymmetricDae
from dm_ros.mechanism.variants import SYMMETRIC, variant_named, variants_of
from dm_ros.motion.energy import AuditedSimulation
from dm_ros.motion.models import PAPER, PASSIVE
from dm_ros.motion.simulation import NO_FORCE

ROUNDING = 1e-14     # of the largest term of a constraint
TORQUE_LIMIT = 1e5   # N m


class Case(NamedTuple):
    """One random differential and what happens to it."""

    variant: str
    arguments: dict   # of ``Simulation``
    load: list        # torques of each tick


def power_of_ten(rng, low, high):
    return float(10.0 ** rng.uniform(low, high))


def or_zero(rng, value):
    return 0.0 if rng.random() < 0.2 else value


def efficiency(rng):
    return float(rng.choice([1.0, rng.uniform(0.95, 1.0), rng.uniform(0.3, 1.0)]))


def elements(rng, names):
    """Return inertias from 1e-5 to 1e3 kg m^2 and viscosities to 10 N m s/rad."""
    narrow = rng.random() < 0.3   # a mechanism whose parts fit each other
    centre = rng.uniform(-4, 2)
    values = {}
    for name in names:
        values[f'I_{name}'] = (power_of_ten(rng, centre - 1, centre + 1) if narrow
                               else power_of_ten(rng, -5, 3))
        values[f'l_{name}'] = or_zero(rng, power_of_ten(rng, -5, 1))
    return values


def symmetric_parameters(rng):
    return SymmetricParameters(
        **elements(rng, '0123s'), n_s=int(rng.integers(1, 9)),
        g_F=float(rng.choice([-1, 1])) * power_of_ten(rng, -1, 1.5),
        g_2s=power_of_ten(rng, -1, 1),
        **{name: efficiency(rng) for name in ('eta_3B', 'eta_FG', 'eta_0B', 'eta_1G', 'eta_2G')})


def self_locking_parameters(rng):
    """Return parameters of which the gain of a clutch reaches 0.99 of what locks it."""
    values = {
        **elements(rng, '012s'), 'n_s': int(rng.integers(1, 9)), 'g_2s': power_of_ten(rng, -1, 1),
        'R_1': power_of_ten(rng, -2, 0), 'alpha': or_zero(rng, rng.uniform(0.01, 0.8)),
        **{name: efficiency(rng) for name in ('eta_0B', 'eta_1G', 'eta_2G')}}
    values['R_2'] = values['R_1'] * power_of_ten(rng, -0.7, 0.7)
    return SelfLockingParameters(**values, **clutches(rng, values, values['R_1'], values['R_2']))


def clutches(rng, values, *radii):
    """Return clutches for a mechanism with the given efficiencies, gearing angle, gear radii."""
    result = {}
    for k, gear in zip('12', radii):
        radius = gear * rng.uniform(0.5, 2.0)
        surfaces = int(rng.integers(0, 13))
        share = rng.choice([0.0, 0.99, rng.uniform(0.0, 0.99)])
        gain = share * values[f'eta_{k}G'] * values['eta_0B']
        for_one = max(surfaces, 1) * radius / gear * math.tan(values['alpha'])
        result |= {
            f'R_F{k}': radius, f'n_F{k}': surfaces,
            f'mu_{k}': min(gain / for_one, 10.0) if for_one else rng.uniform(0.0, 1.0),
            f'c_f{k}': or_zero(rng, power_of_ten(rng, -1, 3)),
            f'N_{k}': or_zero(rng, power_of_ten(rng, 0, 4))}
    return result


def clutched_symmetric(rng, p):
    """Return a symmetric differential with random clutches beside what it has."""
    values = {**vars(p), 'alpha': or_zero(rng, rng.uniform(0.01, 0.8)),
              'R': power_of_ten(rng, -2, 0), 'c_1': or_zero(rng, rng.uniform(0, 1)),
              'c_2': or_zero(rng, rng.uniform(0, 1))}
    return SymmetricParameters(**{**values, **clutches(rng, values, values['R'], values['R'])})


def load(rng, ticks):
    """Return torques to 1e5 N m: none, held, by steps, with flipping signs or new every tick."""
    size = rng.choice([0.0, 1e-3, 30.0, 1e3, TORQUE_LIMIT])
    kind = rng.choice(['held', 'steps', 'flips', 'noise', 'balanced', 'limits'])
    if kind == 'held':
        T = np.tile(rng.uniform(-size, size, 3), (ticks, 1))
    elif kind == 'steps':
        T = np.repeat(rng.uniform(-size, size, (ticks // 4 + 1, 3)), 4, axis=0)[:ticks]
        T[rng.random(ticks) < 0.2] = 0.0
    elif kind == 'flips':
        T = rng.uniform(-size, size, 3) * (-1.0) ** np.arange(ticks)[:, None]
    elif kind == 'noise':
        T = rng.uniform(-size, size, (ticks, 3))
    elif kind == 'balanced':
        T = rng.uniform(-size, size, (ticks, 1)) * np.array([1.0, 0.0, 0.0])
        T[:, 1] = -T[:, 0] * rng.uniform(0.0, 1.0)
        T[:, 2] = -T[:, 0] - T[:, 1]
    else:
        T = rng.choice([-size, 0.0, size], (ticks, 3))
    return T.tolist()


def random_case(n, clutched=False):
    """Return case n; the variants take turns, or those of the symmetric one with clutches."""
    rng = np.random.default_rng([3, n])
    variants = variants_of(SYMMETRIC) if clutched else VARIANTS
    variant = variants[n % len(variants)]
    parameters = (symmetric_parameters if is_symmetric(variant)
                  else self_locking_parameters)(rng)
    if clutched:
        parameters = clutched_symmetric(np.random.default_rng([5, n]), parameters)
    rate = float(rng.choice([100.0, 1000.0, 1e4, power_of_ten(rng, 2, 4)]))
    speed = rng.choice([0.0, rng.normal(0.0, 50.0), 1e4, 1e6], p=[0.3, 0.3, 0.3, 0.1])
    start = speed * rng.choice([-1.0, 1.0, rng.uniform(-1, 1)], 2)
    arguments = {'dt': 1 / rate, 'parameters': parameters,
                 'substeps': int(rng.choice([1, 1, 1, 2, 5])),
                 'power_flow_deadband': or_zero(rng, power_of_ten(rng, -3, 4)),
                 'initial_velocity': tuple(start.tolist())}
    return Case(variant, arguments, load(rng, int(rng.integers(4, 13))))


class Bound:
    """
    How fast the torques can make the speeds grow, by the energy.

    With v such that |v|^2/2 is the kinetic energy, v' = A v + b gives d|v|/dt <= mu |v| + |b|,
    where mu is the logarithmic norm of A. It is not positive where the losses are losses. It
    may be where a moment does not have the sign that fits the direction of power flow: the
    efficiencies of the paper then add power. Whatever part of their full friction the clutches
    have, A and b are averages of those at the corners, full to either side and none; norms are
    convex, so the largest at the corners bounds them all.
    """

    def __init__(self, variant, p):
        formulation = variant_named(variant).formulation
        self._lagged = variant == 'lsd_lagged'
        self._phi, self._preload = clutched.full_friction(p)
        inertia = [p.I_0, p.I_1, p.I_2, p.n_s * p.I_s]
        if is_symmetric(variant):
            inertia.insert(3, p.I_3)
            shafts = symmetric.kinematics(p)
        else:
            shafts = self_locking.kinematics(p) @ np.linalg.inv(self_locking.slip_coordinates(p))
        self._to_v = np.linalg.qr(np.sqrt(inertia)[:, None] * shafts, 'r')
        self._growth, torque, friction = 0.0, [], []
        for direction in (1, -1):
            for A, B, K in self._corners(formulation(p).response(direction)):
                A = self._to_v @ A @ np.linalg.inv(self._to_v)
                self._growth = max(self._growth, float(np.linalg.eigvalsh((A + A.T) / 2)[-1]))
                torque.append(self._to_v @ B)
                friction.append(self._to_v @ K)
        self._torque, self._friction = np.array(torque), np.array(friction)

    def _corners(self, r):
        """Yield A, B and K of x' = A x + B T - K (friction that does not follow M)."""
        P, Q, W = r.P[-2:], r.Q[-2:], r.W[-2:]   # of the output shafts
        corners = itertools.product((-1.0, 0.0, 1.0), repeat=2)
        for shares in ([(0.0, 0.0)] if self._lagged else corners):
            X = np.diag(np.multiply(shares, self._phi))   # F = X M + the rest
            K = r.C @ np.linalg.inv(np.eye(2) + X @ W)
            yield r.A - K @ X @ P, r.B - K @ X @ Q, K

    def norm(self, x):
        """Return |v|, the root of twice the kinetic energy."""
        return float(np.linalg.norm(self._to_v @ x))

    def after(self, norm, torque, M, dt):
        """Return the largest |v| after a step; variant 1 has its friction from the last M."""
        rest = np.add(self._preload, np.multiply(self._phi, np.abs(M)) * self._lagged)
        # one slip drives both clutches, to opposite sides
        sides = rest[:, None] * np.array([[1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]])
        push = (np.linalg.norm(self._torque @ torque, axis=1).max()
                + np.linalg.norm(self._friction @ sides, axis=1).max())
        growth = math.exp(self._growth * dt) if self._growth * dt < 600.0 else math.inf
        return growth * (norm + dt * float(push))


class Tally:
    """What was counted over many cases, and the worst that was seen."""

    def __init__(self, loss_law, clutched=False):
        self.loss_law, self.clutched = loss_law, clutched
        self.cases = self.ticks = self.coarse_cases = self.coarse_steps = 0
        self.residual = 0.0   # of a constraint, over its largest term
        self.fullest = 0.0    # speeds, or energy, over what may be

    def __str__(self):
        which = ', symmetric with clutches' if self.clutched else ''
        return (f'{self.loss_law}{which}: {self.cases} cases, {self.ticks} ticks, '
                f'{self.coarse_steps} coarse steps in {self.coarse_cases} cases, '
                f'worst constraint residual {self.residual:.1e} of '
                f'its largest term, up to {self.fullest:.6f} of what energy allows')

    def run(self, n):
        """Run case n; raise AssertionError, with the case, whatever goes wrong."""
        case = random_case(n, self.clutched)
        try:
            if self.loss_law == PAPER:
                self._run(*case)
            else:
                self._run_passive(np.random.default_rng([4, n]), *case)
        except Exception as error:
            raise AssertionError(f'case {n}: {error!r}: {case}') from error

    def _run(self, variant, arguments, load):
        p, dt = arguments['parameters'], arguments['dt']
        simulation, bound = Simulation(variant, loss_law=PAPER, **arguments), Bound(variant, p)
        # what the friction of variant 1 knows changes between the substeps
        bounded = variant != 'lsd_lagged' or simulation.substeps == 1
        g = constraints(variant, p)
        before = simulation.snapshot()
        self._check(before, g)
        for tick, torque in enumerate(load, 1):
            after = simulation.step(torque)
            self._check(after, g)
            assert after.time == tick * dt, after.time
            assert after.torque == tuple(torque), after.torque
            if bounded:
                speed = bound.norm(independent(after, p))
                allowed = bound.after(bound.norm(independent(before, p)), torque,
                                      before.moment[:2], dt)
                assert speed <= allowed * (1 + 1e-9), (speed, allowed)
                self.fullest = max(self.fullest, speed / allowed if allowed else 0.0)
            before = after
        self._count(simulation)

    def _run_passive(self, rng, variant, arguments, load):
        p = dataclasses.replace(arguments['parameters'], sign_speed=power_of_ten(rng, -3, 2))
        audit = AuditedSimulation(variant, loss_law=PASSIVE, **{**arguments, 'parameters': p})
        g = constraints(variant, p)
        H = form(symmetric_energy if is_symmetric(variant) else self_locking_energy, p)
        self._check(audit.snapshot(), g)
        for torque in load:
            after = audit.step(torque)
            self._check(after, g)
            tick = after.energy
            assert min(tick.viscous, *tick.gears, *tick.bearings, *tick.clutches) >= 0.0, tick
            # an error of 1e-3 rad/s in a speed is worth that, times the momentum
            worth = 1e-3 * np.abs(H @ after.velocity[1:3]).sum() + 1e-6 * np.abs(H).sum()
            made = tick.stored - sum(tick.work)
            assert made <= worth + 1e-12 * tick.scale, (made, worth, tick)
            self.fullest = max(self.fullest, made / worth)
        assert all(times == 0 for times, _ in audit.returned.values()), audit.returned
        self._count(audit)

    def _count(self, simulation):
        self.cases += 1
        self.ticks += simulation.ticks
        self.coarse_cases += simulation.coarse_steps > 0
        self.coarse_steps += simulation.coarse_steps

    def _check(self, snapshot, g):
        """Check what holds at every moment; g: the constraints."""
        numbers = (*snapshot.velocity, *snapshot.position, *snapshot.moment)
        assert all(map(math.isfinite, numbers)), snapshot
        assert snapshot.power_flow in (1, -1), snapshot.power_flow
        for values in (snapshot.velocity, snapshot.position):
            residual = largest_residual(g, values)
            assert residual < ROUNDING, (residual, values)
            self.residual = max(self.residual, residual)
        if len(snapshot.moment) > 3:   # friction opposes slip; the satellite turns with the rear
            *_, front, rear = snapshot.moment
            slip = -snapshot.velocity[-1]
            assert front * slip >= 0.0 >= rear * slip, (front, rear, slip)


def constraints(variant, p):
    """Return the matrix g with g omega = 0 for the speeds of all shafts, (47), (80)."""
    formulation = SymmetricDae if is_symmetric(variant) else SelfLockingDae
    return formulation(p).constraints()


def largest_residual(g, values):
    """Return how far speeds or angles are off the constraints, over the largest term of each."""
    terms = g * np.array(values)
    largest = np.abs(terms).max(axis=1)
    return float((np.abs(terms.sum(axis=1)) / np.where(largest > 0.0, largest, 1.0)).max())


def independent(snapshot, p):
    """Return the two speeds that a model integrates."""
    omega = snapshot.velocity
    if isinstance(p, SymmetricParameters):
        return omega[1:3]
    return omega[0], -omega[3] * p.g_2s * (1 + p.g_12)   # omega_1 - omega_2, not yet rounded


# One state


RANDOM = {'symmetric': random_symmetric, 'lsd': random_self_locking,
          'symmetric with clutches': random_clutched_symmetric}


def random_state(rng, kind):
    """Return random parameters, (carrier speed, slip) and torques, on every side of every kink."""
    p = RANDOM[kind](rng)
    p = dataclasses.replace(p, sign_speed=power_of_ten(rng, -3, 1))
    y = tuple(rng.choice([-1.0, 1.0]) * power_of_ten(rng, -3, 2) for _ in range(2))
    return p, y, rng.normal(0, 200, 3) * (rng.random(3) < 0.85)


def check_state(rng, kind):
    """Check that a random state has one solution, which loses power and keeps the symmetries."""
    p, (w, s), T = random_state(rng, kind)
    symmetric = kind != 'lsd'
    flow = PassiveFlow(p, T)
    k, u, point = flow.k, flow.u, flow.point(w, s)
    k_1s, k_2s = k.k_1 * s, k.k_2 * s

    # each pattern of signs that agrees with its own solution has the same solution
    q = [u[3] * point[8][5] + k.l_1 * k_1s - u[1], u[4] * point[8][6] - k.l_2 * k_2s - u[2]]
    found = []
    for signs in passive.PATTERNS:
        wrong, _, solution = passive.solve(k, u, *q, point[8], signs)
        if wrong <= 0.0:
            found.append(solution[:7])
    assert found, (p, w, s, T)
    for solution in found:
        assert relative_difference(solution, point[:7]) < 1e-10, (p, w, s, T)

    # what goes in is stored or lost, and nothing is lost negatively
    e = point[0] + k.k_1 * point[1], point[0] - k.k_2 * point[1]
    energy = symmetric_energy if symmetric else self_locking_energy
    outputs = np.array([w + k_1s, w - k_2s])
    stored = outputs @ form(energy, p) @ e
    powers = np.array([T[0] * (k.g_F or 1.0) * w, *(T[1:] * outputs)])
    lost = flow.lost(w, s)
    assert min(lost) >= 0.0, (p, w, s, T)
    scale = np.abs(powers).sum() + abs(stored) + sum(lost)
    assert abs(powers.sum() - stored - sum(lost)) <= 1e-11 * scale, (p, w, s, T)

    # all turned round, and both sides exchanged
    back = PassiveFlow(p, -T).point(-w, -s)
    assert relative_difference(point[:7], np.negative(back[:7])) < 1e-10, (p, w, s, T)
    mirrored = (mirrored_symmetric if symmetric else mirrored_self_locking)(p)
    other = PassiveFlow(mirrored, T[[0, 2, 1]]).point(w, -s)
    expected = (point[0], -point[1], point[3], point[2], point[5], point[4], point[6])
    assert relative_difference(other[:7], expected) < 1e-10, (p, w, s, T)


# Endurance


PERIOD, DT = 1000, 0.01   # ticks of a load, s
ANGLE_ERROR = 5e-5        # trapezoids cut the corners where a shaft turns round


def steady_load(variant, kind):
    """Return the torques of a period: constant, or swinging through both power flows and slip."""
    if kind == 'rest':
        return [(0.0, 0.0, 0.0)] * PERIOD
    ratio, share = (3.517, 0.5) if is_symmetric(variant) else (1.0, 0.4)
    if kind == 'constant':
        return [(50.0 / ratio, -19.0, -28.0)] * PERIOD
    torques = []
    for n in range(PERIOD):
        phase = 2 * math.pi * n / PERIOD
        drive = 200.0 * math.sin(2 * phase) + 80.0 * math.sin(5 * phase + 0.5)
        load = 3.0 + 15.0 * math.sin(phase + 1.5) - drive
        front = share + (0.01 if is_symmetric(variant) else 0.28) * math.sin(3 * phase)
        torques.append((drive / ratio, front * load, (1.0 - front) * load))
    return torques


class Endured(NamedTuple):
    """What a long run came to."""

    ticks: int
    time: float           # s
    speed: float          # rad/s, the largest at the end
    turned: float         # rad, the largest angle since it had settled
    residual: float       # the worst of a constraint, speeds or angles, over its largest term
    angle_error: float    # of the angles beside the sum of speeds, over the largest angle
    coarse_steps: int


def endure(variant, kind, settle, periods, loss_law=PASSIVE):
    """
    Repeat a load at 100 Hz for some periods and return what it came to.

    When it has settled, the speeds over one period are summed by trapezoids: the angles of all
    periods from then on should be that sum, as often as there were periods.
    """
    simulation, load = Simulation(variant, DT, loss_law=loss_law), steady_load(variant, kind)
    g = constraints(variant, simulation.parameters)
    residual, turn, start = 0.0, None, None
    for period in range(periods):
        if period == settle:
            start = simulation.snapshot()
            speeds = np.array([start.velocity, *(simulation.step(T).velocity for T in load)])
            turn = (speeds[1:] + speeds[:-1]).sum(axis=0) / 2 * DT
        else:
            for T in load:
                simulation.advance(T)
        if period % 100 == 0 or period == periods - 1:
            now = simulation.snapshot()
            residual = max(residual, largest_residual(g, now.velocity),
                           largest_residual(g, now.position))
    turned = np.subtract(now.position, start.position)
    largest = float(np.abs(turned).max())
    error = float(np.abs(turned - turn * (periods - settle)).max()) / (largest or 1.0)
    return Endured(simulation.ticks, now.time, max(map(abs, now.velocity)), largest, residual,
                   error, simulation.coarse_steps)


# In C and in Python


def half_shafts(rng, case, arguments):
    """
    Return ``ports`` of one to three half-shafts for a case, and its load with outside speeds.

    These stay near the speeds at the start or jump anywhere, and now and then nothing holds one.
    """
    simulation = Simulation(case.variant, **arguments)
    chosen = rng.permutation(simulation.inputs)[:int(rng.integers(1, 4))].tolist()
    ports = {name: (power_of_ten(rng, 2, 6), or_zero(rng, power_of_ten(rng, 0, 4)))
             for name in chosen}
    start = dict(zip(simulation.shafts, simulation.snapshot().velocity))
    near, free = power_of_ten(rng, -3, 3), float(rng.choice([0.0, 0.3]))
    load = [list(torques) for torques in case.load]
    for inputs in load:
        for n, name in enumerate(simulation.inputs):
            if name in ports:
                speed = float(np.clip(start[name] + rng.normal(0.0, near), -1e6, 1e6))
                inputs[n] = None if rng.random() < free else speed
    return ports, load


class Twins:
    """
    Random cases by C and by Python: equal to the last bit.

    :param ported: whether some ports take a speed, by half-shafts.
    """

    def __init__(self, loss_law, clutched=False, ported=False):
        self.loss_law, self.clutched, self.ported = loss_law, clutched, ported
        self.cases = self.ticks = self.coarse_steps = self.refused = 0

    def __str__(self):
        which = 'symmetric with clutches' if self.clutched else 'all variants'
        ports = ' on half-shafts' if self.ported else ''
        return (f'{self.loss_law}, {which}{ports}: {self.cases} cases, {self.ticks} ticks, '
                f'{self.coarse_steps} coarse '
                f'steps, {self.refused} ticks refused, equal bits')

    def run(self, n):
        """Run case n both ways; raise AssertionError, with the case, where they differ."""
        rng, case = np.random.default_rng([6, n]), random_case(n, self.clutched)
        p = dataclasses.replace(case.arguments['parameters'], sign_speed=power_of_ten(rng, -3, 2))
        arguments = {**case.arguments, 'parameters': p, 'loss_law': self.loss_law}
        forces = rng.uniform(0.0, 1e4, (len(case.load), 2)) * rng.integers(2)
        load = case.load
        if self.ported:
            arguments['ports'], load = half_shafts(np.random.default_rng([7, n]), case, arguments)
        ways = []
        in_c = core._chosen('')
        for ticker, coupled_step in ((in_c.Ticker, in_c.coupled_step), (None, None)):
            with (mock.patch.object(core, 'Ticker', ticker),
                  mock.patch.object(core, 'coupled_step', coupled_step)):
                ways.append(self._way(case.variant, arguments, load, forces.tolist()))
        assert ways[0] == ways[1], f'case {n}: {case}'
        self.cases += 1

    def _way(self, variant, arguments, load, forces):
        """Return all that a run reports, as bytes."""
        audit, found = AuditedSimulation(variant, **arguments), []
        for n, (torque, force) in enumerate(zip(load, forces)):
            if n == len(load) // 2:   # what goes on from tick to tick may be handed over
                audit.parameters = audit.parameters
                audit.state = audit.state
            try:
                snapshot = audit.step(torque, force if audit.clutches else NO_FORCE)
            except ValueError as error:
                found.append(str(error))
                self.refused += 1
                continue
            numbers = np.hstack([*snapshot, audit.coarse_steps, *snapshot.energy.entries])
            found.append(numbers.tobytes())
        total = audit.total.entries, audit.stored_energy, audit.stored_by_changes, audit.worst
        found.append(np.hstack(total).tobytes())
        found.append(f'{audit.state} {audit.returned}')
        self.ticks += audit.ticks
        self.coarse_steps += audit.coarse_steps
        return found
