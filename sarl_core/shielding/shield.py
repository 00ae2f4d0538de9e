"""The shield (the paper's Algorithm 2): an action that breaks a matching rule is replaced.

It is post-posed and learned from data: it guarantees nothing beyond doing what its rules say.
"""

from __future__ import annotations

from copy import copy
from math import isfinite, isnan
from typing import Any, Literal, Self, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.demonstrations.derived import Combination, Extension
from sarl_core.errors import InputError, require
from sarl_core.mining.rule_order import without_idle
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.mining.rules import take_back_unanswered
from sarl_core.shielding.boxes import Boxes, leaves_out
from sarl_core.shielding.forbidding import Forbidding, first_of, never_rules
from sarl_core.shielding.matching import Matcher
from sarl_core.shielding.projection import Projection, label_replacements, replacements
from sarl_core.shielding.readers import ActionForm, ActionReader, StateReader, UnreadableError
from sarl_core.shielding.record import BatchDecision, Decision, DecisionFields, with_passed

__all__ = ["BatchDecision", "Decision", "OnInvalid", "Outside", "Projection", "Shield"]

Outside = Literal["act", "abstain"]
"""What a rule does with a state that lies outside the data it was mined from."""
OnInvalid = Literal["raise", "pass"]
"""What becomes of a step whose state is no state, or whose action is none of the space."""

_RULES = "mine one: mine_rules(...), or load one: load_rules(path)"
_ARRAY, _FLOAT32 = np.ndarray, np.dtype(np.float32)


