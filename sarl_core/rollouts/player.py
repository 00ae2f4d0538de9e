"""The loop that steps environments side by side; whoever wants to see more of it observes it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.agent import Agent, EpisodicAgent, PlacedAgent, order_notes
from sarl_core.agents.own import AgentFaultError
from sarl_core.agents.spaces import Actions, SpaceAdapter, adapt
from sarl_core.environments.description import describe_environment, make_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.environments.imports import reason
from sarl_core.environments.signals import SignalTally, StepOutcomes
from sarl_core.errors import InputError
from sarl_core.rollouts.steps import StepTable

if TYPE_CHECKING:
    from sarl_core.shielding.shield import Shield


class EpisodeArrays(NamedTuple):
    """Arrays of E finished episodes; the names are those of `Episodes`."""

    returns: NDArray[np.float64]
    lengths: NDArray[np.int64]
    interventions: NDArray[np.int64]
    covered: NDArray[np.int64]
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]
    last_rewards: NDArray[np.float64]
    steps: StepTable | None
    flips: NDArray[np.int64]
    outside: NDArray[np.int64]
    withheld: NDArray[np.int64]
    cut: NDArray[np.bool_]
    freedom: NDArray[np.float64]
    costs: NDArray[np.float64]
    notes: tuple[str, ...]
    invalid: NDArray[np.int64] | None
    signalled: NDArray[np.float64] | None


class EpisodeFaultError(InputError):
    """The environment, or an agent of the caller's own, failed in the middle of an episode.

    Attributes:
        played: The steps before it, those of that episode included; None where there are none.
    """

    played: EpisodeArrays | None = None


class CheckedActions(NamedTuple):
    """What agent and shield made of B states; actions with one column a dimension."""

    proposed: Actions
    executed: Actions
    rules: NDArray[np.int64]
    intervened: NDArray[np.bool_]
    margin: NDArray[np.float64]
    outside: NDArray[np.bool_]
    invalid: NDArray[np.object_]


class View(NamedTuple):
    """What an observer sees: a state before an action is chosen in it, or the last one.

    Attributes:
        env: The environment, in that state.
        episode: Index of the episode.
        step: Steps of the episode so far.
        state: Shape (d,), float32.
    """

    env: Any
    episode: int
    step: int
    state: NDArray[np.float32]


Observer = Callable[[View], None]
"""Called with every state, the first and the last included; may raise to stop."""


@dataclass
class _Lane:
    """One environment on its way through one episode."""

    episode: int
    env: Any
    generator: np.random.Generator


def play(
    env_id: EnvironmentOrId,
    agent: Agent,
    shield: Shield | None,
    seeds: NDArray[np.int64],
    *,
    batch: int,
    max_steps: int,
    keep_steps: bool,
    finished: Callable[[], None] | None = None,
    observer: Observer | None = None,
    render_mode: str | None = None,
) -> EpisodeArrays:
    """Run one episode for each seed.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: Chooses the actions.
        shield: Checks them, or None.
        seeds: Shape (E,).
        batch: Environments side by side; an `EpisodicAgent` plays in one after the other.
        max_steps: An episode that has not ended by then is cut off.
        keep_steps: Whether to keep the record of every step.
        finished: Called after every episode; may raise to stop.
        observer: Sees every state.
        render_mode: Of the environments.

    Returns:
        The episodes in the order of the seeds.

    Raises:
        InputError: If the environment cannot be used, or the shield is not for it.
        EpisodeFaultError: If the environment, or an agent of the caller's own, fails.
    """
    batch = 1 if isinstance(agent, EpisodicAgent) else batch
    run = _Lanes(env_id, agent, shield, seeds, max_steps, keep_steps, observer, render_mode)
    try:
        for _ in range(min(batch, len(seeds))):
            run.start()
        while run.lanes:
            for _ in range(run.step()):
                if finished is not None:
                    finished()
    except AgentFaultError as error:
        raise run.fault(error) from error
    finally:
        for lane in run.lanes:
            lane.env.close()
    return run.outcome()


class _Lanes:
    """The state of `play`: lanes that step together, and what they have brought so far."""

    def __init__(
        self,
        env_id: EnvironmentOrId,
        agent: Agent,
        shield: Shield | None,
        seeds: NDArray[np.int64],
        max_steps: int,
        keep_steps: bool,
        observer: Observer | None,
        render_mode: str | None,
    ) -> None:
        self.env_id, self.agent = env_id, agent
        # To look at every step takes a part of its time.
        self.placed = agent if isinstance(agent, PlacedAgent) else None
        self.observer, self.render_mode = observer, render_mode
        self.seeds, self.max_steps, self.keep_steps = seeds, max_steps, keep_steps
        self.adapter, self.shield, notes = check_environment(env_id, shield)
        self.notes = (*notes, *order_notes(agent, env_id))
        self.lanes: list[_Lane] = []
        self.states = np.zeros((0, self.adapter.n_features), dtype=np.float32)
        self.started = 0
        count = len(seeds)
        self.returns, self.last_rewards = np.zeros((2, count))
        self.lengths, self.interventions, self.covered = np.zeros((3, count), dtype=np.int64)
        self.terminated, self.truncated, self.cut = np.zeros((3, count), dtype=np.bool_)
        self.free = np.zeros(count)
        self.tally = SignalTally(
            env_id, count, lambda episode: f"of the episode with seed {seeds[episode]}"
        )
        self.flips = np.zeros(count, dtype=np.int64)
        self.on = np.zeros(count, dtype=np.bool_)  # whether the shield changed the latest action
        self.outside, self.withheld, self.invalid = np.zeros((3, count), dtype=np.int64)
        self.chunks: list[tuple[NDArray[Any], ...]] = []

    def start(self) -> None:
        """Open a lane for the next seed, if there is one."""
        if self.started == len(self.seeds):
            return
        # A fresh environment: what an earlier episode left behind cannot matter.
        lane = _Lane(
            self.started,
            make_environment(self.env_id, render_mode=self.render_mode),
            np.random.default_rng(int(self.seeds[self.started])),
        )
        self.lanes.append(lane)
        self.started += 1
        if isinstance(self.agent, EpisodicAgent):
            self.agent.begin_episode(int(self.seeds[lane.episode]))
        try:
            observation, _ = lane.env.reset(seed=int(self.seeds[lane.episode]))
        except (Exception, SystemExit) as error:  # other people's code, which may raise anything
            raise self._broken(lane, "at its reset", error) from error
        if misfit := self.adapter.misfit(observation):
            raise self._fault(
                f"{self.env_id} gives an observation that is not of its space ({misfit}) in the "
                f"episode with seed {self.seeds[lane.episode]}, at its reset; let it, or the "
                "wrapper around it, say in observation_space what it gives"
            )
        state = self.adapter.flat(observation)
        self.states = np.concatenate([self.states, state[None]])
        if self.observer is not None:
            self.observer(View(lane.env, lane.episode, 0, state))

    def step(self) -> int:
        """Step every lane once, and give the number of episodes that ended."""
        states, adapter = self.states, self.adapter
        episodes = np.array([lane.episode for lane in self.lanes])
        if self.placed is not None:
            self.placed.place(episodes, self.lengths[episodes])
        choice = choose(
            self.agent, self.shield, adapter, states, [lane.generator for lane in self.lanes]
        )
        executed = adapter.shaped(choice.executed)
        actions = (
            executed.tolist()
            if adapter.action_shape == () and adapter.is_discrete
            else [adapter.native(action) for action in executed]
        )
        if adapter.is_whole:  # what is written down is what the environment was given
            whole: Any = np.array(actions).astype(choice.executed.dtype)
            choice = choice._replace(executed=adapter.columns(whole))
        following = np.empty_like(states)
        rewards, ends = np.empty(len(states)), np.zeros(len(states), dtype=np.bool_)
        infos: list[dict[str, Any]] = []
        ended: list[tuple[int, bool, bool]] = []
        for index, lane in enumerate(self.lanes):
            try:
                observation, reward, terminated, truncated, info = lane.env.step(actions[index])
                rewards[index] = reward
            except (Exception, SystemExit) as error:  # other people's code, as above
                where = f"at step {self.lengths[lane.episode]}"
                raise self._broken(lane, where, error) from error
            following[index] = adapter.flat(observation)
            infos.append(info)
            ends[index] = terminated
            if terminated or truncated:
                ended.append((index, bool(terminated), bool(truncated)))
            if self.observer is not None:
                step = int(self.lengths[lane.episode]) + 1
                self.observer(View(lane.env, lane.episode, step, following[index]))
        fails, costs = self.tally.add(
            episodes, self.lengths[episodes], StepOutcomes(following, actions, rewards, ends, infos)
        )
        if self.keep_steps:
            self.chunks.append(
                (
                    episodes,
                    self.lengths[episodes],
                    states,
                    choice.proposed,
                    choice.executed,
                    choice.rules,
                    choice.intervened,
                    choice.margin,
                    rewards,
                    choice.outside,
                    choice.invalid,
                    fails,
                    costs,
                )
            )
        self.returns[episodes] += rewards
        self.last_rewards[episodes] = rewards
        if self.shield is not None:
            switched = (choice.intervened != self.on[episodes]) & (self.lengths[episodes] > 0)
            self.flips[episodes] += switched
            self.on[episodes] = choice.intervened
            self.interventions[episodes] += choice.intervened
            self.covered[episodes] += (choice.rules >= 0).any(axis=1)
            self.outside[episodes] += choice.outside
            self.withheld[episodes] += choice.outside & ~choice.intervened
            self.free[episodes] += self.shield.freedom(states, choice.rules)
            if self.shield.on_invalid == "pass":
                self.invalid[episodes] += choice.invalid.astype(np.bool_)
        else:
            self.free[episodes] += 1.0
        self.lengths[episodes] += 1
        self.states = following
        return self._end(ended, episodes)

    def _broken(self, lane: _Lane, where: str, error: BaseException) -> EpisodeFaultError:
        """What to say of an environment that raises in the middle of its work."""
        return self._fault(
            f"{self.env_id} failed in the episode with seed {self.seeds[lane.episode]}, {where} "
            f"({reason(error)}); mend the environment or its wrapper, or choose another"
        )

    def _end(self, ended: list[tuple[int, bool, bool]], episodes: NDArray[np.int64]) -> int:
        closed = {index for index, _, _ in ended}
        too_long = np.flatnonzero(self.lengths[episodes] >= self.max_steps).tolist()
        for index in too_long:
            if index not in closed:
                self.cut[self.lanes[index].episode] = True
                ended.append((index, False, True))
        if not ended:
            return 0
        for index, terminated, truncated in ended:
            lane = self.lanes[index]
            self.terminated[lane.episode] = terminated
            self.truncated[lane.episode] = truncated
            self.tally.end(lane.episode)
            lane.env.close()
        going = np.ones(len(self.lanes), dtype=np.bool_)
        going[[index for index, _, _ in ended]] = False
        self.lanes = [lane for lane, goes in zip(self.lanes, going, strict=True) if goes]
        self.states = self.states[going]
        for _ in ended:
            self.start()
        return len(ended)

    def fault(self, error: AgentFaultError) -> EpisodeFaultError:
        """What is to be said where the agent failed; it plays one episode after the other."""
        episode = self.started - 1
        return self._fault(
            f"in step {self.lengths[episode]} of the episode with seed {self.seeds[episode]}, "
            f"{error}"
        )

    def _fault(self, sentence: str) -> EpisodeFaultError:
        """What came before goes with it: the first episodes, up to one that has not ended."""
        fault = EpisodeFaultError(sentence)
        whole = int(np.argmin(self.terminated | self.truncated))
        if played := whole + bool(self.lengths[whole]):
            fault.played = self.outcome(played)
        return fault

    def outcome(self, count: int | None = None) -> EpisodeArrays:
        """What the first episodes brought; all of them where no number is given."""
        steps = None
        if self.keep_steps and self.chunks:
            columns = [np.concatenate(column) for column in zip(*self.chunks, strict=True)]
            if count is not None:
                columns = [column[columns[0] < count] for column in columns]
            order = np.lexsort((columns[1], columns[0]))
            steps = StepTable(*(column[order] for column in columns))
        passes = self.shield is not None and self.shield.on_invalid == "pass"
        signals = self.tally.signals
        return EpisodeArrays(
            self.returns[:count],
            self.lengths[:count],
            self.interventions[:count],
            self.covered[:count],
            self.terminated[:count],
            self.truncated[:count],
            self.last_rewards[:count],
            steps,
            self.flips[:count],
            self.outside[:count],
            self.withheld[:count],
            self.cut[:count],
            self.free[:count] / self.lengths[:count],
            self.tally.costs[:count],
            (*self.notes, *self.tally.notes),
            self.invalid[:count] if passes else None,
            signals[:count] if signals is not None else None,
        )


def choose(
    agent: Agent,
    shield: Shield | None,
    adapter: SpaceAdapter,
    states: NDArray[np.float32],
    generators: list[np.random.Generator],
) -> CheckedActions:
    """Let the agent propose and the shield decide.

    Args:
        agent: Chooses the actions.
        shield: Checks them, or None.
        adapter: Of the environment.
        states: Shape (B, d), float32.
        generators: B random generators, one an episode.

    Returns:
        The choice for each state.
    """
    uniforms = None
    if agent.n_uniforms:
        uniforms = np.empty((len(states), agent.n_uniforms))
        for row, generator in zip(uniforms, generators, strict=True):
            generator.random(out=row)
    proposed = agent.act(states, uniforms)
    if shield is None:
        none = np.full(proposed.shape, -1, dtype=np.int64)
        never = np.zeros(len(states), dtype=np.bool_)
        valid = np.full(len(states), None, dtype=np.object_)
        return CheckedActions(
            proposed, proposed, none, never, np.full(len(states), np.inf), never, valid
        )
    decision = shield.decide_batch(states, adapter.shaped(proposed))
    executed: Any = decision.executed
    if executed.dtype != proposed.dtype:  # what is executed is a number of the agents' kind, too
        executed = np.array(executed.tolist(), dtype=proposed.dtype)
    return CheckedActions(
        proposed,
        adapter.columns(executed),
        decision.rules,
        decision.intervened,
        decision.margin,
        decision.outside,
        decision.invalid,
    )


def shield_for(env_id: EnvironmentOrId, shield: Shield) -> Shield:
    """The shield whose rules are in the order of an environment's features and actions.

    Args:
        env_id: What ``gymnasium.make`` takes.
        shield: In whatever order.

    Returns:
        The same object where the order is the same.

    Raises:
        InputError: If the environment cannot be used, or the shield is not for it.
    """
    fitted = check_environment(env_id, shield).shield
    return shield if fitted is None else fitted


class Ready(NamedTuple):
    """An environment that can be run, and the shield for it.

    Attributes:
        adapter: Of its spaces.
        shield: In the order of its features, or None.
        notes: What is to be said of that order.
    """

    adapter: SpaceAdapter
    shield: Shield | None
    notes: tuple[str, ...]


def check_environment(env_id: EnvironmentOrId, shield: Shield | None) -> Ready:
    """Read an environment's spaces, put the shield into their order, and refuse what cannot be run.

    Args:
        env_id: What ``gymnasium.make`` takes.
        shield: To be used in it, or None.

    Returns:
        Its adapter, and the shield as it is to be used.

    Raises:
        InputError: If the environment cannot be used, or the shield is not for it.
    """
    describe_environment(env_id)
    env = make_environment(env_id)
    adapter = adapt(env)
    try:
        if shield is None:
            return Ready(adapter, None, ())
        from sarl_core.environments.observation_layers import observed
        from sarl_core.shielding.wrappers import fitted

        spaces = adapter.observation_space, adapter.action_space
        return Ready(adapter, *fitted(shield, *spaces, observed(env)))
    finally:
        env.close()
