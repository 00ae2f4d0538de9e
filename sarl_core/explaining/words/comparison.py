"""What a comparison comes to, in a sentence."""

from __future__ import annotations

from collections.abc import Sequence

from sarl_core.decimals import telling_text
from sarl_core.mining.language import at_least_text
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.statistics import Rate
from sarl_core.studies.shield_effect import ERROR_RATE, ShieldEffect, shield_effect

POLICY_TEXT = (
    "These rules decide every step (freedom 0 %), so they are a policy that replaces the agent "
    "and no longer a shield that corrects it"
)
"""What is said of rules that leave an agent nothing to choose from."""


def verdict(agent: str, shield: str, alone: Episodes, shielded: Episodes) -> str:
    """Whether a shield did an agent good, by the same seeds with it and without.

    Args:
        agent: Its name, as "novice".
        shield: What is in force, as "the unfiltered rules".
        alone: Episodes of the agent without a shield.
        shielded: Its episodes with the shield, on the same seeds.

    Returns:
        As "With the unfiltered rules the typical return of the expert falls from 271 to 242 (its
        mean from 271 to 168, a difference of −103, 95 % interval −186 to −21), and 25 % instead
        of 0 % of its episodes fail: these rules harm it."
    """
    effect = shield_effect(alone, shielded)
    before, after = (telling_text(episodes.statistics.iqm) for episodes in (alone, shielded))
    mean = effect.returns.mean
    if not _is_clear(effect):
        change = (
            f"does not clearly change ({after}, without them {before}; "
            f"{_difference(effect, alone, shielded)})"
        )
    elif mean * (shielded.statistics.iqm - alone.statistics.iqm) > 0:
        word = "rises" if mean > 0 else "falls"
        change = f"{word} from {before} to {after} ({_difference(effect, alone, shielded)})"
    else:  # what moved lies among the worst or the best episodes
        change = (
            f"hides what changes ({after}, without them {before}): its mean "
            f"{'rises' if mean > 0 else 'falls'} ({_difference(effect, alone, shielded)})"
        )
    harm = ": these rules harm it" if effect.effect == "harms" else ""
    crashes = _crashes(effect, alone, shielded)
    return f"With {shield} the typical return of the {agent} {change}{crashes}{harm}."


def verdict_on_all(agent: str, alone: Episodes, shielded: Sequence[tuple[str, Episodes]]) -> str:
    """What each of several shields did to an agent, the one that served it best first.

    Args:
        agent: Its name, as "novice".
        alone: Episodes of the agent without a shield.
        shielded: What is in force, as "the unfiltered rules", and its episodes with it, on the
            same seeds; at least one.

    Returns:
        As that of `verdict`, and then "; with the filtered rules it rises to 305 (its mean from 22
        to 305, a difference of 283, 95 % interval 279 to 287; 75 % of its episodes crash)."
    """
    best, *others = sorted(shielded, key=lambda pair: pair[1].statistics.iqm, reverse=True)
    first = verdict(agent, best[0], alone, best[1]).removesuffix(".")
    return "; ".join([first, *(_clause(name, alone, episodes) for name, episodes in others)]) + "."


def _is_clear(effect: ShieldEffect) -> bool:
    """Whether a difference in return is said to be one; of few episodes with a caution."""
    return effect.return_p < ERROR_RATE or (effect.too_few and effect.returns.mean != 0.0)


def _difference(effect: ShieldEffect, alone: Episodes, shielded: Episodes) -> str:
    """The means with their paired difference, its interval, and whether it may be chance."""
    if effect.returns.low == effect.returns.high == 0.0:
        return "every episode has the same return with them and without"
    before, after = (telling_text(episodes.statistics.mean) for episodes in (alone, shielded))
    ends = [telling_text(end) for end in (effect.returns.low, effect.returns.high)]
    few = f"; {effect.episodes} episodes are too few to rule out chance" if effect.too_few else ""
    return (
        f"its mean from {before} to {after}, a difference of {telling_text(effect.returns.mean)}, "
        f"95 % interval {ends[0]} to {ends[1]}{few}"
    )


def _clause(shield: str, alone: Episodes, shielded: Episodes) -> str:
    """The same of one more shield, in a few words."""
    effect = shield_effect(alone, shielded)
    after = telling_text(shielded.statistics.iqm)
    notes = [_difference(effect, alone, shielded)]
    if alone.failures is not None and shielded.failures is not None:
        some = alone.failures.count or shielded.failures.count
        notes += [f"{_share(shielded.failures)} of its episodes fail"] if some else []
    if effect.effect == "harms":
        notes.append("these rules harm it")
    text = "; ".join(notes)
    if not _is_clear(effect):
        return f"with {shield} it does not clearly change ({after}; {text})"
    word = "rises" if shielded.statistics.iqm > alone.statistics.iqm else "falls"
    return f"with {shield} it {word} to {after} ({text})"


def _share(failures: Rate) -> str:
    return at_least_text(failures.rate, failures.unknown)


def _crashes(effect: ShieldEffect, alone: Episodes, shielded: Episodes) -> str:
    """What to say of the failures; nothing where it is not known which ends are some."""
    if alone.failures is None or shielded.failures is None:
        return ""
    before, after = _share(alone.failures), _share(shielded.failures)
    if alone.failures.rate == shielded.failures.rate:
        none = not alone.failures.count
        return "" if none else f", and {after} of its episodes fail, as without"
    chance = "" if effect.failure_p < ERROR_RATE else ", which alone may still be chance"
    return (
        f", and {after} instead of {before} of its episodes fail{'' if effect.too_few else chance}"
    )
