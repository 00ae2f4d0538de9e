"""What finds rules in pairs: a method, in a process of its own, with a limit of time and memory.

``python -m docs.scripts.large_methods METHOD FOLDER`` reads states and labels from the folder
(``seen_states.npy``, ``seen_labels.npy``, and ``fresh_…`` to predict) and prints what came out as
JSON: a line before the work, one after the rules are there and one after the prediction. It imports
what the method needs and nothing else, so that it runs in an interpreter that has the method alone.
"""

from __future__ import annotations

import json
import resource
import signal
import sys
import time
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

SMALLEST, CONFIDENT = 0.001, 0.9
"""Least support of a rule, and confidence."""
SECONDS, MEMORY = 120, 8_000_000_000
"""That a method has for its rules."""
PREDICTING = 30
"""Seconds that it has for the prediction."""
BINS, LONGEST = 5, 3
"""Of a feature, and conditions of a rule, for what looks for combinations of both."""

States = NDArray[np.float32]
Labels = NDArray[np.int64]
Predict = Callable[[States], Labels]
Fit = Callable[[States, Labels], tuple[int, Predict | None]]
"""Gives the number of rules, and predicts where the method does."""


class Method(NamedTuple):
    """A way to rules.

    Attributes:
        title: For people.
        package: That brings it.
        load: Imports it, which is not timed.
        binary: Whether it only knows "label 0 or not".
    """

    title: str
    package: str
    load: Callable[[], Fit]
    binary: bool = False


