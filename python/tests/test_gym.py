"""The environments pass gymnasium's own check."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import slipbound

gymnasium = pytest.importorskip("gymnasium")


@pytest.mark.parametrize("name", ["HoldBottle", "ScrewCap"])
def test_gymnasium_accepts_it(name):
    import slipbound.gym  # noqa: F401
    from gymnasium.utils.env_checker import check_env

    env = gymnasium.make(f"slipbound/{name}-v0", render_mode="rgb_array", grid="fast")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # The numbers of an observation have no bounds, and a force is not centred on 0: both are only warnings.
        warnings.filterwarnings("ignore", message=".*(Box observation space|symmetric|normalized).*")
        check_env(env.unwrapped, skip_render_check=True)
    assert env.unwrapped.render().shape == env.observation_space["image"].shape


def test_a_steady_grip_holds():
    import slipbound.gym  # noqa: F401

    env = gymnasium.make("slipbound/HoldBottle-v0", grid="fast")
    env.reset(seed=1)
    for _ in range(40):
        observation, reward, terminated, truncated, info = env.step(np.array([25.0], np.float32))
    assert observation["numbers"][0] > 20 and info["slid_mm"] < 0.5 and not terminated and not truncated
    assert -1 < reward < 0


def test_the_reward_charges_the_force_that_was_commanded():
    import slipbound.gym  # noqa: F401

    env = gymnasium.make("slipbound/HoldBottle-v0", grid="fast", disable_env_checker=True)
    rewards = []
    for force_n in (25.0, 40.0):
        env.reset(seed=1)
        rewards.append([env.step(np.array([force_n], np.float32))[1] for _ in range(40)])
    # While the jaws close the task commands its own force, whatever the action.
    assert rewards[0][0] == rewards[1][0]
    assert rewards[0][-1] == pytest.approx(-25 / 60, abs=0.1) and rewards[1][-1] == pytest.approx(-40 / 60, abs=0.1)


@pytest.mark.parametrize("action", [[np.nan], [np.inf], np.zeros(7), []])
def test_an_action_that_is_no_force_is_refused(action):
    import slipbound.gym  # noqa: F401

    env = gymnasium.make("slipbound/HoldBottle-v0", grid="fast", disable_env_checker=True)
    env.reset(seed=1)
    with pytest.raises(slipbound.SettingError, match="action: expected one finite force"):
        env.step(np.asarray(action, np.float32))
    assert np.isfinite(env.step(np.array([25.0], np.float32))[1]), "it goes on"
