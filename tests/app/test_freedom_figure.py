"""Failures against freedom on the page Measure."""

from __future__ import annotations

import json
from typing import Any

from streamlit.testing.v1 import AppTest

from sarl_core.shipped import DATA
from tests.app.screens import open_page, run_through, texts

SHIPPED = json.loads((DATA / "rules" / "freedom.json").read_text("utf-8"))


def figure(app: AppTest) -> dict[str, Any]:
    charts = app.get("plotly_chart")
    (chart,) = (one for one in charts if "freedom_figure" in one.proto.id)
    return dict(json.loads(chart.proto.spec))


def test_what_is_measured_stands_beside_the_shipped_measurement() -> None:
    app = open_page(
        "shield",
        data="lunar_lander",
        mode="forbid",
        agents="novice",
        shields=["no shield", "in force"],
        episodes="2",
    )
    run_through(app, "comparison")
    traces = {trace["name"]: trace for trace in figure(app)["data"]}
    here = traces["measured here"]
    assert len(here["hovertext"]) == 2
    assert "2 of 2 fail" in here["hovertext"][0]
    assert "freedom 100 %" in here["hovertext"][0]
    assert "freedom 100 %" not in here["hovertext"][1]
    others = [trace for name, trace in traces.items() if "hovertext" in trace and trace != here]
    assert sum(len(trace["hovertext"]) for trace in others) == len(SHIPPED)
    assert "All other points are a shipped measurement" in texts(app)
    assert "They say nothing of other agents" not in texts(app)


def test_another_environment_shows_what_was_measured_alone() -> None:
    app = open_page("shield", data="cartpole", agents="novice", episodes="2")
    run_through(app, "comparison")
    assert [trace["name"] for trace in figure(app)["data"]] == ["measured here"]
    assert "shipped measurement" not in texts(app)
