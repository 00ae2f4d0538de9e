"""What a notebook shows of landscapes and episodes, and their frames."""

from __future__ import annotations

import re

import numpy as np
import pytest

from sarl_core import Demonstrations, PolicyTree, grow_policy_trees, rollout, threshold_landscape
from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS
from sarl_core.notebooks import table_html


def cells(html: str) -> list[list[str]]:
    rows = re.findall(r"<tr>(.*?)</tr>", html)
    return [re.findall(r"<t[dh]>(.*?)</t[dh]>", row) for row in rows]


def test_every_text_is_escaped() -> None:
    html = table_html("<b>", ("<i>",), [("<script>",), (3,)], more=1200)
    assert re.findall(r"<(?!/?(?:p|table|thead|tbody|tr|th|td)>)", html) == []
    assert "and 1,200 more" in html


def test_a_landscape_is_a_frame_of_one_row_a_cell(lander_trees: tuple[PolicyTree, ...]) -> None:
    landscape = threshold_landscape(lander_trees, PAPER_SUPPORTS, PAPER_CONFIDENCES)
    frame = landscape.to_frame()
    assert list(frame.columns) == [
        "support",
        "confidence",
        "rule_count",
        "mean_length",
        "coverage",
        "fidelity",
    ]
    assert len(frame) == 231
    cell = frame[(frame["support"] == 0.05) & (frame["confidence"] == 0.9)].iloc[0]
    assert cell["rule_count"] == landscape.rule_count[1, 18]
    assert cell["coverage"] == landscape.coverage[1, 18]


def test_each_action_dimension_has_rows_of_its_own() -> None:
    rng = np.random.default_rng(0)
    states = rng.normal(size=(300, 2))
    actions = np.stack([states[:, 0] > 0, states[:, 1] > 1], axis=1).astype(np.int64)
    trees = grow_policy_trees(Demonstrations(states, actions, np.zeros(300, dtype=int)))
    landscape = threshold_landscape(trees, [0.0, 0.1], [0.5, 0.9])
    frame = landscape.to_frame(by_dimension=True)
    assert list(frame.columns)[:3] == ["dimension", "support", "confidence"]
    assert frame["dimension"].tolist() == [0] * 4 + [1] * 4
    counts = [part.rule_count.ravel().tolist() for part in landscape.dimensions]
    assert frame["rule_count"].tolist() == counts[0] + counts[1]


def test_a_notebook_shows_the_counts_of_a_landscape(lander_trees: tuple[PolicyTree, ...]) -> None:
    landscape = threshold_landscape(lander_trees, PAPER_SUPPORTS, PAPER_CONFIDENCES)
    table = cells(landscape._repr_html_())
    assert (len(table), len(table[0])) == (12, 22)
    assert table[0][-1] == "1"
    shown = [[int(cell.replace(",", "")) for cell in row[1:]] for row in table[1:]]
    assert shown == landscape.rule_count.tolist()
    large = threshold_landscape(lander_trees, np.linspace(0, 1, 300), np.linspace(0, 1, 500))
    html = large._repr_html_()
    assert "441 of 150,000 cells" in html
    assert [row[0] for row in cells(html)[1:]][-1] == "1"


@pytest.mark.parametrize("agent", ["expert", "novice"])
def test_a_notebook_sums_episodes_up(agent: str) -> None:
    episodes = rollout("CartPole-v1", agent, episodes=4)
    rows = {row[0]: row[1] for row in cells(episodes._repr_html_())}
    failures = {"expert": "0 failures in 4: at most 53 %", "novice": "4 of 4 episodes, 100 %"}
    assert rows["failures"].startswith(failures[agent])
    assert rows["return"].startswith(f"mean {episodes.returns.mean():.1f}")
    assert rows["interventions"] == "0 % of the steps"
