"""Rules that an aggregation begins with, in place of those that it would mine first."""

from __future__ import annotations

from sarl_core.demonstrations.dataset import derived_features
from sarl_core.errors import InputError
from sarl_core.improving.plan import Plan
from sarl_core.improving.questions import Answers
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rule_tree import recount
from sarl_core.mining.tree import PolicyTree


def check_first_rules(rules: RuleSet, plan: Plan) -> None:
    """Refuse rules that an aggregation cannot begin with.

    Args:
        rules: Such as an aggregation gave, or a person has changed since.
        plan: Of the aggregation.

    Raises:
        InputError: If they do not say what to do, are of another divider, or are more than the
            plan allows where it does not refine them alone.
    """
    if plan.thresholds is not None:
        raise InputError(
            "rules to begin with say something in every state, and thresholds cut them; give "
            "--first-rules without --support and --confidence"
        )
    if rules.forbids or not all(rule.enabled for rule in rules.rules):
        raise InputError(
            "rules to begin with say what to do in every state, and some of these forbid or are "
            "switched off; give those of an aggregation"
        )
    if any(one.is_interval for one in rules.actions) and rules.divider != plan.divider:
        raise InputError(
            f"the rules to begin with are of divider {rules.divider}, and the rounds of "
            f"{plan.divider}; give --divider {rules.divider}"
        )
    most = max(len(rules.of_dimension(index)) for index in range(len(rules.actions)))
    if most > plan.max_rules and not (plan.turns and plan.rounds == 1):
        raise InputError(
            f"there are {most} rules to begin with for one action dimension, and the budget is "
            f"{plan.max_rules}; give --max-rules {most}, fewer rules, or --rounds 1 and --refine, "
            "which leaves some of them out"
        )


def first_trees(rules: RuleSet, answers: Answers) -> tuple[PolicyTree, ...]:
    """The trees whose leaves they are, counted over what the expert has shown.

    Args:
        rules: As `check_first_rules` lets pass.
        answers: Before the first round.

    Returns:
        One tree an action dimension.

    Raises:
        InputError: If they do not say something in every state, or are of other intervals,
            features or actions.
    """
    trees = recount(rules, answers.pairs(0, derived=derived_features(rules.source.features)))
    edges = {one.name: one.edges for one in rules.actions}
    for tree in trees:
        name = tree.dimension.name
        if name in edges and edges[name] != tree.dimension.edges:
            raise InputError(
                f"the rules to begin with part {name!r} into other intervals than the "
                "demonstrations do; give rules of the same environment"
            )
    return trees
