"""Links with numbers that nobody can mean: every page opens, and says what it left out."""

from __future__ import annotations

import re

import pytest
from streamlit.testing.v1 import AppTest

from tests.app.screens import ROUTER

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


@pytest.mark.parametrize("value", [NINES, "nan", "-1e999", "-1", "", "٣²", "0.5", "1,x"])
@pytest.mark.parametrize("page", PAGES)
def test_a_page_opens_whatever_its_address_says(page: str, value: str) -> None:
    app = opened(page, **dict.fromkeys(parameters(), value))
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
    (told,) = [warning.value for warning in app.warning if "link" in warning.value]
    assert f"cannot be used for {named}," in told
    assert NINES not in told


def test_a_link_keeps_what_can_be_used() -> None:
    app = opened("overview", seed="inf", data="pendulum", left_out="3,7")
    assert app.query_params["data"] == "pendulum"
    assert app.query_params["left_out"] == "3,7"
    assert "seed" not in app.query_params
    app = opened("overview", data="cartpole", left_out="3,7")
    assert not [warning for warning in app.warning if "link" in warning.value]
