"""Demonstrations where they are missing (the paper's Prospects): dataset aggregation for rules.

The rules act, the expert says what it would have done in the states they lead to, and rules are
grown again from all answers (DAgger, Ross et al. 2011). Of all rounds the best is found by
successive halving, and reported on episodes that nothing was chosen by.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.budget import MIN_RULES, grow_budgeted_trees, leaf_rules
from sarl_core.mining.rules import RuleSet, Thresholds, mine_rules
from sarl_core.mining.tree import PolicyTree
from sarl_core.rollouts.agents import Agent, make_agent
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.progress import CancelledError, Progress, report
from sarl_core.rollouts.questions import answered, ask, importance, scores
from sarl_core.rollouts.refinement import generation_cost, refine
from sarl_core.rollouts.selection import planned_episodes, successive_halving
from sarl_core.rollouts.spaces import Actions
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

# Far apart, and far from what a person types, so that no episode is used twice.
ROUND_SEED = 20_000_000
VALIDATION_SEED = 30_000_000
REPORT_SEED = 50_000_000
_SEEDS_A_RUN = 1_000_000  # between two values of the seed
_SEEDS_A_ROUND = 10_000

_PAIRS_A_ROUND = 25_000  # more states of one round are too alike to be worth their time
# Rules learn from what was shown at first and from where the latest rules led: what earlier ones
# got into, the present ones may never meet.
_ROUNDS_KEPT = 12
_FIRST_VALIDATION = 16
_MARKS = 8  # points on the way of a refinement from which the best is chosen


@dataclass(frozen=True)
class Plan:
    """What an aggregation is to do.

    Attributes:
        max_rules: Most rules of each action dimension.
        rounds: How often the rules act and the expert answers.
        episodes: Episodes a round.
        thresholds: Cut the trees there; None makes every leaf a rule.
        divider: Number of intervals of continuous dimensions.
        projection: How the shield replaces a continuous action.
        generations: Of the refinement that follows; 0 for none.
        validation: Episodes by which the best of all is chosen in the end.
        report: Episodes of the final report.
        seed: Another one gives other episodes.
    """

    max_rules: int
    rounds: int = 20
    episodes: int = 40
    thresholds: Thresholds | None = None
    divider: int = 2
    projection: Projection = "centre"
    generations: int = 0
    validation: int = 256
    report: int = 100
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what cannot be done.

        Raises:
            InputError: If a number is out of range.
        """
        for name, value, least in (
            ("budget of rules", self.max_rules, MIN_RULES),
            ("number of rounds", self.rounds, 1),
            ("number of episodes a round", self.episodes, 1),
            ("number of generations", self.generations, 0),
            ("number of validation episodes", self.validation, 1),
            ("number of report episodes", self.report, 1),
            ("seed", self.seed, 0),
        ):
            if value < least:
                raise InputError(f"the {name} is {value}; give {least} or more")


@dataclass(frozen=True)
class Round:
    """What one round brought.

    Attributes:
        number: Counted from 1.
        pairs: State-action pairs that its rules were grown from.
        rules: Number of rules.
        returns: Of its episodes, in which the rules shielded a novice, (E,).
        coverage: Share of the met states in which some rule applied.
        disagreement: Share of the covered decisions in which the expert would do otherwise.
        needed: Share of the met states that no rule covers, or where the expert would do
            otherwise in some action dimension.
    """

    number: int
    pairs: int
    rules: int
    returns: NDArray[np.float64]
    coverage: float
    disagreement: float
    needed: float

    @property
    def mean_return(self) -> float:
        """Mean of the returns."""
        return float(self.returns.mean())


@dataclass(frozen=True)
class Aggregation:
    """A finished (or a stopped) aggregation.

    Attributes:
        env_id: Environment.
        plan: What was to be done.
        rule_set: The best that was found.
        trees: Of its rules, one an action dimension, with the pairs it was grown from.
        rounds: All that were finished.
        chosen: Number of the round whose rules are the best.
        validation_mean: Mean return by which it was chosen; too good by what luck it had. None
            where the run was stopped before.
        refined: Whether its thresholds and labels were moved afterwards.
        reported: Episodes that nothing was chosen by; None where the run was stopped before.
        demonstrations: All pairs of the chosen round.
    """

    env_id: str
    plan: Plan
    rule_set: RuleSet
    trees: tuple[PolicyTree, ...]
    rounds: tuple[Round, ...]
    chosen: int
    validation_mean: float | None
    refined: bool
    reported: Episodes | None
    demonstrations: Demonstrations


