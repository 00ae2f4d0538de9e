from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import load_demonstrations, record, save_demonstrations
from sarl_core.mining.quantisation import quantise
from sarl_core.studies.divider import study_divider
from tests.app.screens import errors, open_page, texts

PENDULUM = load_demonstrations(
    Path(__file__).parents[2] / "data" / "demonstrations" / "pendulum.parquet"
)


def heatmaps(app: AppTest) -> list[dict[str, Any]]:
    """Those with ways to snap as rows: the errors, and the returns where they are known."""
    traces = [
        trace
        for chart in app.get("plotly_chart")
        for trace in json.loads(chart.proto.spec)["data"]
        if trace["type"] == "heatmap"
    ]
    return [trace for trace in traces if "centre" in (trace.get("y") or [])]


def open_tab(**query: str) -> AppTest:
    return open_page("thresholds", details="Divider", **query)


def test_discrete_actions_have_no_divider() -> None:
    app = open_tab(data="cartpole")
    assert [tab.label for tab in app.tabs] == ["Largest rules", "Best trade-offs"]
    assert not errors(app)


def test_what_the_data_say_is_there_at_once() -> None:
    app = open_tab(data="pendulum")
    assert "Divider" in [tab.label for tab in app.tabs]
    (found,) = heatmaps(app)
    (divided,) = quantise(PENDULUM)
    assert found["y"] == ["centre", "expert"]
    assert found["z"][0] == pytest.approx([each.share_of_width("centre") for each in divided])
    assert "Every interval was shown at least once" in texts(app)


def test_every_action_is_shown_or_the_chosen_one() -> None:
    whole = open_tab(data="bipedal_walker")
    one = open_tab(data="bipedal_walker", dimension="knee 2 torque")
    assert len(whole.get("plotly_chart")) == len(one.get("plotly_chart")) + 3


def test_the_snapped_expert_is_run_on_request() -> None:
    app = open_tab(data="pendulum", divider_episodes="2")
    app.button(key="run_divider").click().run()
    for _ in range(3_000):
        assert not app.exception, app.exception
        if "cancel_divider" not in [button.key for button in app.button]:
            break
        time.sleep(0.1)
        app.run()
    assert not errors(app)
    _, found = heatmaps(app)
    study = study_divider("Pendulum-v1", "expert", PENDULUM, episodes=2, seed=100_000)
    for row, snapping in enumerate(("centre", "clip", "expert")):
        wanted = [study.of(divider, snapping) for divider in (2, 3, 5, 9)]
        assert found["z"][row] == pytest.approx(
            [episodes.statistics.iqm for episodes in wanted if episodes is not None]
        )
    assert all(words for row in found["text"] for words in row)
    assert "that row is the expert as it is" in texts(app)
    # Whoever asks again has it at once; the expert as it is stands on the page Measure too.
    assert len(heatmaps(open_tab(data="pendulum", divider_episodes="2"))) == 2
    shield = open_page(
        "shield", data="pendulum", episodes="2", agents="expert", shields="no shield"
    )
    assert shield.button(key="run_comparison").disabled


@pytest.mark.parametrize(
    ("env_id", "fragment"),
    [
        ("", "do not say which environment"),
        ("MountainCarContinuous-v0", "No expert is shipped for MountainCarContinuous-v0"),
    ],
)
def test_without_an_expert_the_data_are_shown_all_the_same(
    env_id: str, fragment: str, tmp_path: Path
) -> None:
    demonstrations = record("MountainCarContinuous-v0", "novice", steps=300)
    path = tmp_path / "mine.npz"
    save_demonstrations(replace(demonstrations, env_id=env_id), path)
    app = open_page("demonstrations")
    app.file_uploader(key="upload_files").set_value([("mine.npz", path.read_bytes(), "")]).run()
    app.query_params["details"] = "Divider"
    app.switch_page("thresholds.py").run()
    assert not app.exception
    assert fragment in texts(app)
    assert len(heatmaps(app)) == 1
    assert "run_divider" not in [button.key for button in app.button]
