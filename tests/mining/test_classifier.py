from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.utils.estimator_checks import check_estimator

from sarl_core import InputError, RuleClassifier
from tests.mining.strategies import labelled_states


def test_scikit_learns_own_checks_pass():
    results = check_estimator(RuleClassifier(), on_skip=None)
    assert len(results) > 30
    # One it may skip by itself asks for an optional array library.
    others = [r for r in results if r["status"] != "passed"]
    assert {r["check_name"] for r in others} <= {"check_array_api_input"}


def test_where_no_rule_applies_it_predicts_the_most_frequent_label():
    states = np.array([[0.0], [0.0], [0.0], [0.0], [1.0]])
    labels = np.array(["stay", "stay", "go", "go", "stay"])
    model = RuleClassifier(supp_min=0.0, conf_min=1.0).fit(states, labels)
    assert len(model.rule_set_) == 1
    assert model.predict([[1.0], [0.0]]).tolist() == ["stay", "stay"]


def test_probabilities_are_the_shares_at_the_rule_that_applies():
    states = np.array([[0.0], [0.0], [0.0], [0.0], [1.0], [1.0], [1.0]])
    labels = np.array(["stay", "stay", "stay", "go", "go", "go", "stop"])
    model = RuleClassifier(supp_min=0.0, conf_min=0.7).fit(states, labels)
    assert len(model.rule_set_) == 1
    assert model.classes_.tolist() == ["go", "stay", "stop"]
    applies, nothing = model.predict_proba([[0.0], [1.0]])
    assert applies.tolist() == [1 / 4, 3 / 4, 0]
    assert nothing.tolist() == [3 / 7, 3 / 7, 1 / 7]
    assert model.predict([[0.0], [1.0]]).tolist() == ["stay", "go"]


@settings(max_examples=40)
@given(labelled_states(), st.floats(0, 1), st.floats(0, 1))
def test_what_is_predicted_is_the_most_probable(demonstrations, supp, conf):
    states = demonstrations.observations
    model = RuleClassifier(supp_min=supp, conf_min=conf).fit(states, demonstrations.actions)
    shares = model.predict_proba(states)
    assert np.allclose(shares.sum(axis=1), 1)
    assert (model.classes_[shares.argmax(axis=1)] == model.predict(states)).all()
    for rule in model.rule_set_:
        assert (shares[rule.applies(states)][:, rule.action] == rule.confidence).all()


def test_the_rules_are_text_with_the_names_of_the_columns():
    states = pd.DataFrame({"angle": [0.0, 0.0, 0.0, 1.0, 1.0], "speed": [0.0, 1.0, 0.0, 1.0, 0.0]})
    model = RuleClassifier(conf_min=0.9).fit(states, ["left", "left", "left", "right", "right"])
    assert model.export_text() == (
        "angle \N{LESS-THAN OR EQUAL TO} 0.5: left (100 % of 3)\n"
        "angle > 0.5: right (100 % of 2)\n"
        "otherwise: left (60 % of 5)\n"
    )
    assert (
        model.export_text(feature_names=["a", "b"]).splitlines()[1] == "a > 0.5: right (100 % of 2)"
    )
    plain = RuleClassifier(conf_min=0.9).fit(states.to_numpy(), [0, 0, 0, 1, 1])
    assert plain.export_text().splitlines()[1] == "feature 0 > 0.5: 1 (100 % of 2)"
    with pytest.raises(InputError, match="are 1, and the model has 2 features; give as many"):
        plain.export_text(feature_names=["a"])
