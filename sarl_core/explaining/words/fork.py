"""What a fork comes to, in sentences."""

from __future__ import annotations

from sarl_core.decimals import rounded_text
from sarl_core.mining.language import counted
from sarl_core.rendering.fork import Branch, Ending, Fork, Rest, endings
from sarl_core.rollouts.episodes import Episodes

# What a failure and another end are called, by the beginning of an environment's name.
_ENDS: dict[str, tuple[str, str]] = {
    "LunarLander": ("it crashes", "it lands and rests"),
    "BipedalWalker": ("it falls", "it arrives"),
    "CartPole": ("the pole falls, or the cart leaves the track", "it ends"),
    "MountainCar": ("it fails", "it reaches the flag"),
    "Acrobot": ("it fails", "it swings up"),
    "Driving": ("it crashes", "it ends"),
}
_OTHERS = ("it fails", "the environment ends it")

REST_TEXT: dict[Rest, str] = {
    "shielded": "Only this one change is withheld; the shield goes on after it.",
    "alone": "The shield is off from this step to the end.",
}


def ending_texts(episodes: Episodes) -> list[str]:
    """How each of some episodes ended, in words.

    Args:
        episodes: Finished ones.

    Returns:
        One entry an episode, as `ending_text`.
    """
    named = episodes.signalled is not None
    return [ending_text(one, episodes.env_id, named=named) for one in endings(episodes)]


def ending_text(ending: Ending, env_id: str, *, named: bool = False) -> str:
    """How an episode ended, in words.

    Args:
        ending: As `endings` says.
        env_id: Environment.
        named: Whether somebody named what a failure is, who may mean something else than a fall.

    Returns:
        As "it crashes" or "it runs to the limit".
    """
    if ending == "limit":
        return "it runs to the limit"
    family = env_id.rsplit(":", 1)[-1].rsplit("/", 1)[-1]
    words = next((words for name, words in _ENDS.items() if family.startswith(name)), _OTHERS)
    if ending == "failure":
        return _OTHERS[0] if named else words[0]
    return words[1]


def fork_text(fork: Fork) -> str:
    """What the change that was withheld was worth in this episode.

    Args:
        fork: Both branches.

    Returns:
        As "With the change the return is 120.5 and it lands and rests, after 210 steps. Without
        it the return is −80.2 (200.7 less) and it crashes, after 95 steps."
    """
    env_id, named = fork.unchanged.env_id, fork.unchanged.signalled is not None
    with_it, without = fork.branches
    gain = fork.difference
    compared = f"{abs(gain):,.1f} {'more' if gain > 0 else 'less'}" if gain else "the same"
    return (
        f"With the change the return is {rounded_text(with_it.gained, 1)} and "
        f"{_ended(with_it, env_id, named)}. Without it the return is "
        f"{rounded_text(without.gained, 1)} ({compared}) and {_ended(without, env_id, named)}."
    )


def _ended(branch: Branch, env_id: str, named: bool) -> str:
    return (
        f"{ending_text(branch.ending, env_id, named=named)}, after {counted(branch.steps, 'step')}"
    )