def aggregate(
    start: Demonstrations,
    plan: Plan,
    *,
    env_id: str | None = None,
    agent: str | Agent = "novice",
    expert: str | Agent = "expert",
    jobs: int = 1,
    progress: Progress | None = None,
    watch: Callable[[Round], None] | None = None,
) -> Aggregation:
    """Improve demonstrations and rules in turns.

    Args:
        start: What the expert has shown so far.
        plan: How many rules, rounds and episodes.
        env_id: Environment; that of `start` where not given.
        agent: Who is shielded, as in `make_agent`.
        expert: Who is asked: a trained policy.
        jobs: Processes; changes the speed, never the result.
        progress: Called with (units done, in all); returning False stops.
        watch: Called after every round.

    Returns:
        The best rules. Stopped after a first round (by `progress`, or by Ctrl-C), what was
        finished is given, unreported.

    Raises:
        InputError: If agent, expert and environment do not fit, or the expert acts at random.
        CancelledError: If `progress` returned False before the first round was finished.
    """
    env_id = env_id or start.env_id
    if not env_id:
        raise InputError("the demonstrations name no environment; say which with --env")
    run = _Run(start, plan, env_id, make_agent(agent, env_id), make_agent(expert, env_id), jobs)
    clock = _Clock(run.planned_units(), progress)
    try:
        for number in range(1, plan.rounds + 1):
            run.round(number, clock)
            if watch is not None:
                watch(run.rounds[-1])
        best, mean = run.select(clock)
        trees, refined, mean = run.refine(best, mean, clock)
        reported = run.report(trees, clock)
    except (CancelledError, KeyboardInterrupt):
        if not run.rounds:
            raise
        best = int(np.argmax([found.mean_return for found in run.rounds]))
        return run.result(best, run.trees[best], None, False, None)
    return run.result(best, trees, mean, refined, reported)


