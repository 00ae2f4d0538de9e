"""How often a shield switches on and off, as tables have it."""

from __future__ import annotations

from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.flips import Pace, pace_of
from sarl_dashboard.state.environments import offers


def pace_of_played(env_id: str) -> Pace:
    """By what the flips in an environment that was played here are counted."""
    return pace_of(offers().environment(env_id) or env_id)


def flips_title(env_id: str) -> str:
    """What the column is called: its unit is that of the environment."""
    return f"Flips {pace_of_played(env_id).each}"


def flips_rate(episodes: Episodes) -> float:
    """Flips of all episodes together, which were counted, a unit."""
    assert episodes.flips is not None
    return pace_of_played(episodes.env_id).rate(
        int(episodes.flips.sum()), int(episodes.lengths.sum())
    )
