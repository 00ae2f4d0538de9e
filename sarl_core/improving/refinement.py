"""Making a few rules achieve more: their thresholds and their shape, in turns.

A tree that imitates its expert is not yet the best tree of its size. Of several trees thresholds,
ratios and intervals are moved, and the one that achieves most then is where the search begins. In
each turn its likeliest neighbours in shape are moved, and the best of them takes its place if it
achieves more.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.improving.candidate import Candidate, Evaluator
from sarl_core.improving.movement import FIRST_STEP, POPULATION, Movement
from sarl_core.improving.policy_improvement import (
    MOST_PROPOSALS,
    DeviatingAgent,
    PolicyImprovement,
)
from sarl_core.improving.questions import answered, ask, scores, with_values
from sarl_core.improving.shapes import MetStates, neighbours, with_a_rule_less
from sarl_core.improving.successive_halving import (
    Selection,
    planned_episodes,
    successive_halving,
)
from sarl_core.mining.budgeted_trees import leaf_rules
from sarl_core.mining.combining.candidates import Pair, candidates
from sarl_core.mining.growing.structure import count_tree
from sarl_core.mining.labels import label_dimensions
from sarl_core.mining.tree import PolicyTree
from sarl_core.processes import executor_of
from sarl_core.progress import Progress, report
from sarl_core.rollouts.episodes import MAX_STEPS, Episodes, rollout
from sarl_core.rollouts.player import check_environment
from sarl_core.shielding.shield import Shield

_LONG = 0.9  # quantile of the expert's lengths
_PATIENCE = 2  # times as long: what takes longer is tried no further
_MET_STATES = 10_000
_PAIRS = 20  # of features that new queries may combine, others each time
_NEIGHBOURS = 80  # in shape
_SHAPES = 4  # that are moved: which has most in it is not seen before
_STARTS = 8  # of which one is moved before the first turn, `_SHAPES` at least
_EARLY = 4  # generations for each of them before the worse half is left, then twice as many, ...
_EARLY_STEPS = 1  # or so many steps
_LATE = 16  # further ones for the best, in each turn, where nothing else is said
_LEFT_OUT = 24  # rules of which one is left out: those that are met least
_AT_A_TIME = 3  # rules that are left out before thresholds are moved
_BETWEEN = 12  # generations of that
_NEAR = 0.06  # the first step there: what is pruned was good as it was
_SOONER = 3  # part of their episodes after which the worse half is left, where there are more

# Times the episodes of a neighbour:
_EXPERT = 2  # in which it is seen how long the expert takes
_MET = 2  # in which it is seen where the rules lead
_RANKED = 4  # for the best shapes, and for each way that is gone
_CAREFUL = 2  # where what is good already is moved on
_COMPARED = 32  # for the best starts, and for what is to take the place of what is there
_DEVIATED = 12  # of a step: in which single actions are others, so that it is seen what that brings
_FOLLOWED = 8  # in which the rules are followed
_BEFORE = 2  # times as many of either, before the first step
_PROPOSED = (3, 24)  # for what is proposed, before the worse half is left, and for the best


def _halvings(ways: int, steps: int) -> list[tuple[int, int]]:
    """How many ways are gone on with before each halving, of so many, and how far each.

    A step takes about as many episodes as eight generations that play all of them.
    """
    stages, generations = [], _EARLY_STEPS if steps else _EARLY
    while ways > 1:
        stages.append((ways, generations))
        ways, generations = (ways + 1) // 2, 2 * generations
    return stages


@dataclass(frozen=True)
class SearchEffort:
    """How much a refinement tries.

    Attributes:
        episodes: For each neighbour, the same for all of a generation.
        starts: What it may begin with, how many.
        moved: How many of these, that achieve most, have their thresholds moved; an eighth of all,
            four at least, where None.
        steps: In each turn, in which the rules are changed by what their own episodes say, in
            place of neighbours in shape; then what it may begin with is moved in the same way.
        late: Generations in which the thresholds of the best are moved, in each turn; 16 where
            None. Of more than 16 each leaves its worse half sooner.
        pruned: Rules more than there may be, which are left out first, one after the other.
    """

    episodes: int
    starts: int = 1
    moved: int | None = None
    steps: int = 0
    late: int | None = None
    pruned: int = 0

    @property
    def ways(self) -> int:
        """How many starts are moved."""
        usual = max(_SHAPES, self.starts // _STARTS)
        return min(self.starts, usual if self.moved is None else self.moved)

    @property
    def generations(self) -> int:
        """In which the best is moved, in each turn."""
        return _LATE if self.late is None else self.late

    def sooner(self, episodes: int) -> int:
        """Episodes of a generation after which its worse half is left, of so many."""
        return -(-episodes // _SOONER) if self.generations > _LATE else episodes

    def cost(self, turns: int) -> int:
        """Most episodes of so many turns, and of what comes before them."""
        episodes, played = self.episodes, (_DEVIATED + _FOLLOWED) * self.episodes

        def ranked(count: int, times: int) -> int:
            return planned_episodes(count, episodes, times * episodes)

        def moved(times: int) -> int:
            most = times * episodes
            return planned_episodes(POPULATION, self.sooner(most), most)

        first, most = (times * episodes for times in _PROPOSED)
        step = played + planned_episodes(1 + MOST_PROPOSALS, first, most)

        def halved(ways: int) -> int:
            each = step if self.steps else moved(1)
            return sum(
                left * (generations * each + _RANKED * episodes)
                for left, generations in _halvings(ways, self.steps)
            )

        met, compared = _MET * episodes, 2 * _COMPARED * episodes
        before = self.ways * _BEFORE * played if self.steps else 0
        begun = ranked(self.starts, _COMPARED) + met + halved(self.ways) + compared
        changed = ranked(_NEIGHBOURS, _RANKED) + halved(_SHAPES)
        if self.steps:
            changed = self.steps * step + met
        moved_on = self.generations * moved(_CAREFUL)
        turn = met + changed + moved_on + 2 * compared
        begun = begun if self.starts > 1 else 0
        pruned = self.pruned * (met + ranked(_LEFT_OUT, _COMPARED))
        pruned += -(-self.pruned // _AT_A_TIME) * (met + _BETWEEN * moved(_CAREFUL) + compared)
        return _EXPERT * episodes + before + begun + pruned + turns * turn

    def seeds(self, turns: int) -> int:
        """Most seeds of them: all that are compared play the same episodes."""
        played = _DEVIATED + _FOLLOWED
        step = played + _PROPOSED[-1]

        def halved(ways: int) -> int:
            each = step if self.steps else 1
            return sum(
                left * generations * each + _RANKED
                for left, generations in _halvings(ways, self.steps)
            )

        before = self.ways * _BEFORE * played if self.steps else 0
        begun = _COMPARED + _MET + halved(self.ways) + _COMPARED
        changed = self.steps * step + _MET if self.steps else _RANKED + halved(_SHAPES)
        turn = _MET + changed + _COMPARED + self.generations * _CAREFUL + _COMPARED
        begun = begun if self.starts > 1 else 0
        pruned = self.pruned * (_MET + _COMPARED)
        pruned += -(-self.pruned // _AT_A_TIME) * (_MET + _BETWEEN * _CAREFUL + _COMPARED)
        return self.episodes * (_EXPERT + before + begun + pruned + turns * turn)


Way: TypeAlias = Movement | PolicyImprovement


class Refinement:
    """A search around one rule set."""

    def __init__(
        self,
        starts: Sequence[Sequence[PolicyTree]],
        pairs: Demonstrations,
        evaluator: Evaluator,
        *,
        expert: Agent,
        combined: Sequence[Pair] = (),
        max_rules: int,
        effort: SearchEffort,
        first: int,
        seed: int = 0,
        jobs: int = 1,
        executor: Executor | None = None,
    ) -> None:
        """Begin a search.

        Args:
            starts: Where it may begin, each one tree an action dimension; every leaf is a rule.
                Of those that achieve most, the one that achieves most when its thresholds were
                moved is where it does begin.
            pairs: What trees are counted over where no others are known.
            evaluator: How candidates are tried.
            expert: Who is asked about the states that they lead to.
            combined: Pairs of features of which new queries may ask about combinations.
            max_rules: Most leaves of each tree.
            effort: How much is tried; of these starts, and the rules of a single one that are too
                many, however many it says.
            first: Seed of the first episode.
            seed: Another one gives another way.
            jobs: Processes; changes the speed, never the result.
            executor: Whose processes they are; this machine's where not given.
        """
        self._starts = [Candidate.of_trees(trees) for trees in starts]
        # What it began with, and its index among those it might have.
        self.begun, self.start = 0, self._starts[0]
        self.here = self.start
        self._way: Movement | None = None  # that led here
        self._step = FIRST_STEP  # how wide its steps were in the end
        self._pairs = pairs
        self._dimensions = label_dimensions(pairs, evaluator.divider)
        self._progress: Progress | None = None
        self._done = self._total = 0
        self._evaluator, self._expert = evaluator, expert
        self._combined, self._max_rules = combined, max_rules
        beyond = self.here.beyond(max_rules) if len(starts) == 1 else 0
        self._effort = replace(effort, starts=len(starts), pruned=beyond)
        self.is_pruned = beyond > 0  # whether it leaves out some of those that it begins with
        self._improvement: PolicyImprovement | None = None  # that led here
        self._next, self._generator = first, np.random.default_rng(seed)
        self._workers = executor_of(jobs, executor)

    def run(
        self,
        turns: int,
        *,
        progress: Progress | None = None,
        better: Callable[[Candidate], None] | None = None,
    ) -> list[Candidate]:
        """Search.

        Args:
            turns: How often the shape is changed, and thresholds are moved.
            progress: Called with (episodes done, in all); returning False stops.
            better: Called with the best of all starts, and then with whatever achieved more than
                what was there before, in the same episodes; so that something is there when the
                way is not gone to its end.

        Returns:
            What it began with, as it was and when it was moved, and what was best after each
            turn, no two of them alike. Which is best of all is not known: choose by episodes.

        Raises:
            WorkError: If a process ended in the middle of its work.
            CancelledError: If `progress` returned False.
        """
        self._progress, self._total = progress, self._effort.cost(turns)
        self._better = better or (lambda _: None)
        self._begin()
        planned = replace(self._effort, starts=1)
        begun = self._done - planned.cost(0)
        marks = [self.start, self.here]
        for turn in range(1, turns + 1):
            self._turn()
            # Some had fewer neighbours.
            self._tell(begun + planned.cost(turn) - self._done)
            marks.append(self.here)
        different: dict[tuple[object, ...], Candidate] = {}
        for one in marks:
            different.setdefault(one.key, one)
        return list(different.values())

    def _begin(self) -> None:
        """Begin with what achieves most when it is moved."""
        self._evaluator = replace(self._evaluator, max_steps=self._patience())
        if len(self._starts) == 1:
            if self.is_pruned:
                self._prune()
            self._better(self.here)
            if self._effort.steps:
                self._improvement = self._improving(self.start)
            self._tell(self._effort.cost(0) - self._done)  # a rule less may have been several
            return
        ranking = self._ranking(self._starts, self._pairs, _COMPARED)
        self._begin_with(ranking[0])
        self._better(self.start)
        met = self._met()
        best = ranking[: self._effort.ways]
        begun = [self._starts[index] for index in best]
        ways: Sequence[Way] = (
            [self._improving(start) for start in begun]
            if self._effort.steps
            else [self._movement(start, met) for start in begun]
        )
        place = self._halved(ways, met)
        way = ways[place]
        if self._is_as_good(way.here, self.start, met):
            self._begin_with(best[place])
            self._go_on(way)
        elif isinstance(way, PolicyImprovement):
            self._improvement = way  # what it has learned serves on
        self._tell(self._effort.cost(0) - self._done)

    def _begin_with(self, index: int) -> None:
        self.begun, self.start = index, self._starts[index]
        self.here = self.start

    def _go_on(self, way: Way) -> None:
        """From where a way has come to."""
        self.here = way.here
        if isinstance(way, Movement):
            self._way, self._step = way, way.step
        else:
            self._way, self._improvement = None, way
        self._better(self.here)

    def _prune(self) -> None:
        """Leave rules out, one after the other, until there are no more than there may be."""
        self._step = _NEAR
        pruned = 0
        while self.here.beyond(self._max_rules):
            met = self._met()
            trees = self._counted(met)
            tried = with_a_rule_less(trees, met.pairs, max_rules=self._max_rules, count=_LEFT_OUT)
            self.here = tried[self._ranking(tried, met.pairs, _COMPARED)[0]]
            pruned += 1
            fits = not self.here.beyond(self._max_rules)
            if fits:
                self._better(self.here)
            if fits or pruned % _AT_A_TIME == 0:
                self._move_after_pruning()
        self.start = self.here

    def _move_after_pruning(self) -> None:
        met = self._met()
        way = self._movement(self.here, met)
        self._move(way, _BETWEEN, met, times=_CAREFUL)
        self._step = way.step
        if self._is_as_good(way.here, self.here, met):
            self.here = way.here

    def _patience(self) -> int:
        """Steps after which an episode of the search is left.

        Rules that never come to an end would cost most of the time, and what they do so long is
        not what the expert does.
        """
        played = self._play(self._expert, None, _EXPERT)
        long = math.ceil(_PATIENCE * float(np.quantile(played.lengths, _LONG)))
        return min(long, self._evaluator.max_steps or MAX_STEPS)

    def _turn(self) -> None:
        """Change the shape, if that is better, and move the thresholds, if that is."""
        met = self._met()
        ways: Sequence[Way]
        if self._effort.steps:
            ways = [self._improved_further(met)]
        else:
            ways = [self._movement(shape, met) for shape in self._shapes(met)]
        if ways:
            changed = ways[self._halved(ways, met)]
            is_other = changed.here is not self.here
            if is_other and self._is_as_good(changed.here, self.here, met):
                self._go_on(changed)
                met = self._met() if self._effort.steps else met
        # What it has learned of the way serves on.
        way = self._way or self._movement(self.here, met)
        self._move(way, self._effort.generations, met, times=_CAREFUL)
        if self._is_as_good(way.here, self.here, met):
            self._go_on(way)
        else:  # it was led astray
            self._way, self._step = None, way.step

    def _improved_further(self, met: MetStates) -> PolicyImprovement:
        """Changed by what the episodes say, from here."""
        way = self._improvement
        assert way is not None
        way.here = self.here
        self._advance(way, self._effort.steps, met)
        return way

    def _halved(self, ways: Sequence[Way], met: MetStates) -> int:
        """Move all a little, the better half on, and so forth; the place of the one that is left.

        What achieves most before it is moved need not be what achieves most then. One alone is
        not moved here: there is nothing to choose.
        """
        left: Sequence[int] = range(len(ways))
        for _, generations in _halvings(len(ways), self._effort.steps):
            for place in left:
                self._advance(ways[place], generations, met)
            moved = [ways[place].here for place in left]
            ranking = self._ranking(moved, met.pairs, _RANKED, first=_RANKED)
            left = [left[rank] for rank in ranking[: (len(left) + 1) // 2]]
        return left[0]

    def _is_as_good(self, moved: Candidate, there: Candidate, met: MetStates) -> bool:
        """Whether what was moved achieves as much in all episodes of a comparison.

        Of two that never fail the one that was moved is further from where it would.
        """
        both = [moved, there]
        return not self._ranking(both, met.pairs, _COMPARED, first=_COMPARED)[0]

    def _met(self, way: PolicyImprovement | None = None) -> MetStates:
        """Where the rules lead now, and what the expert says there.

        Args:
            way: Whose rules they are, and who learns from these episodes; of here where None.
        """
        here = self.here if way is None else way.here
        played = self._play(
            self._evaluator.agent, self._shield(here), _MET if way is None else _FOLLOWED
        )
        if way is not None:
            way.add(played)
        table = played.steps
        assert table is not None
        wanted = ask(self._expert, table.observation, table.episode)
        queried = here.derived
        rows = with_values(table.observation, queried)
        if not len(rows):  # nothing of what it asks about has a value where it leads
            demonstrated = self._pairs.deriving(queried)
            return MetStates(demonstrated, scores(self._expert, demonstrated.raw_observations))
        if len(rows) > _MET_STATES:
            rows = np.sort(self._generator.choice(rows, _MET_STATES, replace=False))
        pairs = answered(
            self._evaluator.env_id,
            self._expert,
            table.observation[rows],
            wanted[rows],
            table.episode[rows],
            table.step[rows],
        )
        # Where the space has no bounds, what was shown is divided; labels stay what they are.
        pairs = replace(
            pairs,
            action_low=self._pairs.action_low,
            action_high=self._pairs.action_high,
            bounds_from=self._pairs.bounds_from,
        )
        offered = [DerivedFeature(one) for one in candidates(pairs, self._some_pairs())]
        # What the trees ask about stands first, where they look for it.
        pairs = pairs.deriving(list(dict.fromkeys([*here.derived, *offered])))
        return MetStates(pairs, scores(self._expert, pairs.raw_observations))

    def _counted(self, met: MetStates) -> list[PolicyTree]:
        """The trees of here, over all that may be asked about."""
        return [
            count_tree(structure, met.pairs, index, divider=self._evaluator.divider)
            for index, structure in enumerate(self.here.structures)
        ]

    def _some_pairs(self) -> list[Pair]:
        """Pairs of features that the next queries may combine."""
        if len(self._combined) <= _PAIRS:
            return list(self._combined)
        chosen = self._generator.choice(len(self._combined), _PAIRS, replace=False)
        return [self._combined[place] for place in np.sort(chosen).tolist()]

    def _shapes(self, met: MetStates) -> list[Candidate]:
        """The likeliest neighbours in shape."""
        others = neighbours(
            self._counted(met),
            met,
            max_rules=self._max_rules,
            count=_NEIGHBOURS,
            generator=self._generator,
        )
        if not others:
            return []
        return [others[one] for one in self._ranking(others, met.pairs, _RANKED)[:_SHAPES]]

    def _ranking(
        self, tried: Sequence[Candidate], pairs: Demonstrations, times: int, *, first: int = 1
    ) -> Sequence[int]:
        """Candidates by what they achieve in so many times the episodes, the best first.

        The worse half is left after `first` times as many; of equals, the first is first.
        """
        episodes = self._effort.episodes
        return self._selection(tried, pairs, first=first * episodes, most=times * episodes).ranking

    def _selection(
        self, tried: Sequence[Candidate], pairs: Demonstrations, *, first: int, most: int
    ) -> Selection:
        """What candidates achieve in the same episodes, of which the worse half plays fewer."""

        def achieved(left: Sequence[int], seed: int, count: int) -> list[NDArray[np.float64]]:
            return self._scores([tried[place] for place in left], pairs, seed=seed, episodes=count)

        return successive_halving(
            len(tried), achieved, seed=self._take(most), first=first, most=most
        )

    def _movement(self, candidate: Candidate, met: MetStates) -> Movement:
        pairs = met.pairs.deriving(candidate.derived)
        trees = candidate.trees(pairs, self._evaluator.divider)
        # Wide steps away from what was moved to where it is good lead astray.
        seed = int(self._generator.integers(2**31))
        return Movement(trees, pairs, step=self._step, seed=seed)

    def _improving(self, here: Candidate) -> PolicyImprovement:
        """A way that begins here, and knows a little."""
        seed = int(self._generator.integers(2**31))
        way = PolicyImprovement(
            here,
            self._dimensions,
            observed=len(self._pairs.observed),
            max_rules=self._max_rules,
            worth=self._evaluator.worth,
            seed=seed,
        )
        for _ in range(_BEFORE):
            self._deviate(way)
            self._met(way)
        return way

    def _shield(self, candidate: Candidate) -> Shield:
        rules = leaf_rules(candidate.trees(self._pairs, self._evaluator.divider))
        return Shield(rules, projection=self._evaluator.projection)

    def _advance(self, way: Way, times: int, met: MetStates) -> None:
        """Go so many steps, or generations, of a way."""
        if isinstance(way, Movement):
            self._move(way, times, met)
            return
        for _ in range(times):
            self._deviate(way)
            met = self._met(way)
            tried = [way.here, *way.proposals(met.pairs)]
            if len(tried) > 1:
                first, most = _PROPOSED
                way.here = tried[self._ranking(tried, met.pairs, most, first=first)[0]]

    def _deviate(self, way: PolicyImprovement) -> None:
        """Show it what single other actions bring."""
        env_id = self._evaluator.env_id
        ready = check_environment(env_id, self._shield(way.here))
        assert ready.shield is not None
        agent = DeviatingAgent(ready.shield, self._dimensions, ready.adapter)
        way.add(self._play(agent, None, _DEVIATED))

    def _move(
        self, movement: Movement, generations: int, met: MetStates, *, times: int = 1
    ) -> None:
        """Move thresholds in the direction that brings more."""
        episodes = times * self._effort.episodes
        for _ in range(generations if movement.count else 0):
            tried = movement.ask()
            selection = self._selection(
                tried, met.pairs, first=self._effort.sooner(episodes), most=episodes
            )
            movement.tell(selection.places())

    def _scores(
        self, tried: Sequence[Candidate], pairs: Demonstrations, *, seed: int, episodes: int
    ) -> list[NDArray[np.float64]]:
        """What each candidate achieves in the same episodes."""
        before = self._done
        return self._evaluator.scores(
            tried,
            pairs,
            seed=seed,
            episodes=episodes,
            workers=self._workers,
            progress=lambda done, _: self._tell(before + done * episodes - self._done),
        )

    def _play(self, agent: Agent, shield: Shield | None, times: int) -> Episodes:
        """So many times the episodes of an agent, with every step."""
        before, episodes = self._done, times * self._effort.episodes
        return rollout(
            self._evaluator.env_id,
            agent,
            shield=shield,
            episodes=episodes,
            seed=self._take(episodes),
            keep_steps=True,
            max_steps=self._evaluator.max_steps,
            executor=self._workers,
            progress=lambda done, _: self._tell(before + done - self._done),
        )

    def _take(self, episodes: int) -> int:
        """Seed of episodes that are used for nothing else."""
        self._next += episodes
        return self._next - episodes

    def _tell(self, episodes: int) -> None:
        self._done += episodes
        report(self._progress, self._done, self._total)
