"""What an audit says, in sentences."""

from __future__ import annotations

from sarl_core.auditing.clock import GAP
from sarl_core.auditing.comparison import LogComparison
from sarl_core.auditing.counts import Stretch
from sarl_core.auditing.drift import Drift, Moved
from sarl_core.auditing.near import NEAR
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.mining.evidence import FEWEST_EPISODES
from sarl_core.mining.language import counted, share_text

_LISTED = 5
_UNITS = ((3600.0, "h"), (60.0, "min"), (1.0, "s"))


def audit_facts(audit: AuditNumbers) -> list[tuple[str, str]]:
    """The numbers of an audit, with what each counts.

    Args:
        audit: Rules against a log.

    Returns:
        Names and values, in the order in which they are read.
    """
    steps, held = audit.steps, audit.agreement_by_episode
    interval = held.interval
    between = (
        f"; by episodes {share_text(held.share or 0.0)} "
        f"(95 % interval {share_text(interval.low)} to {share_text(interval.high)})"
        if interval is not None
        else "; too few episodes for an interval"
    )
    every = "" if audit.looked_at == 1 else f", of every {audit.looked_at}th step"
    facts = [
        ("steps", f"{steps:,} in {counted(audit.n_episodes, 'episode')}"),
        ("coverage", f"{share_text(audit.coverage)}: {counted(audit.covered, 'step')} with a rule"),
        (
            "agreement",
            f"{share_text(audit.agreement)} of those{between}"
            if audit.covered
            else "no step has a rule",
        ),
        (
            "breaks",
            f"{counted(audit.broken, 'step')}, {audit.breaks_per_thousand:.1f} in a thousand; a "
            f"shield would have changed these actions{_save_where(audit)}",
        ),
        ("breaks a minute", _pace_text(audit)),
        ("longest run", counted(audit.longest_run, "step") + _lasting(audit)),
        ("outside", f"{counted(audit.outside_count, 'break')} where the rule has no data"),
        (
            "near misses",
            f"{counted(audit.near_count, 'step')} ({share_text(audit.near_share)}{every}): one "
            f"feature at most {NEAR:g} of its spread away from breaking a rule",
        ),
        ("freedom", f"{share_text(audit.freedom)} under a shield with these rules"),
    ]
    if audit.gaps:
        facts.append(
            (
                "gaps",
                f"{counted(audit.gaps, 'jump')} in the numbers of the steps, which leave out "
                f"{counted(audit.missing_steps, 'step')}",
            )
        )
    time = audit.time
    if time is not None and time.gaps:
        facts.append(
            (
                "gaps in time",
                f"{counted(time.gaps, 'jump')} of more than {GAP} steps, or back, within "
                f"episodes; the longest of {duration_text(time.longest_gap)}",
            )
        )
    return facts


def _save_where(audit: AuditNumbers) -> str:
    """Where a shield does not change what breaks a rule."""
    return ", unless all others were forbidden too" if audit.rule_set.forbids else ""


def duration_text(seconds: float) -> str:
    """A time in the unit that it is read in.

    Args:
        seconds: At least 0.

    Returns:
        As "0.02 s", "3.5 min" or "12 h".
    """
    size, unit = next((one for one in _UNITS if seconds >= one[0]), _UNITS[-1])
    return f"{seconds / size:.3g} {unit}"


def _pace_text(audit: AuditNumbers) -> str:
    time, minute = audit.time, audit.worst_minute
    if time is None:
        return (
            "not known, as the log has no times: say which column holds them (--column t=time), or "
            "call it time"
        )
    worst = (
        ""
        if minute is None
        else f"; {minute.breaks:,} in the worst one, from step {minute.step} of episode "
        f"{minute.episode}"
    )
    return (
        f"{audit.breaks_per_minute:.3g} in {duration_text(60 * time.minutes)} with a step every "
        f"{duration_text(time.step)}{worst}"
    )


