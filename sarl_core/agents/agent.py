"""Agents: whoever chooses the actions, by name or from a file.

An agent gets its random numbers as arguments, so `act` is a pure function and an episode does
not depend on what runs beside it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.driver import Driver
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.agents.spaces import Actions, label_counts
from sarl_core.environments.description import catalogued, describe_environment, make_environment
from sarl_core.environments.environment import EnvironmentOrId, as_environment
from sarl_core.environments.feature_order import NamedFeatures, line_up, only_counts
from sarl_core.errors import InputError, needing_extras, require
from sarl_core.shipped import DATA

if TYPE_CHECKING:
    from sarl_core.agents.sb3_normalisation import TrainingEnd

EXPERT_FOLDER = DATA / "experts"
_SCRIPTED = {"Driving-v0": Driver}

_SMALLEST_UNIFORM = 1e-12  # the quantile of 0 would be infinite


@runtime_checkable
class Agent(Protocol):
    """Whoever chooses actions."""

    @property
    def name(self) -> str:
        """What it is called on screen."""

    @property
    def n_uniforms(self) -> int:
        """How many random numbers it needs a step; 0 if it is deterministic."""

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """Choose actions.

        Args:
            observations: Shape (B, d), float32.
            uniforms: In [0, 1), shape (B, n_uniforms); None if it needs none.

        Returns:
            The environment's actions with one column a dimension: (B, m) int64, or (B, m)
            float32. A row depends on that row's arguments only.
        """


@runtime_checkable
class EpisodicAgent(Agent, Protocol):
    """One that plays in this process, episode by episode, as what remembers has to."""

    def begin_episode(self, seed: int) -> None:
        """Forget what was before.

        Args:
            seed: Of the episode that begins.
        """


@runtime_checkable
class PlacedAgent(Agent, Protocol):
    """One that does what it does by where in its episode it is, and so has to be told."""

    def place(self, episodes: NDArray[np.int64], steps: NDArray[np.int64]) -> None:
        """Say where the states lie that it is asked about next.

        Args:
            episodes: Index of the episode of each, (B,).
            steps: Steps of the episode so far, (B,).
        """


@dataclass(frozen=True, eq=False)
class PolicyAgent:
    """A trained (or an untrained) network.

    Attributes:
        name: What it is called on screen.
        policy: The network.
        stochastic: Whether its actions are sampled and not the most likely ones. A policy
            without a distribution (DQN, TD3) always does the same.
        label_first: Action that label 0 stands for, shape (m,).
        notes: Sentences on how its file was read, and on what looks odd in it.
        doubt: What leaves open whether its observations were normalised in its training, or None.
    """

    name: str
    policy: MlpPolicy
    stochastic: bool
    label_first: NDArray[np.int64]
    notes: tuple[str, ...] = ()
    doubt: TrainingEnd | None = None

    @property
    def n_uniforms(self) -> int:
        """One a dimension when sampled."""
        sampled = self.stochastic and self.policy.is_sampled
        return self.policy.n_dimensions if sampled else 0

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """See `Agent.act`."""
        chosen = self.policy.act(observations, uniforms)
        if self.policy.is_discrete:
            return cast(NDArray[np.int64], chosen + self.label_first)
        return chosen


@dataclass(frozen=True, eq=False)
class UniformAgent:
    """The novice: uniform random actions, whatever the state.

    Attributes:
        name: What it is called on screen.
        counts: Number of labels of each discrete dimension, shape (m,); (0,) if continuous.
        label_first: Action that label 0 stands for, shape (m,).
        low: Bounds of continuous dimensions, shape (m,); where a side is unbounded, the
            distribution is Gymnasium's: exponential from the other bound, or normal.
        high: Likewise.
        whole: Whether continuous actions are amounts in whole numbers, of which each from the
            lower to the upper bound is drawn alike.
    """

    name: str
    counts: NDArray[np.int64]
    label_first: NDArray[np.int64]
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    whole: bool = False

    @property
    def n_uniforms(self) -> int:
        """One a dimension."""
        return len(self.counts) or len(self.low)

    def act(
        self, observations: NDArray[np.float32], uniforms: NDArray[np.float64] | None
    ) -> Actions:
        """See `Agent.act`."""
        if uniforms is None:
            raise ValueError("the novice needs random numbers")
        if len(self.counts):
            return cast(
                NDArray[np.int64], (uniforms * self.counts).astype(np.int64) + self.label_first
            )
        return self._continuous(uniforms)

    def _continuous(self, uniforms: NDArray[np.float64]) -> NDArray[np.float32]:
        below, above = np.isfinite(self.low), np.isfinite(self.high)
        low = np.where(below, self.low, 0.0).astype(np.float64)
        high = np.where(above, self.high, 0.0).astype(np.float64)
        amounts = uniforms * (high - low)
        if self.whole:
            amounts = np.floor(uniforms * (high - low + 1.0))
        actions = low + amounts
        if not (below & above).all():
            from scipy.special import ndtri

            inner = np.clip(uniforms, _SMALLEST_UNIFORM, 1.0 - _SMALLEST_UNIFORM)
            actions = np.select(
                [below & above, below, above],
                [actions, low - np.log(inner), high + np.log(inner)],
                ndtri(inner),
            )
        return cast(NDArray[np.float32], np.clip(actions.astype(np.float32), self.low, self.high))


@needing_extras()
def untried_agent(
    spec: str | Path | Agent,
    env_id: EnvironmentOrId,
    *,
    stochastic: bool = False,
    seed: int = 0,
    normalise: str | Path | None = None,
) -> Agent:
    """Make the agent that a name or a file stands for, without a step in its environment.

    Args:
        spec: As in `rollouts.trial.make_agent`, like the rest.
        env_id: What ``gymnasium.make`` takes.
        stochastic: Whether a trained policy is sampled.
        seed: Of the untrained weights.
        normalise: The statistics of a `.zip`, or ``none``.

    Returns:
        The agent.

    Raises:
        InputError: If there is no such agent, or it does not fit the environment.
        WorkError: If a package that it needs is not installed.
    """
    as_environment(env_id)  # refuses what is no environment
    if isinstance(spec, Agent):
        return spec
    require(
        spec,
        (str, Path),
        "an agent must be novice, untrained, expert, the path of an .npz policy or of a "
        "Stable-Baselines3 .zip, or an object with name, n_uniforms and "
        "act(observations, uniforms),",
        "give one of these",
    )
    if normalise is not None and Path(spec).suffix.lower() != ".zip":
        raise InputError(
            f"statistics to normalise by belong to a Stable-Baselines3 .zip, and the agent is "
            f"{str(spec)!r}; leave out --normalise"
        )
    first = np.array(describe_environment(env_id).label_first, dtype=np.int64)
    if spec == "novice":
        return _novice(env_id, first)
    if spec == "untrained":
        return PolicyAgent("untrained", _untrained(env_id, seed), True, first)
    notes: tuple[str, ...] = ()
    doubt = None
    if spec == "expert":
        if scripted := _SCRIPTED.get(_own_id(env_id)):
            return scripted()
        name, policy = "expert", _expert(str(env_id))
    else:
        name = Path(spec).stem
        policy, notes, doubt = _policy_from(Path(spec), env_id, normalise)
    _check_fit(str(spec), policy, env_id)
    if stochastic and policy.noise_by_state:
        raise InputError(
            f"the policy {spec} explored by noise that hangs on the state (gSDE), which is not "
            "read; leave out --stochastic"
        )
    return PolicyAgent(name, policy, stochastic, first, notes, doubt)


def shipped_experts(folder: Path = EXPERT_FOLDER) -> dict[str, Path]:
    """Which experts there are.

    Args:
        folder: Where they lie.

    Returns:
        The `.npz` file of each environment id, in the ids' order.
    """
    experts = {MlpPolicy.load(path).env_id: path for path in folder.glob("*.npz")}
    return dict(sorted(experts.items()))


def has_expert(env_id: EnvironmentOrId) -> bool:
    """Whether an expert is shipped for an environment.

    Args:
        env_id: What ``gymnasium.make`` takes.
    """
    return _own_id(env_id) in {*shipped_experts(), *_SCRIPTED}


def _own_id(env_id: EnvironmentOrId) -> str:
    """An environment's id without the module that registers it."""
    return str(env_id).rsplit(":", 1)[-1]


