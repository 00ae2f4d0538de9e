from __future__ import annotations

from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from streamlit.testing.v1 import AppTest

from sarl_core import Demonstrations, load_demonstrations, mine_rules
from sarl_core.demonstrations.dataset import Feature
from sarl_core.demonstrations.formats import save_demonstrations
from sarl_core.mining.language import sentence
from sarl_core.mining.rule_set import rules_to_json
from tests.app.screens import ROUTER, errors, html, open_page, run_through, texts, upload_rules

CART = ROUTER.parents[1] / "data" / "demonstrations" / "cartpole.parquet"


def type_into(app: AppTest, table: int, rows: dict[int, dict[str, str]]) -> None:
    """Change cells of one of the tables: features, actions, labels."""
    key: Any = app.data_editor[table].key
    app.session_state[key] = {"edited_rows": rows, "added_rows": [], "deleted_rows": []}
    app.run()
    assert not app.exception, app.exception


def test_new_names_are_used_everywhere_and_change_no_rule() -> None:
    app = open_page("names", data="cartpole")
    assert [table.value["Name"].iloc[0] for table in app.data_editor] == [
        "cart position",
        "push",
        "push left",
    ]
    type_into(app, 0, {2: {"Name": "lean <b>*of*</b> the pole"}, 3: {"Unit": "°/s"}})
    type_into(app, 1, {0: {"Name": "shove"}})
    type_into(app, 2, {0: {"Name": "shove west"}})
    assert not errors(app)
    assert "shove west" in texts(app) or "push right" in texts(app)

    app.switch_page("rules.py").run()
    assert not app.exception
    table = app.dataframe[0].value
    when = " ".join(table["When"])
    assert "lean <b>*of*</b> the pole" in when
    assert "°/s" in when
    assert "pole angle " not in when
    assert {tuple(action) for action in table["Action"]} == {("shove west",), ("push right",)}
    mined = mine_rules(load_demonstrations(CART), supp_min=0.005, conf_min=0.95)
    largest = max(mined.rules, key=lambda rule: rule.samples)
    assert f"{mined.name_of(largest)} ·" in html(app)
    assert "lean &lt;b&gt;*of*&lt;/b&gt; the pole" in html(app)
    assert "<b>*of*" not in html(app)
    assert table["States"].tolist() == sorted((r.samples for r in mined.rules), reverse=True)

    app.switch_page("export.py").run()
    assert not app.exception
    app.button_group(key="format").set_value("C").run()
    assert "/* R1: shove west */" in str(app.get("code")[0].value)

    app.switch_page("names.py").run()
    assert list(app.data_editor[2].value["Name"]) == ["shove west", "push right"]
    app.button(key="names_back").click().run()
    assert "pole angle" in list(app.data_editor[0].value["Name"])
    assert app.button(key="names_back").disabled
    app.switch_page("rules.py").run()
    assert escape(sentence(largest, mined)) in html(app)


def test_an_empty_or_doubled_name_is_refused_and_nothing_is_lost() -> None:
    app = open_page("names", data="cartpole")
    type_into(app, 0, {0: {"Name": "place"}})
    type_into(app, 0, {0: {"Name": "place"}, 1: {"Name": " "}})
    (error,) = errors(app)
    assert error.startswith("Feature 1 has an empty name; give it one.")
    type_into(app, 0, {0: {"Name": "place"}, 1: {"Name": "place"}})
    (error,) = errors(app)
    assert error.startswith("The name 'place' stands twice, for feature 0 and 1;")
    app.switch_page("rules.py").run()
    words = texts(app)
    assert "cart velocity" in " ".join(app.dataframe[0].value["When"])
    assert "place" in " ".join(app.dataframe[0].value["When"]) + words
    app.switch_page("names.py").run()
    # What was typed is still there, and still said.
    assert list(app.data_editor[0].value["Name"])[:2] == ["place", "place"]
    assert errors(app)
    type_into(app, 0, {1: {"Name": "speed"}})
    assert not errors(app)


