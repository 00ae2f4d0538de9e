"""The scene at a step: the episode is played again as it was recorded."""

from __future__ import annotations

import numpy as np
import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_core.explaining.html.step_card import picture
from sarl_core.rendering.repeating import Repeating
from sarl_core.rendering.replay import Replay, render_episode
from sarl_dashboard.cache import cached
from sarl_dashboard.state.environments import registered
from sarl_dashboard.text import in_full

_MOST_STEPS = 2_000  # of an episode that is played again while somebody waits, 20 s at most


def show_scene(demonstrations: Demonstrations, episode: int, step: int) -> None:
    """A picture of the scene, or why there is none.

    Args:
        demonstrations: All of them: an episode has the seed of the first and its own number.
        episode: As it stands in `demonstrations.episodes`.
        step: Index within it.
    """
    scene = _scene(demonstrations, episode)
    if isinstance(scene, str):
        st.caption(in_full(scene))
    else:
        st.html(picture(scene.png(step), f"The environment at step {step}"))


@cached(show_spinner="Playing the episode again …")
def _scene(demonstrations: Demonstrations, episode: int) -> Replay | str:
    """The episode before the camera, or why it cannot be drawn, as a sentence."""
    env_id, first = demonstrations.env_id, demonstrations.seed
    if not env_id or first is None:
        lacks = "environment" if not env_id else "seed"
        return f"the scene cannot be drawn: the demonstrations name no {lacks}"
    recorded = demonstrations.select([episode])
    if len(recorded) > _MOST_STEPS:
        return f"the scene is drawn for episodes of up to {_MOST_STEPS:,} steps only"
    try:
        replay = render_episode(
            registered(env_id),
            Repeating(recorded.action_columns),
            seed=first + episode,
            max_steps=len(recorded),
        )
    except SarlError as error:
        return f"the scene cannot be drawn: {error}"
    steps = replay.episodes[0].steps
    assert steps is not None  # a replay records them
    states = steps.observation
    if states.shape != recorded.raw_observations.shape or not np.allclose(
        states, recorded.raw_observations
    ):
        return (
            f"the scene cannot be drawn: played again with seed {first + episode}, {env_id} gives "
            "other states than were recorded"
        )
    return replay
