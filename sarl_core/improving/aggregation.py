"""Demonstrations where they are missing (the paper's Prospects): dataset aggregation for rules.

The rules act, the expert says what it would have done in the states they lead to, and rules are
grown again from all answers (DAgger, Ross et al. 2011). Of all rounds, or of all that a refinement
of the best of them came to, the best is found by successive halving, and reported on episodes that
nothing was chosen by.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.agents.own import AgentFaultError
from sarl_core.demonstrations.dataset import Demonstrations, derived_features
from sarl_core.environments.environment import EnvironmentOrId, with_time_limit
from sarl_core.environments.failures import no_failures_text
from sarl_core.errors import InputError
from sarl_core.improving.alternation import ScoredStates, achieved, alternated, label_scores
from sarl_core.improving.candidate import Candidate, Evaluator, structure_of
from sarl_core.improving.first_rules import check_first_rules, first_trees
from sarl_core.improving.plan import Plan
from sarl_core.improving.questions import Answers, ask, importance
from sarl_core.improving.questions import scores as expert_scores
from sarl_core.improving.refinement import Refinement
from sarl_core.improving.successive_halving import planned_episodes, successive_halving
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.combining.queries import trees_over_used
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.growing.structure import count_tree
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_core.mining.tree import LEAF, PolicyTree
from sarl_core.progress import CancelledError, Progress, report
from sarl_core.rollouts import seeds
from sarl_core.rollouts.choices import check_choice, mean_score, scores
from sarl_core.rollouts.episodes import MAX_STEPS, Episodes, cut_text, rollout
from sarl_core.rollouts.player import EpisodeFaultError
from sarl_core.rollouts.seeds import RunSeeds
from sarl_core.rollouts.statistics import Rate
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

_ALTERNATED = 10_000  # pairs by which queries are chosen anew, or of many rules
_A_RULE = 100  # for each of them
_FIRST_VALIDATION = 16
_USUAL = (0.05, 0.95)  # quantiles between which most returns lie
_FIRST_SHARE = 4  # where much must be seen first, the first validation is this part of the whole


@dataclass(frozen=True)
class AggregationRound:
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
        cut: How many of its episodes were cut off before their end.
        failures: How many of them failed; None where that is not known.
        score: By which it would be chosen, were it all that is known (`choices.scores`).
    """

    number: int
    pairs: int
    rules: int
    returns: NDArray[np.float64]
    coverage: float
    disagreement: float
    needed: float
    cut: int = 0
    failures: Rate | None = None
    score: tuple[float, ...] = ()

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
        chosen: Number of the round whose rules are the best, or were before they were refined.
        validation_mean: Mean return in the episodes by which these very rules were chosen; too good
            by what luck they had. None where the run was stopped before.
        refined: Whether its queries, labels or thresholds were changed afterwards.
        reported: Episodes that nothing was chosen by; None where the run was stopped before.
        demonstrations: All pairs of the chosen round.
        seeds: Which episodes served for what.
        first_rules: Digest of those that it began with; "" where they were mined.
        fault: Why it was stopped, where agent or expert failed; else "".
    """

    env_id: str
    plan: Plan
    rule_set: RuleSet
    trees: tuple[PolicyTree, ...]
    rounds: tuple[AggregationRound, ...]
    chosen: int
    validation_mean: float | None
    refined: bool
    reported: Episodes | None
    demonstrations: Demonstrations
    seeds: RunSeeds
    first_rules: str = ""
    fault: str = ""

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a person should know of how the episodes came about, as clauses."""
        cut, of = sum(one.cut for one in self.rounds), sum(len(one.returns) for one in self.rounds)
        steps = self.plan.max_steps or MAX_STEPS
        clauses = (
            (
                cut_text(
                    cut,
                    of,
                    steps,
                    may_fail=any(one.failures is not None for one in self.rounds),
                    episodes="episodes of the rounds",
                ),
            )
            if cut
            else ()
        )
        return (*clauses, *(() if self.reported is None else self.reported.remarks))

    @property
    def left_out(self) -> int:
        """How many of the rules that it began with are no longer there; 0 where they were mined."""
        return max(self.rounds[0].rules - len(self.rule_set), 0) if self.first_rules else 0

    @property
    def is_finished(self) -> bool:
        """Whether it was not stopped before its report."""
        return self.reported is not None


def recorded_environment(demonstrations: Demonstrations) -> str:
    """The environment that demonstrations name, to be played in.

    Args:
        demonstrations: From a file, perhaps.

    Returns:
        Its id.

    Raises:
        InputError: If they name none, or one whose module would have to be imported.
    """
    env_id = demonstrations.env_id
    if not env_id:
        raise InputError("the demonstrations name no environment; say which with --env")
    if ":" in env_id:  # what a file names is not imported
        raise InputError(
            f"the demonstrations name the environment {env_id!r}, which would be imported, and a "
            f"file may not say what is; say so yourself, with --env {env_id}"
        )
    return env_id


