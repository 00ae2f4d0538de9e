"""Algorithm 1 as the paper writes it: a loop over paths and nodes, on scikit-learn's own tree.

Written from the paper's Algorithm 1, without a look at `sarl_core.mining`, so that an error
would have to be made twice.
"""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from sklearn.tree import DecisionTreeClassifier


def paths_of(learner, observations, labels):
    """Every path from the root to a leaf, as a list of nodes.

    A node is (its queries so far, the rows that reach it).
    """
    tree = learner.tree_
    found = []

    def descend(node, queries, rows, above):
        path = [*above, (queries, rows)]
        if tree.children_left[node] == -1:
            found.append(path)
            return
        feature, threshold = int(tree.feature[node]), float(tree.threshold[node])
        below = observations[rows, feature] <= np.float64(threshold)  # not rounded to float32
        descend(tree.children_left[node], (*queries, (feature, "<=", threshold)), rows[below], path)
        descend(
            tree.children_right[node], (*queries, (feature, ">", threshold)), rows[~below], path
        )

    descend(0, (), np.arange(len(observations)), [])
    return found


def measures(rows, labels):
    """Support, confidence, lift, label and number of steps of that label, of a node.

    Measures are compared as floats, which is how thresholds are given; a quotient of whole
    numbers becomes the float nearest to it.
    """
    here = labels[rows].tolist()
    best = min(set(here), key=lambda label: (-here.count(label), label))
    support = Fraction(len(here), len(labels))
    confidence = Fraction(here.count(best), len(here))
    share = Fraction(np.count_nonzero(labels == best), len(labels))
    return float(support), float(confidence), float(confidence / share), best, here.count(best)


def algorithm_1(paths, labels, supp_min, conf_min, lift_min=0.0, max_depth=None, known=None):
    """The set of (conditions, label, samples, correct) that Algorithm 1 returns."""
    known = {} if known is None else known
    filtered_paths = set()
    for path in paths:
        for queries, rows in path:
            if max_depth is not None and len(queries) > max_depth:
                break
            if queries not in known:
                known[queries] = measures(rows, labels)
            support, confidence, lift, label, correct = known[queries]
            if support >= supp_min and confidence >= conf_min and lift >= lift_min:
                filtered_paths.add((queries, label, len(rows), correct))
                break
    return filtered_paths


def fit(observations, labels, seed=0):
    return DecisionTreeClassifier(criterion="gini", random_state=seed).fit(observations, labels)
