"""Rules changed by what their own episodes say, in small steps.

In each step critics say what every label is worth in the states that the rules lead to, and all
queries are chosen anew by that. What they say holds only as long as the rules lead there, so
another label has its price: only where it is worth most is anything changed. Several critics and
prices give several trees; which of them achieves most, if any, episodes say (conservative policy
iteration, Kakade and Langford 2002).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.spaces import Actions, SpaceAdapter
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import Extension
from sarl_core.improving.alternation import (
    ScoredStates,
    achieved,
    alternated,
    without_query,
)
from sarl_core.improving.candidate import Candidate
from sarl_core.improving.critic import Critic, Experience, Horizon
from sarl_core.mining.budgeted_trees import without_idle_queries
from sarl_core.mining.growing.structure import TreeStructure
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.tree import LEAF
from sarl_core.rollouts.choices import weighed
from sarl_core.rollouts.episodes import Episodes
from sarl_core.shielding.shield import Shield

_HORIZONS = (Horizon(0.99, 0.0), Horizon(0.99, 0.9), Horizon(0.995, 0.97))
_SHARES = (0.02, 0.06, 0.15)  # of the states, in which another label may be worth its price
_DEVIATING = 0.15  # of the actions
_MOST_STEPS = 150_000  # of which the latest are learned from
_FIRST_BATCHES, _BATCHES = 1_600, 300

MOST_PROPOSALS = 2 * len(_HORIZONS) * len(_SHARES)


class DeviatingAgent:
    """Does what rules say, but for single actions at random."""

    name = "deviating"

    def __init__(
        self, shield: Shield, dimensions: Sequence[LabelledDimension], adapter: SpaceAdapter
    ) -> None:
        """Begin.

        Args:
            shield: Whose rules say something everywhere, for the environment as it is.
            dimensions: Of its actions, m.
            adapter: Of the environment.
        """
        self._shield, self._adapter = shield, adapter
        self._actions = [
            np.array(
                [one.centre(label) for label in range(one.n_labels)]
                if one.is_interval
                else one.actions
            )
            for one in dimensions
        ]
        # What is proposed, whether it is done all the same, and in which dimension.
        self.n_uniforms = len(dimensions) + 2

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """Choose actions.

        Args:
            observations: Shape (B, d), float32.
            uniforms: Shape (B, m + 2).

        Returns:
            Actions with one column a dimension.
        """
        assert uniforms is not None
        kind = self._adapter.action_space.dtype
        random = np.column_stack(
            [
                values[(uniforms[:, index] * len(values)).astype(np.int64)]
                for index, values in enumerate(self._actions)
            ]
        ).astype(kind)
        decided = self._shield.decide_batch(observations, self._adapter.shaped(random))
        columns: Any = np.array(self._adapter.columns(decided.executed))
        deviates = np.flatnonzero(uniforms[:, -2] < _DEVIATING)
        where = (uniforms[deviates, -1] * len(self._actions)).astype(np.int64)
        columns[deviates, where] = random[deviates, where]
        chosen: Actions = columns
        return chosen


class PolicyImprovement:
    """A way from rules to better ones.

    Attributes:
        here: Where it has come to.
    """

    def __init__(
        self,
        here: Candidate,
        dimensions: Sequence[LabelledDimension],
        *,
        observed: int,
        max_rules: int,
        worth: float,
        seed: int,
    ) -> None:
        """Begin.

        Args:
            here: Where.
            dimensions: Of the actions.
            observed: Number of features that are observed.
            max_rules: Most leaves of each tree.
            worth: Of a failure, in units of the return.
            seed: Another one gives another way.
        """
        self.here = here
        self._dimensions, self._observed = tuple(dimensions), observed
        self._max_rules, self._worth = max_rules, worth
        self._generator = np.random.default_rng(seed)
        labels = [one.n_labels for one in dimensions]
        self._critics = [
            Critic(labels, horizon, seed=int(self._generator.integers(2**31)))
            for horizon in _HORIZONS
        ]
        self._parts: list[Experience] = []
        self._batches = _FIRST_BATCHES

    def add(self, played: Episodes) -> None:
        """Take up episodes with every step."""
        table = played.steps
        assert table is not None
        last = np.append(table.episode[1:] != table.episode[:-1], True)
        rewards = table.reward.copy()
        rewards[last] += weighed(played, self._worth) - played.returns
        labels = [
            one.labels_of(column)
            for one, column in zip(self._dimensions, table.executed.T, strict=True)
        ]
        self._parts.append(
            Experience(
                table.observation,
                np.column_stack(labels),
                rewards,
                last=last,
                open=last & (played.truncated & ~played.terminated)[table.episode],
            )
        )
        # The last two stay, however long they are: only where actions deviate it is seen what
        # another label brings.
        while sum(map(len, self._parts)) > _MOST_STEPS and len(self._parts) > 2:
            del self._parts[0]

    def proposals(self, pairs: Demonstrations) -> list[Candidate]:
        """Learn from all episodes, and change the rules by that.

        Args:
            pairs: States that the rules lead to, with what they derive first and then what else
                may be asked about.

        Returns:
            Up to `MOST_PROPOSALS` trees, no two of which say the same in all these states.
        """
        from threadpoolctl import threadpool_limits

        # Small products: a second thread costs more than it brings, and may round otherwise.
        with threadpool_limits(1):
            self._learn()
            valued = [critic.values(pairs.raw_observations) for critic in self._critics]
        states = pairs.observations
        said = _said(self.here.structures, states)
        result, known = [], {said.tobytes()}
        for values in valued:
            for share in _SHARES:
                priced = [
                    ScoredStates(states, _priced(value, labels, share))
                    for value, labels in zip(values, said.T, strict=True)
                ]
                for structures in (self._changed(priced), self._with_room(priced)):
                    answers = _said(structures, states).tobytes()
                    asks = any(len(one.feature) > 1 for one in structures)
                    if asks and answers not in known:
                        known.add(answers)
                        result.append(
                            Candidate.of(structures, pairs.derived, observed=self._observed)
                        )
        return result

    def _learn(self) -> None:
        experience = Experience.join(self._parts)
        extension = Extension(self._observed, [one.definition for one in self.here.derived])
        said = _said(self.here.structures, extension.many(experience.observations))
        for critic in self._critics:
            critic.learn(experience, said, self._batches)
        self._batches = _BATCHES

    def _changed(self, priced: Sequence[ScoredStates]) -> list[TreeStructure]:
        """Every tree chosen anew."""
        return [
            alternated(structure, states, max_rules=self._max_rules)
            for structure, states in zip(self.here.structures, priced, strict=True)
        ]

    def _with_room(self, priced: Sequence[ScoredStates]) -> list[TreeStructure]:
        """One tree chosen anew without the query that it needs least."""
        structures = list(self.here.structures)
        asking = [place for place, one in enumerate(structures) if len(one.feature) > 1]
        if not asking:
            return structures
        place = int(self._generator.choice(asking))
        structure, states = structures[place], priced[place]
        fewer = [
            without_query(structure, node, int(child))
            for node in np.flatnonzero(structure.feature != LEAF).tolist()
            for child in (structure.children_left[node], structure.children_right[node])
        ]
        least = max(fewer, key=lambda one: achieved(one, states))
        structures[place] = alternated(
            without_idle_queries(least), states, max_rules=self._max_rules
        )
        return structures


def _said(structures: Sequence[TreeStructure], states: NDArray[np.float32]) -> NDArray[np.int64]:
    """What the trees say, (N, m)."""
    return np.column_stack([np.asarray(one.label)[one.apply(states)] for one in structures])


def _priced(
    values: NDArray[np.float64], said: NDArray[np.int64], share: float
) -> NDArray[np.float64]:
    """How much more each label is worth than what is said, less the price of another, (N, labels).

    The price is what no other label is worth in all but this share of the states.
    """
    rows = np.arange(len(values))
    more: NDArray[np.float64] = values - values[rows, said][:, None]
    more -= np.quantile(more.max(axis=1), 1.0 - share)
    more[rows, said] = 0.0
    return more
