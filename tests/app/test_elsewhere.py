"""What rules are worth in episodes that they were not mined from, made while nobody waits."""

from __future__ import annotations

import os
import sys
import time
from functools import cache
from html import unescape
from typing import Any

import numpy as np
import psutil
import pytest
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, load_demonstrations
from sarl_core.explaining.words.cross_fit import elsewhere_text, judged_sentence
from sarl_core.mining.rules import FILTERED, UNFILTERED, Thresholds
from sarl_core.mining.validation.cross_fitting import CrossFit, Judged, cross_fit
from sarl_core.processes import Processes
from sarl_core.progress import Progress, report
from tests.app.screens import ROUTER, html, metrics, open_page

pytestmark = pytest.mark.usefixtures("elsewhere")
CART = ROUTER.parents[1] / "data" / "demonstrations" / "cartpole.parquet"


@cache
def fit() -> CrossFit:
    return cross_fit(load_demonstrations(CART))


def expected(thresholds: Thresholds) -> Judged:
    return fit().at(thresholds)


def until(app: AppTest, words: str) -> None:
    """Look again until work beside the page has come to an end."""
    for _ in range(600):
        app.run()
        assert not app.exception, app.exception
        if words in html(app) + captions(app):
            return
        time.sleep(0.2)
    raise AssertionError(html(app))


def captions(app: AppTest) -> str:
    return "\n".join(unescape(str(caption.value).replace("\\", "")) for caption in app.caption)


def deltas(app: AppTest) -> dict[str, str]:
    return {metric.label: metric.delta for metric in app.metric if metric.delta}


def test_the_numbers_of_other_episodes_stand_beside_those_mined_from() -> None:
    app = open_page("thresholds", data="cartpole")
    until(app, judged_sentence(expected(FILTERED)))
    found = expected(FILTERED)
    assert deltas(app) == {
        "Coverage": f"elsewhere {elsewhere_text(found.coverage)}",
        "Fidelity": f"elsewhere {elsewhere_text(found.fidelity)}",
    }
    assert not app.warning
    # Other thresholds need no other trees: it is there at once, with a warning where they part.
    app.button(key="unfiltered").click().run()
    found = expected(UNFILTERED)
    assert deltas(app)["Fidelity"] == f"elsewhere {elsewhere_text(found.fidelity)}"
    assert metrics(app)["Fidelity"] == "100 %"
    assert "believe the second number" in app.warning[0].value
    for page in ("rules", "evidence"):
        app.switch_page(f"{page}.py").run()
        assert judged_sentence(found) in html(app)
        assert "believe the second number" in app.warning[0].value


