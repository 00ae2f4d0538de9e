"""How often a shield switches on and off, as tables have it."""

from __future__ import annotations

from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.flips import pace_of


def flips_title(env_id: str) -> str:
    """What the column is called: its unit is that of the environment."""
    return f"Flips {pace_of(env_id).each}"


def flips_rate(episodes: Episodes) -> float:
    """Flips of all episodes together, which were counted, a unit."""
    assert episodes.flips is not None
    return pace_of(episodes.env_id).rate(int(episodes.flips.sum()), int(episodes.lengths.sum()))
