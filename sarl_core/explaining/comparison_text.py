"""What a comparison comes to, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

from sarl_core.explaining.language import share_text
from sarl_core.rollouts.comparison import crash_rate, failure_known
from sarl_core.rollouts.episodes import Episodes


def clear_change(alone: Episodes, shielded: Episodes) -> int:
    """Whether the typical return differs by more than the intervals leave open.

    Args:
        alone: Episodes of an agent without a shield.
        shielded: Its episodes with a shield.

    Returns:
        1 if it rises with the shield, -1 if it falls, 0 if the intervals overlap.
    """
    before, after = alone.statistics, shielded.statistics
    return int(after.low > before.high) - int(after.high < before.low)


def verdict(agent: str, shield: str, alone: Episodes, shielded: Episodes) -> str:
    """Whether a shield did an agent good.

    Args:
        agent: Its name, as "novice".
        shield: What is in force, as "the unfiltered rules".
        alone: Episodes of the agent without a shield.
        shielded: Its episodes with the shield, on the same seeds.

    Returns:
        As "With the unfiltered rules the typical return of the novice rises from 22 to 500, and
        0 % instead of 100 % of its episodes end in a crash."
    """
    before, after = (f"{episodes.statistics.iqm:,.0f}" for episodes in (alone, shielded))
    change = {
        1: f"rises from {before} to {after}",
        -1: f"falls from {before} to {after}",
        0: f"does not clearly change ({after}, without them {before})",
    }[clear_change(alone, shielded)]
    return f"With {shield} the typical return of the {agent} {change}{_crashes(alone, shielded)}."


def verdict_on_all(agent: str, alone: Episodes, shielded: Sequence[tuple[str, Episodes]]) -> str:
    """What each of several shields did to an agent, the one that served it best first.

    Args:
        agent: Its name, as "novice".
        alone: Episodes of the agent without a shield.
        shielded: What is in force, as "the unfiltered rules", and its episodes with it, on the
            same seeds; at least one.

    Returns:
        As "With the unfiltered rules the typical return of the novice rises from 22 to 500, and
        0 % instead of 100 % of its episodes end in a crash; with the filtered rules it rises to
        305 (75 % of its episodes crash)."
    """
    best, *others = sorted(shielded, key=lambda pair: pair[1].statistics.iqm, reverse=True)
    first = verdict(agent, best[0], alone, best[1]).removesuffix(".")
    return "; ".join([first, *(_clause(name, alone, episodes) for name, episodes in others)]) + "."


def _clause(shield: str, alone: Episodes, shielded: Episodes) -> str:
    """The same of one more shield, in a few words."""
    after = f"{shielded.statistics.iqm:,.0f}"
    notes = []
    if failure_known(alone.env_id):
        rates = [crash_rate(episodes, episodes.env_id) for episodes in (alone, shielded)]
        notes = [f"{share_text(rates[1])} of its episodes crash"] if any(rates) else []
    change = clear_change(alone, shielded)
    if not change:
        return f"with {shield} it does not clearly change ({'; '.join([after, *notes])})"
    note = f" ({notes[0]})" if notes else ""
    return f"with {shield} it {'rises' if change > 0 else 'falls'} to {after}{note}"


def _crashes(alone: Episodes, shielded: Episodes) -> str:
    """What to say of the failures; nothing where it is not known which ends are some."""
    if not failure_known(alone.env_id):
        return ""
    before, after = (crash_rate(episodes, episodes.env_id) for episodes in (alone, shielded))
    if before != after:
        return (
            f", and {share_text(after)} instead of {share_text(before)} of its episodes end in a "
            "crash"
        )
    return f", and {share_text(after)} of its episodes end in a crash, as without" if after else ""
