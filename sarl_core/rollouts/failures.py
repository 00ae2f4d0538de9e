"""What is said of failures, cost, the worst tenth and freedom, in words and the same everywhere."""

from __future__ import annotations

import math
from collections.abc import Mapping

from sarl_core.decimals import telling_text
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.failures import cannot_fail, no_failures_text
from sarl_core.mining.language import at_least_text, share_text
from sarl_core.rollouts.statistics import Rate


def rate_text(rate: Rate) -> str:
    """How many episodes failed, and how sure one can be of the share.

    Args:
        rate: Of failures.

    Returns:
        As "3 of 300 episodes, 1 % (95 % interval 0.2 % to 2.9 %)" or "0 failures in 300: at most
        1 % with 95 % certainty".
    """
    if rate.unknown == rate.of:
        return "not known: no episode ran to its end"
    if not (rate.count or rate.unknown):
        return f"0 failures in {rate.of:,}: at most {bound_text(rate.at_most)} with 95 % certainty"
    ended = (
        f" of the {rate.of - rate.unknown:,} that ended"
        if rate.unknown
        else f" of {rate.of:,} episodes"
    )
    return (
        f"{rate.count:,}{ended}, {at_least_text(rate.rate, rate.unknown)}"
        f"{' of all' if rate.unknown else ''} ({interval_text(rate)})"
    )


def interval_text(rate: Rate) -> str:
    """How sure one can be of a share.

    Args:
        rate: With its interval.

    Returns:
        As "95 % interval 0.2 % to 2.9 %"; without any failure "at most 1 % with 95 % certainty".
    """
    if not (rate.count or rate.unknown):
        return f"at most {bound_text(rate.at_most)} with 95 % certainty"
    return f"95 % interval {share_text(rate.low)} to {share_text(rate.high)}"


def bound_text(share: float) -> str:
    """An upper bound of a share, rounded up so that it stays one.

    Args:
        share: 0 to 1.

    Returns:
        As "1 %" for 0.00994.
    """
    percent = 100 * share
    decimals = 0 if percent >= 10 else 1 if percent >= 0.1 else 3
    scale = 10**decimals
    return f"{math.ceil(percent * scale - 1e-9) / scale:g} %"


def rate_in(summary: Mapping[str, float], episodes: int) -> Rate | None:
    """The failures of a summary, as `Episodes.summary` gives it or a file keeps it.

    Args:
        summary: Of some episodes.
        episodes: How many they are.

    Returns:
        None where it does not tell.
    """
    if "failures" not in summary:
        return None
    return Rate(
        int(summary["failures"]),
        episodes,
        summary["failure_rate"],
        summary["failure_low"],
        summary["failure_high"],
        int(summary.get("undecided", summary.get("cut", 0))),
    )


def failures_text(summary: Mapping[str, float], episodes: int, environment: EnvironmentOrId) -> str:
    """How many episodes failed, and how sure one can be of the share.

    Args:
        summary: What `Episodes.summary` gave.
        episodes: How many there are.
        environment: Theirs.

    Returns:
        As `rate_text`; in words also where it is not known which are failures, or none can be.
    """
    rate = rate_in(summary, episodes)
    if rate is not None:
        return rate_text(rate)
    why = no_failures_text(environment)
    return f"{'none' if cannot_fail(environment) else 'not known'}: {why}"


def cost_text(summary: Mapping[str, float | None]) -> str:
    """What an episode costs on average.

    Args:
        summary: What `Episodes.summary` gave.

    Returns:
        As "2.3 an episode (95 % interval 1.9 to 2.7)"; "" where it is not known, or each failure
        costs one and nothing else does.
    """
    cost = summary.get("cost")
    if cost is None or cost == summary.get("failure_rate"):
        return ""
    low, high = summary.get("cost_low"), summary.get("cost_high")
    text = f"{telling_text(cost)} an episode"
    if low is None or high is None:
        return f"{text}, each the same"
    return f"{text} (95 % interval {telling_text(low)} to {telling_text(high)})"


def worst_tenth_text(summary: Mapping[str, float | None]) -> str:
    """What the worst tenth of the episodes brought.

    Args:
        summary: What `Episodes.summary` gave.

    Returns:
        As "a mean return of −12, a mean cost of 3"; "" where it is not known.
    """
    worst = summary.get("worst_tenth")
    if worst is None:
        return ""
    text = f"a mean return of {telling_text(worst)}"
    cost = summary.get("cost_worst_tenth")
    if cost is None or not cost_text(summary):
        return text
    return f"{text}, a mean cost of {telling_text(cost)}"


def freedom_text(freedom: float) -> str:
    """What a shield leaves the agent to choose from.

    Args:
        freedom: 0 to 1.

    Returns:
        In words.
    """
    what = share_text(freedom)
    if not freedom:
        return f"{what}: a rule decides every step, so this is a policy and no longer a shield"
    return f"{what} of the choice is left to the agent"


def safety_facts(
    summary: Mapping[str, float],
    episodes: int,
    environment: EnvironmentOrId,
    *,
    shielded: bool,
) -> list[tuple[str, str]]:
    """All that is said of safety, wherever it is said.

    Args:
        summary: What `Episodes.summary` gave.
        episodes: How many there are.
        environment: Theirs.
        shielded: Whether a shield was in force.

    Returns:
        Pairs of what and text: failures, and where they are known cost, worst tenth and freedom.
    """
    facts = [
        ("failures", failures_text(summary, episodes, environment)),
        ("cost", cost_text(summary)),
        ("worst tenth of the episodes", worst_tenth_text(summary)),
    ]
    if shielded and "freedom" in summary:
        facts.append(("freedom", freedom_text(summary["freedom"])))
    return [(what, text) for what, text in facts if text]


def safety_cells(summary: Mapping[str, float], episodes: int) -> dict[str, str]:
    """The same in a row of a table.

    Args:
        summary: What `Episodes.summary` gave, or a file keeps of it.
        episodes: How many there are.

    Returns:
        `Failures`, `Failures, 95 %`, `Cost` with its interval, and `Worst tenth`, the mean of
        their returns; "–" where it is not known, or no failure can be.
    """
    rate = rate_in(summary, episodes)
    if rate is not None and rate.unknown == rate.of:
        rate = None
    cost = summary.get("cost") if cost_text(summary) else None
    between = ""
    if "cost_low" in summary:
        between = f" ({telling_text(summary['cost_low'])} to {telling_text(summary['cost_high'])})"
    worst = summary.get("worst_tenth")
    return {
        "Failures": "–" if rate is None else at_least_text(rate.rate, rate.unknown),
        "Failures, 95 %": "–"
        if rate is None
        else f"{share_text(rate.low)} to {share_text(rate.high)}",
        "Cost": "–" if cost is None else f"{telling_text(cost)}{between}",
        "Worst tenth": "–" if worst is None else telling_text(worst),
    }
