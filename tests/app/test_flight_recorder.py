"""The flight recorder, the path of a state and the fork on the page Replay."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Shield, load_demonstrations, mine_rules, rollout
from sarl_core.rendering.fork import fork
from sarl_core.rollouts.episodes import Episodes
from sarl_dashboard.jobs import replays
from tests.app.screens import errors, finished, html, metrics, open_page, run_through, texts

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
SEED = 100_007  # of a short episode


def shield() -> Shield:
    demonstrations = load_demonstrations(DATA / "cartpole.parquet")
    return Shield(mine_rules(demonstrations, supp_min=0.005, conf_min=0.95))


@pytest.fixture(scope="module")
def wanted() -> Episodes:
    return rollout("CartPole-v1", "novice", shield=shield(), episodes=1, seed=SEED)


def replayed(**query: str) -> AppTest:
    asked = {"data": "cartpole", "rules": "filtered", "seed": str(SEED), **query}
    app = open_page("replay", **asked)
    return run_through(app, "replay")


def table(app: AppTest) -> pd.DataFrame:
    (found,) = [one.value for one in app.dataframe if "Distance" in one.value.columns]
    return found


def chosen(app: AppTest) -> list[int]:
    """The steps of the rows that are selected."""
    rows = app.session_state["recorder_table"]["selection"]["rows"]
    return [int(step) for step in table(app)["Step"].iloc[rows]]


def click(app: AppTest, row: int) -> AppTest:
    """Select a row, as the box at its left does."""
    selection: Any = {"selection": {"rows": [row], "columns": [], "cells": []}}
    app.session_state["recorder_table"] = selection
    return app


def test_slider_table_and_buttons_are_one_selection(wanted: Episodes) -> None:
    assert wanted.steps is not None
    app = replayed(step="40")
    changes = np.flatnonzero(wanted.steps.intervened)
    assert chosen(app) == [40]
    assert 40 in table(app)["Step"].tolist()
    app.slider(key="step").set_value(70).run()
    assert chosen(app) == [70]
    app.button(key="next").click().run()
    following = int(changes[changes > 70][0])
    assert app.slider(key="step").value == following
    assert chosen(app) == [following]
    assert table(app)["Changed"].iloc[table(app)["Step"].tolist().index(following)]
    assert re.search(r"<b>R\d+\.</b>", html(app))
    # To another page of the table and back: the step stays where it is.
    app.session_state["recorder_page"] = 1
    app.run()
    assert not app.exception
    assert table(app)["Step"].tolist()[0] == 0
    assert chosen(app) == []
    assert app.slider(key="step").value == following


def test_filters_leave_what_was_recorded(wanted: Episodes) -> None:
    steps = wanted.steps
    assert steps is not None
    app = replayed(only="changed by the rules")
    changes = np.flatnonzero(steps.intervened)
    assert table(app)["Step"].tolist() == changes[:15].tolist()
    assert f"{len(changes)} of {len(steps)} steps: changed by the rules" in texts(app)
    often = int(np.bincount(steps.rules[steps.rules >= 0]).argmax())
    app.selectbox(key="by_rule").set_value(f"R{often + 1}").run()
    of_rule = [step for step in changes.tolist() if steps.rules[step, 0] == often]
    assert table(app)["Step"].tolist() == of_rule[:15]
    assert set(table(app)["Rule"]) == {f"R{often + 1}"}
    assert [one.label for one in app.get("download_button")][-2:] == ["CSV", "Parquet"]
    (flips,) = [part for part in html(app).splitlines() if "switched on or off" in part]
    assert wanted.flips is not None
    assert f"{int(wanted.flips[0])} times" in flips
    assert "a second" in flips


def test_a_filter_that_leaves_nothing_says_so(wanted: Episodes) -> None:
    steps = wanted.steps
    assert steps is not None
    app = replayed(by_rule="none of these", only="outside the data")
    assert app.selectbox(key="by_rule").value == "every rule"
    if steps.outside.any():
        assert table(app)["Step"].tolist() == np.flatnonzero(steps.outside)[:15].tolist()
    else:
        assert f"None of the {len(steps)} steps is as asked" in texts(app)
    app = replayed(rules="none")
    (alone,) = [one.value for one in app.dataframe if "Step" in one.value.columns]
    assert list(alone.columns[:3]) == ["Step", "Done", "Reward"]
    assert "run_fork" not in [button.key for button in app.button]


def test_the_change_of_a_step_is_withheld(wanted: Episodes) -> None:
    assert wanted.steps is not None
    changes = np.flatnonzero(wanted.steps.intervened)
    calm = int(np.flatnonzero(~wanted.steps.intervened)[0])
    app = replayed(step=str(calm), withhold="the shield from here on")
    assert "run_fork" not in [button.key for button in app.button]
    assert "Choose a step at which the rules changed" in texts(app)
    step = int(changes[3])
    app.slider(key="step").set_value(step).run()
    assert "The shield is off from this step to the end" in texts(app)
    run_through(app, "fork")
    assert not errors(app)
    found = fork("CartPole-v1", "novice", shield(), step=step, rest="alone", seed=SEED)
    shown = metrics(app)
    assert shown["Return with it"] == f"{found.unchanged.returns[0]:,.1f}"
    assert shown["Return without it"] == f"{found.withheld.returns[0]:,.1f}"
    assert shown["Return with it"] == shown["Return with rules"]
    assert "Without it the return is" in texts(app)
    # It is of that step: at another one it is not shown, and back there it is again.
    app.slider(key="step").set_value(int(changes[5])).run()
    assert "Return without it" not in metrics(app)
    app.slider(key="step").set_value(step).run()
    assert "Return without it" in metrics(app)


def test_the_steps_of_all_episodes_and_the_way_to_another() -> None:
    app = replayed()
    run_through(app, "episodes")
    app.session_state["recorded"] = "all episodes"
    app.run()
    assert not app.exception
    everything = rollout("CartPole-v1", "novice", shield=shield(), episodes=20, seed=SEED)
    assert f"{int(everything.lengths.sum()):,} steps" in texts(app)
    assert set(table(app)["Seed"]) == {SEED}
    app.selectbox(key="by_episode").set_value(str(SEED + 4)).run()
    assert not app.exception
    assert set(table(app)["Seed"]) == {SEED + 4}
    assert "is not among them" in texts(app)
    click(app, 6).run()
    finished(app.run(), "replay")
    if app.number_input(key="seed").value == SEED + 4:  # a click reaches the callback in a browser
        assert app.slider(key="step").value == 6
        assert metrics(app)["Length with rules"] == f"{int(everything.lengths[4]):,}"
    (flips,) = [one.value for one in app.dataframe if "Flips a second" in one.value.columns][:1]
    assert everything.flips is not None
    rate = everything.flips.sum() * 50 / everything.lengths.sum()
    assert float(flips["Flips a second"].iloc[0]) == pytest.approx(rate, abs=0.01)


def test_a_link_to_a_fork_runs_it_and_shows_it(wanted: Episodes) -> None:
    assert wanted.steps is not None
    step = int(np.flatnonzero(wanted.steps.intervened)[2])
    app = run_through(replayed(step=str(step)), "fork")
    assert "Return without it" in metrics(app)
    values = dict(app.query_params.items())
    address = {name: one if isinstance(one, str) else one[0] for name, one in values.items()}
    assert address["fork"] == f"{step}:shielded"
    replays.fork_cache().clear()  # as a server that was started anew
    other = finished(finished(open_page("replay", **address), "replay"), "fork")
    assert not errors(other)
    assert metrics(other)["Return without it"] == metrics(app)["Return without it"]
    # At another step nothing is run unasked.
    other.slider(key="step").set_value(step + 1).run()
    assert "Return without it" not in metrics(other)
