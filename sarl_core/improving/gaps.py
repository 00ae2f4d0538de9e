"""States that need a demonstration, where there is no expert to ask."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent
from sarl_core.demonstrations.dataset import observed_features
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.mining.rule_set import RuleSet
from sarl_core.progress import Progress
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.player import check_environment
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.projection import Projection
from sarl_core.shielding.shield import Shield

if TYPE_CHECKING:
    import pandas as pd

_PIECE = 8  # episodes after which a search can be stopped with what it has found
_PIECES = 50  # at most so many; a long search is not slowed down by being cut up


@dataclass(frozen=True, eq=False)
class Gaps:
    """States that a shielded agent met and for which the rules have no answer.

    Attributes:
        feature_names: Of the observations, d.
        episode: Number of the episode, (K,) int64.
        step: Within it, (K,) int64.
        observations: The states, (K, d) float32.
        missing: Action dimensions without a rule, (K, m) bool.
        met: How many states were met in all.
        episodes: In how many episodes.
        cut: How many of them were cut off before their end.
        notes: What is to be said of how rules, agent and environment were matched, as clauses.
    """

    feature_names: tuple[str, ...]
    episode: NDArray[np.int64]
    step: NDArray[np.int64]
    observations: NDArray[np.float32]
    missing: NDArray[np.bool_]
    met: int
    episodes: int
    cut: int = 0
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Number of states K that need a demonstration."""
        return len(self.episode)

    @property
    def share(self) -> float:
        """Share of the met states that need a demonstration."""
        return len(self) / self.met

    def to_frame(self) -> pd.DataFrame:
        """One row a state, with the columns of a demonstration file except the action."""
        import pandas as pd

        columns: dict[str, NDArray[np.generic]] = {"episode": self.episode, "step": self.step}
        for name, column in zip(self.feature_names, self.observations.T, strict=True):
            columns[f"obs_{name}"] = column
        return pd.DataFrame(columns)


def gaps_so_far(
    env_id: EnvironmentOrId,
    rules: RuleSet,
    *,
    agent: str | Agent = "novice",
    episodes: int = 20,
    seed: int = 0,
    projection: Projection = "centre",
    jobs: int = 1,
    executor: Executor | None = None,
    max_steps: int | None = None,
    progress: Progress | None = None,
) -> Iterator[Gaps]:
    """Run a shielded agent, and collect the states in which some dimension has no rule.

    Args:
        env_id: What ``gymnasium.make`` takes.
        rules: The shield's.
        agent: Who is shielded.
        episodes: How many.
        seed: Of the first.
        projection: How the shield replaces a continuous action.
        jobs: Processes.
        executor: Whose processes they are; this machine's where not given.
        max_steps: After which an episode is cut off; `episodes.MAX_STEPS` where None.
        progress: Called with (episodes done, in all); returning False stops.

    Yields:
        Every few episodes all states so far, in the order in which they were met.

    Raises:
        InputError: If agent, rules and environment do not fit.
        CancelledError: If `progress` returned False.
    """
    actor = make_agent(agent, env_id, seed=seed)  # once: an untrained one is of the first seed
    _, shield, notes = check_environment(env_id, Shield(rules, projection=projection))
    assert shield is not None
    size = max(_PIECE, jobs, -(-episodes // _PIECES))
    pieces: list[Gaps] = []
    for start in range(0, episodes, size):

        def advance(done: int, _: int, start: int = start) -> bool | None:
            return progress(start + done, episodes) if progress is not None else None

        played = rollout(
            env_id,
            actor,
            shield=shield,
            episodes=min(size, episodes - start),
            seed=seed + start,
            jobs=jobs,
            executor=executor,
            max_steps=max_steps,
            progress=advance,
        )
        pieces.append(_gaps(played, shield, notes))
        yield join_gaps(pieces)


def _gaps(played: Episodes, shield: Shield, notes: tuple[str, ...]) -> Gaps:
    table = played.steps
    assert table is not None
    missing = table.rules < 0
    rows = np.flatnonzero(missing.any(axis=1))
    return Gaps(
        feature_names=tuple(one.name for one in observed_features(shield.rule_set.source.features)),
        episode=table.episode[rows],
        step=table.step[rows],
        observations=table.observation[rows],
        missing=missing[rows],
        met=len(table),
        episodes=len(played),
        cut=int(played.cut.sum()),
        notes=tuple(dict.fromkeys((*notes, *played.notes))),
    )


def join_gaps(pieces: Sequence[Gaps]) -> Gaps:
    """Put the gaps of several runs of one agent behind each other.

    Args:
        pieces: At least one, of the same rules.

    Returns:
        All their states, episodes numbered on.
    """
    before = np.cumsum([0, *(piece.episodes for piece in pieces)])
    return Gaps(
        feature_names=pieces[0].feature_names,
        episode=np.concatenate(
            [piece.episode + first for piece, first in zip(pieces, before, strict=False)]
        ),
        step=np.concatenate([piece.step for piece in pieces]),
        observations=np.concatenate([piece.observations for piece in pieces]),
        missing=np.concatenate([piece.missing for piece in pieces]),
        met=sum(piece.met for piece in pieces),
        episodes=sum(piece.episodes for piece in pieces),
        cut=sum(piece.cut for piece in pieces),
        notes=pieces[0].notes,
    )
