"""The page Episodes: steps of what was demonstrated, under the rules in force."""

from __future__ import annotations

import numpy as np

from sarl_core import audit, load_demonstrations, mine_rules
from sarl_core.library import Library
from sarl_core.library.contents import add_rules
from tests.app.screens import ROUTER, errors, html, open_page, texts

FILE = ROUTER.parents[1] / "data" / "demonstrations" / "cartpole.parquet"


def test_a_step_shows_its_rule_its_state_and_its_scene() -> None:
    demonstrations = load_demonstrations(FILE)
    held = audit(
        mine_rules(demonstrations, supp_min=0.01, conf_min=0.9), demonstrations.select([1])
    )
    broken = int(np.flatnonzero(held.is_broken)[0])
    app = open_page(
        "episodes",
        data="cartpole",
        support="0.01",
        confidence="0.9",
        episode="1",
        step=str(broken),
    )
    assert f"**Step {broken} of episode 1.**" in texts(app)
    assert "– **broken**" in texts(app)
    assert "data:image/png" in html(app)
    links = [link.proto.page for link in app.get("page_link")]
    assert {"rules", "what_if"} <= set(links)
    app.button(key="next_step").click().run()
    assert f"**Step {broken + 1} of episode 1.**" in texts(app)
    app.button(key="next_episode").click().run()
    assert "**Step 0 of episode 2.**" in texts(app)
    assert not app.exception


def test_without_demonstrations_it_says_what_to_do() -> None:
    assert "Upload a file on the Demonstrations page" in texts(open_page("episodes", data="upload"))


def test_rules_of_another_environment_are_refused_with_what_to_do() -> None:
    rules = mine_rules(load_demonstrations(FILE), supp_min=0.01, conf_min=0.9)
    with Library() as library:
        item = add_rules(library, rules, author="Ada", name="cart")
    app = open_page("episodes", data="lunar_lander", set=item.id)
    assert not errors(app)
    assert "choose the demonstrations of their environment" in texts(app)
    assert not html(app)