class Shield:
    """A rule set in force.

    Rules that are not enabled are left out; rules that a person added come before mined ones.

    Attributes:
        rule_set: The rules.
        projection: How a continuous action is replaced.
        outside: Whether a rule acts on states outside the data it was mined from.
        on_invalid: What becomes of a step that no rule can be asked about.
    """

    def __init__(
        self,
        rule_set: RuleSet,
        *,
        projection: Projection = "centre",
        outside: Outside = "act",
        on_invalid: OnInvalid = "raise",
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
            on_invalid: Whether an observation that is no state (NaN or infinite, masked, of
                another length, no numbers), or an action that is none of the space, is an error
                (``raise``) or lets the action ``pass`` unchecked, with the reason in the record.

        Raises:
            InputError: If it is no rule set, one of the choices is unknown, or the rules hold no
                demonstrated values that ``expert`` could use.
        """
        require(rule_set, RuleSet, "what a shield holds to must be a RuleSet", _RULES)
        if projection not in get_args(Projection):
            raise InputError(
                f"the projection {projection!r} is none of centre, clip, expert; choose one"
            )
        if outside not in get_args(Outside):
            raise InputError(
                f"what to do outside the data, {outside!r}, is neither act nor abstain; choose one"
            )
        if on_invalid not in get_args(OnInvalid):
            raise InputError(
                f"what to do with invalid steps, {on_invalid!r}, is neither raise nor pass; "
                "choose one"
            )
        self.rule_set = rule_set
        self.projection: Projection = projection
        self.outside: Outside = outside
        self.on_invalid: OnInvalid = on_invalid
        self._actions = rule_set.actions
        # What no rule asks about need not be worked out at every step.
        used = without_idle(rule_set)
        self._rules = used.rules
        self._matchers = tuple(
            Matcher.of(
                [
                    (index, rule)
                    for index, rule in enumerate(used.rules)
                    if rule.dimension == dimension and rule.enabled and not rule.forbids
                ]
            )
            for dimension in range(len(rule_set.actions))
        )
        self._labels = np.array([rule.action for rule in rule_set.rules], dtype=np.int64)
        # The last stands for no rule, which is -1.
        self._demands = np.array([not rule.forbids for rule in used.rules] + [False])
        self._label_list: list[int] = self._labels.tolist()
        self._boxes = Boxes(used.rules, len(used.source.features))
        self._sides = self._boxes.sides
        self._abstains = outside == "abstain"
        self._forbidding = tuple(
            Forbidding(entries, used.rules, action, self._boxes, abstains=self._abstains)
            if entries
            else None
            for action, entries in zip(rule_set.actions, never_rules(used), strict=True)
        )
        self._states = StateReader(rule_set)
        self._extension = Extension.of(used.source.features)
        self._extends = bool(self._extension.definitions)
        self._formulas = not all(
            isinstance(one, Combination) for one in self._extension.definitions
        )
        self._n_features = self._extension.width
        self._first_match = self._matchers[0].match
        self._take_form(ActionForm.of_rules(rule_set))

    def __repr__(self) -> str:
        """Its rules and what was chosen, as `Shield(RuleSet(...), projection='centre', ...)`."""
        return (
            f"Shield({self.rule_set!r}, projection={self.projection!r}, "
            f"outside={self.outside!r}, on_invalid={self.on_invalid!r})"
        )

    def _match_one(self, dimension: int, state: list[float]) -> tuple[int | None, float]:
        """The rule that applies to one state, some of whose formulas may have no value."""
        rule, margin = self._matchers[dimension].match(state)
        if rule is not None and any(
            isnan(state[feature]) for feature, _, _ in self._rules[rule].conditions
        ):
            return None, margin
        return rule, margin

    def _take_form(self, form: ActionForm) -> None:
        """Execute actions of this form from now on."""
        self._form = form
        self._reader = ActionReader(self._actions, form)
        self._replace = replacements(self.rule_set, self.projection, form.dtype)
        self._discrete = bool(form.labels)
        self._forbidding = tuple(
            each
            and each.executing(
                label_replacements(action, self.projection, form.dtype), discrete=self._discrete
            )
            for action, each in zip(self._actions, self._forbidding, strict=True)
        )
        self._single = len(form.labels) == 1 and form.shape in (None, ())
        self._scalar = form.dtype.type
        self._wanted: list[int] = []
        self._wanted_scalars: list[Any] = []
        if self._single:
            actions = np.array(self._actions[0].actions, dtype=np.int64)
            wanted = actions[self._labels].astype(form.dtype)
            self._wanted, self._wanted_scalars = wanted.tolist(), list(wanted)
        self._first, count = form.labels[0] if form.labels else (0, 0)
        self._beyond = self._first + count
        self._shape = (len(self._actions),) if form.shape is None else form.shape

    def for_space(self, action_space: Any) -> Self:
        """The same shield for an environment that is known.

        Args:
            action_space: That fits the rules.

        Returns:
            What it executes has the dtype and the shape of the space; an action is valid if it is
            one of the space, also where rules know fewer.

        Raises:
            InputError: If no number of the space's dtype lies in a rule's interval.
        """
        form = ActionForm.of_space(action_space)
        if form == self._form:
            return self
        other = copy(self)
        other._take_form(form)
        return other

    def decide(self, observation: ArrayLike, action: Any) -> Decision:
        """Check one action and replace it if it breaks a rule.

        Args:
            observation: Shape (d,); compared as float32. What the rules derive from it is worked
                out here.
            action: An integer, or m numbers in any container. What will be executed is judged:
                the action in the environment's dtype (float32 where no environment is known).
                Labels are whole numbers of any kind; a continuous action out of its bounds
                carries the label of the outermost interval.

        Returns:
            The decision. An action that breaks no rule is passed on as it is, bit for bit, if it
            has the environment's dtype; else the same numbers in that dtype.

        Raises:
            InputError: If the observation is no state or the action none of the space, unless
                `on_invalid` lets such actions pass.
        """
        return Decision(*self.decision_fields(observation, action))

    def decision_fields(self, observation: Any, action: Any) -> DecisionFields:
        """As `decide`, for those who make a record of their own, as `ShieldedEnv` does.

        Args:
            observation: As for `decide`.
            action: As for `decide`.

        Returns:
            The fields of the decision, without the time that it takes to name them.

        Raises:
            InputError: As `decide`.
        """
        # The plain cases are told by a few comparisons; everything else is read with care.
        if type(observation) is _ARRAY and observation.ndim == 1 and observation.dtype == _FLOAT32:
            state = observation.tolist()
            # A sum of float32 numbers does not overflow in float64.
            if len(state) == self._n_features and isfinite(sum(state)):
                if self._extends:
                    state = self._extension.one(state)
                kind = type(action)
                if self._single:
                    if (
                        kind is self._scalar
                        or kind is int
                        or (kind is _ARRAY and not action.ndim and action.dtype == self._form.dtype)
                    ):
                        value = int(action)
                        if self._first <= value < self._beyond:
                            return self._decide_label(state, action, action, value)
                elif (
                    kind is _ARRAY
                    and action.dtype == self._form.dtype
                    and action.shape == self._shape
                    and not self._discrete
                    and isfinite(sum(action.ravel().tolist()))
                ):
                    return self._decide_each(state, action, action, action.reshape(-1))
        return self._decide_carefully(observation, action)

    def _decide_carefully(self, observation: Any, action: Any) -> DecisionFields:
        """As `decision_fields`, for whatever may come."""
        invalid, state, values, handed = None, None, None, action
        try:
            state = self._extension.one(self._states.one(observation).tolist())
        except UnreadableError as error:
            invalid = str(error)
        try:
            values, shape = self._reader.one(action)
            handed = self._handed(action, values, shape)
        except UnreadableError as error:
            invalid = invalid or str(error)
        if invalid is not None or state is None or values is None:
            if self.on_invalid == "raise":
                raise InputError(f"{invalid}; {_CURE}")
            nothing = (None,) * len(self._actions)
            return handed, action, nothing, False, float("nan"), False, invalid
        if self._single:
            return self._decide_label(state, action, handed, int(values[0]))
        return self._decide_each(state, action, handed, values)

    def _handed(self, action: Any, values: NDArray[Any], shape: tuple[int, ...]) -> Any:
        """An action as it is executed if it breaks no rule."""
        form = self._form
        shape = shape if form.shape is None else form.shape
        if isinstance(action, np.ndarray):
            # No subclass: a matrix or a masked array behaves in other ways.
            plain = type(action) is np.ndarray and action.dtype == form.dtype
            return action if plain and action.shape == shape else values.reshape(shape)
        if shape == () and (
            type(action) is form.dtype.type or (self._single and type(action) is int)
        ):
            return action
        return values.reshape(shape)[()]

    def _decide_label(
        self, state: list[float], action: Any, handed: Any, value: int
    ) -> DecisionFields:
        """Decide one discrete action, a valid one."""
        rule, margin = self._match_one(0, state) if self._formulas else self._first_match(state)
        if rule is None:
            forbidding = self._forbidding[0]
            if forbidding is None:
                return handed, action, (None,), False, margin, False, None
            rule, changed, near, outside = forbidding.decide(state, value)
            margin = min(margin, near)
            if changed == value:
                return handed, action, (rule,), False, margin, outside, None
            kind = type(handed)
            executed = (
                self._scalar(changed)
                if kind is self._scalar
                else changed
                if kind is int
                else np.full_like(handed, changed)
            )
            return executed, action, (rule,), True, margin, outside, None
        if value == self._wanted[rule]:
            return handed, action, (rule,), False, margin, False, None
        sides = self._sides[rule]
        outside = sides is not None and leaves_out(sides, state)
        if outside and self._abstains:
            return handed, action, (rule,), False, margin, True, None
        # A discrete action of the same kind as the one that would have been handed on.
        kind = type(handed)
        executed = (
            self._wanted_scalars[rule]
            if kind is self._scalar
            else self._wanted[rule]
            if kind is int
            else np.full_like(handed, self._wanted[rule])
        )
        return executed, action, (rule,), True, margin, outside, None

    def _decide_each(
        self, state: list[float], action: Any, handed: Any, values: NDArray[Any]
    ) -> DecisionFields:
        """Decide m action dimensions, each of them valid."""
        executed = None
        outside = False
        rules: list[int | None] = []
        nearest = float("inf")
        numbers = values.tolist()
        for dimension, matcher in enumerate(self._matchers):
            rule, margin = (
                self._match_one(dimension, state) if self._formulas else matcher.match(state)
            )
            nearest = min(nearest, margin)
            value, forbidding = numbers[dimension], self._forbidding[dimension]
            if rule is None and forbidding is not None:
                rule, changed, margin, beyond = forbidding.decide(state, value)
                nearest, outside = min(nearest, margin), outside or beyond
                rules.append(rule)
                if changed != value:
                    executed = values.copy() if executed is None else executed
                    executed[dimension] = changed
                continue
            rules.append(rule)
            if rule is None:
                continue
            label = self._label_list[rule]
            if self._actions[dimension].label_of(value) != label:
                sides = self._sides[rule]
                if sides is not None and leaves_out(sides, state):
                    outside = True
                    if self._abstains:
                        continue
                executed = values.copy() if executed is None else executed
                executed[dimension] = (
                    self._actions[dimension].actions[label]
                    if self._discrete
                    else self._replace.one(rule, value)
                )
        if executed is None:
            return handed, action, tuple(rules), False, nearest, outside, None
        changed = executed.reshape(np.shape(handed))
        if not isinstance(handed, np.ndarray):
            changed = changed[()]
        return changed, action, tuple(rules), True, nearest, outside, None

    def decide_batch(self, observations: ArrayLike, actions: ArrayLike) -> BatchDecision:
        """Check many actions at once, each exactly as `decide` would.

        Args:
            observations: B of them, as (B, d); compared as float32.
            actions: B actions.

        Returns:
            The decisions.

        Raises:
            InputError: If there are not as many actions as observations; as `decide` if one of
                them is invalid, then with the number of the row.
        """
        states, faults = self._states.many(observations)
        proposed, values, shape, unread = self._reader.many(actions)
        if len(proposed) != len(states):
            raise InputError(
                f"there are {proposed.size} action values for {len(states)} states with "
                f"{len(self._actions)} action dimensions; give one action a state"
            )
        invalid = np.full(len(states), None, dtype=np.object_)
        shape = shape if self._form.shape is None else self._form.shape
        if not faults and not unread:
            states = self._extension.many(states)
            executed, rules, intervened, margin, outside = self._decide_rows(states, values)
            executed = executed.reshape(len(states), *shape)
            return BatchDecision(executed, proposed, rules, intervened, margin, outside, invalid)
        faults = unread | faults
        if self.on_invalid == "raise":
            row = min(faults)
            where = f" (row {row} of {len(states)})" if len(states) > 1 else ""
            raise InputError(f"{faults[row]}{where}; {_CURE}")
        bad = sorted(faults)
        invalid[bad] = [faults[row] for row in bad]
        valid = np.ones(len(states), dtype=np.bool_)
        valid[bad] = False
        rules = np.full(values.shape, NO_RULE, dtype=np.int64)
        margin = np.full(len(states), np.nan)
        executed = values.copy()
        intervened, outside = np.zeros((2, len(states)), dtype=np.bool_)
        readable = self._extension.many(np.ascontiguousarray(states[valid]))
        decided = self._decide_rows(readable, values[valid])
        columns = (executed, rules, intervened, margin, outside)
        for column, part in zip(columns, decided, strict=True):
            column[valid] = part
        return BatchDecision(
            with_passed(executed.reshape(len(states), *shape), proposed, sorted(unread)),
            proposed,
            rules,
            intervened,
            margin,
            outside,
            invalid,
        )

    def _decide_rows(
        self, states: NDArray[np.float32], flat: NDArray[Any]
    ) -> tuple[
        NDArray[Any],
        NDArray[np.int64],
        NDArray[np.bool_],
        NDArray[np.float64],
        NDArray[np.bool_],
    ]:
        """Decide valid rows.

        Args:
            states: Shape (B, d + k), contiguous.
            flat: Shape (B, m), in the environment's dtype.

        Returns:
            Executed (B, m), rules (B, m), intervened, margin and outside (B,).
        """
        rules, margin = self._match(states)
        executed = flat
        intervened, outside = np.zeros((2, len(states)), dtype=np.bool_)
        for dimension, action in enumerate(self._actions):
            column = flat[:, dimension]
            ruled = np.flatnonzero(rules[:, dimension] >= 0)
            labels = action.labels_of(column[ruled])
            broken = ruled[labels != self._labels[rules[ruled, dimension]]]
            beyond = self._boxes.leave_out(rules[broken, dimension], states[broken])
            outside[broken[beyond]] = True
            if self._abstains:
                broken = broken[~beyond]
            if len(broken):
                executed = flat.copy() if executed is flat else executed
                breaks = rules[broken, dimension]
                executed[broken, dimension] = (
                    np.array(action.actions)[self._labels[breaks]]
                    if self._discrete
                    else self._replace.many(breaks, column[broken])
                )
                intervened[broken] = True
            forbidding = self._forbidding[dimension]
            rows = np.flatnonzero(rules[:, dimension] < 0)
            if forbidding is not None and len(rows):
                rules[rows, dimension], values, near, beyond = forbidding.decide_many(
                    np.ascontiguousarray(states[rows]), column[rows]
                )
                margin[rows] = np.minimum(margin[rows], near)
                outside[rows] |= beyond
                changed = rows[values != column[rows]]
                if len(changed):
                    executed = flat.copy() if executed is flat else executed
                    executed[rows, dimension] = values
                    intervened[changed] = True
        return executed, rules, intervened, margin, outside

    def _match(self, states: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Rules in force (B, m) and margins (B,) of valid states."""
        rules = np.empty((len(states), len(self._actions)), dtype=np.int64)
        margin = np.full(len(states), np.inf)
        for dimension, matcher in enumerate(self._matchers):
            rules[:, dimension], near = matcher.match_batch(states)
            if self._formulas:
                take_back_unanswered(rules[:, dimension], states, self._rules)
            margin = np.minimum(margin, near)
        return rules, margin

    def rules_in_force(self, observations: ArrayLike) -> NDArray[np.int64]:
        """The rules that apply, whatever the action.

        Args:
            observations: Shape (B, d); compared as float32.

        Returns:
            Index of the rule in force or -1, (B, m); -1 in what is no state.

        Raises:
            InputError: As `decide_batch`.
        """
        states, faults = self._states.many(observations)
        if faults and self.on_invalid == "raise":
            raise InputError(f"{faults[min(faults)]}; {_CURE}")
        bad = sorted(faults)
        if bad:
            states = states.copy()
            states[bad] = 0.0
        states = self._extension.many(states)
        rules, _ = self._match(states)
        for dimension, forbidding in enumerate(self._forbidding):
            rows = np.flatnonzero(rules[:, dimension] < 0)
            if forbidding is not None and len(rows):
                forbidden, _ = forbidding.many(np.ascontiguousarray(states[rows]))
                rules[rows, dimension] = first_of(forbidden)
        rules[bad] = NO_RULE
        return rules

    def with_rules(self, rule_set: RuleSet) -> Shield:
        """The same way to act with other rules.

        Args:
            rule_set: The rules.

        Returns:
            Another shield; this one stays what it is.
        """
        return Shield(
            rule_set,
            projection=self.projection,
            outside=self.outside,
            on_invalid=self.on_invalid,
        )

    @property
    def scanned(self) -> tuple[int, ...]:
        """The rules in whose place another may apply when they are taken out.

        Rules that demand and were mined from one tree never overlap, so where one is taken out,
        none applies, unless others forbid something there; those overlap.
        """
        tried = {index for matcher in self._matchers for index in matcher.scanned}
        return tuple(
            index
            for index, rule in enumerate(self._rules)
            if index in tried or (rule.enabled and self._forbidding[rule.dimension] is not None)
        )

    def freedom(
        self, observations: NDArray[np.float32], rules: NDArray[np.int64]
    ) -> NDArray[np.float64]:
        """What the rules leave an agent to choose from.

        Args:
            observations: Shape (B, d), or with what is derived (B, d + k).
            rules: In force there, -1 for none, (B, m).

        Returns:
            Shape (B,): the mean over the action dimensions of log(labels still allowed) /
            log(labels): 1 where no rule applies or it abstains, 0 where one label is left, as
            every rule that demands one leaves.
        """
        free = np.where(self._demands[rules], 0.0, 1.0)
        if self._abstains or any(self._forbidding):
            observations = np.ascontiguousarray(self._extension.many(observations))
        for dimension, action in enumerate(self._actions):
            column, forbidding = rules[:, dimension], self._forbidding[dimension]
            if self._abstains:
                ruled = np.flatnonzero(self._demands[column])
                beyond = self._boxes.leave_out(column[ruled], observations[ruled])
                free[ruled[beyond], dimension] = 1.0
            if action.n_labels == 1:  # there was nothing to choose from
                free[:, dimension] = 1.0
            elif forbidding is not None:
                rows = np.flatnonzero((column >= 0) & ~self._demands[column])
                free[rows, dimension] = forbidding.freedom(np.ascontiguousarray(observations[rows]))
        return np.asarray(free.mean(axis=1))

    @property
    def keeps_boxes(self) -> bool:
        """Whether any of the rules says where its pairs lay; else none is ever outside."""
        return self._boxes.count > 0


_CURE = (
    "give states and actions of the rules' environment, or let such steps pass unchecked "
    "(on_invalid='pass', on the command line --on-invalid pass)"
)
