"""The part of a report that says what a shield was worth: a comparison, read from files."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from markupsafe import Markup
from msgspec import Struct

from sarl_core.documents import Count, MisfitError, Number, Share, conformed, parse_json
from sarl_core.environments.failures import cannot_fail
from sarl_core.errors import InputError, quoted
from sarl_core.explaining.report.svg import MUTED, NEUTRAL, SvgScale, dot_and_interval
from sarl_core.explaining.words.comparison import POLICY_TEXT
from sarl_core.limits import limited_bytes
from sarl_core.mining.language import at_least_text, number_text, share_text
from sarl_core.rollouts.episodes import cut_text
from sarl_core.rollouts.statistics import MeanInterval
from sarl_core.studies.comparison import Comparison, comparison_row
from sarl_core.studies.shield_effect import Effect

_MAX_BYTES = 16 * 2**20
_MOST_ROWS = 200
_HEADINGS = (
    "Failures",
    "Cost",
    "Worst tenth",
    "Against no shield",
    "Actions changed",
    "Freedom left",
    "Steps with a rule",
    "Rules",
    "Episodes",
)
_ALWAYS = ("Failures",)  # a typical return hides them
_UNKNOWN, _NOT_KNOWN, _NONE = "–", "not known", "cannot fail"
_NUMBERS = ("mean", "std", "iqm", "iqm_low", "iqm_high")
HARMS: Effect = "harms"


@dataclass(frozen=True)
class ResultFile:
    """Where results were read from.

    Attributes:
        name: Of the file.
        digest: SHA-256 of its text.
    """

    name: str
    digest: str


@dataclass(frozen=True)
class Result:
    """What the episodes of one agent, with a shield or without, came to.

    Attributes:
        name: Of agent and shield.
        env_id: Environment, "" where unknown.
        seed: Of the first episode, None where unknown.
        rules: Number of rules in force, None without a shield or where unknown.
        episodes: How many.
        mean: Of the returns.
        std: Their standard deviation.
        iqm: Mean of the middle half of the returns.
        low: Lower end of its 95 % interval.
        high: Upper end.
        changed: Share of steps at which the shield changed the action, None without one.
        covered: Share of steps at which a rule applied, None without a shield.
        crashes: Share of episodes that ended in failure, None where unknown.
        crash_ends: Its 95 % interval, None where unknown.
        cut: Episodes that were cut off before their end.
        undecided: Episodes of which it is not known whether they failed; none of `crashes`.
        cost: What an episode costs on average, with its 95 % interval; None where unknown.
        worst_tenth: Mean return of the worst tenth of the episodes, None where unknown.
        freedom: What the rules left the agent to choose from, 0 to 1, None where unknown.
        gained: Return with the shield less the return without it on the same seeds, mean and 95 %
            interval; None where both were not run.
        effect: What that and the failures mean: helps, harms, or no difference seen; "" where
            unknown.
        agent: Who acted; "" where unknown.
        failure: What a failure was, in words; "" where unknown.
        file: It was read from; None where it was measured just now.
    """

    name: str
    env_id: str
    seed: int | None
    rules: int | None
    episodes: int
    mean: float
    std: float
    iqm: float
    low: float
    high: float
    changed: float | None
    covered: float | None
    crashes: float | None
    crash_ends: tuple[float, float] | None = None
    cut: int = 0
    undecided: int = 0
    cost: MeanInterval | None = None
    worst_tenth: float | None = None
    freedom: float | None = None
    gained: MeanInterval | None = None
    effect: str = ""
    agent: str = ""
    failure: str = ""
    file: ResultFile | None = None


@dataclass(frozen=True)
class ResultRow:
    """A result as it is shown.

    Attributes:
        name: Of agent and shield.
        picture: SVG of the typical return and its interval.
        typical: In numbers.
        interval: Of the typical return.
        mean: Mean return and standard deviation.
        more: One text a heading of the comparison.
    """

    name: str
    picture: Markup
    typical: str
    interval: str
    mean: str
    more: tuple[str, ...]


@dataclass(frozen=True)
class Compared:
    """A comparison.

    Attributes:
        sentences: In which environment, on which seeds.
        headings: Of what else is known of at least one result.
        rows: One a result.
        ends: The numbers at the left and right end of the picture.
    """

    sentences: tuple[str, ...]
    headings: tuple[str, ...]
    rows: tuple[ResultRow, ...]
    ends: tuple[str, str]


def results_of(comparison: Comparison) -> tuple[Result, ...]:
    """A comparison as results.

    Args:
        comparison: A arms on the same seeds.

    Returns:
        A results.
    """
    of_all = {"environment": comparison.env_id, "seed": comparison.seed}
    return tuple(
        conformed(
            comparison_row(arm, episodes, comparison.alone(place)) | of_all, _ResultRow
        ).read()
        for place, (arm, episodes) in enumerate(
            zip(comparison.arms, comparison.episodes, strict=True)
        )
    )


def read_results(path: Path) -> tuple[Result, ...]:
    """Read a comparison: the CSV of the page Measure, or what `evaluate --json` printed.

    Args:
        path: The file.

    Returns:
        Its results.

    Raises:
        InputError: If it is neither.
    """
    try:
        text = limited_bytes(path, _MAX_BYTES).decode("utf-8-sig")
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is no text"
        raise InputError(
            f"the comparison {path} cannot be read ({reason}); give the CSV file of the page "
            "Measure, or a JSON document of `evaluate --json`"
        ) from error
    return results_from_text(text, path.name)


def results_from_text(text: str, name: str) -> tuple[Result, ...]:
    """The same from a file's content.

    Args:
        text: Of the file.
        name: Of the file; tells CSV from JSON, and names the result of a JSON document.

    Returns:
        Its results.

    Raises:
        InputError: If it is neither.
    """
    rows = _json_row(text, name) if name.lower().endswith(".json") else _csv_rows(text, name)
    if not 0 < len(rows) <= _MOST_ROWS:
        raise InputError(
            f"the comparison {name} has {len(rows)} rows; give one with 1 to {_MOST_ROWS}"
        )
    file = ResultFile(name, hashlib.sha256(text.encode("utf-8")).hexdigest())
    try:
        return tuple(
            replace(conformed(row, _ResultRow, strict=False).read(), file=file) for row in rows
        )
    except MisfitError as error:
        raise InputError(f"in the comparison {name}, {error}; download it again") from error


def compared(results: Sequence[Result]) -> Compared | None:
    """What a comparison came to.

    Args:
        results: Any number.

    Returns:
        The part of the report; None without results.
    """
    if not results:
        return None
    scale = typical_scale(results)
    more = [_more(one) for one in results]
    known = [
        place
        for place, heading in enumerate(_HEADINGS)
        if heading in _ALWAYS or any(texts[place] != _UNKNOWN for texts in more)
    ]
    environments = sorted({one.env_id for one in results if one.env_id})
    where = f" in {' and '.join(environments)}" if environments else ""
    seeds = {one.seed for one in results if one.seed is not None}
    since = f", from seed {seeds.pop()} on" if len(seeds) == 1 else ""
    return Compared(
        sentences=(
            f"Agents were run{where}{since}. The typical return is the mean of the middle half of "
            "the episodes; the line through the dot shows where it probably lies (95 % interval). "
            "It leaves out the worst quarter of the episodes, so it hides crashes: read the mean "
            "and the failures beside it.",
            *(
                f"{one.name}: {cut_text(one.cut, one.episodes, may_fail=one.crashes is not None)}."
                for one in results
                if one.cut
            ),
            *(
                f"{one.name}: these rules harm the agent."
                for one in results
                if one.effect == HARMS and one.freedom != 0.0
            ),
            *(f"{one.name}: {_policy(one)}" for one in results if one.freedom == 0.0),
        ),
        headings=tuple(_HEADINGS[place] for place in known),
        rows=tuple(
            _row(one, scale, tuple(texts[place] for place in known))
            for one, texts in zip(results, more, strict=True)
        ),
        ends=(number_text(scale.low), number_text(scale.high)),
    )


def typical_scale(results: Sequence[Result]) -> SvgScale:
    """Where typical returns and their intervals are drawn.

    Args:
        results: At least one.

    Returns:
        The scale that shows all of them.
    """
    ends = [end for one in results for end in (one.low, one.high)]
    return SvgScale.over(ends, margin=0.04)


def is_known(one: Result) -> bool:
    """Whether it is known which episodes failed, and some ran to their end."""
    return one.crashes is not None and one.undecided < one.episodes


# --- reading -----------------------------------------------------------------------------------


def _csv_rows(text: str, name: str) -> list[Mapping[str, Any]]:
    try:
        reader = csv.DictReader(io.StringIO(text), strict=True)
        rows = [dict(row) for row in reader]
        there = reader.fieldnames or []
    except csv.Error as error:
        raise InputError(
            f"the comparison {name} is no CSV ({error}); give the file that the page Measure "
            "downloads"
        ) from error
    for column in ("arm", "episodes", *_NUMBERS):
        if column not in there:
            raise InputError(
                f"the comparison {name} has no column {column!r}; give the CSV file that the page "
                "Measure downloads, or a .json document of `evaluate --json`"
            )
    return [{key: value or None for key, value in row.items() if key} for row in rows]


def _json_row(text: str, name: str) -> list[Mapping[str, Any]]:
    try:
        document = parse_json(text)
    except InputError as error:
        raise InputError(f"the comparison {name} is too large: {error}") from error
    except ValueError as error:
        raise InputError(
            f"the comparison {name} is not JSON ({error}); give what `evaluate --json` printed"
        ) from error
    summary = document.get("summary") if isinstance(document, dict) else None
    episodes = document.get("episodes") if isinstance(document, dict) else None
    if not isinstance(summary, dict) or not isinstance(episodes, list) or not episodes:
        raise InputError(
            f"the comparison {name} has no episodes with a summary; give what `evaluate --json` "
            "printed"
        )
    first = episodes[0].get("seed") if isinstance(episodes[0], dict) else None
    # Without a shield no rule ever applies, which is what is shown of it.
    alone = not summary.get("coverage")
    row = {
        "arm": name[: -len(".json")],
        "environment": document.get("environment"),
        "episodes": len(episodes),
        "seed": first,
        "failure": document.get("failure"),
        **summary,
    }
    return [row | ({"intervention_rate": None, "coverage": None} if alone else {})]


class _ResultRow(Struct):
    arm: str
    episodes: Count
    mean: Number
    std: Number
    iqm: Number
    iqm_low: Number
    iqm_high: Number
    environment: str | None = None
    seed: Count | None = None
    rules: Count | None = None
    intervention_rate: Share | None = None
    coverage: Share | None = None
    crash_rate: Share | None = None
    failure_rate: Share | None = None
    failure_low: Share | None = None
    failure_high: Share | None = None
    cut: Count | None = None
    undecided: Count | None = None
    cost: Number | None = None
    cost_low: Number | None = None
    cost_high: Number | None = None
    worst_tenth: Number | None = None
    freedom: Share | None = None
    return_difference: Number | None = None
    difference_low: Number | None = None
    difference_high: Number | None = None
    effect: Effect | None = None
    agent: str | None = None
    failure: str | None = None

    def read(self) -> Result:
        if not self.iqm_low <= self.iqm <= self.iqm_high:
            raise MisfitError(f"the interval of {quoted(self.arm)} does not hold its value")
        return Result(
            name=self.arm,
            env_id=self.environment or "",
            seed=self.seed,
            rules=self.rules,
            episodes=self.episodes,
            mean=self.mean,
            std=self.std,
            iqm=self.iqm,
            low=self.iqm_low,
            high=self.iqm_high,
            changed=self.intervention_rate,
            covered=self.coverage,
            crashes=self.failure_rate if self.crash_rate is None else self.crash_rate,
            crash_ends=_both(self.failure_low, self.failure_high),
            cut=self.cut or 0,
            undecided=(self.cut or 0) if self.undecided is None else self.undecided,
            cost=_gain(self.cost, self.cost_low, self.cost_high),
            worst_tenth=self.worst_tenth,
            freedom=None if self.coverage is None else self.freedom,
            gained=_gain(self.return_difference, self.difference_low, self.difference_high),
            effect=self.effect or "",
            agent=self.agent or "",
            failure=self.failure or "",
        )


def _both(low: float | None, high: float | None) -> tuple[float, float] | None:
    return None if low is None or high is None else (low, high)


def _gain(mean: float | None, low: float | None, high: float | None) -> MeanInterval | None:
    return None if mean is None or low is None or high is None else MeanInterval(mean, low, high)


# --- showing -----------------------------------------------------------------------------------


def _policy(one: Result) -> str:
    changed = (
        "" if one.changed is None else f" They changed {share_text(one.changed)} of the steps."
    )
    return f"{POLICY_TEXT[0].lower()}{POLICY_TEXT[1:]}.{changed}"


def _crashes(one: Result) -> str:
    """The share of failures with its interval."""
    if one.crashes is None and cannot_fail(one.env_id):
        return _NONE
    if one.crashes is None or not is_known(one):
        return _NOT_KNOWN
    share = at_least_text(one.crashes, one.undecided)
    if one.crash_ends is None:
        return share
    low, high = map(share_text, one.crash_ends)
    return f"{share} ({low} to {high})"


def _cost(one: Result) -> str:
    """The cost with its interval, where it is not the failures themselves."""
    if one.cost is None or one.cost.mean == one.crashes:
        return _UNKNOWN
    low, mean, high = map(number_text, (one.cost.low, one.cost.mean, one.cost.high))
    return f"{mean} ({low} to {high})"


def _gained(one: Result) -> str:
    """The paired difference in return, and what it means."""
    if one.gained is None:
        return _UNKNOWN
    low, mean, high = map(number_text, (one.gained.low, one.gained.mean, one.gained.high))
    return f"{mean} ({low} to {high}){f': {one.effect}' if one.effect else ''}"


def _more(one: Result) -> tuple[str, ...]:
    """A text for each of `_HEADINGS`."""

    def share_or_unknown(value: float | None) -> str:
        return _UNKNOWN if value is None else share_text(value)

    return (
        _crashes(one),
        _cost(one),
        _UNKNOWN if one.worst_tenth is None else number_text(one.worst_tenth),
        _gained(one),
        share_or_unknown(one.changed),
        share_or_unknown(one.freedom),
        share_or_unknown(one.covered),
        _UNKNOWN if one.rules is None else f"{one.rules:,}",
        f"{one.episodes:,}",
    )


def _row(one: Result, scale: SvgScale, more: tuple[str, ...]) -> ResultRow:
    colour = MUTED if one.changed is None else NEUTRAL
    return ResultRow(
        name=one.name,
        picture=dot_and_interval(scale, one.iqm, one.low, one.high, colour=colour, zero=True),
        typical=number_text(one.iqm),
        interval=f"{number_text(one.low)} to {number_text(one.high)}",
        mean=f"{number_text(one.mean)} ± {number_text(one.std)}",
        more=more,
    )
