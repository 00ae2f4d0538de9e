"""The shield around a Gymnasium environment: in learning, in evaluation, in rendering."""

from __future__ import annotations

from math import isfinite
from numbers import Real
from typing import Any, NamedTuple, SupportsFloat

import gymnasium
import numpy as np

from sarl_core.demonstrations.dataset import observed_features
from sarl_core.environments.description import catalogued
from sarl_core.environments.feature_order import NamedFeatures, shortened
from sarl_core.environments.naming import key_names
from sarl_core.environments.observation_layers import Observed, observed
from sarl_core.errors import InputError, quoted, require
from sarl_core.mining.rule_order import fitted_rules
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.readers import state_vector
from sarl_core.shielding.shield import Shield


class StepRecord(NamedTuple):
    """The record of one shielded step, in ``info["shield"]``.

    Attributes:
        episode: Index of the episode, counted from the last reset with a seed, so that the same
            seed gives the same records.
        step: Index of the step within its episode.
        observation: What the agent saw, (d,) float32; as it came where it is no such state.
        proposed: The agent's action.
        executed: The action that was executed, in the environment's dtype and shape.
        rules: For each action dimension the index of the rule in force, or None.
        intervened: Whether the shield changed the action.
        margin: Distance to the nearest threshold on the paths walked; NaN where none was.
        outside: Whether the state lies outside the data of a rule that the action breaks.
        invalid: Why no rule was asked, where the observation is no state or the action none of
            the space; else None.
    """

    episode: int
    step: int
    observation: np.ndarray[Any, np.dtype[np.float32]]
    proposed: Any
    executed: Any
    rules: tuple[int | None, ...]
    intervened: bool
    margin: float
    outside: bool = False
    invalid: str | None = None


_new_tuple = tuple.__new__
_MAKE = "make one: gymnasium.make('CartPole-v1')"


