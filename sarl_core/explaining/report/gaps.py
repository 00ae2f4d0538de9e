"""The part of a report that says what the rules do not reach, and which of them are doubtful."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import extend
from sarl_core.explaining.report.demonstrations import ActionShares, action_shares
from sarl_core.explaining.report.rule_cards import least_share
from sarl_core.explaining.report.svg import NEUTRAL, share_bar
from sarl_core.explaining.report.tally import Tally
from sarl_core.mining.evidence import FEWEST_EPISODES
from sarl_core.mining.language import counted, listed, share_text
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.validation.contradictions import NEAR, find_contradictions
from sarl_core.mining.validation.holding_out import verdict
from sarl_core.rendering.example_frames import Examples, PlayedEpisodes

FEW_STATES = 30
_MOST_NAMED = 24
_MOST_UNUSED = 6
_MOST_COMPARED = 50_000  # steps; to compare more states with each other takes minutes


@dataclass(frozen=True)
class Coverage:
    """How far the rules of one action dimension reach.

    Attributes:
        name: Of the dimension; "" where there is only one.
        text: As "14,012 of 15,000 demonstrated states (93 %)".
        bar: SVG.
        uncovered: What the expert did in the other states; None where there are none.
    """

    name: str
    text: str
    bar: Markup
    uncovered: ActionShares | None


@dataclass(frozen=True)
class Doubt:
    """Rules that deserve a second look, and why.

    Attributes:
        text: Why, and how many they are.
        names: Of the rules, as far as they are named.
        more: How many are not named.
    """

    text: str
    names: tuple[str, ...]
    more: int


@dataclass(frozen=True)
class Beyond:
    """What was met when somebody played the episodes of the pictures.

    Attributes:
        player: Who.
        steps: How many steps.
        covered: Share at which some rule applied.
        outside: Share at which some number lay beyond all demonstrated ones.
        outside_share: The same as a number; NaN where it is not known.
        far: Share at which a rule applied beyond its own states; "" where that is not known.
    """

    player: str
    steps: str
    covered: str
    outside: str
    outside_share: float
    far: str


@dataclass(frozen=True)
class UncoveredSummary:
    """What the rules do not reach.

    Attributes:
        coverage: One entry an action dimension.
        contradictions: How often demonstrations disagree, in words; "" where that was not asked.
        doubts: Rules that deserve a second look.
        beyond: One entry a player; () without pictures.
        with_boxes: Whether `Beyond.far` is known.
        unused: Features that no rule asks about, in words; "" where there are none.
    """

    coverage: tuple[Coverage, ...]
    contradictions: str
    doubts: tuple[Doubt, ...]
    beyond: tuple[Beyond, ...]
    with_boxes: bool
    unused: str = ""


def gaps(
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    tally: Tally,
    examples: Examples | None,
) -> UncoveredSummary:
    """What the rules do not reach, and which of them are doubtful.

    Args:
        rule_set: The rules.
        demonstrations: Of the report.
        tally: The rules on them.
        examples: With the episodes that were played; None without pictures.

    Returns:
        The part of the report.
    """
    boxed = any(rule.box is not None for rule in rule_set.rules)
    return UncoveredSummary(
        coverage=tuple(
            _coverage(rule_set, tally, dimension) for dimension in range(len(rule_set.actions))
        ),
        contradictions=_contradictions(demonstrations, rule_set),
        doubts=_doubts(rule_set, demonstrations, tally),
        beyond=tuple(
            _beyond(one, rule_set, demonstrations, boxed=boxed)
            for one in (examples.played if examples is not None else ())
        ),
        with_boxes=boxed,
        unused=_unused(rule_set),
    )


def _unused(rule_set: RuleSet) -> str:
    """Features of the demonstrations that no rule asks about, whether by itself or in a formula.

    "" where no rule is in force.
    """
    if not any(rule.enabled for rule in rule_set.rules):
        return ""
    features = rule_set.source.features
    used: set[int] = set()
    for rule in rule_set.rules:
        for bounds in rule.bounds if rule.enabled else ():
            derived = features[bounds.feature].derived
            used |= {bounds.feature} if derived is None else set(derived.features)
    columns = dict.fromkeys(
        one.name if one.indicator is None else one.indicator.column
        for place, one in enumerate(features)
        if one.derived is None and place not in used
    )
    looked_at = {one.column for place in used if (one := features[place].indicator) is not None}
    names = [f"“{name}”" for name in columns if name not in looked_at]
    return listed(names, most=_MOST_UNUSED)


def _coverage(rule_set: RuleSet, tally: Tally, dimension: int) -> Coverage:
    share = tally.covered(dimension)
    action = rule_set.actions[dimension]
    noun = "sampled state" if tally.sampled else "demonstrated state"
    left = tally.labels[tally.rules[:, dimension] < 0, dimension]
    return Coverage(
        name=action.name if len(rule_set.actions) > 1 else "",
        text=f"{share.part:,} of {counted(share.whole, noun)} ({share_text(share.value)})",
        bar=share_bar(share.value, NEUTRAL),
        uncovered=action_shares(np.bincount(left, minlength=action.n_labels), action)
        if len(left)
        else None,
    )


def _contradictions(demonstrations: Demonstrations, rule_set: RuleSet) -> str:
    if demonstrations.sample_of is not None:
        return ""
    if len(demonstrations) > _MOST_COMPARED or demonstrations.n_episodes < 2:
        return ""
    contradictions = find_contradictions(demonstrations, divider=rule_set.divider)
    count = int(contradictions.contradicting().sum())
    if not count:
        return (
            "None was found: wherever it came to the same state again, or nearly the same in "
            "another episode, it did the same."
        )
    share = share_text(count / len(demonstrations))
    # A rule that forbids a third action is right in both.
    one_right = "" if rule_set.forbids else "A rule can be right in only one of them. "
    return (
        f"In {count:,} of {counted(len(demonstrations), 'state')} ({share}) it did something else "
        "in the same state, or in the nearest one of another episode, no feature of which differs "
        f"by more than {NEAR:g} of its standard deviation. "
        f"{one_right}Where the expert changes its mind within a short way, this need be no mistake."
    )


def _doubts(rule_set: RuleSet, demonstrations: Demonstrations, tally: Tally) -> tuple[Doubt, ...]:
    rules = [
        (index, rule) for index, rule in enumerate(rule_set.rules) if rule.enabled and rule.samples
    ]
    doubts = []

    def doubt(chosen: Sequence[int], one: str, many: str) -> None:
        if chosen:
            named = [rule_set.name_of(rule_set.rules[index]) for index in sorted(chosen)]
            text = f"1 rule {one}" if len(chosen) == 1 else f"{len(chosen):,} rules {many}"
            doubts.append(Doubt(text, tuple(named[:_MOST_NAMED]), max(len(named) - _MOST_NAMED, 0)))

    few = [index for index, rule in rules if rule.origin != "manual" and rule.samples < FEW_STATES]
    doubt(
        few,
        f"rests on fewer than {FEW_STATES} states: it may be chance.",
        f"rest on fewer than {FEW_STATES} states each: they may be chance.",
    )
    if tally.same and not tally.sampled:
        apart = [
            index
            for index, rule in rules
            if rule.origin == "mined"
            and 0 < tally.by_episode[index].episodes < FEWEST_EPISODES <= demonstrations.n_episodes
        ]
        lie = f"fewer than {FEWEST_EPISODES} of the {demonstrations.n_episodes:,} episodes"
        doubt(
            apart,
            f"has its states in {lie}: it may know those and no other.",
            f"have their states in {lie}: they may know those and no others.",
        )
    if rule_set.cut == "thresholds":
        for kind in ("do", "never"):
            own = [(index, rule) for index, rule in rules if rule.kind == kind]
            needed = least_share(own[0][1], rule_set) if own else None
            if needed is None:
                continue
            below = [index for index, rule in own if verdict(rule, needed) == "below"]
            aside = "in the episodes kept aside, each counted once"
            doubt(
                below,
                f"does not reach {share_text(needed)} {aside}{_reached(rule_set, below)}.",
                f"do not reach {share_text(needed)} {aside}.",
            )
        untried = [index for index, rule in rules if (one := rule.held_out) and not one.samples]
        doubt(
            untried,
            "came up in no episode kept aside: it was never tried.",
            "came up in no episode kept aside: they were never tried.",
        )
        scarce = [
            index
            for index, rule in rules
            if (one := rule.held_out) and one.samples and 0 < one.episodes < FEWEST_EPISODES
        ]
        doubt(
            scarce,
            f"came up in fewer than {FEWEST_EPISODES} episodes kept aside: too few to tell.",
            f"came up in fewer than {FEWEST_EPISODES} episodes kept aside: too few to tell.",
        )
    else:
        minority = [index for index, rule in rules if 2 * rule.correct < rule.samples]
        doubt(
            minority,
            "says what the expert did in less than half of its states.",
            "say what the expert did in less than half of their states.",
        )
    off = [index for index, rule in enumerate(rule_set.rules) if not rule.enabled]
    doubt(off, "is switched off and does nothing.", "are switched off and do nothing.")
    return tuple(doubts)


def _reached(rule_set: RuleSet, below: Sequence[int]) -> str:
    """What the only rule reaches that was to reach more."""
    held_out = rule_set.rules[below[0]].held_out if len(below) == 1 else None
    if held_out is None or held_out.share is None:
        return ""
    return f", but {share_text(held_out.share)}"


def _beyond(
    played: PlayedEpisodes, rule_set: RuleSet, demonstrations: Demonstrations, *, boxed: bool
) -> Beyond:
    states = extend(played.steps.observation, demonstrations.features)
    rules = played.steps.rules
    low, high = demonstrations.observations.min(axis=0), demonstrations.observations.max(axis=0)
    outside = ((states < low) | (states > high)).any(axis=1)
    covered = (rules >= 0).any(axis=1)
    known, share = demonstrations.sample_of is None, float(outside.mean())
    return Beyond(
        player=played.player.name,
        steps=f"{len(states):,}",
        covered=share_text(float(covered.mean())),
        outside=share_text(share) if known else "not known",
        outside_share=share if known else float("nan"),
        far=share_text(float(_far(states, rules, rule_set).mean())) if boxed else "",
    )


def _far(
    states: NDArray[np.float32], rules: NDArray[np.int64], rule_set: RuleSet
) -> NDArray[np.bool_]:
    """Whether a rule in force lies beyond the states it was made from, (T,)."""
    beyond = np.zeros(len(states), dtype=np.bool_)
    for index in np.unique(rules[rules >= 0]).tolist():
        rule = rule_set.rules[index]
        if rule.box is not None:
            rows = np.flatnonzero(rules[:, rule.dimension] == index)
            inside = (states[rows] >= np.float32(rule.box.least)) & (
                states[rows] <= np.float32(rule.box.most)
            )
            beyond[rows] |= ~inside.all(axis=1)
    return beyond
