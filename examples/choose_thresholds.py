"""Every threshold at once: pick the fewest rules that are still right often enough elsewhere.

Whole episodes are set aside, and the landscape of the rest is held against them: what is chosen on
some episodes is reported on others.
"""

from __future__ import annotations

import numpy as np

from sarl_core import grow_policy_trees, load_demonstrations, mine_rules, threshold_landscape
from sarl_core.shipped import DATA

RIGHT = 0.9  # of the covered states


def main() -> None:
    """Choose thresholds by their landscape, then look at episodes that were set aside."""
    demonstrations = load_demonstrations(DATA / "demonstrations" / "lunar_lander.parquet")
    numbers = np.arange(demonstrations.n_episodes)
    aside = demonstrations.select(numbers[numbers % 3 == 0])
    trees = grow_policy_trees(demonstrations.select(numbers[numbers % 3 != 0]))
    landscape = threshold_landscape(
        trees, supports=np.linspace(0, 0.05, 51), confidences=np.linspace(0.5, 1, 51)
    )
    cells = landscape.to_frame()
    good = cells[(cells["fidelity"] >= RIGHT) & (cells["coverage"] >= 0.5)]
    chosen = good.sort_values("rule_count").iloc[0]
    print(chosen.to_string())

    rules = mine_rules(trees, supp_min=chosen["support"], conf_min=chosen["confidence"])
    applies = np.array([rule.applies(aside.observations) for rule in rules])
    demanded = np.array([rule.action for rule in rules])
    right = applies & (demanded[:, None] == aside.actions)
    print(f"{len(rules)} rules cover {applies.any(axis=0).mean():.0%} of the states set aside")
    print(f"and are right in {right.sum() / applies.sum():.0%} of those.")


if __name__ == "__main__":
    main()