def aggregate(
    start: Demonstrations,
    plan: Plan,
    *,
    env_id: EnvironmentOrId | None = None,
    agent: str | Agent = "novice",
    expert: str | Agent = "expert",
    first_rules: RuleSet | None = None,
    jobs: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
    watch: Callable[[AggregationRound], None] | None = None,
) -> Aggregation:
    """Improve demonstrations and rules in turns.

    Args:
        start: What the expert has shown so far.
        plan: How many rules, rounds and episodes.
        env_id: Environment; that of `start` where not given.
        agent: Who is shielded, as in `make_agent`.
        expert: Who is asked: a trained policy, or an agent of the caller's own. One with a
            memory is asked about each episode from its start.
        first_rules: Those of the first round, as another aggregation gave them; mined from `start`
            where None. Where they are more than the plan allows and there are no other rounds, the
            refinement begins with leaving out one after the other, by what its episodes say.
        jobs: Processes; changes the speed, never the result.
        executor: Whose processes they are; this machine's where not given.
        progress: Called with (units done, in all); returning False stops.
        watch: Called after every round.

    Returns:
        The best rules. Stopped after a first round (by `progress`, or by Ctrl-C), every part
        that was finished counts: the rounds, the refinement as far as it went, the choice.

    Raises:
        InputError: If agent, expert and environment do not fit, or the expert acts at random; if
            failures are to count where nothing says what one is; or if the first rules do not fit.
        CancelledError: If `progress` returned False before the first round was finished, or before
            a search had left out as many of the first rules as there are too many.
    """
    env_id = env_id or recorded_environment(start)
    check_choice(plan.choose, env_id)
    if plan.search_worth is not None and (why := no_failures_text(env_id)):
        raise InputError(
            f"no failure can count in the search, because {why}; say what a failure is "
            "(--failure), or leave --search-worth out"
        )
    if first_rules is not None:
        check_first_rules(first_rules, plan)
    agents = make_agent(agent, env_id), make_agent(expert, env_id)
    run = _Run(start, plan, env_id, *agents, jobs, executor, first_rules)
    clock = _Clock(run.planned_units(), progress)
    try:
        for number in range(1, plan.rounds + 1):
            run.round(number, clock)
            if watch is not None:
                watch(run.rounds[-1])
        if plan.turns:
            run.refine(clock)
        else:
            run.select(clock)
        run.report(clock)
    except (CancelledError, KeyboardInterrupt, AgentFaultError, EpisodeFaultError) as error:
        if not run.rounds or run.is_too_long():
            raise
        fault = str(error) if isinstance(error, InputError) else ""
        return replace(run.result(), fault=fault)
    return run.result()


class _Clock:
    """Counts episodes over all parts of a run."""

    def __init__(self, total: int, progress: Progress | None) -> None:
        self.total, self.progress, self.done = total, progress, 0

    def tick(self, units: int = 1) -> None:
        self.done += units
        report(self.progress, min(self.done, self.total), self.total)

    def during(self, *_: int) -> bool:
        """For work that takes its time and plays no episodes."""
        self.tick(0)
        return True

    def of(self) -> Progress:
        """For work that counts its own episodes from 0."""
        before = self.done
        return lambda done, _: self.tick(before + done - self.done)


@dataclass(frozen=True)
class _Choice:
    """The best so far.

    Attributes:
        index: Of its round, counted from 0.
        trees: Of its rules.
        mean: Of the validation episodes that these rules were chosen by; None for none.
        refined: Whether the trees are no longer those of the round.
    """

    index: int
    trees: tuple[PolicyTree, ...]
    mean: float | None = None
    refined: bool = False