def ours(learner: str) -> Callable[[], Fit]:
    """Trees and rules of this project."""

    def load() -> Fit:
        from benchmarks.large import pruned
        from sarl_core import Demonstrations, grow_policy_trees, mine_rules

        def fit(states: States, labels: Labels) -> tuple[int, Predict]:
            pairs = Demonstrations(states, labels, np.arange(len(labels)) // 1_000)
            (tree,) = grow_policy_trees(pairs, learner=learner, min_support=SMALLEST)  # type: ignore[arg-type]
            rules = mine_rules([tree], supp_min=SMALLEST, conf_min=CONFIDENT)
            return len(rules), lambda fresh: tree.label[pruned(tree)[tree.apply(fresh)]]

        return fit

    return load


def scikit_learn() -> Fit:
    """CART with leaves of the smallest size."""
    from sklearn.tree import DecisionTreeClassifier

    def fit(states: States, labels: Labels) -> tuple[int, Predict]:
        least = int(SMALLEST * len(labels))
        tree = DecisionTreeClassifier(min_samples_leaf=least, random_state=0).fit(states, labels)
        return int(tree.get_n_leaves()), tree.predict

    return fit


def imodels(name: str, **options: Any) -> Callable[[], Fit]:
    """One of its learners, as it comes."""

    def load() -> Fit:
        import imodels  # type: ignore[import-not-found]

        def fit(states: States, labels: Labels) -> tuple[int, Predict]:
            model = getattr(imodels, name)(**options).fit(states, (labels == 0).astype(int))
            rules = getattr(model, "rules_", None)
            return int(model.complexity_) if rules is None else len(rules), model.predict

        return fit

    return load


def mlxtend(conditions: int) -> Callable[[], Fit]:
    """Frequent sets of bins, and the rules that lead from them to a label."""
    return lambda: _associations(conditions)


def _associations(conditions: int) -> Fit:
    import pandas as pd
    from mlxtend.frequent_patterns import (  # type: ignore[import-not-found]
        association_rules,
        fpgrowth,
    )

    def fit(states: States, labels: Labels) -> tuple[int, None]:
        items = pd.get_dummies(pd.DataFrame(binned(states)), columns=list(range(states.shape[1])))
        actions = pd.get_dummies(pd.Series(labels), prefix="label")
        sets = fpgrowth(
            items.join(actions).astype(bool),
            min_support=SMALLEST,
            max_len=conditions + 1,
            use_colnames=True,
        )
        rules = association_rules(sets, metric="confidence", min_threshold=CONFIDENT)
        wanted = {frozenset([name]) for name in actions.columns}
        return int(rules["consequents"].isin(wanted).sum()), None

    return fit


def pysubgroup() -> Fit:
    """The best subgroups of each label, by beam search."""
    import pandas as pd
    import pysubgroup as groups  # type: ignore[import-not-found]

    def fit(states: States, labels: Labels) -> tuple[int, None]:
        table = pd.DataFrame(states, columns=[f"x{one}" for one in range(states.shape[1])])
        table["label"] = labels
        space = groups.create_selectors(table, nbins=BINS, ignore=["label"])
        rules = 0
        for label in np.unique(labels).tolist():
            target = groups.BinaryTarget("label", label)
            task = groups.SubgroupDiscoveryTask(
                table, target, space, qf=groups.WRAccQF(), result_set_size=20, depth=LONGEST
            )
            rules += len(groups.BeamSearch(beam_width=20).execute(task).to_dataframe())
        return rules, None

    return fit


def binned(states: States) -> NDArray[np.int64]:
    """The bin of each value; each bin of a feature has about as many states."""
    shares = np.linspace(0, 1, BINS + 1)[1:-1]
    return np.stack(
        [np.searchsorted(np.quantile(column, shares), column) for column in states.T], axis=1
    )


METHODS = {
    "histogram": Method("SARL, histogram learner", "sarl_core", ours("histogram")),
    "exact": Method("SARL, exact learner", "sarl_core", ours("exact")),
    "tree": Method("scikit-learn, DecisionTreeClassifier", "scikit-learn", scikit_learn),
    "skope": Method(
        "imodels, SkopeRulesClassifier",
        "imodels",
        imodels("SkopeRulesClassifier", random_state=0),
        binary=True,
    ),
    "rulefit": Method(
        "imodels, RuleFitClassifier",
        "imodels",
        imodels("RuleFitClassifier", random_state=0),
        binary=True,
    ),
    "rule_list": Method(
        "imodels, GreedyRuleListClassifier",
        "imodels",
        imodels("GreedyRuleListClassifier"),
        binary=True,
    ),
    "figs": Method(
        "imodels, FIGSClassifier", "imodels", imodels("FIGSClassifier", random_state=0), binary=True
    ),
    "associations": Method("mlxtend, fpgrowth, three conditions", "mlxtend", mlxtend(LONGEST)),
    "associations_of_two": Method("mlxtend, fpgrowth, two conditions", "mlxtend", mlxtend(2)),
    "pysubgroup": Method("pysubgroup, BeamSearch, three conditions", "pysubgroup", pysubgroup),
}


def peak_memory() -> int:
    """The most memory that this process has had, in bytes: its own, not that of its parent."""
    status = Path("/proc/self/status").read_text(encoding="ascii")
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def run(method: Method, folder: Path) -> None:
    """Find rules and predict; say how it went."""
    try:
        fit = method.load()
        outcome: dict[str, Any] = {"version": version(method.package)}
    except (ImportError, metadata.PackageNotFoundError) as error:
        say({"note": "not installed", "why": str(error)})
        return
    say(outcome)
    states, labels = (np.load(folder / f"seen_{name}.npy") for name in ("states", "labels"))
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    signal.alarm(SECONDS)  # it ends the process, whatever that is doing
    started = time.perf_counter()
    try:
        rules, predict = fit(states, labels)
    except MemoryError:
        say(outcome | {"note": f"needs more than {MEMORY / 1e9:.0f} GB"})
        return
    outcome["seconds"] = round(time.perf_counter() - started, 4)
    outcome |= {"memory": peak_memory(), "rules": rules}
    say(outcome)
    if predict is not None:
        signal.alarm(PREDICTING)
        say(outcome | accuracies(predict, folder, binary=method.binary))


def accuracies(predict: Predict, folder: Path, *, binary: bool) -> dict[str, float]:
    """Of the label, where it is predicted, and of whether it is label 0."""
    states, labels = (np.load(folder / f"fresh_{name}.npy") for name in ("states", "labels"))
    predicted = np.asarray(predict(states))
    if binary:
        return {"of_label_0": float(((predicted == 1) == (labels == 0)).mean())}
    return {
        "accuracy": float((predicted == labels).mean()),
        "of_label_0": float(((predicted == 0) == (labels == 0)).mean()),
    }


def version(package: str) -> str:
    """Of a package; ours need not be installed."""
    if package == "sarl_core":
        import sarl_core

        return sarl_core.__version__
    return metadata.version(package)


def say(outcome: dict[str, Any]) -> None:
    """One line, at once: the process may be ended before the next."""
    print(json.dumps(outcome), flush=True)


if __name__ == "__main__":
    run(METHODS[sys.argv[1]], Path(sys.argv[2]))
