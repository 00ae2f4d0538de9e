"""The part of a report that says what was demonstrated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from sarl_core.decimals import decimal_on_scale, decimal_text
from sarl_core.demonstrations.dataset import Demonstrations, observed_features
from sarl_core.demonstrations.derived import Combination, formula_texts
from sarl_core.demonstrations.samples import sample_text
from sarl_core.explaining.colours import label_colour
from sarl_core.explaining.figures.distributions import FeatureRow, episode_series, feature_rows
from sarl_core.explaining.report.svg import MUTED, NEUTRAL, columns, share_bar
from sarl_core.explaining.report.tally import Tally
from sarl_core.explaining.words.states import state_columns, word_shares
from sarl_core.mining.action_words import label_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import counted, number_text, share_text
from sarl_core.mining.rule_set import RuleSet

_FEW_LABELS = 9  # as rows with their names; more are columns side by side


@dataclass(frozen=True)
class ActionRow:
    """How often an action was taken.

    Attributes:
        name: As "fire main engine".
        colour: As everywhere.
        share: As "21 %".
        bar: SVG.
        part: The share, 0 to 1.
    """

    name: str
    colour: str
    share: str
    bar: Markup
    part: float


@dataclass(frozen=True)
class ActionShares:
    """How often the actions of one dimension were taken: rows, or columns where there are many.

    Attributes:
        name: Of the dimension.
        rows: One an action; () where there are many.
        picture: SVG of many; None where there are rows.
        ends: Under the picture's left and right end.
    """

    name: str
    rows: tuple[ActionRow, ...] = ()
    picture: Markup | None = None
    ends: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class FeatureSummary:
    """One number that the expert saw.

    Attributes:
        name: With its unit.
        low: Least value.
        median: Half of the values lie below it.
        high: Largest value.
    """

    name: str
    low: str
    median: str
    high: str


@dataclass(frozen=True)
class DemonstrationsPart:
    """What was demonstrated.

    Attributes:
        sentences: In words.
        actions: One entry an action dimension.
        returns: SVG of the return of every episode; "" without rewards.
        returns_text: What is at its edges, in words.
        features: What the expert saw.
        formulas: What a person derived of it, as it was written.
        notes: On how the data was read.
    """

    sentences: tuple[str, ...]
    actions: tuple[ActionShares, ...]
    returns: Markup
    returns_text: str
    features: tuple[FeatureSummary, ...]
    formulas: tuple[str, ...]
    notes: tuple[str, ...]


def demonstrations_part(
    rule_set: RuleSet, demonstrations: Demonstrations, tally: Tally
) -> DemonstrationsPart:
    """What was demonstrated.

    Args:
        rule_set: Knows the labels.
        demonstrations: N pairs.
        tally: Of the rules on them.

    Returns:
        The part of the report.
    """
    picture, text = _returns(demonstrations)
    return DemonstrationsPart(
        sentences=_sentences(demonstrations),
        actions=tuple(
            action_shares(np.bincount(tally.labels[:, index], minlength=one.n_labels), one)
            for index, one in enumerate(rule_set.actions)
        ),
        returns=picture,
        returns_text=text,
        features=tuple(
            FeatureSummary(
                f"{row.name} ({row.unit})" if row.unit else row.name,
                *(within(value, row) for value in (row.low, row.median, row.high)),
            )
            for row, feature in zip(
                feature_rows(demonstrations), demonstrations.features, strict=True
            )
            if feature.indicator is None and not isinstance(feature.derived, Combination)
        ),
        formulas=formula_texts(demonstrations.derived),
        notes=demonstrations.notes,
    )


def within(value: float, row: FeatureRow) -> str:
    """A value of a feature for people.

    Args:
        value: Any.
        row: The feature in numbers.

    Returns:
        Three digits, more where the range is narrow for those; "0" for what is nothing beside it;
        words for what is infinite, as a formula may be.
    """
    if math.isinf(value):
        return decimal_text(value)
    width = row.high - row.low
    if math.isfinite(width) and abs(value) <= 1e-4 * width:
        return "0"
    return decimal_text(decimal_on_scale(value, row.low, row.high))


def action_shares(counts: np.ndarray, dimension: LabelledDimension) -> ActionShares:
    """How often which action of a dimension was taken.

    Args:
        counts: One a label, (labels,).
        dimension: The labels.

    Returns:
        Rows, or columns where there are many.
    """
    shares = (counts / max(int(counts.sum()), 1)).tolist()
    names = [label_text(label, dimension) for label in range(dimension.n_labels)]
    if dimension.n_labels <= _FEW_LABELS:
        return ActionShares(
            dimension.name,
            rows=tuple(
                ActionRow(
                    name, label_colour(label), share_text(share), share_bar(share, colour), share
                )
                for label, (name, share) in enumerate(zip(names, shares, strict=True))
                for colour in [label_colour(label)]
            ),
        )
    often = int(np.argmax(counts))
    picture = columns(
        shares,
        f"How often each action of {dimension.name} was taken; most often {names[often]}, in "
        f"{share_text(shares[often])} of the states",
        [label_colour(label) for label in range(dimension.n_labels)],
        zero=0.0,
        top=max(shares),
    )
    return ActionShares(dimension.name, picture=picture, ends=(names[0], names[-1]))


def _sentences(demonstrations: Demonstrations) -> tuple[str, ...]:
    who = f"The agent “{demonstrations.agent}”" if demonstrations.agent else "An expert"
    where = f" in {demonstrations.env_id}" if demonstrations.env_id else ""
    observed = observed_features(demonstrations.features)
    width, shares = len(state_columns(observed)), word_shares(demonstrations)
    seen = [
        counted(count, noun)
        for count, noun in ((width - len(shares), "number"), (len(shares), "word"))
        if count
    ]
    whole = demonstrations.whole
    sentences = [
        f"{who} acted{where} for {counted(whole.steps, 'step')} in "
        f"{counted(whole.episodes, 'episode')}. At every step it saw the state of the "
        f"task, {' and '.join(seen)} listed below, and chose an action. An episode is one attempt "
        "from start to end.",
    ]
    if demonstrations.sample_of is not None:
        sentences.append(
            "The rules were mined from all of these steps on a cluster, and this report was made "
            f"with {sample_text(demonstrations)}: what a rule says of support and confidence "
            "counts all of them, and every other number or picture of states the sample."
        )
    for title, words in shares.items():
        parts = [f"{word} in {share_text(share)}" for word, share in words.items()]
        parts[0] += " of the steps"
        sentences.append(f"The {title} was {', '.join(parts)}.")
    if demonstrations.sample_of is not None:
        return tuple(sentences)  # of a sample no episode is whole
    summary, finished = demonstrations.summary(), demonstrations.episode_finished
    if summary.return_mean is not None:
        ended = "a finished episode" if finished is not None and finished.any() else "an episode"
        spread = (
            ""
            if summary.return_std is None
            else f" (give or take {number_text(summary.return_std)}, one standard deviation)"
        )
        sentences.append(
            f"The task gives points at every step; their sum is the return. On average {ended} "
            f"returned {number_text(summary.return_mean)}{spread}, after "
            f"{counted(round(summary.length_mean), 'step')}."
        )
    if finished is not None and not finished.all():
        count = int((~finished).sum())
        cut = "1 episode was" if count == 1 else f"{count:,} episodes were"
        sentences.append(f"{cut} cut short by the end of the recording.")
    return tuple(sentences)


def _returns(demonstrations: Demonstrations) -> tuple[Markup, str]:
    returns = demonstrations.episode_returns
    if returns is None or demonstrations.sample_of is not None:
        return Markup(), ""
    series = episode_series(returns, demonstrations.episode_finished, most=120)
    least, most = float(returns.min()), float(returns.max())
    zero = 0.0
    label = (
        f"Return of {counted(len(returns), 'episode')}: from {number_text(least)} to "
        f"{number_text(most)}"
    )
    picture = columns(
        series.mean.tolist(),
        label,
        [MUTED if unfinished else NEUTRAL for unfinished in series.unfinished.tolist()],
        zero=zero,
        top=max(most, 0.0),
    )
    grouped = "; each column is the mean of several" if series.is_grouped else ""
    cut = "; grey: cut short" if series.unfinished.any() else ""
    return picture, f"{label}, in their order{grouped}{cut}."
