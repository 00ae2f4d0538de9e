"""What an expert says about states it is asked about, and how much each answer matters."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, EpisodicAgent, PolicyAgent
from sarl_core.agents.own import AgentFaultError
from sarl_core.agents.spaces import Actions
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.derived import DerivedFeature, Extension
from sarl_core.demonstrations.names import in_order_of
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.mining.combining.candidates import Pair
from sarl_core.mining.combining.choice import with_combinations
from sarl_core.rollouts.steps import StepTable

# More states of one round are too alike to be worth their time.
_PAIRS_A_ROUND = 25_000
# Rules learn from what was shown at first and from where the latest rules led: what earlier ones
# got into, the present ones may never meet.
_ROUNDS_USED = 12
# What imitates best is often not what acts best, above all of few rules: each round is offered
# another half of the pairs, and which were good ones is seen from how it does.
_FEWEST_HALVED = 4
# Of more, so many borders imitate well by chance that trees without combinations may do better, as
# those of the walker did (91 pairs): these are grown in every other round.
_MANY_PAIRS = 60
# A label with less than 2 % is one the expert does not want; how much less says nothing.
_LEAST_LOG_PROBABILITY = -4.0


def ask(expert: Agent, observations: NDArray[np.float32], episodes: NDArray[np.int64]) -> Actions:
    """What the expert would do.

    Args:
        expert: Deterministic.
        observations: Shape (B, d), float32.
        episodes: Of each state, (B,); equal ones stand together, in the order of the steps.

    Returns:
        Its actions with one column a dimension, (B, m).

    Raises:
        InputError: If it does not always do the same in the same state, or fails.
    """
    if expert.n_uniforms:
        raise InputError(
            f"the agent {expert.name!r} acts at random and cannot be asked what is right; "
            "name a trained policy as the expert"
        )
    if not isinstance(expert, EpisodicAgent):
        return expert.act(observations, None)
    answers: list[Actions] = []
    for rows in np.split(np.arange(len(episodes)), np.flatnonzero(np.diff(episodes)) + 1):
        expert.begin_episode(int(episodes[rows[0]]))
        try:
            answers.append(expert.act(observations[rows], None))
        except AgentFaultError as error:
            raise AgentFaultError(
                f"asked about the states of episode {episodes[rows[0]]}, {error}"
            ) from error
    return cast(Actions, np.concatenate(answers))


def scores(expert: Agent, observations: NDArray[np.float32]) -> NDArray[np.float64] | None:
    """How good the expert holds each label to be.

    Args:
        expert: An agent.
        observations: Shape (B, d), float32.

    Returns:
        For a policy with one discrete dimension the log-probabilities, bounded below, or the
        values of a greedy one relative to the best, (B, labels); None for any other.
    """
    if not isinstance(expert, PolicyAgent) or not expert.policy.is_discrete:
        return None
    if len(expert.policy.label_counts) != 1:
        return None
    if expert.policy.head == "greedy":
        values = expert.policy.outputs(observations).astype(np.float64)
        return np.asarray(values - values.max(axis=1, keepdims=True))
    return np.maximum(expert.policy.log_probabilities(observations), _LEAST_LOG_PROBABILITY)


def importance(label_scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """How much it matters what is done: the gap between the best and the worst label.

    Args:
        label_scores: As `scores` gives them, (B, labels).

    Returns:
        Shape (B,), with mean 1 where there is any gap at all.
    """
    gap = np.ptp(label_scores, axis=1)
    mean = float(gap.mean())
    return np.asarray(gap / mean) if mean > 0 else np.ones(len(gap))


def with_values(
    observations: NDArray[np.float32], derived: Sequence[DerivedFeature]
) -> NDArray[np.int64]:
    """The states that can be learned from: 0/0 is no value of a formula.

    Args:
        observations: Shape (B, d), float32.
        derived: What is derived of them.

    Returns:
        Rows in which all of it has a value, ascending.
    """
    extension = Extension(observations.shape[1], [one.definition for one in derived])
    return np.flatnonzero(~np.isnan(extension.many(observations)).any(axis=1))


def answered(
    env_id: EnvironmentOrId,
    expert: Agent,
    observations: NDArray[np.float32],
    actions: Actions,
    episodes: NDArray[np.int64],
    steps: NDArray[np.int64],
) -> Demonstrations:
    """Demonstrations of the expert's answers in states that others have met.

    Args:
        env_id: The environment.
        expert: Who answered.
        observations: Shape (N, d), float32.
        actions: Its answers, (N, m).
        episodes: Of each state, ascending, (N,).
        steps: Within the episode, (N,).

    Returns:
        With the environment's names and bounds.
    """
    description = describe_environment(env_id)
    low, high = description.action_low, description.action_high
    bounds: dict[str, Any] = {}
    if low is not None and high is not None and np.isfinite([*low, *high]).all():
        bounds = {"action_low": low, "action_high": high, "bounds_from": "action space"}
    return Demonstrations(
        observations=observations,
        actions=actions[:, 0] if description.action_shape == () else actions,
        episodes=episodes,
        steps=steps,
        feature_names=description.feature_names,
        feature_units=description.feature_units,
        action_names=description.action_names,
        label_names=description.label_names,
        label_first=description.label_first,
        env_id=str(env_id),
        agent=expert.name,
        **bounds,
    )


class Answers:
    """What an expert said, at first and round by round."""

    def __init__(
        self,
        env_id: EnvironmentOrId,
        expert: Agent,
        start: Demonstrations,
        *,
        pairs: Sequence[Pair] = (),
        divider: int = 2,
        seed: int = 0,
    ) -> None:
        """Ask about the states that were demonstrated.

        Args:
            env_id: The environment.
            expert: Who is asked.
            start: What was shown so far; the expert answers anew. What it derives stays derived.
            pairs: Features that are combined, as `with_combinations` takes them; () for none.
            divider: Number of intervals of continuous dimensions.
            seed: Another one offers other pairs in each round.

        Raises:
            InputError: If the expert does not always do the same in the same state, or the
                demonstrations are of other features.
        """
        start = in_order_of(start, describe_environment(env_id)).demonstrations
        self._env_id, self._expert = env_id, expert
        self._derived, self._combined = start.derived, pairs
        self._divider, self._seed = divider, seed
        observations = start.raw_observations
        self._observations = [observations]
        self._actions: list[Actions] = [ask(expert, observations, start.episodes)]
        self._episodes = [start.episodes]
        self._steps = [np.arange(len(start)) if start.steps is None else start.steps]

    def add(self, table: StepTable, actions: Actions, *, seed: int) -> None:
        """Take up the states of one more round, but those in which a formula has no value.

        Args:
            table: The N steps of its episodes.
            actions: What the expert says about them, (N, m).
            seed: For choosing some of them, where they are too many.
        """
        rows = with_values(table.observation, self._derived)
        if len(rows) > _PAIRS_A_ROUND:
            generator = np.random.default_rng(seed)
            rows = np.sort(generator.choice(rows, _PAIRS_A_ROUND, replace=False))
        self._observations.append(table.observation[rows])
        self._actions.append(actions[rows])
        last = max(int(episodes[-1]) for episodes in self._episodes if len(episodes))
        self._episodes.append(last + 1 + table.episode[rows])
        self._steps.append(table.step[rows])

    def pairs(
        self, rounds: int, *, derived: Sequence[DerivedFeature] | None = None
    ) -> Demonstrations:
        """What is learned from after so many rounds.

        Args:
            rounds: How many have been taken up by then.
            derived: What is derived; where not given, chosen anew, of many pairs nothing in every
                other round.

        Returns:
            The pairs of the start and of the latest rounds, with what is derived; which
            combinations are worth it may differ from round to round.
        """
        rounds_used = [0, *range(max(1, rounds + 1 - _ROUNDS_USED), rounds + 1)]

        def column(parts: list[Any]) -> Any:
            return np.concatenate([parts[index] for index in rounds_used])

        pairs = answered(
            self._env_id,
            self._expert,
            column(self._observations),
            column(self._actions),
            column(self._episodes),
            column(self._steps),
        ).deriving(self._derived if derived is None else derived)
        if derived is not None or not (offered := self._offered(rounds)):
            return pairs
        return with_combinations(pairs, pairs=offered, divider=self._divider)

    def _offered(self, rounds: int) -> Sequence[Pair]:
        """The pairs of features that may be combined after so many rounds."""
        if not rounds or len(self._combined) < _FEWEST_HALVED:
            return self._combined
        if len(self._combined) > _MANY_PAIRS and rounds % 2:
            return ()
        generator = np.random.default_rng((self._seed, rounds))
        count = (len(self._combined) + 1) // 2
        chosen = generator.choice(len(self._combined), count, replace=False)
        return [self._combined[place] for place in np.sort(chosen).tolist()]
