"""What the expert recovers from: in states of played episodes each action is tried for some steps.

An episode is played again from its seed up to the state; then the action is done for some steps,
and then the expert has the controls. If the episode fails, the expert could not recover. A state
that fails under the expert alone is lost whatever is done, and says nothing; nor does one so near
a time limit that an action was cut short.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, EpisodicAgent
from sarl_core.agents.spaces import Actions
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.improving.questions import ask
from sarl_core.mining.labels import LabelledDimension
from sarl_core.rollouts.episodes import run_seeds
from sarl_core.rollouts.steps import StepTable
from sarl_core.shielding.shield import Shield

_STRETCH = 30  # steps, on average, that agent and expert have the controls in turns


@dataclass(frozen=True, eq=False)
class Outcomes:
    """What came of probes in N states.

    Attributes:
        observations: The states, (N, d) float32.
        actions: What the expert does there, (N, m).
        episodes: Seed of the episode that each was met in, (N,).
        steps: Within the episode, (N,).
        failed: For each of m action dimensions, whether the expert failed after each label, (N, L).
            What the expert itself does there is not tried, and has not failed.
    """

    observations: NDArray[np.float32]
    actions: Actions
    episodes: NDArray[np.int64]
    steps: NDArray[np.int64]
    failed: tuple[NDArray[np.bool_], ...]

    def __len__(self) -> int:
        """Number N of states."""
        return len(self.observations)

    @classmethod
    def join(cls, parts: Sequence[Self]) -> Self:
        """The outcomes of several episodes as one, in their order."""
        return cls(
            np.concatenate([part.observations for part in parts]),
            np.concatenate([part.actions for part in parts]),
            np.concatenate([part.episodes for part in parts]),
            np.concatenate([part.steps for part in parts]),
            tuple(map(np.concatenate, zip(*(part.failed for part in parts), strict=True))),
        )


class Turns:
    """An agent and the expert, who have the controls in turns: what it gets into, the other mends.

    Attributes:
        name: Of the agent.
        n_uniforms: 0: chance comes with the episode's seed.
    """

    n_uniforms = 0

    def __init__(self, agent: Agent, expert: Agent) -> None:
        """Take in who plays.

        Args:
            agent: Gets into states.
            expert: Mends it.
        """
        self.name, self._players = agent.name, (agent, expert)

    def begin_episode(self, seed: int) -> None:
        """See `EpisodicAgent`."""
        self._generator = np.random.default_rng((seed, 1))
        self._turn, self._left = int(self._generator.integers(2)), 0
        for player in self._players:
            if isinstance(player, EpisodicAgent):
                player.begin_episode(seed)

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """See `Agent`."""
        if self._left == 0:
            self._turn, self._left = 1 - self._turn, int(self._generator.geometric(1 / _STRETCH))
        self._left -= 1
        player = self._players[self._turn]
        if player.n_uniforms:
            uniforms = self._generator.random((len(observations), player.n_uniforms))
        return player.act(observations, uniforms)


class _Probe(NamedTuple):
    """One try: as far as `row` everything as it was, then a value for some steps."""

    row: int
    dimension: int = 0
    value: float = 0.0
    steps: int = 0


class _Prober:
    """Plays episodes again, and does something else from a step on.

    Attributes:
        name: Of the expert.
        n_uniforms: 0, as those of the expert.
    """

    n_uniforms = 0

    def __init__(self, expert: Agent, table: StepTable, probes: Sequence[_Probe]) -> None:
        self.name, self._expert, self._table = expert.name, expert, table
        columns = zip(*probes, strict=True)
        self._row, self._dimension, self._value, self._long = map(np.array, columns)

    def place(self, episodes: NDArray[np.int64], steps: NDArray[np.int64]) -> None:
        self._episodes, self._steps = episodes, steps

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        episodes, steps = self._episodes, self._steps
        again = steps < self._row[episodes]
        before = steps[again]
        if not np.array_equal(observations[again], self._table.observation[before]):
            raise InputError(
                "the environment does not repeat itself: played again from the same seed with the "
                "same actions it comes to other states; probe one that does"
            )
        actions = self._expert.act(observations, None).copy()
        trying = ~again & (steps < (self._row + self._long)[episodes])
        actions[trying, self._dimension[episodes[trying]]] = self._value[episodes[trying]]
        actions[again] = self._table.executed[before]
        return actions


class _RememberingProber(_Prober):
    """The same with an expert that has to see its episodes from their start."""

    def begin_episode(self, seed: int) -> None:
        assert isinstance(self._expert, EpisodicAgent)
        self._expert.begin_episode(seed)


def probed(
    env_id: EnvironmentOrId,
    agent: Agent,
    expert: Agent,
    shield: Shield | None,
    seed: int,
    *,
    dimensions: Sequence[LabelledDimension],
    states: int,
    steps: int,
    max_steps: int | None = None,
) -> Outcomes:
    """Probe states of one episode.

    Args:
        env_id: What ``gymnasium.make`` takes; it repeats itself on one seed.
        agent: Who plays, under the shield; where there is none, in turns with the expert.
        expert: Who recovers; deterministic.
        shield: In force while the agent plays.
        seed: Of the episode.
        dimensions: The action dimensions, whose labels are tried.
        states: How many are probed, at most.
        steps: How long an action is done before the expert has the controls.
        max_steps: After which an episode is cut off.

    Returns:
        What came of it; less states where some were lost.

    Raises:
        InputError: If the environment does not repeat itself, or something does not fit.
    """
    player = Turns(agent, expert) if shield is None else agent
    one = np.array([seed], dtype=np.int64)
    table = run_seeds(env_id, player, shield, one, max_steps=max_steps).steps
    assert table is not None
    wanted = ask(expert, table.observation, np.full(len(table), seed))
    generator = np.random.default_rng((seed, 2))
    rows = np.sort(generator.choice(len(table), min(states, len(table)), replace=False))

    def played(probes: Sequence[_Probe]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which failed, and which were cut short."""
        if not probes:
            return np.zeros(0, dtype=np.bool_), np.zeros(0, dtype=np.bool_)
        remembers = isinstance(expert, EpisodicAgent)
        episodes = run_seeds(
            env_id,
            (_RememberingProber if remembers else _Prober)(expert, table, probes),
            None,
            np.full(len(probes), seed, dtype=np.int64),
            keep_steps=False,
            max_steps=max_steps,
        )
        tried_until = np.array([probe.row + probe.steps for probe in probes])
        return episodes.failed, episodes.truncated & (episodes.lengths < tried_until)

    rows = rows[~played([_Probe(row) for row in rows.tolist()])[0]]
    failed, short = [], np.zeros(len(rows), dtype=np.bool_)
    for index, dimension in enumerate(dimensions):
        labels = dimension.labels_of(wanted[rows, index])
        others = np.arange(dimension.n_labels) != labels[:, None]
        values = (
            [dimension.centre(label) for label in range(dimension.n_labels)]
            if dimension.is_interval
            else list(dimension.actions)
        )
        places = np.argwhere(others)
        tried = [
            _Probe(int(rows[place]), index, values[label], steps)
            for place, label in places.tolist()
        ]
        others[others], cut = played(tried)
        short[places[cut, 0]] = True
        failed.append(others)
    rows, failed = rows[~short], [one[~short] for one in failed]
    return Outcomes(
        table.observation[rows],
        wanted[rows],
        np.full(len(rows), seed, dtype=np.int64),
        table.step[rows],
        tuple(failed),
    )
