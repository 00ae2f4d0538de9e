"""A rule set as a scikit-learn classifier, for whoever wants to put it into a pipeline."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.edit_counts import reading_order
from sarl_core.mining.growing.growth import grow_policy_trees
from sarl_core.mining.language import conditions_text, counted, share_text
from sarl_core.mining.rules import node_of


class RuleClassifier(ClassifierMixin, BaseEstimator):  # type: ignore[misc]  # no types there
    """Predicts by the rule that applies, and the most frequent label where none does.

    Attributes:
        classes_: Labels seen in `fit`.
        rule_set_: The rules mined in `fit`.
        n_features_in_: Number of features seen in `fit`.
    """

    def __init__(
        self,
        *,
        supp_min: float = 0.005,
        conf_min: float = 0.95,
        lift_min: float = 0.0,
        max_depth: int | None = None,
        random_state: int = 0,
    ) -> None:
        """Set the thresholds.

        Args:
            supp_min: Minimum support of a rule.
            conf_min: Minimum confidence.
            lift_min: Minimum lift.
            max_depth: Longest rule.
            random_state: Seed of the tree.
        """
        self.supp_min = supp_min
        self.conf_min = conf_min
        self.lift_min = lift_min
        self.max_depth = max_depth
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> Self:
        """Mine rules.

        Args:
            X: States, shape (N, d); compared as float32.
            y: Labels of any kind, shape (N,).

        Returns:
            Itself.
        """
        states, targets = validate_data(self, X, y, dtype=np.float32, ensure_min_samples=2)
        check_classification_targets(targets)
        self.classes_, labels = np.unique(targets, return_inverse=True)
        demonstrations = Demonstrations(
            states,
            labels.astype(np.int64),
            np.zeros(len(labels), dtype=np.int64),
            label_names=(tuple(map(str, range(len(self.classes_)))),),
        )
        trees = grow_policy_trees(demonstrations, seed=self.random_state)
        self.rule_set_ = mine_rules(
            trees,
            supp_min=self.supp_min,
            conf_min=self.conf_min,
            lift_min=self.lift_min,
            max_depth=self.max_depth,
        )
        # Of the rules in their order, then of all pairs, for states to which none applies.
        counts = trees[0].counts[[*map(node_of, self.rule_set_), 0]]
        self._shares = counts / counts.sum(axis=1, keepdims=True)
        return self

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Predict labels.

        Args:
            X: States, shape (B, d); compared as float32.

        Returns:
            Shape (B,): the label of the rule that applies, or the most frequent one.
        """
        most = self.predict_proba(X).argmax(axis=1)
        return np.asarray(self.classes_[most])

    def predict_proba(self, X: ArrayLike) -> NDArray[np.float64]:
        """How the labels are shared among the pairs that a rule was mined from.

        Args:
            X: States, shape (B, d); compared as float32.

        Returns:
            Shape (B, classes), in the order of `classes_`: the shares at the node of the rule that
            applies, or among all pairs where none does.
        """
        check_is_fitted(self)
        states = validate_data(self, X, dtype=np.float32, reset=False)
        row = np.full(len(states), len(self.rule_set_))
        for place, rule in enumerate(self.rule_set_):
            row[rule.applies(states)] = place
        return np.asarray(self._shares[row])

    def export_text(self, *, feature_names: Sequence[str] | None = None) -> str:
        """The rules for reading, the most general first.

        Args:
            feature_names: d names; those seen in `fit` where not given, or "feature 0" and so on.

        Returns:
            A line a rule, as "pole angle > 0.02: right (97 % of 412)", and a last one for states
            to which none applies.

        Raises:
            InputError: If there is another number of names.
        """
        check_is_fitted(self)
        source = self.rule_set_.source
        names = feature_names
        if names is None:
            names = getattr(self, "feature_names_in_", [one.name for one in source.features])
        if len(names) != len(source.features):
            raise InputError(
                f"the names of features are {len(names):,}, and the model has "
                f"{counted(len(source.features), 'feature')}; give as many"
            )
        features = tuple(
            replace(feature, name=str(name))
            for feature, name in zip(source.features, names, strict=True)
        )
        named = replace(self.rule_set_, source=replace(source, features=features))
        lines = [
            f"{conditions_text(rule, named)}: {self.classes_[rule.action]} "
            f"({share_text(rule.confidence)} of {rule.samples:,})"
            for rule in reading_order(named.rules)
        ]
        most = self._shares[-1]
        share = share_text(float(most.max()))
        lines.append(f"otherwise: {self.classes_[most.argmax()]} ({share} of {source.steps:,})")
        return "\n".join(lines) + "\n"