class _Run:
    """The rounds so far, and what was made of them: whoever stops it loses nothing finished."""

    def __init__(
        self,
        start: Demonstrations,
        plan: Plan,
        env_id: EnvironmentOrId,
        agent: Agent,
        expert: Agent,
        jobs: int,
        executor: Executor | None = None,
        first_rules: RuleSet | None = None,
    ) -> None:
        self.plan, self.env_id, self.jobs, self.executor = plan, env_id, jobs, executor
        self.agent, self.expert = agent, expert
        self.answers = Answers(
            env_id, expert, start, pairs=plan.combined, divider=plan.divider, seed=plan.seed
        )
        self.first: tuple[PolicyTree, ...] | None = None
        self.first_rules = ""
        self.search = plan.search()
        if first_rules is not None:
            self.first = first_trees(first_rules, self.answers)
            self.first_rules = rules_digest(first_rules)
            if plan.rounds == 1:
                beyond = Candidate.of_trees(self.first).beyond(plan.max_rules)
                self.search = plan.search(pruned=beyond)
                plan.check_turns(self.search)
        self.rounds: list[AggregationRound] = []
        self.trees: list[tuple[PolicyTree, ...]] = []
        self.choice: _Choice | None = None
        self.reported: Episodes | None = None
        self.seeds = RunSeeds(rounds=self.seed(seeds.ROUNDS))

    def planned_units(self) -> int:
        plan = self.plan
        refined = self.search.cost(plan.turns) if plan.turns else 0
        chosen = _choice_cost(plan, _most_choices(plan))
        return plan.rounds * plan.episodes + refined + chosen + plan.report

    def grow(self, index: int, clock: _Clock) -> tuple[PolicyTree, ...]:
        """The trees of a round (counted from 0)."""
        pairs = self.answers.pairs(index)
        known = expert_scores(self.expert, pairs.raw_observations)
        ways: dict[str, Any] = {}
        if known is not None:
            # Two ways to say what matters, in turns; which is better is seen, not known.
            ways = {"scores": known} if index % 2 else {"weights": importance(known)}
        trees = grow_budgeted_trees(
            pairs,
            max_rules=self.plan.max_rules,
            divider=self.plan.divider,
            seed=self.plan.seed + index,
            progress=clock.during,
            **ways,
        )
        return trees_over_used(self.alternated(trees, pairs, known, index, clock), pairs)

    def alternated(
        self,
        trees: tuple[PolicyTree, ...],
        pairs: Demonstrations,
        known: NDArray[np.float64] | None,
        index: int,
        clock: _Clock,
    ) -> tuple[PolicyTree, ...]:
        """Trees of a round with their queries chosen anew, each by what the others make of it."""
        rows, most = np.arange(len(pairs)), max(_ALTERNATED, _A_RULE * self.plan.max_rules)
        if len(rows) > most:
            generator = np.random.default_rng((self.plan.seed, index))
            rows = np.sort(generator.choice(rows, most, replace=False))
        result = []
        for tree in trees:
            clock.tick(0)
            scores = known
            if scores is None:
                scores = label_scores(pairs, tree.dimension, tree.index)
            before, every = structure_of(tree), ScoredStates(pairs.observations, scores)
            after = alternated(before, every.select(rows), max_rules=self.plan.max_rules)
            # Of many rules some are met by few of the chosen pairs.
            better = achieved(after, every) > achieved(before, every)
            changed = count_tree(after, pairs, tree.index, divider=self.plan.divider)
            result.append(changed if better else tree)
        return tuple(result)

    def pairs(self, choice: _Choice) -> Demonstrations:
        """What the trees of a choice were grown from, with what they derive."""
        derived = derived_features(choice.trees[0].source.features)
        return self.answers.pairs(choice.index, derived=derived)

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
            executor=self.executor,
            keep_steps=keep_steps,
            max_steps=self.plan.max_steps,
            progress=clock.of(),
        )

    def seed(self, first: int) -> int:
        return seeds.of_run(first, self.plan.seed)

    def round(self, number: int, clock: _Clock) -> None:
        trees = self.first if number == 1 else None
        trees = trees or self.grow(number - 1, clock)
        rules = self.rules(trees)
        played = self.shielded(
            rules,
            self.seeds.rounds + (number - 1) * seeds.SEEDS_A_ROUND,
            self.plan.episodes,
            clock,
            keep_steps=True,
        )
        table = played.steps
        assert table is not None
        wanted = ask(self.expert, table.observation, table.episode)
        covered = table.rules >= 0
        rule_labels = np.array([rule.action for rule in rules.rules] or [0])[
            np.maximum(table.rules, 0)
        ]
        labels = np.stack(
            [
                dimension.labels_of(column)
                for dimension, column in zip(rules.actions, wanted.T, strict=True)
            ],
            axis=1,
        )
        otherwise = covered & (rule_labels != labels)
        self.trees.append(trees)
        self.rounds.append(
            AggregationRound(
                number=number,
                pairs=trees[0].source.steps,
                rules=len(rules),
                returns=played.returns,
                coverage=float(covered.any(axis=1).mean()),
                disagreement=float(otherwise.sum() / max(int(covered.sum()), 1)),
                needed=float((otherwise | ~covered).any(axis=1).mean()),
                cut=int(played.cut.sum()),
                failures=played.failures,
                score=mean_score(scores(played, self.plan.choose)),
            )
        )
        self.answers.add(table, wanted, seed=self.seed(number))

    def select(self, clock: _Clock) -> None:
        """Choose the best round."""
        first = self.seed(seeds.VALIDATION)
        best, mean = self.best_of([self.rules(trees) for trees in self.trees], first, clock)
        self.choice = _Choice(best, self.trees[best], mean)
        self.seeds = self.seeds._replace(validation=first)

    def best_of(self, candidates: list[RuleSet], seed: int, clock: _Clock) -> tuple[int, float]:
        """The best candidate, and its mean return over all episodes that it was given."""
        tried = successive_halving(
            len(candidates),
            lambda left, first, count: [
                scores(self.shielded(candidates[one], first, count, clock), self.plan.choose)
                for one in left
            ],
            seed=seed,
            first=_first_validation(self.plan),
            most=self.plan.validation,
        )
        return tried.best, float(tried.means[tried.best])

    def refine(self, clock: _Clock) -> None:
        """Change shape and thresholds of the best rules, and choose the best of all turns."""
        plan, first = self.plan, self.seed(seeds.REFINEMENT)
        search = Refinement(
            self.trees,
            self.answers.pairs(0, derived=()),
            Evaluator(
                self.env_id
                if plan.search_limit is None
                else with_time_limit(self.env_id, plan.search_limit),
                self.agent,
                projection=plan.projection,
                divider=plan.divider,
                worth=self.worth(),
                max_steps=plan.max_steps,
            ),
            expert=self.expert,
            combined=plan.combined,
            max_rules=plan.max_rules,
            effort=self.search,
            first=first,
            seed=plan.seed,
            jobs=self.jobs,
            executor=self.executor,
        )

        def moved(candidate: Candidate) -> _Choice:
            pairs = self.answers.pairs(search.begun, derived=candidate.derived)
            trees = candidate.trees(pairs, plan.divider)
            return _Choice(
                search.begun, trees, refined=search.is_pruned or candidate is not search.start
            )

        def better(candidate: Candidate) -> None:
            # By the episodes of the search only: for who stops before the validation.
            self.choice = moved(candidate)
            self.seeds = self.seeds._replace(refinement=first)

        marks = search.run(plan.turns, progress=clock.of(), better=better)
        clock.tick(_choice_cost(plan, _most_choices(plan)) - _choice_cost(plan, len(marks)))
        self.seeds = self.seeds._replace(refinement=first)
        choices = [moved(one) for one in marks]
        chosen_by = self.seed(seeds.VALIDATION)
        index, mean = self.best_of([self.rules(one.trees) for one in choices], chosen_by, clock)
        self.choice = replace(choices[index], mean=mean)
        self.seeds = self.seeds._replace(validation=chosen_by)

    def is_too_long(self) -> bool:
        """Whether all that is there yet are more rules to begin with than there may be."""
        if self.plan.thresholds is not None or self.choice is not None:
            return False
        leaves = [int((tree.feature == LEAF).sum()) for tree in self.trees[0]]
        return max(leaves) > self.plan.max_rules

    def worth(self) -> float:
        """What a failure counts in a search: as much as the returns of the rounds differ."""
        if self.plan.search_worth is not None:
            return self.plan.search_worth
        if self.plan.choose == "return":
            return 0.0
        low, high = np.quantile(np.concatenate([one.returns for one in self.rounds]), _USUAL)
        return float(high - low)

    def report(self, clock: _Clock) -> None:
        """Episodes that nothing was chosen by."""
        assert self.choice is not None
        first = self.seed(seeds.REPORT)
        rules = self.rules(self.choice.trees)
        self.reported = self.shielded(rules, first, self.plan.report, clock)
        self.seeds = self.seeds._replace(report=first)

    def result(self) -> Aggregation:
        choice = self.choice
        if choice is None:  # stopped early: the episodes of the rounds are all there is
            best = max(range(len(self.rounds)), key=lambda index: self.rounds[index].score)
            choice = _Choice(best, self.trees[best])
        pairs = self.pairs(choice)
        return Aggregation(
            env_id=str(self.env_id),
            plan=self.plan,
            rule_set=with_boxes(self.rules(choice.trees), pairs),
            trees=choice.trees,
            rounds=tuple(self.rounds),
            chosen=choice.index + 1,
            validation_mean=choice.mean,
            refined=choice.refined,
            reported=self.reported,
            demonstrations=pairs,
            seeds=self.seeds,
            first_rules=self.first_rules,
        )


def _most_choices(plan: Plan) -> int:
    """What may be left to choose from: all rounds, or all that turns came to."""
    if not plan.turns:
        return plan.rounds
    begun = 1 if plan.rounds == 1 else 2  # as it was, and when it was moved
    return begun + plan.turns


def _choice_cost(plan: Plan, choices: int) -> int:
    """Episodes by which one of so many is chosen."""
    return planned_episodes(choices, _first_validation(plan), plan.validation)


def _first_validation(plan: Plan) -> int:
    """Episodes that every candidate plays before the worse half of them leaves."""
    if plan.choose == "return" and not plan.turns:
        return _FIRST_VALIDATION
    # Failures are rare, and what a refinement leaves to choose from differs little.
    return max(_FIRST_VALIDATION, plan.validation // _FIRST_SHARE)