class _Clock:
    """Counts episodes over all parts of a run."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self.total, self.progress, self.done = total, progress, 0

    def tick(self, units: int = 1) -> None:
        self.done += units
        report(self.progress, min(self.done, self.total), self.total)

    def of(self) -> Progress:
        """For work that counts its own episodes from 0."""
        before = self.done

        def told(done: int, _: int) -> None:
            self.tick(before + done - self.done)

        return told


class _Run:
    """The pairs so far, and the rounds that they came from."""

    def __init__(
        self, start: Demonstrations, plan: Plan, env_id: str, agent: Agent, expert: Agent, jobs: int
    ) -> None:
        self.plan, self.env_id, self.jobs = plan, env_id, jobs
        self.agent, self.expert = agent, expert
        self.observations = [start.observations]
        self.actions: list[Actions] = [ask(expert, start.observations)]
        self.episodes = [start.episodes]
        self.steps = [np.arange(len(start)) if start.steps is None else start.steps]
        self.rounds: list[Round] = []
        self.trees: list[tuple[PolicyTree, ...]] = []

    def planned_units(self) -> int:
        plan = self.plan
        refined = plan.generations * generation_cost() + (
            planned_episodes(_MARKS + 1, _FIRST_VALIDATION, plan.validation)
            if plan.generations
            else 0
        )
        return (
            plan.rounds * plan.episodes
            + planned_episodes(plan.rounds, _FIRST_VALIDATION, plan.validation)
            + refined
            + plan.report
        )

    def pairs(self, rounds: int) -> Demonstrations:
        """What a round (counted from 0) learns from."""
        kept = [0, *range(max(1, rounds + 1 - _ROUNDS_KEPT), rounds + 1)]

        def column(parts: list[Any]) -> Any:
            return np.concatenate([parts[index] for index in kept])

        return answered(
            self.env_id,
            self.expert,
            column(self.observations),
            column(self.actions),
            column(self.episodes),
            column(self.steps),
        )

    def grow(self, index: int) -> tuple[PolicyTree, ...]:
        """The trees of a round (counted from 0)."""
        pairs = self.pairs(index)
        label_scores = scores(self.expert, pairs.observations)
        ways: dict[str, Any] = {}
        if label_scores is not None:
            # Two ways to say what matters, in turns; which is better is seen, not known.
            ways = {"scores": label_scores} if index % 2 else {"weights": importance(label_scores)}
        return grow_budgeted_trees(
            pairs,
            max_rules=self.plan.max_rules,
            divider=self.plan.divider,
            seed=self.plan.seed + index,
            **ways,
        )

    def rules(self, trees: tuple[PolicyTree, ...]) -> RuleSet:
        at = self.plan.thresholds
        if at is None:
            return leaf_rules(trees)
        return mine_rules(
            trees,
            supp_min=at.support,
            conf_min=at.confidence,
            lift_min=at.lift,
            max_depth=at.max_depth,
        )

    def shielded(
        self, rules: RuleSet, seed: int, episodes: int, clock: _Clock, *, keep_steps: bool = False
    ) -> Episodes:
        return rollout(
            self.env_id,
            self.agent,
            shield=Shield(rules, projection=self.plan.projection),
            episodes=episodes,
            seed=seed,
            jobs=self.jobs,
            keep_steps=keep_steps,
            progress=clock.of(),
        )

    def seed(self, first: int) -> int:
        return first + self.plan.seed * _SEEDS_A_RUN

    def round(self, number: int, clock: _Clock) -> None:
        trees = self.grow(number - 1)
        rules = self.rules(trees)
        found = self.shielded(
            rules,
            self.seed(ROUND_SEED) + (number - 1) * _SEEDS_A_ROUND,
            self.plan.episodes,
            clock,
            keep_steps=True,
        )
        table = found.steps
        assert table is not None
        wanted = ask(self.expert, table.observation)
        covered = table.rules >= 0
        said = np.array([rule.action for rule in rules.rules] or [0])[np.maximum(table.rules, 0)]
        labels = np.stack(
            [
                dimension.labels_of(column)
                for dimension, column in zip(rules.actions, wanted.T, strict=True)
            ],
            axis=1,
        )
        otherwise = covered & (said != labels)
        self.rounds.append(
            Round(
                number=number,
                pairs=trees[0].source.steps,
                rules=len(rules),
                returns=found.returns,
                coverage=float(covered.any(axis=1).mean()),
                disagreement=float(otherwise.sum() / max(int(covered.sum()), 1)),
                needed=float((otherwise | ~covered).any(axis=1).mean()),
            )
        )
        self.trees.append(trees)
        rows = np.arange(len(table))
        if len(rows) > _PAIRS_A_ROUND:
            generator = np.random.default_rng(self.seed(number))
            rows = np.sort(generator.choice(rows, _PAIRS_A_ROUND, replace=False))
        self.observations.append(table.observation[rows])
        self.actions.append(wanted[rows])
        self.episodes.append(self.episodes[-1][-1] + 1 + table.episode[rows])
        self.steps.append(table.step[rows])

    def select(self, clock: _Clock) -> tuple[int, float]:
        """The best round (counted from 0), and its mean return over the validation episodes."""
        candidates = [self.rules(trees) for trees in self.trees]
        return self.best_of(candidates, VALIDATION_SEED, clock)

    def best_of(self, candidates: list[RuleSet], seed: int, clock: _Clock) -> tuple[int, float]:
        found = successive_halving(
            len(candidates),
            lambda index, first, count: (
                self.shielded(candidates[index], first, count, clock).returns
            ),
            seed=self.seed(seed),
            first=_FIRST_VALIDATION,
            most=self.plan.validation,
        )
        return found.best, float(found.means[found.best])

    def refine(
        self, best: int, mean: float, clock: _Clock
    ) -> tuple[tuple[PolicyTree, ...], bool, float]:
        """Move thresholds and labels of the best rules, and keep what is better."""
        trees = self.trees[best]
        if not self.plan.generations:
            return trees, False, mean
        marks = refine(
            self.env_id,
            trees,
            self.pairs(best),
            agent=self.agent,
            projection=self.plan.projection,
            generations=self.plan.generations,
            marks=_MARKS,
            seed=self.plan.seed,
            jobs=self.jobs,
            progress=clock.of(),
        )
        candidates = [trees, *marks]
        # On other episodes than those of the rounds: the first candidate was chosen by them.
        found, mean = self.best_of(
            [self.rules(one) for one in candidates], VALIDATION_SEED + _SEEDS_A_RUN // 2, clock
        )
        return candidates[found], found > 0, mean

    def report(self, trees: tuple[PolicyTree, ...], clock: _Clock) -> Episodes:
        return self.shielded(self.rules(trees), self.seed(REPORT_SEED), self.plan.report, clock)

    def result(
        self,
        best: int,
        trees: tuple[PolicyTree, ...],
        mean: float | None,
        refined: bool,
        reported: Episodes | None,
    ) -> Aggregation:
        return Aggregation(
            env_id=self.env_id,
            plan=self.plan,
            rule_set=self.rules(trees),
            trees=trees,
            rounds=tuple(self.rounds),
            chosen=best + 1,
            validation_mean=mean,
            refined=refined,
            reported=reported,
            demonstrations=self.pairs(best),
        )
