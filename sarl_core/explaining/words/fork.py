"""What a fork comes to, in sentences."""

from __future__ import annotations

from sarl_core.decimals import rounded_text
from sarl_core.mining.language import counted
from sarl_core.rendering.fork import Branch, Ending, Fork, Rest

# What a failure and another end are called, by the beginning of an environment's name.
_ENDS: dict[str, tuple[str, str]] = {
    "LunarLander": ("it crashes", "it lands and rests"),
    "BipedalWalker": ("it falls", "it arrives"),
    "CartPole": ("the pole falls, or the cart leaves the track", "it ends"),
    "MountainCar": ("it fails", "it reaches the flag"),
    "Acrobot": ("it fails", "it swings up"),
}
_OTHERS = ("it fails", "the environment ends it")

REST_TEXT: dict[Rest, str] = {
    "shielded": "Only this one change is withheld; the shield goes on after it.",
    "alone": "The shield is off from this step to the end.",
}


def ending_text(ending: Ending, env_id: str) -> str:
    """How an episode ended, in words.

    Args:
        ending: As `endings` says.
        env_id: Environment.

    Returns:
        As "it crashes" or "it runs to the limit".
    """
    if ending == "limit":
        return "it runs to the limit"
    family = env_id.rsplit(":", 1)[-1].rsplit("/", 1)[-1]
    words = next((words for name, words in _ENDS.items() if family.startswith(name)), _OTHERS)
    return words[0] if ending == "failure" else words[1]


def fork_text(fork: Fork) -> str:
    """What the change that was withheld was worth in this episode.

    Args:
        fork: Both branches.

    Returns:
        As "With the change the return is 120.5 and it lands and rests, after 210 steps. Without
        it the return is −80.2 (200.7 less) and it crashes, after 95 steps."
    """
    env_id = fork.unchanged.env_id
    with_it, without = fork.branches
    gain = fork.difference
    compared = f"{abs(gain):,.1f} {'more' if gain > 0 else 'less'}" if gain else "the same"
    return (
        f"With the change the return is {rounded_text(with_it.gained, 1)} and "
        f"{_ended(with_it, env_id)}. Without it the return is {rounded_text(without.gained, 1)} "
        f"({compared}) and {_ended(without, env_id)}."
    )


def _ended(branch: Branch, env_id: str) -> str:
    return f"{ending_text(branch.ending, env_id)}, after {counted(branch.steps, 'step')}"
