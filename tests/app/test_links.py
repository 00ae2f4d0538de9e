"""Links with numbers that nobody can mean: every page opens, and says what it left out."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from sarl_core.library import Library
from sarl_core.library.results import add_note
from tests.app.screens import ROUTER, errors, run_through

PAGES = sorted(path.stem for path in ROUTER.parent.glob("*.py") if not path.stem.startswith("_"))
NINES = "9" * 400


def parameters() -> list[str]:
    """Every name that may stand in an address: keys of widgets, and choices without one."""
    folders = (ROUTER.parent, ROUTER.parents[1] / "sarl_dashboard")
    files = [path for folder in folders for path in folder.rglob("*.py")]
    source = "\n".join(path.read_text(encoding="utf-8") for path in files)
    keyed = re.findall(r'\bkey=f?"([a-z_]\w*)', source)
    chosen = re.findall(r'(?:url_choice|url_text|_number|with_own)\([^"()]*"(\w+)"', source)
    return sorted({*keyed, *chosen, "a0", "a1"})


def opened(page: str, **query: str) -> AppTest:
    """A page as a link opens it."""
    app = AppTest.from_file(ROUTER, default_timeout=120)
    for name, value in query.items():
        app.query_params[name] = value
    app.run()
    if page != "overview":
        assert not app.exception, app.exception
        app.switch_page(f"{page}.py").run()
    return app


def test_the_parameters_are_found() -> None:
    assert {
        "data",
        "support",
        "holdout_seed",
        "left_out",
        "seed",
        "divider",
        "step",
        "rule",
    } <= set(parameters())
    assert len(PAGES) > 12


ODD = (NINES, "nan", "-1e999", "-1", "", "٣²", "0.5", "1,x")


@pytest.mark.parametrize("first", range(0, len(ODD), 3))
@pytest.mark.parametrize("page", PAGES)
def test_a_page_opens_whatever_its_address_says(page: str, first: int) -> None:
    # Each parameter has another value than its neighbours, and another one in each address.
    values = (ODD[(first + place) % len(ODD)] for place in itertools.count(PAGES.index(page)))
    app = opened(page, **dict(zip(parameters(), values, strict=False)))
    assert not app.exception, app.exception
    assert app.title


@pytest.mark.parametrize(
    ("query", "named"),
    [
        ({"holdout": "0.2", "holdout_seed": "9" * 5000}, "holdout\\_seed"),
        ({"seed": NINES}, "seed"),
        ({"support": "inf", "confidence": "0.9"}, "support"),
        ({"divider": "1e300"}, "divider"),
    ],
)
def test_what_was_left_out_of_a_link_is_said(query: dict[str, str], named: str) -> None:
    app = opened("overview", **query)
    assert not app.exception
    (told,) = said(app)
    assert f"cannot be used for {named}," in told
    assert NINES not in told


def test_a_link_keeps_what_can_be_used() -> None:
    app = opened("overview", seed="inf", data="pendulum", left_out="3,7")
    assert app.query_params["data"] == "pendulum"
    assert app.query_params["left_out"] == "3,7"
    assert "seed" not in app.query_params
    app = opened("overview", data="cartpole", left_out="3,7")
    assert not [warning for warning in app.warning if "link" in warning.value]


def said(app: AppTest) -> list[str]:
    """What is said of the link."""
    return [warning.value for warning in app.warning if "The link gives" in warning.value]


NONSENSE = {
    # What is beside every page.
    "overview": (
        *("support", "confidence", "lift", "depth", "divider"),
        *("holdout", "holdout_seed", "left_out", "combine", "first_run"),
    ),
    "rules": ("rule",),
    "edit": ("rule",),
    "episodes": ("episode", "step", "drawn"),
    "replay": ("agent", "seed"),
    "shield": ("episodes", "first_seed", "agents", "shields"),
    "ablation": ("agent", "ablation_episodes"),
    "research/improve": ("expert", "max_rules", "rounds", "choose"),
    "evidence": ("about",),
    "what_if": ("x0",),
}


@pytest.mark.parametrize(
    ("page", "name"), [(page, name) for page, names in NONSENSE.items() for name in names]
)
def test_nonsense_in_an_address_is_said(page: str, name: str) -> None:
    app = opened(page, data="cartpole", **{name: "nonsense"})
    assert not app.exception
    (sentence,) = said(app)
    assert f"cannot be used for {name}," in sentence.replace("\\", "")
    app.run()
    assert said(app) == [sentence]
    app.switch_page("names.py").run()
    assert not said(app)


def test_nonsense_of_learning_is_said() -> None:
    own = {"data": "cartpole", "learn_view": "Your own", "learn_choose": "best"}
    app = opened("research/learning", **own, learn_steps="3", learn_arms="x")
    (sentence,) = said(app)
    names = ("learn_steps", "learn_arms", "learn_choose")
    assert all(name in sentence.replace("\\", "") for name in names)


@pytest.mark.parametrize("page", PAGES)
def test_of_an_address_with_usual_and_unusual_values_nothing_is_said(page: str) -> None:
    app = opened(page, data="cartpole", support="0.01", confidence="0.95", rule="", holdout="0.2")
    assert not said(app)
    usual = {"support": "0.005", "agents": "novice", "env": "as demonstrated", "seed": "0"}
    more = {"learn_choose": "return first", "expert": "shipped", "episode": "2", "step": "4"}
    assert not said(opened(page, data="cartpole", **usual, **more, choose="return first"))


def test_a_fork_and_a_step_of_a_link_that_are_none_are_said_when_the_replay_is_there() -> None:
    app = opened("replay", data="cartpole", fork="nonsense", step="nonsense")
    (sentence,) = said(run_through(app, "replay"))
    assert "fork" in sentence
    assert "step" in sentence


@pytest.mark.parametrize(
    ("page", "name"),
    [
        ("overview", "data"),
        ("rules", "set"),
        ("rules", "edits"),
        ("rules", "wording"),
        ("audit", "log"),
        ("audit", "other_log"),
    ],
)
@pytest.mark.parametrize("kind", ["note", "long"])
def test_what_is_of_another_kind_is_said_and_nothing_takes_its_place(
    place: Path, page: str, name: str, kind: str
) -> None:
    with Library() as library:
        note = add_note(library, "hello", author="Ada")
    named = {"note": note.id, "long": "a" * 300}[kind]
    query = {name: named} if name == "data" else {"data": "cartpole", name: named}
    app = opened(page, **query)
    (sentence,) = errors(app)
    assert {"note": "hello", "long": "called 'aaa"}[kind] in sentence
    assert len(sentence) < 200
    assert not app.exception
    assert not app.dataframe
