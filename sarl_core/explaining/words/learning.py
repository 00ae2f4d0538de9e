"""A study of learning in plain words, made from its numbers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from sarl_core.decimals import rounded_text
from sarl_core.environments.failures import no_failures_text
from sarl_core.files import whole_file
from sarl_core.learning.study_files import LearningStudy
from sarl_core.learning.summary import (
    SAFE_SHARE,
    ArmSummary,
    TrialSummary,
    best,
    reference,
)
from sarl_core.mining.language import at_least_text, counted, share_text, threshold_text
from sarl_core.rollouts.choices import CHOICE_TEXTS
from sarl_core.rollouts.episodes import MAX_STEPS, cut_text
from sarl_core.rollouts.failures import interval_text

_SAME = 1.0  # returns that differ by no more are the same
_NEARLY_ALL = 0.99  # share of the steps to which a rule applies, so that the rules decide

HEADINGS = (
    "Way to learn",
    "Verdict",
    "Crashes while learning",
    "Episodes",
    "Changed",
    "Return meanwhile",
    "Return after",
    "Typical return, 95 % interval",
    "Crashed after",
    "Worst tenth after",
    "Cost after",
    "Shield on",
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


def table_rows(summaries: Sequence[ArmSummary]) -> list[tuple[str, ...]]:
    """The study as a table.

    Args:
        summaries: Of `summarise_study`.

    Returns:
        A row an arm, under `HEADINGS`.
    """
    rows: list[tuple[str, ...]] = []
    for summary in summaries:
        alone, shielded, known = summary.alone, summary.shielded, summary.failures_known
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
                rounded_text(summary.learning_return),
                _with_worst(alone.mean, alone.means),
                f"{rounded_text(alone.returns.iqm)} ({rounded_text(alone.returns.low)} to "
                f"{rounded_text(alone.returns.high)})",
                f"{_crash_share(alone)} ({interval_text(alone.failures)})" if known else "–",
                rounded_text(alone.worst_tenth),
                _cost(alone),
                "–" if shielded is None else rounded_text(shielded.mean),
            )
        )
    return rows


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
    paragraphs += [_rules(study, summaries), _cut(study, summaries), _conditions(study)]
    return [paragraph for paragraph in paragraphs if paragraph]


def save_finding(study: LearningStudy, summaries: Sequence[ArmSummary], folder: Path) -> None:
    """Write the finding and the table as ``finding.md``.

    Args:
        study: With finished runs.
        summaries: Of it.
        folder: Where it goes.
    """
    rows = [HEADINGS, ["---"] * len(HEADINGS), *table_rows(summaries)]
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    text = "\n\n".join([f"# Learning in {study.env_id}", *finding(study, summaries), table])
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
    after = rounded_text(safest.alone.halves[1])
    crashes = [_crash_share(one.alone) for one in (safest, alone)]
    chosen = "these returns are of the second"
    if study.choose == "failures":
        # What was chosen by a share cannot be reported by it.
        crashes = [
            at_least_text(one.alone.crash_halves[1], one.alone.cut) for one in (safest, alone)
        ]
        chosen = f"{CHOICE_TEXTS['failures']}; these shares and returns are of the second"
    return (
        f"Safe while learning and good afterwards: “{safest.arm.title}”. While learning it crashed "
        f"{_times(safest.mean_crashes)}, against {_times(alone.mean_crashes)} without a shield. "
        f"Afterwards, without the shield, it returns {after} and "
        f"crashes in {crashes[0]} of the episodes; the same learner "
        f"that never had a shield returns {rounded_text(alone.alone.halves[1])} and crashes in "
        f"{crashes[1]}. (It was chosen by the first half of the episodes "
        f"afterwards{': ' if study.choose == 'failures' else '; '}{chosen}.)"
    )


def _others(judged: Sequence[ArmSummary], safest: ArmSummary | None) -> list[str]:
    """The other arms by what they are."""

    def listed(safe: bool, good: bool) -> str:
        return _listed(
            [
                f"“{summary.arm.title}” ({_times(summary.mean_crashes)}; afterwards "
                f"{rounded_text(summary.alone.mean)})"
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
            f"“{summary.arm.title}” {_crashed(summary)}returns "
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
        f"{text}. Mind that {names} crashed no more often than the best shielded way to learn"
        f"{', in fewer and longer episodes' if fewer else ''}; of those of “{safest.arm.title}” "
        f"{share} crashed."
    )


def _crashed(summary: ArmSummary) -> str:
    """How often it did while learning; nothing where that is not known."""
    if not sum(summary.episodes):
        return "finished no episode while learning, and "
    if not summary.failures_known:
        return ""
    share = share_text(sum(summary.crashes) / sum(summary.episodes))
    return (
        f"crashed {_times(summary.mean_crashes)} while learning, in {share} of its episodes, and "
    )


def _rules(study: LearningStudy, summaries: Sequence[ArmSummary]) -> str:
    """How good the rules are themselves, as far as they decide everything."""
    covered = [
        summary.shielded
        for summary in summaries
        if summary.shielded is not None and summary.shielded.coverage >= _NEARLY_ALL
    ]
    # Where an interval leaves the learner room, it matters what was learned.
    if not covered or np.ptp([trials.mean for trials in covered]) > _SAME:
        return ""
    crashes = f", crashes in {_crash_share(covered[0])} of the episodes"
    if not summaries[0].failures_known:
        crashes = ""
    return (
        "These rules speak in nearly every state, so with the shield on it is they who act, "
        f"whatever was learned: return {rounded_text(covered[0].mean)}{crashes}."
    )


def _cost(trials: TrialSummary) -> str:
    cost = trials.cost
    if cost is None:
        return "–"
    between = f" ({rounded_text(cost.low, 1)} to {rounded_text(cost.high, 1)})"
    return rounded_text(cost.mean, 1) + ("" if np.isnan(cost.low) else between)


def _crash_share(trials: TrialSummary) -> str:
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
            else f"support {threshold_text(rules['support'])}, confidence "
            f"{threshold_text(rules['confidence'])}"
        )
        by = f"{counted(int(rules['count']), 'rule')} ({cut})"
    seeds = len(study.seeds)
    meant = ""
    if study.failures_known:
        meant = (
            f"Safe means at most {share_text(SAFE_SHARE)} of the crashes of the same learner "
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
    return "once" if count == 1 else f"{rounded_text(count)} times"


def _with_worst(mean: float, means: Sequence[float]) -> str:
    if len(means) < 2:
        return rounded_text(mean)
    return f"{rounded_text(mean)} ({rounded_text(min(means))} to {rounded_text(max(means))})"


def _listed(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)
