"""Rules as a classifier of scikit-learn, on data that have nothing to do with agents."""

from __future__ import annotations

from sklearn.datasets import load_breast_cancer
from sklearn.model_selection import GridSearchCV, train_test_split

from sarl_core import RuleClassifier


def main() -> None:
    """Choose thresholds by cross-validation, and read the rules."""
    data = load_breast_cancer(as_frame=True)
    train, test, known, truth = train_test_split(data.data, data.target, random_state=0)
    search = GridSearchCV(
        RuleClassifier(), {"supp_min": [0.005, 0.02, 0.05], "conf_min": [0.9, 0.95, 1.0]}, cv=5
    )
    search.fit(train, known)
    rules = search.best_estimator_
    print(search.best_params_)
    print(rules.export_text(feature_names=list(train.columns)))
    print(f"right on {rules.score(test, truth):.1%} of {len(test)} cases it has not seen")
    sure = rules.predict_proba(test).max(axis=1) >= 0.95
    print(f"at least 95 % sure of {sure.mean():.0%} of them")


if __name__ == "__main__":
    main()
