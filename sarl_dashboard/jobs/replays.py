"""What a replay depends on, how it is run, and where the latest few are kept.

A module and not part of the page: a page is run anew each time, and would not recognise its own
requests from the time before.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path

import streamlit as st

from sarl_core.demonstrations.dataset import Feature
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.explaining.state_path import PathFinder
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.language import sentence
from sarl_core.mining.rule_set import RuleSet
from sarl_core.rendering.fork import Fork, Rest, fork
from sarl_core.rendering.replay import Replay as Film
from sarl_core.rendering.replay import render_episode, side_by_side
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.steps import StepTable
from sarl_core.shielding.shield import Outside, Projection, Shield
from sarl_dashboard.cache import key_of
from sarl_dashboard.jobs.job import Job, Place, Result
from sarl_dashboard.memory_cache import BoundedCache
from sarl_dashboard.state.agents import ChosenAgent
from sarl_dashboard.text import digest_of

EPISODES = (20, 50, 100, 200)
WITH, WITHOUT, ALONE = "with the rules", "without", "agent alone"
MOST_REPLAYS, MOST_COMPARISONS, MOST_FORKS = 6, 8, 8
_WHOLE, _PLAYED = 1_000, 0.7  # of the work, and the share of it before pictures are encoded
MOST_PICTURES = 64  # of a replay, some 30 kB each
_LATEST = "_replay"


@dataclass(frozen=True, eq=False)
class ReplayOrder:
    """A replay that is asked for.

    Attributes:
        env_id: Environment.
        agent: Makes the agent.
        rules: Which rules were chosen.
        rule_set: Those in force, or None.
        projection: How they replace a continuous action.
        seed: Of the episode.
        outside: Whether they act in states outside the data they were mined from.
        description: Of the environment, under the names in force.
    """

    env_id: EnvironmentOrId
    agent: ChosenAgent
    rules: str
    rule_set: RuleSet | None
    projection: Projection
    seed: int
    outside: Outside
    description: EnvironmentDescription

    @cached_property
    def key(self) -> object:
        """Equal keys give equal replays."""
        # Fresh weights depend on a seed too: those of the first episode act in all.
        weights = self.agent.seed if self.agent.choice == "untrained" else None
        shield = (self.rules, self.rule_set, self.projection, self.outside)
        parts = (self.env_id, self.seed, self.agent.digest, weights, shield)
        return key_of((parts, repr(self.description)))

    @property
    def shield(self) -> Shield | None:
        """The rules in force, or None."""
        if self.rule_set is None:
            return None
        return Shield(self.rule_set, projection=self.projection, outside=self.outside)

    def of_seed(self, seed: int) -> ReplayOrder:
        """The same agent and rules on another seed, as in a comparison over several."""
        return replace(self, seed=seed)


@dataclass(frozen=True, eq=False)
class ReplayPair:
    """One episode without the rules and, where there are any, one with them."""

    order: ReplayOrder
    film: Film
    dimensions: tuple[LabelledDimension, ...]
    features: tuple[Feature, ...]

    @property
    def rule_set(self) -> RuleSet | None:
        """The rules in force, or None."""
        return self.order.rule_set

    @property
    def plain(self) -> Episodes:
        """The episode without the rules."""
        return self.film.episodes[-1]

    @property
    def shielded(self) -> Episodes | None:
        """The episode with the rules."""
        return self.film.episodes[0] if len(self.film.episodes) > 1 else None

    @property
    def main_episode(self) -> Episodes:
        """The episode that is gone through step by step."""
        return self.film.episodes[0]

    @property
    def steps(self) -> StepTable:
        """The steps of that episode."""
        assert self.main_episode.steps is not None  # a replay records them
        return self.main_episode.steps

    @cached_property
    def name(self) -> str:
        """Tells its film from all others."""
        return digest_of(self.film.gif())

    @cached_property
    def png(self) -> Callable[[int], bytes]:
        """Gives the picture of a step as a file; the latest are kept."""
        return lru_cache(MOST_PICTURES)(self.film.png)

    @cached_property
    def shield(self) -> Shield | None:
        """Of the rules in force; None without rules."""
        return self.order.shield

    @cached_property
    def finder(self) -> PathFinder | None:
        """Follows a state through the rules; None without rules."""
        return None if self.rule_set is None else PathFinder(self.rule_set)


@st.cache_resource
def replay_cache() -> BoundedCache[ReplayPair]:
    """Replays by the key of their order."""
    return BoundedCache(MOST_REPLAYS)


@st.cache_resource
def comparison_cache() -> BoundedCache[tuple[tuple[str, Episodes], ...]]:
    """Comparisons by the key of their order, and number of episodes."""
    return BoundedCache(MOST_COMPARISONS)


@st.cache_resource
def fork_cache() -> BoundedCache[Fork]:
    """Forks by the key of their order, the step, and what the shield does after it."""
    return BoundedCache(MOST_FORKS)


@dataclass(frozen=True, eq=False)
class Played:
    """A replay, and the order that it fulfils."""

    order: ReplayOrder
    replay: ReplayPair


def begin_anew(order: ReplayOrder) -> None:
    """Run a replay in the place of the latest, which is of another task.

    Args:
        order: Of the replay.
    """
    st.session_state.pop(_LATEST, None)
    REPLAY.begin(lambda: replaying(Jump(order)))


def latest_order() -> ReplayOrder | None:
    """What asked for the replay that the visitor ran last."""
    order: ReplayOrder | None = st.session_state.get(_LATEST)
    return order


def latest() -> Played | None:
    """The replay that the visitor ran last, while it is kept."""
    order = latest_order()
    replay = None if order is None else replay_cache().get(order.key)
    return None if order is None or replay is None else Played(order, replay)


@dataclass(frozen=True, eq=False)
class Jump:
    """A way to a replay.

    Attributes:
        order: Of the replay.
        step: To be looked at; None for the one that is looked at.
    """

    order: ReplayOrder
    step: int | None = None


REPLAY = Place[Jump]("replay")


def arrived() -> Jump | None:
    """The way to a replay that is ready by now, which becomes the latest; each once."""
    job = REPLAY.job
    if job is None or job.result is None:
        return None
    jump, job.result = job.result, None
    st.session_state[_LATEST] = jump.order
    if jump.step is not None:
        st.session_state["step"] = jump.step
    return jump


def compared(order: ReplayOrder) -> tuple[ReplayOrder, int] | None:
    """The comparison that the visitor ran last, if an order is one of its episodes.

    Args:
        order: Of the episode on screen.

    Returns:
        Its own order and number of episodes, or None.
    """
    latest: tuple[ReplayOrder, int] | None = st.session_state.get("_compared")
    if latest is None:
        return None
    first, episodes = latest
    number = order.seed - first.seed
    inside = 0 <= number < episodes
    return latest if inside and first.of_seed(order.seed).key == order.key else None


# --- running -----------------------------------------------------------------------------------


def replaying(jump: Jump) -> Job[Jump]:
    """Run an episode, without the rules and with them, and draw it; one that is kept is ready.

    Args:
        jump: To the replay.
    """
    cache, order = replay_cache(), jump.order

    def work(job: Job[Jump]) -> None:
        if order.key not in cache:
            cache.put(order.key, _replay(order, job))
        job.result = jump

    return Job(order.key, work, _WHOLE)


def _replay(order: ReplayOrder, job: Job[Jump]) -> ReplayPair:
    shield, rule_set = order.shield, order.rule_set
    job.text = "Making the agent …"
    agent = order.agent()
    playing = _part(job, lambda *_: "Playing the episode and drawing it …", 0.0, _PLAYED)
    if shield is None or rule_set is None:
        film = render_episode(order.env_id, agent, seed=order.seed, progress=playing)
    else:
        film = side_by_side(
            order.env_id,
            agent,
            shield,
            seed=order.seed,
            progress=playing,
            describe_rule=lambda index: sentence(rule_set.rules[index], rule_set, evidence=False),
        )
    description = order.description
    dimensions = environment_dimensions(description, rule_set)
    film = film.named(dimensions)
    film.gif(progress=_encoding(job))
    return ReplayPair(
        order=order,
        film=film,
        dimensions=dimensions,
        features=tuple(
            Feature(name, unit)
            for name, unit in zip(description.feature_names, description.feature_units, strict=True)
        ),
    )


def _part(
    job: Job[Result], text: Callable[[int, int], str], first: float, last: float
) -> Callable[[int, int], bool]:
    """The progress of a part of some work, from one share of it to another."""

    def progress(done: int, total: int) -> bool:
        job.text = text(done, total)
        share = first + (last - first) * done / total
        return job.progress(round(_WHOLE * share), _WHOLE)

    return progress


def _encoding(job: Job[Result]) -> Callable[[int, int], bool]:
    return _part(job, lambda done, total: f"Picture {done:,} of {total:,} …", _PLAYED, 1.0)


Runs = tuple[tuple[str, Episodes], ...]
"""With the rules, where there are some, and without; of the first the steps are kept."""
EPISODE_RUNS = Place[Runs]("episodes")


def comparing(order: ReplayOrder, episodes: int) -> Job[Runs]:
    """Run several episodes with the rules and without.

    Args:
        order: Of the first of them.
        episodes: How many.
    """
    cache, key = comparison_cache(), (order.key, episodes)
    return Job(key, lambda job: cache.put(key, _compare(order, episodes, job)), _WHOLE)


def _compare(order: ReplayOrder, episodes: int, job: Job[Runs]) -> Runs:
    agent, shield = order.agent(), order.shield
    wanted = [(ALONE, None)] if shield is None else [(WITH, shield), (WITHOUT, None)]

    def run(part: int, name: str, guard: Shield | None) -> tuple[str, Episodes]:
        return name, rollout(
            order.env_id,
            agent,
            shield=guard,
            episodes=episodes,
            seed=order.seed,
            keep_steps=part == 0,
            progress=_part(
                job,
                lambda done, total: f"{done} of {total} episodes, {name} …",
                part / len(wanted),
                (part + 1) / len(wanted),
            ),
        )

    return tuple(run(part, *one) for part, one in enumerate(wanted))


FORK = Place[Fork]("fork")


def forking(order: ReplayOrder, step: int, rest: Rest) -> Job[Fork]:
    """Run the episode with what the shield changed at a step, and without it, and draw both.

    Args:
        order: Of the episode; it has rules.
        step: At which the change is withheld.
        rest: What the shield does after it.
    """
    cache, key = fork_cache(), (order.key, step, rest)
    return Job(key, lambda job: cache.put(key, _fork(order, step, rest, job)), _WHOLE)


def _fork(order: ReplayOrder, step: int, rest: Rest, job: Job[Fork]) -> Fork:
    shield, rule_set = order.shield, order.rule_set
    assert shield is not None
    assert rule_set is not None
    job.text = "Making the agent …"
    branched = fork(
        order.env_id,
        order.agent(),
        shield,
        step=step,
        rest=rest,
        seed=order.seed,
        describe_rule=lambda index: sentence(rule_set.rules[index], rule_set, evidence=False),
        progress=_part(job, lambda *_: "Playing both and drawing them …", 0.0, _PLAYED),
    )
    dimensions = environment_dimensions(order.description, rule_set)
    branched = replace(branched, replay=branched.replay.named(dimensions))
    branched.replay.gif(progress=_encoding(job))
    return branched


def movie(film: Film) -> bytes:
    """A replay, or both branches of a fork, as MP4."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        film.save(path)
        return path.read_bytes()