def _novice(env_id: EnvironmentOrId, first: NDArray[np.int64]) -> UniformAgent:
    env = make_environment(env_id)
    space = env.action_space
    counts = np.array(label_counts(space), dtype=np.int64)
    whole = not len(counts) and np.issubdtype(space.dtype, np.integer)
    low = np.zeros(0) if len(counts) else space.low.reshape(-1)
    high = np.zeros(0) if len(counts) else space.high.reshape(-1)
    env.close()
    bounds = low.astype(np.float32), high.astype(np.float32)
    return UniformAgent("novice", counts, first, *bounds, whole=whole)


def _untrained(env_id: EnvironmentOrId, seed: int) -> MlpPolicy:
    """The weights PPO starts from, without a learner around them."""
    import torch
    from gymnasium import spaces
    from stable_baselines3.common.policies import ActorCriticPolicy

    from sarl_core.agents.sb3_weights import policy_from_state

    description = describe_environment(env_id)
    d, counts = len(description.feature_names), [len(names) for names in description.label_names]
    low = high = None
    actions: spaces.Space[Any] = spaces.MultiDiscrete(counts if description.is_discrete else [2])
    if description.action_low is not None:
        low = np.array(description.action_low, dtype=np.float32)
        high = np.array(description.action_high, dtype=np.float32)
        actions = spaces.Box(low, high, dtype=np.float32)
    with torch.random.fork_rng(devices=[]):  # leave the caller's random numbers alone
        torch.manual_seed(seed)
        network = ActorCriticPolicy(spaces.Box(-np.inf, np.inf, (d,)), actions, lambda _: 0.0)
    return policy_from_state(
        {name: value.detach().numpy().copy() for name, value in network.state_dict().items()},
        discrete=description.is_discrete,
        label_counts=tuple(counts) if description.is_discrete else (),
        action_low=low,
        action_high=high,
        env_id=str(env_id),
    )


