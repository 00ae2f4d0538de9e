"""What the paper says: a table of its claims, what is measured for each, and what decides it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Generic, TypeVar

from sarl_core.decimals import rounded_text
from sarl_core.mining.language import share_text
from sarl_core.paper.criteria import Criterion, InMost, MeanBounds, Measurement, Together
from sarl_core.paper.metrics import division, landscapes, learning, named_settings, shields
from sarl_core.paper.replicates import PAPER_DIVIDER
from sarl_core.paper.shields import FILTERED, UNFILTERED, Runs
from sarl_core.paper.verdicts import VERDICTS, Claim
from sarl_core.paper.words import percent

Data = TypeVar("Data")


@dataclass(frozen=True)
class ClaimRow(Generic[Data]):
    """A claim of the paper, before anything was measured.

    Attributes:
        id: Of no other claim.
        paper: What the paper says, in one sentence.
        where: Where it says so.
        measured: What is held against the criterion, in words.
        metric: Measures it; None where there is nothing to measure it on.
        criterion: Decides it.
        constructed: Why it holds whatever was demonstrated; empty if it may fail.
    """

    id: str
    paper: str
    where: str
    measured: str
    metric: Callable[[Data], Measurement | None]
    criterion: Criterion
    constructed: str = ""

    def decided(self, data: Data) -> Claim | None:
        """The claim beside what was measured; None where nothing was."""
        measurement = self.metric(data)
        if measurement is None:
            return None
        finding = self.criterion.finding(*measurement.samples)
        return Claim(
            paper=self.paper,
            where=self.where,
            ours=f"{measurement.ours} {finding.sentence}".strip(),
            verdict=max(finding.verdict, measurement.no_better_than, key=VERDICTS.index),
            decided_by=f"{self.measured} {self.criterion.rule}",
            numbers={**measurement.numbers, **finding.numbers},
            constructed=self.constructed,
        )


Rows = tuple[ClaimRow[Data], ...]


def decided(rows: Rows[Data], data: Data) -> tuple[Claim, ...]:
    """The paper's claims and ours.

    Args:
        rows: Claims about one study.
        data: What they are measured on.

    Returns:
        Those for which there is something to measure.
    """
    return tuple(claim for row in rows if (claim := row.decided(data)) is not None)


_IN_MOST = Together(
    InMost(),
    "Counted over recordings in each environment: agrees if it holds in 5 of 6, and with every "
    "expert at least once, everywhere; does not agree if nowhere in more than 1 of 6; else partly.",
)
_EVERYWHERE = "{each} So in every environment; partly, if in some."
_POSITIVE = MeanBounds("above", 0, 0)
_MANY = MeanBounds(
    "above", 0.1, 0.05
)  # shares of episodes that are some, and that are too few to be
_NEARLY_ALL = MeanBounds("above", shields.NEARLY_ALL, 0.8)
_CUT_EARLIER = (
    "where less is asked, a path is cut earlier, and paths that part below the cut share a rule"
)
_ONE_ACTION = (
    "a fully grown tree ends in one action everywhere, but for equal states that were shown with "
    "different ones"
)
_WAY = "in parts of the way from the lone novice's typical return (IQM) to the expert's"
# Such parts: of two that are alike, and of two that are not quite different.
_SIMILAR, _OTHER = 0.1, 0.5

FIGURE_2: Rows[landscapes.Environments] = (
    ClaimRow(
        id="most-rules",
        paper="A rule set has the most rules where nothing is filtered, at support 0 and "
        "confidence 1.",
        where="Figure 2",
        measured="Holds in a recording if no other cell has more rules.",
        metric=landscapes.most_rules,
        criterion=_IN_MOST,
        constructed=_CUT_EARLIER,
    ),
    ClaimRow(
        id="fewer-with-less-confidence",
        paper="At support 0, the number of rules falls continuously as less confidence is asked.",
        where="Figure 2",
        measured="Holds in a recording if the number never rises from one confidence of the grid "
        "to the next lower one.",
        metric=landscapes.fewer_with_less_confidence,
        criterion=_IN_MOST,
        constructed=_CUT_EARLIER,
    ),
    ClaimRow(
        id="fewer-with-more-confidence",
        paper="If more confidence is asked, fewer rules are found.",
        where="text on Figure 2",
        measured="Compares the two on Cart Pole; holds in a recording if there are fewer at every "
        "minimum support of the grid, in part if at some.",
        metric=landscapes.fewer_with_more_confidence,
        criterion=InMost(),
    ),
    ClaimRow(
        id="fewer-with-more-support",
        paper="If more support is asked, fewer rules are found.",
        where="text on Figure 2",
        measured="Holds in a recording if the number never rises from one support of the grid to "
        "the next, at any confidence.",
        metric=landscapes.fewer_with_more_support,
        criterion=_IN_MOST,
        constructed="support shrinks along a path, so a rule that is lost leaves none below it",
    ),
)

FIGURE_3: Rows[landscapes.Environments] = (
    ClaimRow(
        id="longest-rules",
        paper="Rules are longest, too, at support 0 and confidence 1.",
        where="Figure 3",
        measured="Holds in a recording if no other cell has longer rules, in part if none has "
        f"rules longer by more than a tenth of its own (at least {landscapes.NEAR:g} of the "
        "greatest).",
        metric=landscapes.longest_rules,
        criterion=_IN_MOST,
    ),
    ClaimRow(
        id="longest-in-the-middle",
        paper="Above support 0, the longest rules move to the middle of the confidence scale.",
        where="Figure 3",
        measured="The confidence with the longest rules, the mean of several if they tie; holds in "
        "a recording if it lies from 0.25 to 0.75 at every support of the grid above 0, in part if "
        "it is below 1 at some.",
        metric=landscapes.longest_in_the_middle,
        criterion=InMost(),
    ),
    ClaimRow(
        id="number-and-length",
        paper="Support and confidence influence the number of rules and their length in the same "
        "way.",
        where="text on Figure 3",
        measured="The rank correlation over the cells.",
        metric=landscapes.number_and_length,
        criterion=Together(
            MeanBounds("above", 0.8, 0.5, partial(rounded_text, decimals=2)), _EVERYWHERE
        ),
    ),
)

TABLE_1: Rows[named_settings.Environments] = (
    ClaimRow(
        id="compact",
        paper="Filtering by support and confidence gives a compact rule set.",
        where="Lessons Learned, Table 1",
        measured="The share of the unfiltered rules that remains.",
        metric=named_settings.compact,
        criterion=Together(MeanBounds("below", 0.1, 0.5), _EVERYWHERE),
        constructed="a rule with support 0.005 applies to 75 of 15,000 steps, so there can be no "
        "more than 200 a dimension, whatever was demonstrated",
    ),
    ClaimRow(
        id="every-demonstrated-state",
        paper="The unfiltered rule set has an action for every state.",
        where="text on Figure 4",
        measured="The share of the demonstrated states with a rule.",
        metric=named_settings.covered,
        criterion=Together(MeanBounds("above", 0.995, 0.95, share_text), _EVERYWHERE),
        constructed=_ONE_ACTION,
    ),
)

FIGURE_4: Rows[learning.Learners] = (
    ClaimRow(
        id="fewer-violations",
        paper="For both rule sets, violations become fewer as the agent learns.",
        where="Figure 4",
        measured="The change of each learner from its first test to the mean of its last tenth.",
        metric=learning.fewer_violations,
        criterion=Together(
            _POSITIVE,
            "Agrees if the whole 95 % interval over recordings and experts lies below 0 for "
            "both rule sets, and the end is not more than "
            f"{percent(learning.AGAIN)} of the steps above the lowest tenth; partly, if for "
            "one, or if it rises again; does not agree if both rise; else it cannot be judged.",
        ),
    ),
    ClaimRow(
        id="filtered-converge",
        paper="The share of kept filtered rules converges towards their minimum confidence, 0.95.",
        where="Figure 4",
        measured="The mean of the last tenth of the tests, as its distance from 0.95.",
        metric=learning.converges,
        criterion=MeanBounds("within", 0.02, 0.05),
    ),
    ClaimRow(
        id="unfiltered-do-not-converge",
        paper="This cannot be seen for the unfiltered rule set.",
        where="Figure 4",
        measured="How far the mean of the last tenth of the tests lies below 0.95.",
        metric=learning.does_not_converge,
        criterion=MeanBounds("above", 0.05, 0.02),
    ),
    ClaimRow(
        id="every-state-met",
        paper="The unfiltered rule set has an action for each state that the agent meets.",
        where="text on Figure 4",
        measured="The least share over the tests of each learner.",
        metric=learning.every_state,
        criterion=MeanBounds("above", 0.999, 0.99, share_text),
        constructed=_ONE_ACTION,
    ),
    ClaimRow(
        id="smaller-effect",
        paper="The agent departs from the filtered rules too, but clearly less than from the "
        "unfiltered ones.",
        where="text on Figure 4",
        measured="How much more often the unfiltered rule that applied was broken over the last "
        "tenth of the tests; agrees only if filtered rules are broken too.",
        metric=learning.smaller_effect,
        criterion=MeanBounds("above", 0.05, 0),
    ),
)

FIGURE_5: Rows[Runs] = (
    ClaimRow(
        id="expert-best",
        paper="The expert performs best.",
        where="Figure 5",
        measured="Holds in a recording if the typical return of the expert is above that of every "
        f"other, in part if it is no more than {percent(shields.AS_GOOD)} of the way from the lone "
        "novice to the expert below the best.",
        metric=shields.expert_ahead,
        criterion=InMost(),
    ),
    ClaimRow(
        id="novice-range",
        paper="The lone novice's return varies between 8 and 95.",
        where="text on Figure 5",
        measured="The share of the episodes with a return from 8 to 95.",
        metric=shields.novice_range,
        criterion=_NEARLY_ALL,
    ),
    ClaimRow(
        id="unfiltered-reach-the-expert",
        paper="With unfiltered rules, the novice does as well as the expert in parts.",
        where="Figure 5",
        measured="The share of the episodes that reach the lower quartile of the expert's.",
        metric=partial(shields.reaching_the_expert, arm=UNFILTERED),
        criterion=_MANY,
    ),
    ClaimRow(
        id="dips",
        paper="With unfiltered rules there are sharp dips in some episodes, to a return of 167.",
        where="text on Figure 5",
        measured="Holds in a recording if one of its episodes at least is below half of the "
        "expert's typical return.",
        metric=shields.dips,
        criterion=InMost(existence=True),
    ),
    ClaimRow(
        id="dips-beat-the-novice",
        paper="Even in these dips the novice with unfiltered rules does clearly better than alone.",
        where="text on Figure 5",
        measured="Holds in a recording with dips if their median is above what the lone novice "
        "stays below in 95 % of its episodes, in part if it is above the lone novice's mean.",
        metric=shields.dips_beat_the_novice,
        criterion=InMost(only_judged=True),
    ),
    ClaimRow(
        id="always-better",
        paper="Unfiltered rules improve the novice's performance consistently.",
        where="text on Figure 5",
        measured="The share of the seeds on which the return is higher with the rules.",
        metric=shields.better_with_rules,
        criterion=_NEARLY_ALL,
    ),
    ClaimRow(
        id="filtered-similar",
        paper="With filtered rules the result is similar to that with unfiltered ones.",
        where="text on Figure 5",
        measured=f"How far the two are apart, {_WAY}.",
        metric=shields.filtered_and_unfiltered,
        criterion=MeanBounds("within", _SIMILAR, _OTHER),
    ),
)

FIGURE_6: Rows[Runs] = (
    ClaimRow(
        id="order",
        paper="The average return is highest for the expert, then with unfiltered rules, then with "
        "filtered rules, and lowest for the lone novice.",
        where="Figure 6",
        measured="The mean returns of one recording, each against the next.",
        metric=shields.order,
        criterion=Together(
            _POSITIVE,
            "Agrees if the whole 95 % interval over recordings and experts of each of the "
            "three differences of means lies above 0, partly if of two; does not agree if one "
            "lies below 0; else it cannot be judged.",
            in_part_of=2,
        ),
    ),
    ClaimRow(
        id="closely-followed",
        paper="The novice with filtered rules follows closely behind the one with unfiltered "
        "rules.",
        where="text on Figure 6",
        measured=f"How far the two are apart, {_WAY}; not judged unless unfiltered rules are shown "
        "to bring anything at all.",
        metric=shields.following,
        criterion=MeanBounds("within", 0.2, _OTHER),
    ),
    ClaimRow(
        id="filtered-reach-the-expert",
        paper="With filtered rules, the novice reaches the level of the expert in places.",
        where="Figure 6",
        measured="The share of the episodes that reach the lower quartile of the expert's.",
        metric=partial(shields.reaching_the_expert, arm=FILTERED),
        criterion=_MANY,
    ),
    ClaimRow(
        id="deeper-falls",
        paper="Falls downwards are more pronounced than on CartPole.",
        where="text on Figure 6",
        measured="The distance from the typical return to the lowest tenth of a recording's "
        f"episodes, {_WAY}, less that of a recording on Cart Pole.",
        metric=shields.deeper_falls,
        criterion=Together(_POSITIVE, "{each} So for both rule sets; partly, if for one."),
    ),
    ClaimRow(
        id="more-rules",
        paper="More rules improve the performance of the agent.",
        where="text on Figure 6",
        measured=f"How much more the unfiltered rules bring than the filtered ones, {_WAY}.",
        metric=shields.more_rules,
        criterion=MeanBounds("above", 0, -shields.AS_GOOD),
    ),
    ClaimRow(
        id="by-the-shield-alone",
        paper="The expert's performance can be reached by the shield alone.",
        where="Lessons Learned",
        measured=f"The typical return with unfiltered rules, {_WAY}; agrees only if it is also "
        f"shown that no more than {percent(shields.MORE_FAILURES)} more of the episodes fail.",
        metric=shields.by_the_shield_alone,
        criterion=MeanBounds("above", 1 - shields.AS_GOOD, 0.8),
    ),
)

FIGURE_7: Rows[Runs] = (
    ClaimRow(
        id="expert-drops",
        paper="The expert shows strong drops and does not solve the task.",
        where="text on Figure 7",
        measured="The share of the episodes below half of the expert's typical return.",
        metric=shields.expert_drops,
        criterion=_MANY,
    ),
    ClaimRow(
        id="below-the-expert",
        paper="With unfiltered rules the novice is clearly below the expert.",
        where="Figure 7",
        measured=f"How far it is behind the expert, {_WAY}.",
        metric=shields.behind_the_expert,
        criterion=MeanBounds("above", 0.2, 0),
    ),
    *(
        ClaimRow(
            id=f"{arm}-do-not-help",
            paper=f"With {arm} rules there is no improvement over the lone novice.",
            where="Figure 7",
            measured=f"What the rules bring, {_WAY}.",
            metric=partial(shields.what_rules_bring, arm=arm),
            criterion=MeanBounds("below", _SIMILAR, _OTHER),
        )
        for arm in (UNFILTERED, FILTERED)
    ),
    ClaimRow(
        id="no-fluctuation",
        paper="The curves with rules show no fluctuation upwards.",
        where="text on Figure 7",
        measured="The share of the episodes with rules that get half of the way from the lone "
        "novice's typical return to the expert's.",
        metric=shields.half_of_the_way,
        criterion=MeanBounds("below", _MANY.partly, _MANY.agrees),
    ),
    ClaimRow(
        id="finer-division-with-rules",
        paper="A finer division of the actions may have a positive effect (left open).",
        where="Conclusion and Prospects",
        measured=f"What a finer divider brings over the paper's with unfiltered rules, {_WAY}.",
        metric=shields.finer_division,
        criterion=Together(_POSITIVE, "{each} So for every finer divider; partly, if for some."),
    ),
)

DIVIDER: Rows[division.Environments] = (
    ClaimRow(
        id="finer-division",
        paper="A finer division of the actions may have a positive effect (left open).",
        where="Conclusion and Prospects",
        measured=f"What all finer divisions bring on average, over that in {PAPER_DIVIDER} "
        "intervals.",
        metric=division.finer,
        criterion=Together(
            MeanBounds("above", 0, 0, rounded_text),
            "{each} So in every environment with continuous actions; partly, if in some.",
        ),
    ),
    ClaimRow(
        id="too-complex",
        paper="That no rules help on BipedalWalker is put down to poor demonstrations and to an "
        "environment that is too complex.",
        where="text on Figure 7",
        measured=f"What the expert, its actions divided into {PAPER_DIVIDER} intervals, keeps of "
        "its typical return with the better of the two, the centre and its own typical value.",
        metric=division.return_with_two_intervals,
        criterion=MeanBounds("above", 0.5, 0.25),
    ),
)
