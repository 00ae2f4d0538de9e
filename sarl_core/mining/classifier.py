"""A rule set as a scikit-learn classifier, for whoever wants to put it into a pipeline."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, ClassifierMixin
from sklearn.utils.multiclass import check_classification_targets
from sklearn.utils.validation import check_is_fitted, validate_data

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.tree import grow_policy_trees


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
        self._fallback = int(np.bincount(labels).argmax())
        return self

    def predict(self, X: ArrayLike) -> NDArray[Any]:
        """Predict labels.

        Args:
            X: States, shape (B, d); compared as float32.

        Returns:
            Shape (B,): the label of the rule that applies, or the most frequent one.
        """
        check_is_fitted(self)
        states = validate_data(self, X, dtype=np.float32, reset=False)
        labels = np.full(len(states), self._fallback)
        for rule in self.rule_set_.rules:
            labels[rule.applies(states)] = rule.action
        return np.asarray(self.classes_[labels])
