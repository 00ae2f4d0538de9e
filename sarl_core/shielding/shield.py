"""The shield (the paper's Algorithm 2): an action that breaks a matching rule is replaced.

It is post-posed and learned from data: it guarantees nothing beyond doing what its rules say.
"""

from __future__ import annotations

from typing import Any, Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.errors import InputError
from sarl_core.mining.rules import RuleSet
from sarl_core.shielding.boxes import Boxes, leaves_out
from sarl_core.shielding.matching import Matcher
from sarl_core.shielding.projection import Projection, replacements

__all__ = ["BatchDecision", "Decision", "Outside", "Projection", "Shield"]

Outside = Literal["act", "abstain"]
"""What a rule does with a state that lies outside the data it was mined from."""


class Decision(NamedTuple):
    """What the shield made of one action; the heart of the flight recorder.

    Attributes:
        executed: The action to execute; the proposed object itself if it breaks no rule.
        proposed: The agent's action.
        rules: For each action dimension the index of the rule in force, in the rule set's
            order, or None.
        intervened: Whether the shield changed the action.
        margin: Distance of the state to the nearest threshold on the paths walked, in the
            feature's own unit; inf where there is no threshold.
        outside: Whether the state lies outside the data of a rule that the proposed action
            breaks: of one that changed it, or, where rules abstain, would have.
    """

    executed: Any
    proposed: Any
    rules: tuple[int | None, ...]
    intervened: bool
    margin: float
    outside: bool = False


class BatchDecision(NamedTuple):
    """What the shield made of B actions.

    Attributes:
        executed: Shape and dtype of the proposed actions.
        proposed: The agent's actions.
        rules: Index of the rule in force or -1, (B, m) int64.
        intervened: Shape (B,).
        margin: Shape (B,).
        outside: Shape (B,).
    """

    executed: NDArray[Any]
    proposed: NDArray[Any]
    rules: NDArray[np.int64]
    intervened: NDArray[np.bool_]
    margin: NDArray[np.float64]
    outside: NDArray[np.bool_]