def _lasting(audit: AuditNumbers) -> str:
    """How long the longest run lasts, where that is known."""
    seconds = audit.worst[0].seconds if audit.worst else None
    return "" if seconds is None else f" ({duration_text(seconds)})"


def stretch_text(audit: AuditNumbers, stretch: Stretch) -> str:
    """A stretch of breaks in a sentence.

    Args:
        audit: Where it is.
        stretch: One of its worst.

    Returns:
        As "episode 3, from step 17: 12 steps (24 s) that break R4".
    """
    rules = " and ".join(audit.rule_set.name_of(audit.rule_set[at]) for at in stretch.rules)
    lasting = "" if stretch.seconds is None else f" ({duration_text(stretch.seconds)})"
    breaks = "breaks" if stretch.length == 1 else "break"
    return (
        f"episode {stretch.episode}, from step {stretch.step}: "
        f"{counted(stretch.length, 'step')}{lasting} that {breaks} {rules}"
    )


def drift_text(drift: Drift) -> str:
    """Whether a log still looks like the demonstrations, in a sentence or two.

    Args:
        drift: What moved.

    Returns:
        With the number of comparisons that it rests on.
    """
    if not drift.is_known:
        return (
            f"Whether the log looks like the demonstrations cannot be said of so few episodes "
            f"({drift.episodes[0]} in the log, {drift.episodes[1]} in the demonstrations; it takes "
            f"{FEWEST_EPISODES} of each)."
        )
    if not drift.all:
        return (
            "Whether the log looks like the demonstrations cannot be said: nothing that these "
            "rules say of them can be compared with a log. Compare it with the demonstrations "
            "themselves (--demonstrations)."
        )
    compared = counted(len(drift.all), "share")
    sure = (
        f"{compared} compared with {drift.against}, over episodes, with intervals that hold "
        "together with 95 % certainty"
    )
    moved = drift.drifted
    if not moved:
        return f"Nothing shows that the log looks different from the demonstrations ({sure})."
    which = "; ".join(moved_text(one) for one in moved[:_LISTED])
    more = f"; and {len(moved) - _LISTED} more" if len(moved) > _LISTED else ""
    return f"The log no longer looks like the demonstrations: {which}{more} ({sure})."


def moved_text(moved: Moved) -> str:
    """One share, before and now.

    Args:
        moved: Of a drift or a comparison.

    Returns:
        As "R3, steps in which it applies: 12 % now, 4 % before".
    """
    return (
        f"{moved.name}, {moved.what}: {share_text(moved.now)} now, "
        f"{share_text(moved.before)} before"
    )


def interval_text(moved: Moved) -> str:
    """The interval of a difference, in points of per cent.

    Args:
        moved: Of a drift or a comparison.

    Returns:
        As "+2.1 to +9.8", or that there are too few episodes.
    """
    if moved.low is None or moved.high is None:
        return "too few episodes"
    return f"{100 * moved.low:+.1f} to {100 * moved.high:+.1f}"


def comparison_text(comparison: LogComparison) -> str:
    """What differs between two logs, in a sentence.

    Args:
        comparison: Of the two.

    Returns:
        With the number of comparisons that it rests on.
    """
    if not comparison.is_known:
        return (
            "Whether the two logs differ cannot be said of so few episodes: it takes "
            f"{FEWEST_EPISODES} in each."
        )
    compared = comparison.differences
    differing = sorted(
        (one for one in compared if one.drifted), key=lambda one: -abs(one.now - one.before)
    )
    sure = (
        f"{counted(len(compared), 'share')} compared, over episodes, with intervals that hold "
        "together with 95 % certainty"
    )
    if not differing:
        return f"Nothing shows that the two logs differ ({sure})."
    which = "; ".join(moved_text(one) for one in differing[:_LISTED])
    more = f"; and {len(differing) - _LISTED} more" if len(differing) > _LISTED else ""
    return f"The logs differ: {which}{more} ({sure})."
