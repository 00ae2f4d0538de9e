"""Running and rendering episodes against what Stable-Baselines3 and imageio do."""

from __future__ import annotations

import os
import statistics
import tempfile
from collections.abc import Iterable
from pathlib import Path

import gymnasium
import numpy as np

from benchmarks import data
from benchmarks.measure import Row, duration, side_by_side
from sarl_core import Shield, rollout
from sarl_core.studies.ablation import Ablation
from sarl_core.studies.ablation_run import ablate


def episodes(quick: bool) -> Iterable[Row]:
    """The expert's episodes, against Stable-Baselines3's evaluation of the same policy."""
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.monitor import Monitor

    count, model = 10 if quick else 100, data.same_in_sb3()
    returns: list[float] = []

    def theirs() -> None:
        env = Monitor(gymnasium.make(data.ENV_ID))
        env.reset(seed=0)
        found, _ = evaluate_policy(model, env, n_eval_episodes=count, return_episode_rewards=True)
        env.close()
        returns[:] = list(map(float, np.asarray(found)))

    mean = 0.0

    def ours() -> None:
        nonlocal mean
        mean = float(rollout(data.ENV_ID, "expert", episodes=count, seed=0).returns.mean())

    ours_took, theirs_took = side_by_side(ours, theirs, repeats=1 if quick else 3)
    yield Row(
        f"{count} LunarLander episodes, expert",
        "Stable-Baselines3's evaluate_policy",
        "times faster",
        theirs_took / ours_took,
        5,
        f"{duration(ours_took)} against {duration(theirs_took)}; mean return {mean:.0f} and "
        f"{statistics.mean(returns):.0f}",
    )


def gif(quick: bool) -> Iterable[Row]:
    """A GIF of 200 frames, against imageio's default."""
    import imageio

    from sarl_core.rendering.replay import encode_gif

    frames = _frames(50 if quick else 200)
    with tempfile.TemporaryDirectory() as folder:
        ours_file, theirs_file = Path(folder) / "ours.gif", Path(folder) / "theirs.gif"
        ours, theirs = side_by_side(
            lambda: encode_gif(frames, 50, ours_file),
            lambda: imageio.mimsave(theirs_file, frames),
            repeats=1 if quick else 5,
        )
        sizes = ours_file.stat().st_size, theirs_file.stat().st_size
    yield Row(
        f"GIF of {len(frames)} frames, 600 x 400, encoding",
        "imageio.mimsave with defaults",
        "times faster",
        theirs / ours,
        8,
        f"{duration(ours)} against {duration(theirs)}; {sizes[0] / 1e6:.2f} MB against "
        f"{sizes[1] / 1e6:.2f} MB",
        holds=sizes[0] <= sizes[1],
    )


def ablation(quick: bool) -> Iterable[Row]:
    """Rules taken out one by one, on all cores against one."""
    cores = os.cpu_count() or 1
    shield = Shield(data.rules())
    count, most = (40, 20) if quick else (50, 30)  # starting processes takes seconds
    found: dict[int, Ablation] = {}

    def with_jobs(jobs: int) -> None:
        found[jobs] = ablate(data.ENV_ID, "novice", shield, episodes=count, most=most, jobs=jobs)

    ours, theirs = side_by_side(lambda: with_jobs(cores), lambda: with_jobs(1), repeats=1)
    yield Row(
        f"ablation of {most} rules, {count} LunarLander episodes, {cores} cores",
        "the same on one core",
        "times faster",
        theirs / ours,
        1.5,
        f"{duration(ours)} against {duration(theirs)}; {found[cores].played:,} episodes played",
        holds=np.array_equal(found[cores].returns, found[1].returns),
    )


def _frames(count: int) -> list[np.ndarray]:
    """What the expert's episodes look like."""
    from sarl_core.rollouts.trial import make_agent

    agent, env = (
        make_agent("expert", data.ENV_ID),
        gymnasium.make(data.ENV_ID, render_mode="rgb_array"),
    )
    frames: list[np.ndarray] = []
    observation, _ = env.reset(seed=1)
    while len(frames) < count:
        frames.append(np.asarray(env.render()))
        action = int(agent.act(observation[None].astype(np.float32), None)[0, 0])
        observation, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            observation, _ = env.reset()
    env.close()
    return frames