def _expert(env_id: str) -> MlpPolicy:
    experts = shipped_experts()
    policy = experts.get(_own_id(env_id))
    if policy is None:
        raise InputError(
            f"there is no shipped expert for {env_id!r}, only for "
            f"{', '.join([*experts, *_SCRIPTED])}; "
            "train one with `train-expert` and give its path"
        )
    return MlpPolicy.load(policy)


def _policy_from(
    path: Path, env_id: EnvironmentOrId, normalise: str | Path | None
) -> tuple[MlpPolicy, tuple[str, ...], TrainingEnd | None]:
    if path.suffix.lower() not in (".npz", ".zip"):
        raise InputError(
            f"there is no agent {str(path)!r}; give novice, untrained, expert, or the path of "
            "an .npz policy or of a Stable-Baselines3 .zip"
        )
    if not path.is_file():
        raise InputError(f"the policy {path} does not exist; check the path")
    if path.suffix.lower() == ".npz":
        return MlpPolicy.load(path), (), None
    from sarl_core.agents.sb3_zip import load_sb3_zip

    env = make_environment(env_id)
    try:
        return load_sb3_zip(path, env, str(env_id), normalise=normalise)
    finally:
        env.close()


def order_notes(agent: Agent, env_id: EnvironmentOrId) -> tuple[str, ...]:
    """What is to be said of how the features of a policy and of an environment were matched.

    Args:
        agent: Who acts.
        env_id: Where it acts.

    Returns:
        Clauses; none where the policy is known to be of such an environment, or is no network.

    Raises:
        InputError: If it was trained in an environment whose features have other names.
    """
    if not isinstance(agent, PolicyAgent):
        return ()
    here = describe_environment(env_id)
    names = catalogued(
        agent.policy.env_id,
        agent.policy.n_features,
        len(here.action_names),
        discrete=here.is_discrete,
    )
    own = tuple(name for name, _ in names.features)
    there, where = (one.rsplit(":", 1)[-1] for one in (agent.policy.env_id, str(env_id)))
    if only_counts(own) and there == where and len(own) == len(here.feature_names):
        return ()  # trained there, and there the environment names its features itself
    order = line_up(
        NamedFeatures(
            f"the policy {agent.name}",
            own,
            agent.policy.env_id,
        ),
        NamedFeatures(where, here.feature_names, str(env_id)),
    )
    if order.how == "permuted":  # two environments of one catalogue: none is the other's
        raise InputError(
            f"the policy {agent.name} was trained on {agent.policy.env_id}, whose features come "
            f"in another order than those of {env_id}; choose a policy trained on {env_id}"
        )
    return (order.note,) if order.note else ()


def _check_fit(spec: str, policy: MlpPolicy, env_id: EnvironmentOrId) -> None:
    """Refuse a policy that was trained for other observations or actions."""
    description = describe_environment(env_id)
    d = len(description.feature_names)
    counts = tuple(len(names) for names in description.label_names)
    advice = f"choose a policy trained on {env_id}"
    if policy.n_features != d:
        raise InputError(
            f"the policy {spec} takes {policy.n_features} features and {env_id} gives {d}; {advice}"
        )
    if policy.is_discrete != description.is_discrete:
        kinds = ("discrete", "continuous") if policy.is_discrete else ("continuous", "discrete")
        raise InputError(
            f"the policy {spec} gives {kinds[0]} actions and {env_id} takes {kinds[1]} ones; "
            f"{advice}"
        )
    if policy.is_discrete and policy.label_counts != counts:
        raise InputError(
            f"the policy {spec} chooses among {_counted(policy.label_counts)} and {env_id} "
            f"offers {_counted(counts)}; {advice}"
        )
    if not policy.is_discrete and policy.n_dimensions != len(description.action_names):
        raise InputError(
            f"the policy {spec} gives {policy.n_dimensions} action dimensions and {env_id} "
            f"takes {len(description.action_names)}; {advice}"
        )


def _counted(counts: tuple[int, ...]) -> str:
    return f"{' x '.join(str(count) for count in counts)} actions"