class ShieldedEnv(gymnasium.Wrapper[Any, Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """An environment whose every action passes through a shield.

    Whoever acts in it, a learner, an evaluation or a renderer, cannot do otherwise. The record
    of each step is in ``info["shield"]``.

    Attributes:
        shield: The rules in force, in the order of the environment's features.
        notes: What is to be said of that order, where names do not tell it.
        penalty: Taken off the reward at every intervention.
    """

    def __init__(
        self, env: gymnasium.Env[Any, Any], shield: Shield, *, penalty: float = 0.0
    ) -> None:
        """Wrap an environment.

        Args:
            env: To wrap.
            shield: The rules in force.
            penalty: Taken off the reward at every intervention.

        Raises:
            InputError: If the penalty is no number, the rules are not for the spaces of this
                environment, its features have other names than theirs, or its observations are
                normalised. So does `step`,
                at an observation or an action that is none, unless the shield lets them pass.
        """
        require(env, gymnasium.Env, "what is shielded must be a gymnasium.Env", _MAKE)
        check_penalty(penalty)
        gymnasium.utils.RecordConstructorArgs.__init__(self, shield=shield, penalty=penalty)
        super().__init__(env)
        self.shield, self.notes = fitted(
            shield, env.observation_space, env.action_space, observed(env)
        )
        self.penalty = penalty
        space = env.observation_space
        self._space = None if is_flat(space) else space
        self._observation: Any = None
        self._episode = -1
        self._step = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Start an episode, as the wrapped environment does."""
        observation, info = self.env.reset(seed=seed, options=options)
        self._observation = state_vector(observation, self._space)
        self._episode = 0 if seed is not None else self._episode + 1
        self._step = 0
        return observation, info

    def step(self, action: Any) -> tuple[Any, SupportsFloat, bool, bool, dict[str, Any]]:
        """Check the action, execute what the shield makes of it, and record it."""
        if self._episode < 0:
            raise gymnasium.error.ResetNeeded("call reset before step")
        state = self._observation
        executed, proposed, rules, intervened, margin, outside, invalid = (
            self.shield.decision_fields(state, action)
        )
        observation, reward, terminated, truncated, info = self.env.step(executed)
        # As `StepRecord(...)`, in half the time, at every step.
        info["shield"] = _new_tuple(
            StepRecord,
            (
                self._episode,
                self._step,
                state,
                proposed,
                executed,
                rules,
                intervened,
                margin,
                outside,
                invalid,
            ),
        )
        if intervened and self.penalty:
            reward = float(reward) - self.penalty
        self._step += 1
        # A copy: an environment may write the next observation into the same array.
        self._observation = state_vector(observation, self._space)
        return observation, reward, terminated, truncated, info


def check_penalty(penalty: float) -> None:
    """Refuse a penalty that cannot be taken off a reward.

    Args:
        penalty: As it was given.

    Raises:
        InputError: If it is no finite number.
    """
    if not (isinstance(penalty, Real) and isfinite(penalty)):
        raise InputError(f"the penalty is {quoted(penalty)}; give a finite number")


def is_flat(space: gymnasium.Space[Any]) -> bool:
    """Whether observations of a space are vectors already.

    Args:
        space: Observation space.

    Returns:
        False where `flatten` is needed.
    """
    return isinstance(space, gymnasium.spaces.Box) and len(space.shape) == 1


class FittedShield(NamedTuple):
    """A shield for one environment.

    Attributes:
        shield: Its rules are in the order of the environment's features and actions, under the
            numbers they had; what it executes has the dtype and the shape of the action space.
        notes: What is to be said of that order, as clauses; none where it was the same.
    """

    shield: Shield
    notes: tuple[str, ...]


def fitted(
    shield: Shield,
    observation_space: gymnasium.Space[Any],
    action_space: gymnasium.Space[Any],
    observed: Observed,
) -> FittedShield:
    """Put a shield's rules into the order of an environment's features, by their names.

    Args:
        shield: The rules.
        observation_space: Of the environment.
        action_space: Of the environment.
        observed: Whose observations it shows, which tells the names of its features.

    Returns:
        The same shield where the order is the same.

    Raises:
        InputError: If the number of features, the kind and number of actions or their names
            differ.
    """
    check_fit(observation_space, action_space, shield)
    rule_set = shield.rule_set
    discrete = not rule_set.actions[0].is_interval
    width = len(observed_features(rule_set.source.features))
    names = catalogued(observed.env_id, width, len(rule_set.actions), discrete=discrete)
    features = observed.names.features or key_names(observation_space)
    ordered = fitted_rules(
        rule_set,
        NamedFeatures(
            observed.owner,
            features or tuple(name for name, _ in names.features),
            observed.env_id,
        ),
        observed.names.actions or names.actions,
    )
    if ordered.rule_set is not rule_set:
        shield = shield.with_rules(ordered.rule_set)
    inner = observed.owner.partition(" behind ")[0]  # no wrapper renames what is done
    m = len(rule_set.actions)
    labels = observed.names.labels or catalogued(inner, width, m, discrete=discrete).labels
    notes = (*ordered.notes, *_label_notes(ordered.rule_set, labels))
    return FittedShield(shield.for_space(action_space), notes)


def _label_notes(rule_set: RuleSet, known: tuple[tuple[str, ...], ...]) -> tuple[str, ...]:
    """Which actions stand for labels that are words of a file, which knew no environment."""
    if rule_set.source.env_id:
        return ()
    notes = []
    for place, action in enumerate(rule_set.actions):
        own, theirs = action.label_names, known[place] if place < len(known) else ()
        numbered = own == tuple(map(str, action.actions))
        if action.is_interval or action.codes or numbered or own == theirs:
            continue
        if {*own} <= {*theirs} and own != theirs[: len(own)]:
            raise InputError(
                f"the rules number their labels {shortened(own)} otherwise than the environment "
                f"numbers its actions {shortened(theirs)}; mine them with --env, which tells the "
                "numbers"
            )
        stand = shortened([f"{name!r} for {number}" for number, name in enumerate(own)])
        notes.append(
            "the rules do not say of which environment they are; their labels stand for its "
            f"actions in their order: {stand}"
        )
    return tuple(notes)


def check_fit(
    observation_space: gymnasium.Space[Any], action_space: gymnasium.Space[Any], shield: Shield
) -> None:
    """Refuse rules that are not for these spaces.

    Args:
        observation_space: Of the environment.
        action_space: Of the environment.
        shield: The rules.

    Raises:
        InputError: If the number of features or the kind and number of actions differ.
    """
    require(shield, Shield, "the shield must be a Shield", "wrap the rules: Shield(rules)")
    spaces = gymnasium.spaces
    source, actions = shield.rule_set.source, shield.rule_set.actions
    rules_of = f"the rules (of {source.env_id or 'an unnamed environment'})"
    features, width = (
        spaces.utils.flatdim(observation_space),
        len(observed_features(source.features)),
    )
    if features != width:
        raise InputError(
            f"{rules_of} ask about {width} features and the environment's "
            f"observations have {features}; use rules of this environment"
        )
    labels = _labels_of(action_space)
    wanted = None if actions[0].is_interval else [a.reach for a in actions]
    dimensions = spaces.utils.flatdim(action_space) if labels is None else len(labels)
    fits = dimensions == len(actions) and (labels is None) == (wanted is None)
    if fits and labels is not None and wanted is not None:
        fits = all(
            first <= least and least + need <= first + have
            for (first, have), (least, need) in zip(labels, wanted, strict=True)
        )
    if not fits:
        raise InputError(
            f"{rules_of} prescribe {_actions_in_words(wanted, len(actions))} and the environment "
            f"takes {_actions_in_words(labels, dimensions)}; use rules of this environment"
        )


def _labels_of(space: gymnasium.Space[Any]) -> list[tuple[int, int]] | None:
    """First action and number of actions of each discrete dimension; None if continuous."""
    spaces = gymnasium.spaces
    if isinstance(space, spaces.Discrete):
        return [(int(space.start), int(space.n))]
    if isinstance(space, spaces.MultiDiscrete):
        starts = np.asarray(space.start).reshape(-1).tolist()
        return list(zip(starts, space.nvec.reshape(-1).tolist(), strict=True))
    if isinstance(space, spaces.MultiBinary):
        return [(0, 2)] * spaces.utils.flatdim(space)
    return None


def _actions_in_words(labels: list[tuple[int, int]] | None, dimensions: int) -> str:
    if labels is None:
        return f"{dimensions} continuous action dimension{'s' if dimensions > 1 else ''}"
    return "the discrete actions " + ", ".join(
        f"{first} to {first + count - 1}" for first, count in labels
    )
