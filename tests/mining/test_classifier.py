from __future__ import annotations

import numpy as np
from sklearn.utils.estimator_checks import check_estimator

from sarl_core import RuleClassifier


def test_scikit_learns_own_checks_pass():
    results = check_estimator(RuleClassifier(), on_skip=None)
    assert len(results) > 30
    # The one it skips by itself asks for an optional array library.
    others = [r for r in results if r["status"] != "passed"]
    assert [r["check_name"] for r in others] == ["check_array_api_input"]


def test_where_no_rule_applies_it_predicts_the_most_frequent_label():
    states = np.array([[0.0], [0.0], [0.0], [0.0], [1.0]])
    labels = np.array(["stay", "stay", "go", "go", "stay"])
    model = RuleClassifier(supp_min=0.0, conf_min=1.0).fit(states, labels)
    assert len(model.rule_set_) == 1
    assert model.predict([[1.0], [0.0]]).tolist() == ["stay", "stay"]