class Shield:
    """A rule set in force.

    Rules that are not enabled are left out; rules that a person added come before mined ones.

    Attributes:
        rule_set: The rules.
        projection: How a continuous action is replaced.
        outside: Whether a rule acts on states outside the data it was mined from.
    """

    def __init__(
        self,
        rule_set: RuleSet,
        *,
        projection: Projection = "centre",
        outside: Outside = "act",
    ) -> None:
        """Prepare for deciding.

        Args:
            rule_set: The rules.
            projection: A continuous action that breaks a rule becomes the ``centre`` of the
                rule's interval, is moved to the nearest value in it (``clip``), or becomes what
                the ``expert`` showed there (the median).
            outside: Whether a rule changes the action (``act``) or leaves it as it is
                (``abstain``) in a state outside the rule's data box. A rule without a box acts
                everywhere.

        Raises:
            InputError: If the projection or `outside` is unknown, or the rules hold no
                demonstrated values that ``expert`` could use.
        """
        if projection not in get_args(Projection):
            raise InputError(
                f"the projection {projection!r} is none of centre, clip, expert; choose one"
            )
        if outside not in get_args(Outside):
            raise InputError(
                f"what to do outside the data, {outside!r}, is neither act nor abstain; choose one"
            )
        self.rule_set = rule_set
        self.projection = projection
        self.outside: Outside = outside
        self._actions = rule_set.actions
        self._n_features = len(rule_set.source.features)
        self._matchers = tuple(
            Matcher.of(
                [
                    (index, rule)
                    for index, rule in enumerate(rule_set.rules)
                    if rule.dimension == dimension and rule.enabled
                ]
            )
            for dimension in range(len(rule_set.actions))
        )
        self._labels = np.array([rule.action for rule in rule_set.rules], dtype=np.int64)
        self._label_list: list[int] = self._labels.tolist()
        self._replace = replacements(rule_set, projection)
        self._boxes = Boxes(rule_set.rules, self._n_features)
        self._sides = self._boxes.sides
        self._abstains = outside == "abstain"
        self._single = len(self._actions) == 1 and not self._actions[0].is_interval
        self._first = self._actions[0].first

    def decide(self, observation: ArrayLike, action: Any) -> Decision:
        """Check one action and replace it if it breaks a rule.

        Args:
            observation: Shape (d,); compared as float32.
            action: In the environment's own form: an integer, or an array with m entries.

        Returns:
            The decision. An action that breaks no rule is passed on as it is, bit for bit.

        Raises:
            InputError: If the observation has another length than the rules' features.
        """
        state = np.asarray(observation, dtype=np.float32).tolist()
        if len(state) != self._n_features:
            raise self._wrong_width(len(state))
        if self._single:
            rule, margin = self._matchers[0].match(state)
            if rule is None:
                return Decision(action, action, (None,), False, margin)
            wanted = self._label_list[rule] + self._first
            if action == wanted:
                return Decision(action, action, (rule,), False, margin)
            sides = self._sides[rule]
            outside = sides is not None and leaves_out(sides, state)
            if outside and self._abstains:
                return Decision(action, action, (rule,), False, margin, True)
            return Decision(_like(action, wanted), action, (rule,), True, margin, outside)
        return self._decide_each(state, action)

    def _decide_each(self, state: list[float], action: Any) -> Decision:
        values = np.asarray(action)
        flat = values.reshape(-1)
        executed = None
        outside = False
        found: list[int | None] = []
        nearest = float("inf")
        for dimension, matcher in enumerate(self._matchers):
            rule, margin = matcher.match(state)
            nearest = min(nearest, margin)
            found.append(rule)
            if rule is None:
                continue
            value = flat[dimension]
            if self._actions[dimension].label_of(float(value)) != self._label_list[rule]:
                sides = self._sides[rule]
                if sides is not None and leaves_out(sides, state):
                    outside = True
                    if self._abstains:
                        continue
                executed = flat.copy() if executed is None else executed
                executed[dimension] = self._replace.one(rule, float(value))
        if executed is None:
            return Decision(action, action, tuple(found), False, nearest, outside)
        changed = executed.reshape(values.shape)
        return Decision(changed, action, tuple(found), True, nearest, outside)

    def decide_batch(self, observations: ArrayLike, actions: ArrayLike) -> BatchDecision:
        """Check many actions at once, each exactly as `decide` would.

        Args:
            observations: Shape (B, d); compared as float32.
            actions: B actions in the environment's own form.

        Returns:
            The decisions.

        Raises:
            InputError: If the observations have another length than the rules' features, or
                the actions another number than the observations.
        """
        states = np.ascontiguousarray(observations, dtype=np.float32)
        if states.ndim != 2 or states.shape[1] != self._n_features:
            raise self._wrong_width(states.shape[-1] if states.ndim else 0)
        proposed = np.asarray(actions)
        if proposed.size != len(states) * len(self._actions):
            raise InputError(
                f"there are {proposed.size} action values for {len(states)} states with "
                f"{len(self._actions)} action dimensions; give one action a state"
            )
        flat = proposed.reshape(len(states), len(self._actions))
        rules = np.empty((len(states), len(self._actions)), dtype=np.int64)
        margin = np.full(len(states), np.inf)
        executed = flat
        intervened = np.zeros(len(states), dtype=np.bool_)
        outside = np.zeros(len(states), dtype=np.bool_)
        for dimension, matcher in enumerate(self._matchers):
            rules[:, dimension], near = matcher.match_batch(states)
            margin = np.minimum(margin, near)
            column = flat[:, dimension]
            ruled = np.flatnonzero(rules[:, dimension] >= 0)
            labels = self._actions[dimension].labels_of(column[ruled])
            broken = ruled[labels != self._labels[rules[ruled, dimension]]]
            beyond = self._boxes.leave_out(rules[broken, dimension], states[broken])
            outside[broken[beyond]] = True
            if self._abstains:
                broken = broken[~beyond]
            if len(broken):
                executed = flat.copy() if executed is flat else executed
                executed[broken, dimension] = self._replace.many(
                    rules[broken, dimension], column[broken]
                )
                intervened[broken] = True
        return BatchDecision(
            executed.reshape(proposed.shape), proposed, rules, intervened, margin, outside
        )

    def with_rules(self, rule_set: RuleSet) -> Shield:
        """The same way to act with other rules.

        Args:
            rule_set: The rules.

        Returns:
            Another shield; this one stays what it is.
        """
        return Shield(rule_set, projection=self.projection, outside=self.outside)

    @property
    def scanned(self) -> tuple[int, ...]:
        """The rules in whose place another may apply when they are taken out.

        Rules mined from one tree never overlap, so where one is taken out, none applies.
        """
        return tuple(index for matcher in self._matchers for index in matcher.scanned)

    @property
    def keeps_boxes(self) -> bool:
        """Whether any of the rules says where its pairs lay; else none is ever outside."""
        return self._boxes.count > 0

    def _wrong_width(self, got: int) -> InputError:
        env_id = self.rule_set.source.env_id or "another environment"
        return InputError(
            f"the rules ask about {self._n_features} features (of {env_id}) and the observation "
            f"has {got}; use rules of this environment"
        )


def _like(action: Any, value: int) -> Any:
    """A discrete action of the same kind as the one that was proposed."""
    if isinstance(action, np.ndarray):
        return np.full_like(action, value)
    return action.dtype.type(value) if isinstance(action, np.generic) else value
