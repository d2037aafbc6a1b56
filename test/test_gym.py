# Copyright 2026 dm_ros developers
# SPDX-License-Identifier: Apache-2.0

"""The task of a slip controller, by gymnasium's own checks, and that it is worth learning."""

import warnings

import numpy as np
import pytest

gymnasium = pytest.importorskip('gymnasium', reason='the task needs gymnasium: the extra gym')

from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AutoresetMode  # noqa: E402

from dm_ros.gym import RADIUS, SlipControlEnv, SlipControlVectorEnv  # noqa: E402

GRIP = {'symmetric.clutch.left.friction_coefficient': (0.07, 0.13)}


def episode(axles, policy, seed=1):
    """Return observations (steps, axles, 7) and rewards (steps, axles) of an episode."""
    seen, _ = axles.reset(seed=seed)
    observations, rewards = [seen], []
    while True:
        seen, reward, ended, over, _ = axles.step(policy(seen))
        observations.append(seen)
        rewards.append(reward)
        assert not ended.any() and over.all() == over.any()
        if over.all():
            return np.array(observations), np.array(rewards)


def held(share):
    return lambda seen: np.full((len(seen), 1), share, np.float32)


def test_the_checker_of_gymnasium_finds_nothing_wrong():
    with warnings.catch_warnings():
        warnings.simplefilter('error')
        check_env(gymnasium.make('dm_ros/SlipControl-v0', duration=0.1).unwrapped)


def test_spaces_and_what_is_returned_are_those_of_a_vector_environment():
    axles = gymnasium.make_vec('dm_ros/SlipControl-v0', num_envs=3, duration=0.02, randomize=GRIP,
                               vectorization_mode='vector_entry_point')
    assert isinstance(axles.unwrapped, SlipControlVectorEnv)
    assert axles.metadata['autoreset_mode'] == AutoresetMode.NEXT_STEP
    axles.action_space.seed(0)
    seen, infos = axles.reset(seed=0)
    assert seen in axles.observation_space and infos == {}
    for over in (False, True, False, False, True, False):   # the third begins the next episode
        seen, rewards, ended, truncated, infos = axles.step(axles.action_space.sample())
        assert seen in axles.observation_space and infos == {}
        assert rewards.shape == (3,) and rewards.dtype == float
        assert ended.dtype == truncated.dtype == bool
        assert not ended.any() and truncated.tolist() == [over] * 3
    assert not rewards.any() and not seen[:, :4].any()


def test_equal_seeds_give_equal_bits_and_others_do_not():
    runs = [episode(SlipControlVectorEnv(4, 0.3, GRIP), held(0.3), seed) for seed in (1, 1, 2)]
    for first, again, other in zip(*runs):
        assert np.array_equal(first, again) and not np.array_equal(first, other)


def test_one_axle_is_one_of_the_vector():
    one, axles = SlipControlEnv(0.05, GRIP), SlipControlVectorEnv(1, 0.05, GRIP)
    seen, _ = one.reset(seed=5)
    seen_of_all, _ = axles.reset(seed=5)
    assert np.array_equal(seen, seen_of_all[0])
    for _ in range(12):   # beyond the end of the episode too
        seen, reward, *_ = one.step(np.array([0.7], np.float32))
        seen_of_all, rewards, *_ = axles.step(np.array([[0.7]], np.float32))
        assert np.array_equal(seen, seen_of_all[0]) and reward == rewards[0]


def test_parameters_are_drawn_anew_for_each_axle_and_episode():
    axles = SlipControlVectorEnv(5, 0.01, GRIP)
    drawn = []
    for seed in (1, 2):
        axles.reset(seed=seed)
        drawn += axles.parameters[next(iter(GRIP))].tolist()
    assert len(set(drawn)) == 10 and min(drawn) >= 0.07 and max(drawn) <= 0.13


def test_pressing_holds_the_shafts_together():
    open_axle, locked = (episode(SlipControlVectorEnv(16, 2.0), held(share))[0][-1]
                         for share in (0.0, 1.0))
    assert np.abs(locked[:, 2]).max() < 2.0 < np.abs(open_axle[:, 2]).max()
    assert locked[:, 6] == pytest.approx(1.0, abs=1e-3) and not open_axle[:, 6].any()
    assert (locked[:, 3] > 0.0).all()


def by_slip(seen):
    """Press by the slip beyond that of the curve."""
    of_curve = -2.0 * seen[:, 4] * seen[:, 3] / RADIUS
    return np.clip(0.3 * np.abs(seen[:, 2] - of_curve) - 0.15, 0.0, 1.0)[:, None]


def test_a_controller_of_slip_is_better_than_any_constant_force():
    """Open wins on a dry road, pressed on ice."""
    controlled, free, *pressed = (
        episode(SlipControlVectorEnv(16, 3.0), policy)[1].sum(axis=0)
        for policy in (by_slip, held(0.0), held(0.3), held(0.5)))
    for each in pressed:
        assert 0.3 < (each > free).mean() < 0.9
        assert controlled.mean() > max(free.mean(), each.mean())


@pytest.mark.parametrize('arguments, words', [
    ({'duration': 0.005}, 'duration: 0.005 is not allowed, it must be 0.01 s at least'),
    ({'duration': float('nan')}, 'duration: nan'), ({'duration': 'a'}, "duration: 'a'"),
    ({'num_envs': 0}, 'num_envs: 0'), ({'num_envs': 1.5}, 'num_envs: 1.5'),
    ({'randomize': {'symmetric.inertia.left': 1.0}}, r'symmetric.inertia.left: 1.0 must be \(low'),
    ({'randomize': {'symmetric.inertia.left': (2.0, 1.0)}}, r'\(2.0, 1.0\) must be \(low, high\)'),
    ({'randomize': {'symmetric.inertia.left': (-1.0, 1.0)}}, 'symmetric.inertia.left: -1.0'),
    ({'randomize': {'symmetric.inertia.lift': (1.0, 2.0)}}, 'there is no such parameter')])
def test_what_is_not_allowed_is_refused_at_once_and_named(arguments, words):
    with pytest.raises(ValueError, match=words):
        SlipControlVectorEnv(**arguments)


@pytest.mark.parametrize('actions', [[[0.1]], [[0.1, 0.1]], [0.1, 0.1], [[0.1], [np.nan]]])
def test_actions_of_another_shape_and_no_numbers_are_refused(actions):
    axles = SlipControlVectorEnv(2)
    axles.reset(seed=1)
    with pytest.raises(ValueError, match=r'actions: .* must be numbers of the shape \(2, 1\)'):
        axles.step(actions)
