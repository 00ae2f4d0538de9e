"""From demonstrations to a shield: mine rules, read them, and see what they do for a novice.

Run it from the top folder of a checkout, `python -m examples.mine_and_shield`, or copy it to where
the library is installed.
"""

from __future__ import annotations

from sarl_core import Shield, make_agent, mine_rules, record, rollout

ENVIRONMENT = "CartPole-v1"


def main() -> None:
    """Record an expert, mine its rules, and compare a novice with and without them."""
    demonstrations = record(ENVIRONMENT, make_agent("expert", ENVIRONMENT), steps=6000, seed=0)
    rules = mine_rules(demonstrations, supp_min=0.005, conf_min=0.9)
    print(rules.to_text())

    # Seeds that nothing was recorded with.
    alone = rollout(ENVIRONMENT, "novice", episodes=30, seed=1_000)
    shielded = rollout(ENVIRONMENT, "novice", shield=Shield(rules), episodes=30, seed=1_000)
    for name, episodes in (("alone", alone), ("shielded", shielded)):
        print(f"{name:9} mean return {episodes.returns.mean():6.1f}")
    changed = shielded.interventions.sum() / shielded.lengths.sum()
    print(f"The shield changed {changed:.0%} of the novice's actions.")


if __name__ == "__main__":
    main()