def test_what_comes_while_the_page_is_drawn_stands_in_the_numbers_too(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    open_page("thresholds", data="cartpole")
    module = sys.modules["sarl_dashboard.jobs.cross_fitting"]
    known = module.judged
    looked = []

    def looked_up_too_soon(thresholds: Thresholds) -> Judged | None:
        looked.append(thresholds)
        return None if len(looked) == 1 else known(thresholds)

    until(open_page("thresholds", data="cartpole"), "mined without it, they are right in")
    monkeypatch.setattr(module, "judged", looked_up_too_soon)
    app = open_page("thresholds", data="cartpole")
    assert deltas(app).keys() == {"Coverage", "Fidelity"}


@pytest.mark.parametrize("episodes", [12, 1])
def test_random_labels_end_with_a_warning(episodes: int) -> None:
    rng = np.random.default_rng(0)
    noise = Demonstrations(
        rng.normal(size=(3_000, 2)).astype(np.float32),
        rng.integers(0, 2, 3_000),
        np.arange(3_000) * episodes // 3_000,
    )
    open_page("thresholds", data="cartpole")
    cache = sys.modules["sarl_dashboard.cache"]
    visit = cache.Visit()
    cache._VISITS.add(visit)
    visit.bring(noise.digest)
    app = AppTest.from_file(ROUTER, default_timeout=120)
    app.session_state["_upload"] = noise
    for key, value in {"data": "upload", "support": "0", "confidence": "1"}.items():
        app.query_params[key] = value
    app.run()
    app.switch_page("thresholds.py").run()
    until(app, "mined without it, they are right in")
    assert metrics(app)["Fidelity"] == "100 %"
    assert "Part of what they say is chance" in app.warning[0].value
    found = cross_fit(noise).at(UNFILTERED)
    assert found.fidelity.share == pytest.approx(0.5, abs=0.05)
    assert judged_sentence(found) in html(app)
    cache._leave(visit)


def test_compact_rules_are_not_mined_again() -> None:
    app = open_page("thresholds", data="cartpole")
    app.button(key="compact").click().run()
    assert not deltas(app)
    assert "mined without it" not in html(app)


def test_what_takes_minutes_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    open_page("names", data="pendulum")  # where nothing is begun beside the page
    module = sys.modules["sarl_dashboard.jobs.cross_fitting"]
    monkeypatch.setattr(module, "UNASKED", 1_000)
    module.RESULTS.clear()
    app = open_page("thresholds", data="pendulum")
    fit = module.cross_fit

    def waits(*given: Any, progress: Progress, **named: Any) -> Any:
        while True:
            report(progress, 0, 5)
            time.sleep(0.05)

    monkeypatch.setattr(module, "cross_fit", waits)
    app.button(key="elsewhere").click().run()
    job = app.session_state["_job_elsewhere"]
    app.button(key="cancel_elsewhere").click().run()
    assert not job.running
    monkeypatch.setattr(module, "cross_fit", fit)
    app.button(key="elsewhere").click().run()
    until(app, "mined without it, they are right in")
    assert not [button for button in app.button if button.key == "elsewhere"]


def test_of_many_steps_a_process_of_its_own_grows_the_trees_and_ends_with_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    open_page("names", data="pendulum")
    module = sys.modules["sarl_dashboard.jobs.cross_fitting"]
    fit, given = module.cross_fit, dict[int, Processes]()

    def watched(*arguments: Any, executor: Processes, **named: Any) -> Any:
        given[executor.submit(os.getpid).result()] = executor
        return fit(*arguments, executor=executor, **named)

    monkeypatch.setattr(module, "cross_fit", watched)
    module.RESULTS.clear()
    until(open_page("thresholds", data="pendulum"), "mined without it, they are right in")
    monkeypatch.setattr(module, "UNASKED", 1_000)
    module.RESULTS.clear()
    app = open_page("thresholds", data="pendulum")
    app.button(key="elsewhere").click().run()
    until(app, "mined without it, they are right in")
    (first, shared), (second, own) = given.items()
    assert shared.workers >= 2
    assert own.workers == 1
    assert psutil.pid_exists(first)
    for _ in range(300):
        if not psutil.pid_exists(second):
            break
        time.sleep(0.1)
    assert not psutil.pid_exists(second)


def test_of_many_steps_rules_of_few_states_are_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    open_page("names", data="pendulum")
    module = sys.modules["sarl_dashboard.jobs.cross_fitting"]
    monkeypatch.setattr(module, "UNASKED", 1_000)
    monkeypatch.setattr(module, "_MOST_SHARE", 0.0)
    module.RESULTS.clear()
    app = open_page("thresholds", data="pendulum")
    app.button(key="elsewhere").click().run()
    until(app, "it takes")  # more than there is room for
    assert "(SARL_CACHE_MB, for whoever runs it)" in captions(app)
    assert "mined without it" not in html(app)
    monkeypatch.setattr(module, "_MOST_SHARE", 1.0)
    app = open_page("thresholds", data="pendulum")
    app.button(key="elsewhere").click().run()
    until(app, "mined without it, they are right in")
    app.button(key="unfiltered").click().run()
    assert not deltas(app)
    assert "What rules with a support of less than 0.01% are worth in other episodes" in captions(
        app
    )
    assert "mined without it" not in html(app)
