from __future__ import annotations

import re

import numpy as np

from sarl_core import Demonstrations, grow_policy_trees, mine_rules
from sarl_core.explaining.html.rule_examples import examples_html


def test_each_example_is_a_state_of_the_rule_and_names_are_no_markup() -> None:
    states = np.linspace(-1, 1, 40, dtype=np.float32)[:, None]
    actions = (states[:, 0] > 0.0123).astype(np.int64)
    pairs = Demonstrations(
        states, actions, np.repeat(np.arange(2), 20), feature_names=["<b>lean</b>"]
    )
    trees = grow_policy_trees(pairs)
    rule = max(mine_rules(trees, supp_min=0, conf_min=1).rules, key=lambda one: one.action)
    html = examples_html(pairs, trees[0], rule)
    assert "&lt;b&gt;lean&lt;/b&gt;" in html
    assert "<b>" not in html
    (head, *rows) = re.findall(r"<tr>(.*?)</tr>", html)
    assert re.findall(r">([^<>]+)</th>", head)[-2:] == ["Episode", "Step"]
    assert len(rows) == 10
    for row in rows:
        _, agrees, value, episode, step = re.findall(r"<td[^>]*>([^<]*)</td>", row)
        assert agrees == "yes"
        place = 20 * int(episode) + int(step)
        assert abs(float(value) - states[place, 0]) < 5e-4
        assert actions[place] == rule.action
