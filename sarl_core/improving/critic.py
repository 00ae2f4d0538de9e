"""What it brings to say something else once, learned from the episodes of the rules themselves.

The expert knows what is best where it acts on; rules of which there are few act on otherwise. So
their own episodes say what a label is worth: in some of them single actions are others than the
rules say, and what follows is counted as long as the rules go on as they do now (Q(lambda), cut
where they would act otherwise: Watkins 1989).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

_HIDDEN = (128, 128)
_BATCH = 256
_CHUNK = 100  # batches between two looks at what follows
_WIDEST = 5.0  # half spreads, beyond which a feature says no more
_SPREAD = (0.1, 0.9)  # quantiles


@dataclass(frozen=True)
class Horizon:
    """How far a critic looks.

    Attributes:
        discount: What a reward counts a step later.
        trace: How much of what was seen to follow is believed, rather than what is known of the
            next state: 0 to 1.
    """

    discount: float
    trace: float


@dataclass(frozen=True)
class Experience:
    """T steps of episodes, in their order.

    Attributes:
        observations: Shape (T, d), float32.
        labels: What was done, (T, m).
        rewards: Shape (T,).
        last: Whether the episode ended there, (T,) bool.
        open: Whether it would have gone on, but for a limit of time, (T,) bool.
    """

    observations: NDArray[np.float32]
    labels: NDArray[np.int64]
    rewards: NDArray[np.float64]
    last: NDArray[np.bool_]
    open: NDArray[np.bool_]

    def __len__(self) -> int:
        """Number of steps."""
        return len(self.rewards)

    @classmethod
    def join(cls, parts: Sequence[Experience]) -> Experience:
        """One after the other."""
        return cls(
            np.concatenate([part.observations for part in parts]),
            np.concatenate([part.labels for part in parts]),
            np.concatenate([part.rewards for part in parts]),
            np.concatenate([part.last for part in parts]),
            np.concatenate([part.open for part in parts]),
        )


class Critic:
    """How good each label is in a state, if the rules go on from there."""

    def __init__(self, labels: Sequence[int], horizon: Horizon, *, seed: int) -> None:
        """Know nothing yet.

        Args:
            labels: Of each action dimension, their number.
            horizon: How far it looks.
            seed: Another one gives another critic.
        """
        from sklearn.neural_network import MLPRegressor

        self._labels, self._horizon = tuple(labels), horizon
        self._generator = np.random.default_rng(seed)
        self._networks = [
            MLPRegressor(hidden_layer_sizes=_HIDDEN, batch_size=_BATCH, random_state=seed + index)
            for index in range(len(labels))
        ]
        self._centre = self._half = np.zeros(0)
        self._unit = 1.0  # of values
        self._knows = False

    def learn(self, experience: Experience, said: NDArray[np.int64], batches: int) -> None:
        """Learn what follows if the rules say this.

        Args:
            experience: T steps.
            said: What the rules say there now, (T, m).
            batches: How many are learned from.
        """
        if not self._knows:
            self._measure(experience)
        inputs = self._scaled(experience.observations)
        follows = experience.labels == said
        # Of a dimension only where the others do what they are to go on with.
        rows = [
            np.flatnonzero(np.delete(follows, index, axis=1).all(axis=1))
            for index in range(len(self._labels))
        ]
        for _ in range(-(-batches // _CHUNK)):
            targets = self._targets(experience, inputs, said, follows.all(axis=1))
            for index, (network, known) in enumerate(zip(self._networks, rows, strict=True)):
                if len(known):
                    chosen = self._generator.choice(known, _CHUNK * _BATCH)
                    labels = experience.labels[chosen, index]
                    network.partial_fit(
                        self._with_label(inputs[chosen], labels, index), targets[chosen]
                    )
            self._knows = True

    def values(self, observations: NDArray[np.float32]) -> list[NDArray[np.float64]]:
        """Of each dimension, how good each label is, m times (N, labels).

        Args:
            observations: Shape (N, d).
        """
        inputs = self._scaled(observations)
        return [
            np.column_stack(
                [self._value(inputs, np.full(len(inputs), label), index) for label in range(labels)]
            )
            for index, labels in enumerate(self._labels)
        ]

    def _measure(self, experience: Experience) -> None:
        """In which units features and values are counted."""
        values = np.nan_to_num(experience.observations.astype(np.float64))
        low, high = np.quantile(values, _SPREAD, axis=0)
        self._centre, half = (low + high) / 2, (high - low) / 2
        self._half = np.where(half > 0, half, 1.0)
        sums = np.add.reduceat(
            experience.rewards, np.append(0, np.flatnonzero(experience.last)[:-1] + 1)
        )
        self._unit = float(sums.std()) or 1.0

    def _scaled(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        scaled = (np.nan_to_num(observations) - self._centre) / self._half
        return np.clip(scaled, -_WIDEST, _WIDEST).astype(np.float32)

    def _with_label(
        self, inputs: NDArray[np.float32], labels: NDArray[np.int64], index: int
    ) -> NDArray[np.float32]:
        return np.hstack([inputs, np.eye(self._labels[index], dtype=np.float32)[labels]])

    def _value(
        self, inputs: NDArray[np.float32], labels: NDArray[np.int64], index: int
    ) -> NDArray[np.float64]:
        network = self._networks[index]
        if not hasattr(network, "coefs_"):  # it has never seen the others follow the rules
            return np.zeros(len(inputs))
        predicted: NDArray[np.float64] = network.predict(self._with_label(inputs, labels, index))
        return predicted.astype(np.float64) * self._unit

    def _targets(
        self,
        experience: Experience,
        inputs: NDArray[np.float32],
        said: NDArray[np.int64],
        follows: NDArray[np.bool_],
    ) -> NDArray[np.float64]:
        """What each step brought, in units of the network, (T,)."""
        discount, trace = self._horizon.discount, self._horizon.trace
        n = len(experience)
        if self._knows:
            value = np.mean(
                [self._value(inputs, said[:, index], index) for index in range(said.shape[1])],
                axis=0,
            )
        else:
            value, trace = np.zeros(n), 1.0
        # All episodes abreast, from their ends.
        ends = np.flatnonzero(experience.last)
        begins = np.append(0, ends[:-1] + 1)
        targets = np.empty(n)
        after = np.where(experience.open[ends], value[ends], 0.0)
        for back in range(int((ends - begins).max()) + 1):
            rows = ends - back
            there = rows >= begins
            rows = rows[there]
            brought = experience.rewards[rows] + discount * after[there]
            targets[rows] = brought
            # Where the rules would not have done that, what followed says nothing of them.
            believed = np.where(follows[rows], trace, 0.0)
            after[there] = believed * brought + (1 - believed) * value[rows]
        return targets / self._unit
