"""Making a few rules achieve more: their shape, then their thresholds, in turns.

A tree that imitates its expert is not yet the best tree of its size. First its neighbours in shape
are tried, of which the best stays; then thresholds, ratios and intervals are moved; and so on.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor

import numpy as np

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.improving.candidate import Candidate, Trial
from sarl_core.improving.movement import POPULATION, Parameters, evolution_strategy, ranks
from sarl_core.improving.questions import answered, ask, scores
from sarl_core.improving.shapes import MetStates, neighbours
from sarl_core.improving.successive_halving import planned_episodes, successive_halving
from sarl_core.mining.budgeted_trees import leaf_rules
from sarl_core.mining.combining.candidates import Pair, candidates
from sarl_core.mining.tree import PolicyTree, count_tree
from sarl_core.processes import executor_of
from sarl_core.progress import Progress, report
from sarl_core.rollouts.choices import mean_score
from sarl_core.rollouts.episodes import rollout
from sarl_core.shielding.shield import Shield

GENERATIONS = 10  # between two changes of the shape
EPISODES = 16  # for each neighbour, the same for all of a generation
MET_EPISODES = 32  # in which it is seen where the rules lead
NEIGHBOURS = 63  # in shape
SHAPE_EPISODES = 128  # for the best of them

_MET_STATES = 10_000
_PAIRS = 20  # of features that new queries may combine, others each time


def refinement_cost(generations: int) -> int:
    """Most episodes of a refinement."""
    turns = -(-generations // GENERATIONS)
    shape = MET_EPISODES + planned_episodes(NEIGHBOURS + 1, EPISODES, SHAPE_EPISODES)
    return turns * shape + generations * POPULATION * EPISODES


def refinement_seeds(generations: int) -> int:
    """Most seeds of a refinement: all that are compared play the same episodes."""
    turns = -(-generations // GENERATIONS)
    return turns * (MET_EPISODES + SHAPE_EPISODES) + generations * EPISODES


class Refinement:
    """A search around one rule set."""

    def __init__(
        self,
        trees: Sequence[PolicyTree],
        pairs: Demonstrations,
        trial: Trial,
        *,
        expert: Agent,
        combined: Sequence[Pair] = (),
        max_rules: int,
        first: int,
        seed: int = 0,
        jobs: int = 1,
        executor: Executor | None = None,
    ) -> None:
        """Begin a search.

        Args:
            trees: Where it begins, one an action dimension; every leaf is a rule.
            pairs: What they were grown from.
            trial: How candidates are tried.
            expert: Who is asked about the states that they lead to.
            combined: Pairs of features of which new queries may ask about combinations.
            max_rules: Most leaves of each tree.
            first: Seed of the first episode.
            seed: Another one gives another way.
            jobs: Processes; changes the speed, never the result.
            executor: Whose processes they are; this machine's where not given.
        """
        self.here = Candidate.of_trees(trees)
        self._start = pairs
        self._trial, self._expert = trial, expert
        self._combined, self._max_rules = combined, max_rules
        self._next, self._generator = first, np.random.default_rng(seed)
        self._workers = executor_of(jobs, executor)

    def run(
        self,
        generations: int,
        *,
        progress: Progress | None = None,
        better: Callable[[Candidate], None] | None = None,
    ) -> list[Candidate]:
        """Search.

        Args:
            generations: In how many steps thresholds are moved, in all.
            progress: Called with (episodes done, in all); returning False stops.
            better: Called with where the search has come to whenever the neighbours there
                achieved more than those anywhere before, the start included; so that something
                is there when the way is not gone to its end.

        Returns:
            Where it stood after each turn of shape and thresholds. Which is best is not known:
            choose by episodes.

        Raises:
            WorkError: If a process ended in the middle of its work.
            CancelledError: If `progress` returned False.
        """
        total, done = refinement_cost(generations), 0
        most: tuple[float, ...] = ()
        marks = []
        for turn in range(0, generations, GENERATIONS):
            met = self._met()
            self._shape(met)
            done += refinement_cost(1) - POPULATION * EPISODES
            report(progress, done, total)
            pairs = met.pairs.deriving(self.here.derived)
            parameters = Parameters.of(self.here.trees(pairs, self._trial.divider), pairs)
            strategy = evolution_strategy(parameters.count, int(self._generator.integers(2**31)))
            for _ in range(min(GENERATIONS, generations - turn)):
                points = strategy.ask()
                moved = [parameters.candidate(point) for point in points]
                means = np.array([mean_score(one) for one in self._scores(moved, pairs)])
                if (mean := mean_score(means)) > most:
                    if most and better is not None:
                        better(self.here)
                    most = mean
                strategy.tell(points, -ranks(means))  # which follows the least
                self.here = parameters.candidate(strategy.mean)
                done += POPULATION * EPISODES
                report(progress, done, total)
            marks.append(self.here)
        return marks

    def _take(self, episodes: int) -> int:
        """Seed of episodes that are used for nothing else."""
        self._next += episodes
        return self._next - episodes

    def _scores(self, tried: Sequence[Candidate], pairs: Demonstrations) -> list[np.ndarray]:
        return self._trial.scores(
            tried, pairs, seed=self._take(EPISODES), episodes=EPISODES, workers=self._workers
        )

    def _met(self) -> MetStates:
        """Where the rules lead now, and what the expert says there."""
        seed = self._take(MET_EPISODES)
        rules = leaf_rules(self.here.trees(self._start, self._trial.divider))
        played = rollout(
            self._trial.env_id,
            self._trial.agent,
            shield=Shield(rules, projection=self._trial.projection),
            episodes=MET_EPISODES,
            seed=seed,
            keep_steps=True,
            max_steps=self._trial.max_steps,
            executor=self._workers,
        )
        table = played.steps
        assert table is not None
        wanted = ask(self._expert, table.observation, table.episode)
        rows = np.arange(len(table))
        if len(rows) > _MET_STATES:
            rows = np.sort(self._generator.choice(rows, _MET_STATES, replace=False))
        pairs = answered(
            self._trial.env_id,
            self._expert,
            table.observation[rows],
            wanted[rows],
            table.episode[rows],
            table.step[rows],
        )
        offered = [DerivedFeature(one) for one in candidates(pairs, self._some_pairs())]
        # What the trees ask about stands first, where they look for it.
        derived = dict.fromkeys([*self.here.derived, *offered])
        pairs = pairs.deriving(list(derived))
        return MetStates(pairs, scores(self._expert, pairs.raw_observations))

    def _some_pairs(self) -> list[Pair]:
        """Pairs of features that the next queries may combine."""
        if len(self._combined) <= _PAIRS:
            return list(self._combined)
        chosen = self._generator.choice(len(self._combined), _PAIRS, replace=False)
        return [self._combined[place] for place in np.sort(chosen).tolist()]

    def _shape(self, met: MetStates) -> None:
        """Go to the best of the neighbours in shape, if it is better."""
        trees = [
            count_tree(structure, met.pairs, index, divider=self._trial.divider)
            for index, structure in enumerate(self.here.structures)
        ]
        tried = [
            self.here,
            *neighbours(
                trees,
                met,
                max_rules=self._max_rules,
                count=NEIGHBOURS,
                generator=self._generator,
            ),
        ]
        first = self._take(SHAPE_EPISODES)
        chosen = successive_halving(
            len(tried),
            lambda left, seed, count: self._trial.scores(
                [tried[place] for place in left],
                met.pairs,
                seed=seed,
                episodes=count,
                workers=self._workers,
            ),
            seed=first,
            first=EPISODES,
            most=SHAPE_EPISODES,
        )
        self.here = tried[chosen.best]