def test_intervals_need_no_names() -> None:
    app = open_page("names", data="pendulum")
    assert len(app.data_editor) == 2
    assert "named by their bounds" in texts(app)


def test_new_names_reach_the_replay_its_files_and_a_rule_file_of_ones_own() -> None:
    content = rules_to_json(mine_rules(load_demonstrations(CART), supp_min=0.0, conf_min=1.0))
    app = open_page("names", data="cartpole")
    type_into(app, 0, {2: {"Name": "lean", "Unit": "turns"}})
    type_into(app, 2, {0: {"Name": "west"}, 1: {"Name": "east"}})
    app.switch_page("replay.py").run()
    app.selectbox(key="agent").select("novice")
    upload_rules(app, "mine.json", content.encode())
    for rules in ("in force", "none"):
        app.selectbox(key="rules").select(rules).run()
        run_through(app, "replay")
        assert not errors(app)
        replayed = kept(app)
        assert replayed.features[2] == Feature("lean", "turns")
        assert replayed.dimensions[0].label_names == ("west", "east")
        assert replayed.film.panels[0].dimensions[0].label_names == ("west", "east")
        if rules != "none":
            assert replayed.rule_set.source.features[2].name == "lean"
            assert replayed.rule_set.actions[0].label_names == ("west", "east")
        assert "<tr><td>lean</td>" in html(app)
        (recorder,) = [table.value for table in app.dataframe if "Step" in table.value]
        assert "lean (turns)" in recorder
        assert {action for (action,) in recorder["Done"]} <= {"west", "east"}
        assert "west" in html(app)
        assert "push left" not in html(app)
    # Without the names, the replay of before is not shown under them.
    app.switch_page("names.py").run()
    app.button(key="names_back").click().run()
    app.switch_page("replay.py").run()
    assert "west" not in html(app)
    run_through(app, "replay")
    assert kept(app).dimensions[0].label_names == ("push left", "push right")


def kept(app: AppTest) -> Any:
    """The replay on screen."""
    from sarl_dashboard.jobs.replays import replay_cache

    return replay_cache().get(app.session_state["_replay"].key)


def test_among_many_features_one_is_searched_for_and_named(tmp_path: Path) -> None:
    states = np.random.default_rng(0).normal(size=(60, 300)).astype(np.float32)
    names = [f"sensor {place:03d}" for place in range(300)]
    demonstrations = Demonstrations(
        states,
        (states[:, 7] > 0).astype(np.int64),
        np.zeros(60, dtype=np.int64),
        feature_names=names,
    )
    path = tmp_path / "wide.parquet"
    save_demonstrations(demonstrations, path)
    app = open_page("demonstrations", data="upload")
    app.file_uploader(key="upload_files").set_value([(path.name, path.read_bytes(), "")]).run()
    app.switch_page("names.py").run()
    assert len(app.data_editor[0].value) == 300
    app.text_input(key="name_search").set_value("SENSOR 20").run()
    matching = [place for place in range(300) if "20" in f"{place:03d}"]
    assert list(app.data_editor[0].value.index) == matching
    type_into(app, 0, {matching.index(207): {"Name": "way to the wall", "Unit": "m"}})
    assert not errors(app)
    assert app.data_editor[0].value["Name"].loc[207] == "sensor 207"  # it is told as a change
    app.text_input(key="name_search").set_value("").run()
    whole = app.data_editor[0].value
    assert whole["Name"].loc[207] == "way to the wall"
    assert whole["Unit"].loc[207] == "m"
    assert whole["Name"].drop(index=207).tolist() == names[:207] + names[208:]
    app.text_input(key="name_search").set_value("wall").run()
    assert list(app.data_editor[0].value.index) == [207]
    app.switch_page("demonstrations.py").run()
    assert "way to the wall" in list(app.dataframe[-1].value["Feature"])


def test_few_features_are_not_searched() -> None:
    assert not [
        box for box in open_page("names", data="cartpole").text_input if box.key == "name_search"
    ]
