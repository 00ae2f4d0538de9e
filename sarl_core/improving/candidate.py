"""Rules on trial in a search: the trees as they are moved, and what episodes say of them."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import Demonstrations, derived_features
from sarl_core.demonstrations.derived import DerivedFeature
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.mining.budgeted_trees import leaf_rules, without_idle_queries
from sarl_core.mining.combining.queries import over_queried
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.tree import LEAF, PolicyTree
from sarl_core.processes import run_each
from sarl_core.progress import Progress
from sarl_core.rollouts.choices import weighed
from sarl_core.rollouts.episodes import LOST, rollout
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

_FEW = 2_000  # rows that tell a shield nothing but that its rules exist


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
        tasks = [(self, candidate, few, seed, episodes) for candidate in candidates]
        return run_each(episode_scores, tasks, lost=LOST, executor=workers, progress=progress)


def episode_scores(
    evaluator: Evaluator, candidate: Candidate, few: Demonstrations, seed: int, episodes: int
) -> NDArray[np.float64]:
    """What one candidate achieves, (E,).

    Args:
        evaluator: How it is tried.
        candidate: The trees.
        few: Pairs that rules can be counted over.
        seed: Of the first episode.
        episodes: How many.
    """
    rules = leaf_rules(candidate.trees(few, evaluator.divider))
    played = rollout(
        evaluator.env_id,
        evaluator.agent,
        shield=Shield(rules, projection=evaluator.projection),
        episodes=episodes,
        seed=seed,
        keep_steps=False,
        max_steps=evaluator.max_steps,
    )
    return weighed(played, evaluator.worth)


def _first_of(pairs: Demonstrations, most: int) -> Demonstrations:
    """The first pairs, whole episodes, at least `most` of them where there are as many."""
    ends = np.cumsum(pairs.episode_lengths)
    return pairs.select(np.arange(1 + int(np.searchsorted(ends, min(most, len(pairs))))))
