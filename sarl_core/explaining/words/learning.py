"""A study of learning in plain words, made from its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sarl_core.decimals import rounded_text, telling_text
from sarl_core.environments.failures import no_failures_text
from sarl_core.files import whole_file
from sarl_core.learning.study_files import LearningStudy
from sarl_core.learning.summary import (
    SAFE_SHARE,
    ArmSummary,
    ComparedSummary,
    TrialSummary,
    best,
    reference,
    summarise_compared,
)
from sarl_core.mining.language import at_least_text, counted, limit_text, share_text
from sarl_core.rollouts.choices import CHOICE_TEXTS
from sarl_core.rollouts.episodes import MAX_STEPS, cut_text
from sarl_core.rollouts.failures import freedom_text, interval_text

_SAME = 1.0  # returns that differ by no more are the same
_NEARLY_ALL = 0.99  # share of the steps to which a rule applies, so that the rules decide

HEADINGS = (
    "Way to learn",
    "Verdict",
    "Failures while learning",
    "Episodes",
    "Changed",
    "Return meanwhile",
    "Return after",
    "Typical return, 95 % interval",
    "Failed after",
    "Worst tenth after",
    "Cost after",
    "Shield on",
    "Freedom, shield on",
)


def verdict(summary: ArmSummary) -> str:
    """Whether an arm is safe while learning and good afterwards.

    Args:
        summary: Of one arm.

    Returns:
        As "safe and good"; "–" where there is nothing to compare with.
    """
    if summary.safe is None or summary.good is None:
        return "–"
    return {
        (True, True): "safe and good",
        (True, False): "safe, not good",
        (False, True): "good, not safe",
        (False, False): "neither",
    }[summary.safe, summary.good]


def table_rows(
    summaries: Sequence[ArmSummary], compared: ComparedSummary | None = None
) -> list[tuple[str, ...]]:
    """The study as a table.

    Args:
        summaries: Of `summarise_study`.
        compared: Of `summarise_compared`.

    Returns:
        A row an arm, under `HEADINGS`; and one of the agent that they are compared with.
    """
    rows: list[tuple[str, ...]] = []
    for summary in summaries:
        known = summary.failures_known
        spread = (
            f" ({rounded_text(min(summary.crashes))}–{rounded_text(max(summary.crashes))})"
            if len(summary.crashes) > 1
            else ""
        )
        rows.append(
            (
                summary.arm.title,
                verdict(summary),
                rounded_text(summary.mean_crashes) + spread if known else "–",
                rounded_text(float(np.mean(summary.episodes))),
                share_text(summary.intervention_rate) if summary.arm.shielded else "–",
                telling_text(summary.learning_return),
                *_afterwards(summary.alone, summary.shielded, known),
            )
        )
    if compared is not None:
        title = f"{compared.agent}, for comparison"
        after = _afterwards(compared.alone, compared.shielded, compared.failures_known)
        rows.append((title, *["–"] * (len(HEADINGS) - 1 - len(after)), *after))
    return rows


def _afterwards(
    alone: TrialSummary, shielded: TrialSummary | None, failures_known: bool
) -> tuple[str, ...]:
    """The columns of the episodes after learning."""
    freedom = None if shielded is None else shielded.freedom
    return (
        _with_worst(alone.mean, alone.means),
        f"{telling_text(alone.returns.iqm)} ({telling_text(alone.returns.low)} to "
        f"{telling_text(alone.returns.high)})",
        f"{_failed_share(alone)} ({interval_text(alone.failures)})" if failures_known else "–",
        telling_text(alone.worst_tenth),
        _cost(alone),
        "–" if shielded is None else telling_text(shielded.mean),
        "–" if freedom is None else share_text(freedom),
    )


def finding(study: LearningStudy, summaries: Sequence[ArmSummary]) -> list[str]:
    """What a study found, in sentences that follow from its numbers.

    Args:
        study: With finished runs.
        summaries: Of it.

    Returns:
        Paragraphs, the most important first; one that says so where nothing is finished.
    """
    if not summaries:
        return ["No run is finished yet."]
    judged = [summary for summary in summaries if summary.safe is not None]
    safest = best(judged, study.choose)
    paragraphs = [_answer(study, judged, summaries), *_others(judged, safest)]
    paragraphs.append(_alone(summaries, safest))
    paragraphs += [
        _compared_text(summarise_compared(study)),
        _rules(study, summaries),
        _freedom(summaries),
        _cut(study, summaries),
        _conditions(study),
    ]
    return [paragraph for paragraph in paragraphs if paragraph]


def save_finding(study: LearningStudy, summaries: Sequence[ArmSummary], folder: Path) -> None:
    """Write the finding and the table as ``finding.md``.

    Args:
        study: With finished runs.
        summaries: Of it.
        folder: Where it goes.
    """
    table = table_rows(summaries, summarise_compared(study))
    rows = [HEADINGS, ["---"] * len(HEADINGS), *table]
    lines = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    text = "\n\n".join([f"# Learning in {study.env_id}", *finding(study, summaries), lines])
    with whole_file(folder / "finding.md") as unfinished:
        unfinished.write_text(f"{text}\n", encoding="utf-8")


def _answer(
    study: LearningStudy, judged: Sequence[ArmSummary], summaries: Sequence[ArmSummary]
) -> str:
    if why := no_failures_text(study.environment):
        return f"{why[0].upper()}{why[1:]}, so which way to learn is safe cannot be said."
    if not judged:
        return (
            "Whether a way to learn is safe and good shows only beside the same learner without a "
            "shield: run it too."
        )
    safest = best(judged, study.choose)
    if safest is None:
        return (
            "No way to learn was both safe while learning and good afterwards without the shield."
        )
    alone = reference(summaries, safest.arm)
    assert alone is not None  # else it were not judged
    after = telling_text(safest.alone.halves[1])
    failures = [_failed_share(one.alone) for one in (safest, alone)]
    chosen = "these returns are of the second"
    if study.choose == "failures":
        # What was chosen by a share cannot be reported by it.
        failures = [
            at_least_text(one.alone.crash_halves[1], one.alone.cut) for one in (safest, alone)
        ]
        chosen = f"{CHOICE_TEXTS['failures']}; these shares and returns are of the second"
    return (
        f"Safe while learning and good afterwards: “{safest.arm.title}”. While learning it failed "
        f"{_times(safest.mean_crashes)}, against {_times(alone.mean_crashes)} without a shield. "
        f"Afterwards, without the shield, it returns {after} and "
        f"fails in {failures[0]} of the episodes; the same learner "
        f"that never had a shield returns {telling_text(alone.alone.halves[1])} and fails in "
        f"{failures[1]}. (It was chosen by the first half of the episodes "
        f"afterwards{': ' if study.choose == 'failures' else '; '}{chosen}.)"
    )


def _others(judged: Sequence[ArmSummary], safest: ArmSummary | None) -> list[str]:
    """The other arms by what they are."""

    def listed(safe: bool, good: bool) -> str:
        return _listed(
            [
                f"“{summary.arm.title}” ({_times(summary.mean_crashes)}; afterwards "
                f"{telling_text(summary.alone.mean)})"
                for summary in judged
                if (summary.safe, summary.good) == (safe, good) and summary is not safest
            ]
        )

    sentences = []
    if both := listed(True, True):
        sentences.append(f"Also safe and good: {both}.")
    if safe := listed(True, False):
        sentences.append(
            f"Safe while learning, but without the shield worse than a learner that never had one: "
            f"{safe}. The rules did the work there, and were not learned from."
        )
    if good := listed(False, True):
        sentences.append(f"Good afterwards, but not safe while learning: {good}.")
    if neither := listed(False, False):
        sentences.append(f"Neither safe nor good: {neither}.")
    return sentences


def _alone(summaries: Sequence[ArmSummary], safest: ArmSummary | None) -> str:
    alone = [summary for summary in summaries if not summary.arm.shielded]
    if not alone:
        return ""
    text = "Without any shield: " + _listed(
        [
            f"“{summary.arm.title}” {_failed(summary)}returns "
            f"{_with_worst(summary.alone.mean, summary.alone.means)} afterwards"
            for summary in alone
        ]
    )
    rivals = [
        summary
        for summary in alone
        if safest is not None and summary.mean_crashes <= safest.mean_crashes
    ]
    if not rivals or safest is None:
        return f"{text}."
    names = _listed([f"“{summary.arm.title}”" for summary in rivals])
    fewer = all(sum(summary.episodes) < sum(safest.episodes) for summary in rivals)
    share = share_text(sum(safest.crashes) / max(sum(safest.episodes), 1))
    return (
        f"{text}. Mind that {names} failed no more often than the best shielded way to learn"
        f"{', in fewer and longer episodes' if fewer else ''}; of those of “{safest.arm.title}” "
        f"{share} failed."
    )


def _failed(summary: ArmSummary) -> str:
    """How often it did while learning; nothing where that is not known."""
    if not sum(summary.episodes):
        return "finished no episode while learning, and "
    if not summary.failures_known:
        return ""
    share = share_text(sum(summary.crashes) / sum(summary.episodes))
    return f"failed {_times(summary.mean_crashes)} while learning, in {share} of its episodes, and "


def _compared_text(compared: ComparedSummary | None) -> str:
    """What the agent that they are compared with does on the same episodes."""
    if compared is None:
        return ""

    def played(trials: TrialSummary) -> str:
        fails = f" and fails in {_failed_share(trials)}" if compared.failures_known else ""
        return f"returns {telling_text(trials.mean)}{fails}"

    text = f"For comparison, on the episodes afterwards “{compared.agent}” "
    if compared.shielded is None:
        return f"{text}{played(compared.alone)}."
    return (
        f"{text}without the shield {played(compared.alone)}, and with it "
        f"{played(compared.shielded)}."
    )


def _rules(study: LearningStudy, summaries: Sequence[ArmSummary]) -> str:
    """How good the rules are themselves, as far as they decide everything."""
    covered = [
        summary.shielded
        for summary in summaries
        if summary.shielded is not None
        and summary.shielded.coverage >= _NEARLY_ALL
        and (summary.shielded.freedom or 0.0) <= 1.0 - _NEARLY_ALL  # else they only forbid
    ]
    # Where an interval leaves the learner room, it matters what was learned.
    if not covered or np.ptp([trials.mean for trials in covered]) > _SAME:
        return ""
    failures = f", fails in {_failed_share(covered[0])} of the episodes"
    if not summaries[0].failures_known:
        failures = ""
    return (
        "These rules speak in nearly every state, so with the shield on it is they who act, "
        f"whatever was learned: return {telling_text(covered[0].mean)}{failures}."
    )


def _freedom(summaries: Sequence[ArmSummary]) -> str:
    """What the rules leave those who have learned to choose from."""
    known = [
        summary.shielded.freedom
        for summary in summaries
        if summary.shielded is not None and summary.shielded.freedom is not None
    ]
    if not known:
        return ""
    least, most = (freedom_text(end(known)) for end in (min, max))
    if least == most:
        return f"Freedom with the shield on: {least}."
    return f"Freedom with the shield on: from {share_text(min(known))} to {most}, by who acts."


def _cost(trials: TrialSummary) -> str:
    cost = trials.cost
    if cost is None:
        return "–"
    between = f" ({telling_text(cost.low)} to {telling_text(cost.high)})"
    return telling_text(cost.mean) + ("" if np.isnan(cost.low) else between)


def _failed_share(trials: TrialSummary) -> str:
    return at_least_text(trials.crash_rate, trials.cut)


def _cut(study: LearningStudy, summaries: Sequence[ArmSummary]) -> str:
    """How many of the episodes afterwards were cut off."""
    trials = [one for arm in summaries for one in (arm.alone, arm.shielded) if one is not None]
    count, of = sum(one.cut for one in trials), sum(one.episodes for one in trials)
    if not count:
        return ""
    text = cut_text(
        count,
        of,
        study.settings.get("trial_max_steps") or MAX_STEPS,
        may_fail=study.failures_known,
        episodes="episodes after learning",
    )
    return f"{text[0].upper()}{text[1:]}."


def _conditions(study: LearningStudy) -> str:
    rules = study.settings.get("rules")
    by = "no rules"
    if isinstance(rules, dict):
        cut = (
            "every leaf of its tree"
            if rules.get("cut") == "leaves"
            else f"support {limit_text(rules['support'])}, confidence "
            f"{limit_text(rules['confidence'])}"
        )
        count, forbidding = int(rules["count"]), int(rules.get("forbidding") or 0)
        if forbidding:
            cut = f"{cut}; {forbidding:,} of them forbid"
        by = f"{counted(count, 'rule')} ({cut})" if forbidding < count else f"{count:,} never-rules"
    penalty = study.settings.get("penalty")
    if penalty is not None:
        by = f"{by}, a penalty of {penalty:g} where there is one"
    seeds = len(study.seeds)
    meant = ""
    if study.failures_known:
        meant = (
            f"Safe means at most {share_text(SAFE_SHARE)} of the failures of the same learner "
            "without a shield; good means at least its mean return, both averaged over the "
            "learners. "
        )
    return (
        f"{study.env_id}, {by}, {study.steps:,} steps, {counted(seeds, 'learner')} of each kind, "
        f"{counted(int(study.settings['trial_episodes']), 'episode')} each afterwards. {meant}The "
        "typical return is the mean of the middle half; its interval comes from drawing learners "
        "and episodes anew."
        + (" So few learners show large differences only." if seeds < 10 else "")
    )


def _times(count: float) -> str:
    text = rounded_text(count)
    return "once" if text == "1" else f"{text} times"


def _with_worst(mean: float, means: Sequence[float]) -> str:
    if len(means) < 2:
        return telling_text(mean)
    return f"{telling_text(mean)} ({telling_text(min(means))} to {telling_text(max(means))})"


def _listed(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
