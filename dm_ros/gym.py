# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""
A slip controller's task for reinforcement learning: a driven axle, one side perhaps on ice.

A car moves off on two wheels behind a symmetric differential. A clutch between carrier and left
shaft holds the shafts together as hard as it is pressed. On ice that brings the car forward, in a
curve on a dry road it makes the tyres slide. It needs gymnasium, the extra ``gym``.
"""

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise ImportError('dm_ros.gym needs gymnasium: pip install "dm_ros[gym]"') from error
from gymnasium.spaces import Box
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
import numpy as np

from dm_ros.ensemble import Ensemble
from dm_ros.motion.checks import checked

VARIANT = 'symmetric_ode'
AXLE = {   # of the preset actuated_axle, with the inertia of wheels
    'symmetric.inertia.left': 1.0, 'symmetric.inertia.right': 1.0,
    'symmetric.pressure_angle': 0.0,   # the gears do not press the clutch
    'symmetric.clutch.left.friction_surfaces': 16,
    'symmetric.clutch.left.friction_coefficient': 0.1,
    'symmetric.clutch.left.actuator_time_constant': 0.05,
    'symmetric.clutch.left.actuator_limit': 15e3}
TICK, TICKS = 0.001, 10   # s, of the differential; how many of them have one action
RAMP = 0.5                # s, in which the driver's torque comes
MASS, WEIGHT = 1200.0, 3500.0   # kg, of the car; N, on each driven wheel
RADIUS, FULL_SLIDE = 0.3, 0.5   # m, of a wheel; m/s of sliding at which its grip is nearly all
ICE, ROAD = (0.05, 0.2), (0.7, 1.0)   # grip
ON_ICE = 0.6      # share of the episodes with a side on ice
CURVE = 0.12      # largest difference of the ground speed of a wheel from the car's, as a share
TORQUE = 80.0, 200.0   # N m, on the pinion
SLIDING, PRESSING = 0.5, 1.0   # cost, m of progress, of a m slid by a wheel, of a s full force
WILDEST = 5.0     # m/s of sliding; a wheel that slides faster costs no more
FASTEST = 1e4     # rad/s, m/s, N m: what is observed is clipped to this


class SlipControlVectorEnv(VectorEnv):
    """
    Many axles at once, on an ``Ensemble``.

    An action is the force on the clutch as a share of its limit, 0 to 1, for 0.01 s. Observed are
    ``OBSERVED``; the reward is the progress of the car in m, less what the wheels slid over the
    ground and what pressing cost. Each episode has other grips, curves and torques. All episodes
    last as long, and begin anew together with the step after their last.

    :param num_envs: number of axles.
    :param duration: of an episode, s.
    :param randomize: ``{full name: (low, high)}`` of parameters that are drawn, evenly, for each
        axle and episode.
    :raises ValueError: as ``Ensemble`` does for parameters that are not allowed.
    """

    OBSERVED = ('speed left, rad/s', 'speed right, rad/s', 'left minus right, rad/s',
                'speed of the car, m/s', 'curve', 'torque on the pinion, N m',
                'force in force, share of its limit')
    metadata = {'autoreset_mode': AutoresetMode.NEXT_STEP, 'render_modes': []}

    def __init__(self, num_envs=1, duration=4.0, randomize=None):
        self.num_envs = num_envs = int(checked(
            'num_envs', num_envs, lambda v: v >= 1 and v == int(v), 'a positive integer'))
        self._steps = round(checked('duration', duration, lambda v: v >= TICK * TICKS,
                                    f'{TICK * TICKS:g} s at least') / (TICK * TICKS))
        self.single_action_space = Box(0.0, 1.0, (1,), np.float32)
        self.single_observation_space = Box(-FASTEST, FASTEST, (len(self.OBSERVED),), np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self._ranges = {name: _range(name, limits) for name, limits in (randomize or {}).items()}
        for end in (0, 1):   # what is not allowed is told at once
            Ensemble(VARIANT, [AXLE | {name: limits[end] for name, limits
                                       in self._ranges.items()}], TICK)
        self._ensemble = None
        self._left = 0   # steps of the episode

    def reset(self, *, seed=None, options=None):
        """Begin an episode of each axle; return what is observed, and {}."""
        super().reset(seed=seed)
        self._begin()
        return self._observed(), {}

    def step(self, actions):
        """
        Press the clutches for 0.01 s.

        :param actions: (num_envs, 1), clipped to 0 to 1.
        :return: observations (num_envs, 7), rewards, terminations (never), truncations, {}.
        """
        none = np.zeros(self.num_envs, bool)
        if not self._left:
            self._begin()
            return self._observed(), np.zeros(self.num_envs), none, none.copy(), {}
        actions = np.asarray(actions, float)
        if actions.shape != (self.num_envs, 1) or np.isnan(actions).any():
            raise ValueError(f'actions: {actions.tolist()!r} must be numbers of the shape '
                             f'{(self.num_envs, 1)}')
        pressed = np.clip(actions[:, 0], 0.0, 1.0)
        rewards = sum(self._tick(pressed) for _ in range(TICKS))
        self._left -= 1
        return self._observed(), rewards, none, np.full(self.num_envs, not self._left), {}

    @property
    def parameters(self):
        """Those of each axle in this episode, as ``Ensemble.parameters``."""
        return self._ensemble.parameters

    def _begin(self):
        draw, count = self.np_random.uniform, self.num_envs
        if self._ensemble is None or self._ranges:
            drawn = {name: draw(*limits, count) for name, limits in self._ranges.items()}
            self._ensemble = Ensemble(VARIANT, [
                AXLE | {name: float(values[index]) for name, values in drawn.items()}
                for index in range(count)], TICK)
            names = self._ensemble.shafts
            self._wheels = [names.index(shaft) for shaft in ('left', 'right')]
            self._limit = AXLE['symmetric.clutch.left.actuator_limit']
        self._ensemble.reset()
        self._grip = draw(*ROAD, (count, 2))
        # the clutch lies on the left, so the sides are not alike
        iced = np.flatnonzero(draw(size=count) < ON_ICE)
        self._grip[iced, draw(size=len(iced)).round().astype(int)] = draw(*ICE, len(iced))
        self._curve = draw(-CURVE, CURVE, count)
        self._demand = draw(*TORQUE, count)
        self._torque, self._speed = np.zeros(count), np.zeros(count)
        self._left = self._steps

    def _tick(self, pressed):
        """Advance by one tick; return its rewards."""
        ensemble, time = self._ensemble, TICK * TICKS * (self._steps - self._left)
        self._torque = self._demand * min(1.0, (time + TICK) / RAMP)
        turning = ensemble.velocity[:, self._wheels] * RADIUS
        ground = self._speed[:, None] * (1.0 + self._curve[:, None] * [-1.0, 1.0])
        sliding = turning - ground
        force = self._grip * WEIGHT * np.tanh(2.0 * sliding / FULL_SLIDE)
        inputs = {'pinion': self._torque, 'left': -RADIUS * force[:, 0],
                  'right': -RADIUS * force[:, 1]}
        ensemble.step(np.column_stack([inputs[shaft] for shaft in ensemble.inputs]),
                      np.column_stack([pressed * self._limit if clutch == 'left' else 0.0 * pressed
                                       for clutch in ensemble.clutches]))
        self._speed = self._speed + force.sum(axis=1) / MASS * TICK
        slid = np.minimum(np.abs(sliding), WILDEST).sum(axis=1)
        return TICK * (self._speed - SLIDING * slid - PRESSING * pressed**2)

    def _observed(self):
        left, right = self._ensemble.velocity[:, self._wheels].T
        share = self._ensemble.clutch_force[:, self._ensemble.clutches.index('left')] / self._limit
        return np.clip(np.column_stack((
            left, right, left - right, self._speed, self._curve, self._torque, share)),
            -FASTEST, FASTEST).astype(np.float32)


def _range(name, limits):
    """Return the ends of a range as floats; raise ValueError that names what is wrong."""
    try:
        low, high = map(float, limits)
    except (TypeError, ValueError):
        low = high = np.nan
    if not low <= high:
        raise ValueError(f'randomize: {name}: {limits!r} must be (low, high)')
    return low, high


class SlipControlEnv(gymnasium.Env):
    """One axle: ``SlipControlVectorEnv`` with one of them, and its arguments."""

    metadata = {'render_modes': []}

    def __init__(self, duration=4.0, randomize=None):
        self._axles = SlipControlVectorEnv(1, duration, randomize)
        self.action_space = self._axles.single_action_space
        self.observation_space = self._axles.single_observation_space

    def reset(self, *, seed=None, options=None):
        """Begin an episode; return what is observed, and {}."""
        super().reset(seed=seed)
        self._axles.np_random = self.np_random
        observations, infos = self._axles.reset()
        return observations[0], infos

    def step(self, action):
        """Press the clutch for 0.01 s; an action is (1,)."""
        observations, rewards, _, truncations, infos = self._axles.step([action])
        return observations[0], float(rewards[0]), False, bool(truncations[0]), infos


gymnasium.register('dm_ros/SlipControl-v0', SlipControlEnv,
                   vector_entry_point=SlipControlVectorEnv)
