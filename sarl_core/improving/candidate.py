"""Rules on trial in a search: the trees as they are moved, and what episodes say of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, EpisodicAgent, PlacedAgent
from sarl_core.agents.spaces import Actions, SpaceAdapter
from sarl_core.demonstrations.dataset import Demonstrations, derived_features
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.mining.budgeted_trees import leaf_rules, without_idle_queries
from sarl_core.mining.combining.queries import over_queried
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.tree import LEAF, PolicyTree
from sarl_core.processes import run_each, workers_of
from sarl_core.progress import Progress, report
from sarl_core.rollouts.choices import weighed
from sarl_core.rollouts.episodes import LOST, run_seeds
from sarl_core.rollouts.player import check_environment, shield_for
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

_FEW = 2_000  # rows that tell a shield nothing but that its rules exist
_ABREAST = 32  # episodes: more brings nothing


@dataclass(frozen=True)
class Candidate:
    """Trees to try.

    Attributes:
        structures: One an action dimension, with labels; none has an idle query.
        derived: What they ask about that is not observed.
    """

    structures: tuple[TreeStructure, ...]
    derived: tuple[DerivedFeature, ...]

    @classmethod
    def of(
        cls,
        structures: Sequence[TreeStructure],
        derived: Sequence[DerivedFeature],
        *,
        observed: int,
    ) -> Candidate:
        """Trees that have just been changed.

        Args:
            structures: Over d observed and k derived features, with labels.
            derived: The k.
            observed: Number d.

        Returns:
            The same without queries that change nothing and combinations that nothing asks about.
        """
        tidy = [without_idle_queries(structure) for structure in structures]
        used, definitions = over_queried(tidy, derived, observed=observed)
        return cls(tuple(used), definitions)

    @classmethod
    def of_trees(cls, trees: Sequence[PolicyTree]) -> Candidate:
        """The queries and labels of trees."""
        features = trees[0].source.features
        derived = derived_features(features)
        return cls.of(
            [structure_of(tree) for tree in trees], derived, observed=len(features) - len(derived)
        )

    @property
    def asks(self) -> bool:
        """Whether what it says depends on the state."""
        return any(len(one.feature) > 1 for one in self.structures)

    def beyond(self, max_rules: int) -> int:
        """How many leaves there are too many, over all trees of at most so many."""
        leaves = [int((one.feature == LEAF).sum()) for one in self.structures]
        return sum(max(count - max_rules, 0) for count in leaves)

    @property
    def key(self) -> tuple[object, ...]:
        """What it has in common with those that act alike, node for node."""
        return (
            self.derived,
            *(
                np.asarray(values).tobytes()
                for one in self.structures
                # What is said at queries is never heard, and leaves ask nothing.
                for values in (
                    one.feature,
                    np.where(one.feature == LEAF, 0.0, one.threshold),
                    np.where(one.feature == LEAF, np.asarray(one.label), LEAF),
                )
            ),
        )

    def trees(self, pairs: Demonstrations, divider: int) -> tuple[PolicyTree, ...]:
        """The trees with what these pairs say of them."""
        known = pairs if pairs.derived == self.derived else pairs.deriving(self.derived)
        return tuple(
            count_tree(structure, known, index, divider=divider)
            for index, structure in enumerate(self.structures)
        )


def structure_of(tree: PolicyTree) -> TreeStructure:
    """A tree without what was counted."""
    return TreeStructure(
        tree.feature, tree.threshold, tree.children_left, tree.children_right, tree.label
    )


@dataclass(frozen=True)
class Evaluator:
    """How candidates are tried.

    Attributes:
        env_id: The environment.
        agent: Who is shielded.
        projection: How the shield replaces a continuous action.
        divider: Number of intervals of continuous dimensions.
        worth: Of a failure where two are compared, in units of the return.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.
    """

    env_id: EnvironmentOrId
    agent: Agent
    projection: Projection
    divider: int
    worth: float
    max_steps: int | None

    def scores(
        self,
        candidates: Sequence[Candidate],
        pairs: Demonstrations,
        *,
        seed: int,
        episodes: int,
        workers: Executor | None,
        progress: Progress | None = None,
    ) -> list[NDArray[np.float64]]:
        """What each candidate achieves.

        Args:
            candidates: K of them.
            pairs: That rules can be counted over.
            seed: Of the first episode, the same for all.
            episodes: For each, E.
            workers: Who runs them.
            progress: Called with (candidates done, in all); returning False stops.

        Returns:
            K times (E,), as `choices.weighed` gives them.

        Raises:
            WorkError: If a process ended in the middle of its work.
            CancelledError: If `progress` returned False.
        """
        few = _first_of(pairs, _FEW)
        many = 1 if workers is None else workers_of(workers)
        groups = _groups(candidates, episodes, many)
        tasks = [(self, group, few, seed, episodes) for group in groups]
        done = 0

        def finished(count: int = 1) -> None:
            nonlocal done
            done += count
            report(progress, min(done // episodes, len(candidates)), len(candidates))

        finished(0)
        if workers is None:
            results = [episode_scores(*task, finished=finished) for task in tasks]
        else:
            results = run_each(
                episode_scores,
                tasks,
                lost=LOST,
                executor=workers,
                progress=lambda ended, _: finished(sum(map(len, groups[:ended])) * episodes - done),
            )
        return [scores for result in results for scores in result]


class ShieldedAgent:
    """An agent whose actions one of several shields checks, depending on the episode.

    A step of many environments costs little more than one of few, so that several rule sets are
    sooner tried side by side. Each decides as it would alone.
    """

    def __init__(
        self, agent: Agent, shields: Sequence[Shield], episodes: int, adapter: SpaceAdapter
    ) -> None:
        """Begin.

        Args:
            agent: Who is shielded; not an `EpisodicAgent`.
            shields: K of them, for the environment as it is.
            episodes: For each, E; the first shield checks the first E episodes, and so on.
            adapter: Of the environment.
        """
        self.name, self.n_uniforms = agent.name, agent.n_uniforms
        self._agent, self._shields, self._episodes = agent, shields, episodes
        self._adapter = adapter
        # To ask what the agent is at every step takes a part of its time.
        self._placed = agent if isinstance(agent, PlacedAgent) else None
        self._checking: list[Shield] = []

    def place(self, episodes: NDArray[np.int64], steps: NDArray[np.int64]) -> None:
        """Say where the states lie that it is asked about next.

        Args:
            episodes: Index of the episode of each, (B,).
            steps: Steps of the episode so far, (B,).
        """
        self._checking = [self._shields[one] for one in (episodes // self._episodes).tolist()]
        if self._placed is not None:
            self._placed.place(episodes % self._episodes, steps)

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """Choose actions, and replace those that break a rule.

        Args:
            observations: Shape (B, d), float32.
            uniforms: As the agent needs them.

        Returns:
            Actions with one column a dimension.
        """
        proposed = self._agent.act(observations, uniforms)
        actions = self._adapter.shaped(proposed)
        executed: Any = np.array(
            [
                shield.decision_fields(state, action)[0]
                for shield, state, action in zip(self._checking, observations, actions, strict=True)
            ]
        )
        return self._adapter.columns(executed)


def episode_scores(
    evaluator: Evaluator,
    candidates: Sequence[Candidate],
    few: Demonstrations,
    seed: int,
    episodes: int,
    *,
    finished: Callable[[], None] | None = None,
) -> list[NDArray[np.float64]]:
    """What each candidate achieves, K times (E,).

    Args:
        evaluator: How they are tried.
        candidates: K times the trees.
        few: Pairs that rules can be counted over.
        seed: Of the first episode, the same for all.
        episodes: How many for each, E.
        finished: Called after every episode; may raise to stop.
    """
    shields = [
        Shield(leaf_rules(candidate.trees(few, evaluator.divider)), projection=evaluator.projection)
        for candidate in candidates
    ]
    seeds = np.arange(seed, seed + episodes, dtype=np.int64)
    run = partial(
        run_seeds,
        evaluator.env_id,
        keep_steps=False,
        max_steps=evaluator.max_steps,
        finished=finished,
    )
    adapter = check_environment(evaluator.env_id, None).adapter
    if len(shields) == 1 or not _go_abreast(evaluator.agent, adapter):
        return [weighed(run(evaluator.agent, shield, seeds), evaluator.worth) for shield in shields]
    fitted = [shield_for(evaluator.env_id, shield) for shield in shields]
    abreast = ShieldedAgent(evaluator.agent, fitted, episodes, adapter)
    played = run(abreast, None, np.tile(seeds, len(shields)), batch=_ABREAST)
    return np.split(weighed(played, evaluator.worth), len(shields))


def _groups(candidates: Sequence[Candidate], episodes: int, workers: int) -> list[list[Candidate]]:
    """Those that are tried together, so that all workers have about as much to do."""
    abreast = max(_ABREAST // episodes, 1)
    rounds = -(-len(candidates) // (workers * abreast))
    groups = min(len(candidates), workers * rounds)
    places = np.array_split(np.arange(len(candidates)), groups) if groups else []
    return [[candidates[place] for place in group] for group in places]


def _go_abreast(agent: Agent, adapter: SpaceAdapter) -> bool:
    """Whether several shields are sooner asked about a row each than one about many."""
    if isinstance(agent, EpisodicAgent):  # it plays one episode after the other
        return False
    one_label = adapter.is_discrete and adapter.action_shape == ()
    return one_label or adapter.action_space.dtype == np.float32


def _first_of(pairs: Demonstrations, most: int) -> Demonstrations:
    """The first pairs, whole episodes, at least `most` of them where there are as many."""
    ends = np.cumsum(pairs.episode_lengths)
    return pairs.select(np.arange(1 + int(np.searchsorted(ends, min(most, len(pairs))))))
