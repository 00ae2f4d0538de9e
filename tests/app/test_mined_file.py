"""A mined file in the dashboard: its counts are those of all steps, whatever sample is here."""

from __future__ import annotations

import base64
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest

from sarl_core import load_demonstrations, mine_rules
from sarl_core.demonstrations.formats import read_demonstrations
from sarl_core.explaining.words.cross_fit import judged_sentence
from sarl_core.explaining.words.evidence import held_out_text
from sarl_core.library import Library
from sarl_core.library.bundles import export_bundle, import_bundle
from sarl_core.library.contents import data_of, rules_of
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.growing import growth
from sarl_core.mining.language import share_text
from sarl_core.mining.never.never_rules import never_thresholds
from sarl_core.mining.rule_set import RuleSet, rules_to_json
from sarl_core.mining.rules import Thresholds
from sarl_dashboard.components.downloads import as_file
from sarl_dashboard.views.rules.rule import features_of
from tests.app.mined_file import (
    DATA,
    EPISODES,
    HELD_OUT,
    LEAST,
    SAMPLE,
    STEPS,
    MinedFiles,
    opened_mined,
    upload_mined,
)
from tests.app.screens import errors, finished, html, metrics, open_page, texts, upload_rules

AT = Thresholds(0.005, 0.9)
NEEDED = "needs the demonstrations themselves"
PART = f"a sample of {SAMPLE:,} of {STEPS:,} steps"


def address(identifier: str, **others: str) -> dict[str, str]:
    """Of the rules that these tests are about."""
    thresholds = {"support": f"{AT.support:g}", "confidence": f"{AT.confidence:g}"}
    return {"data": identifier} | thresholds | others


def rules_at(mined: MinedFiles) -> RuleSet:
    """Those, by the library."""
    return mined.data.mine(supp_min=AT.support, conf_min=AT.confidence)


# --- opened, and opened again -------------------------------------------------------------------


def test_it_is_opened_like_demonstrations_and_says_what_is_here(mined: MinedFiles) -> None:
    app = open_page("demonstrations")
    identifier = upload_mined(app, mined.cartpole)
    for page in (app, open_page("demonstrations", data=identifier)):  # the second visit is new
        numbers = metrics(page)
        assert (numbers["Steps"], numbers["Episodes"]) == (f"{STEPS:,}", f"{EPISODES}")
        assert numbers["Mean length"] == f"{STEPS / EPISODES:,.1f}"
        assert numbers["Mean return"] == "–"
        read = texts(page)
        assert f"{STEPS:,} steps in {EPISODES} episodes; a sample of {SAMPLE:,} of them" in read
        assert f"**{HELD_OUT} episodes** held out" in read
        assert f"The bars are of {PART}." in read
        assert f"What became of each episode {NEEDED}" in read
        assert mined.data.sample.whole.digest[:12] in read
        assert "Leave episodes out" not in [one.label for one in page.expander]
    assert f"{STEPS:,} steps in {EPISODES} episodes, mined on a cluster" in " ".join(
        link.proto.label for link in open_page("overview", data=identifier).get("page_link")
    )


def test_the_table_of_features_is_of_all_steps(mined: MinedFiles) -> None:
    app = open_page("demonstrations", data=opened_mined(mined.cartpole))
    table, box = app.dataframe[-1].value, mined.data.boxes[0][:, 0]
    assert np.allclose(table["Least"], box[0], rtol=0.01)
    assert np.allclose(table["Largest"], box[3], rtol=0.01)
    assert (box[0] < mined.data.sample.observations.min(axis=0)).any()  # which says less


def test_two_files_of_the_same_steps_are_two_things(mined: MinedFiles) -> None:
    app = open_page("demonstrations")
    first = upload_mined(app, mined.cartpole)
    assert upload_mined(app, mined.cartpole, "again.mined") == first
    other = upload_mined(app, mined.finer)
    assert other != first
    with Library() as library:
        items = [library.item(one) for one in (first, other)]
        assert {one.digest for one in items} == {mined.data.sample.whole.digest}
        assert [one.details["steps"] for one in items] == [STEPS, STEPS]
        held = [data_of(library, one) for one in items]
    assert [one.min_support for one in held if isinstance(one, MinedData)] == [LEAST, LEAST / 2]


def test_a_bundle_carries_it(mined: MinedFiles, tmp_path: Path) -> None:
    identifier = opened_mined(mined.cartpole)
    bundle = tmp_path / "fleet.sarl"
    with Library() as library:
        export_bundle(library, [identifier], bundle)
    with Library(tmp_path / "elsewhere") as there:
        (item,) = import_bundle(there, bundle, author="Bob")
        data = data_of(there, item)
    assert isinstance(data, MinedData)
    assert data.digest == mined.data.digest


@pytest.mark.parametrize(
    ("names", "size", "sentence"),
    [
        (["a.mined"], 9, "a.mined: it is damaged or cut off"),
        (["a.mined"], -300, "a.mined: it is damaged or cut off"),
        (["a.mined", "b.csv"], None, "2 files: a mined file holds everything by itself"),
    ],
)
def test_what_cannot_be_opened_is_said(
    mined: MinedFiles, names: list[str], size: int | None, sentence: str
) -> None:
    app = open_page("demonstrations", data="cartpole")
    files = [(name, mined.cartpole[:size], "application/zip") for name in names]
    app.file_uploader(key="upload_files").set_value(files).run()
    assert not app.exception
    (error,) = errors(app)
    assert error.startswith(sentence)
    assert metrics(app)["Steps"] == "15,000"  # what was chosen stays


# --- counts of all steps ------------------------------------------------------------------------


def test_thresholds_are_those_of_all_steps_and_nothing_is_grown(mined: MinedFiles) -> None:
    identifier = opened_mined(mined.cartpole)
    with patch.object(growth, "exact_structure", side_effect=AssertionError("grown")):
        app = open_page("thresholds", **address(identifier))
    rules, judged, numbers = rules_at(mined), mined.data.judged(AT), metrics(app)
    assert judged is not None
    assert numbers["Rules"] == f"{len(rules):,}"
    assert numbers["Coverage"] == share_text(rules.coverage, decimals=1)
    assert numbers["Fidelity"] == share_text(rules.fidelity, decimals=1)
    assert numbers["Held-out fidelity"] == share_text(judged.fidelity.share or 0.0, decimals=1)
    assert "Learner: histogram" in texts(app)
    assert f"In {HELD_OUT} episodes that they were not mined from" in html(app)


def test_less_support_than_was_grown_cannot_be_chosen(mined: MinedFiles) -> None:
    identifier = opened_mined(mined.cartpole)
    app = open_page("thresholds", data=identifier, support="0", confidence="0.9")
    slider = next(one for one in app.select_slider if one.label == "Minimum support")
    assert slider.value == LEAST
    assert slider.options[0] == f"{LEAST:g}"
    assert app.button(key="unfiltered").disabled
    assert not app.button(key="filtered").disabled
    assert f"reach down to a support of {LEAST:g}" in texts(app)
    app = open_page("difference", **address(identifier))
    assert not app.info  # it does not begin with rules that cannot be had


def test_what_was_settled_is_said_and_no_address_changes_it(mined: MinedFiles) -> None:
    identifier = opened_mined(mined.pendulum)
    usual = metrics(open_page("thresholds", data=identifier, confidence="0.8"))
    assert usual["Divider"] == "4"
    others = {"divider": "9", "holdout": "0.3", "combine": "every", "left_out": "3"}
    app = open_page("thresholds", data=identifier, confidence="0.8", details="Divider", **others)
    assert metrics(app) == usual
    assert "Divider" not in [one.label for one in app.slider]
    assert f"Trying other dividers {NEEDED}" in texts(app)
    app = open_page("rules", data=identifier, **others)
    assert "Divider **4**" in texts(app)
    assert "Combinations" not in texts(app)
    assert "No episodes were held out when this file was mined" in texts(app)


def test_rules_have_their_boxes_and_held_out_numbers(mined: MinedFiles) -> None:
    app = open_page("rules", **address(opened_mined(mined.cartpole)))
    rules = rules_at(mined)
    assert f"The histograms and example states below are of {PART}." in texts(app)
    table = app.dataframe[0].value
    assert sorted(table["States"]) == sorted(rule.samples for rule in rules)
    assert all("episode" in text for text in table["Held out"])
    app.switch_page("export.py").run()
    app.toggle(key="rounded").set_value(False).run()
    app.button(key="keep_rules").click().run()
    assert not errors(app)
    with Library() as library:
        (item,) = library.items(kind="rules")
        made = rules_of(library, item)
    assert item.came_from == (str(app.query_params["data"]),)
    assert f"mine library:{item.came_from[0]} --support 0.005 --confidence 0.9" in item.command
    assert made.source.steps == STEPS
    assert [rule.box for rule in made] == [rule.box for rule in rules]
    assert [rule.held_out for rule in made] == [rule.held_out for rule in rules]


def test_evidence_is_of_the_episodes_that_the_file_counted(mined: MinedFiles) -> None:
    app = open_page("evidence", **address(opened_mined(mined.cartpole)))
    judged, numbers = mined.data.judged(AT), metrics(app)
    assert judged is not None
    assert numbers["Held-out fidelity"] == share_text(judged.fidelity.share or 0.0, decimals=1)
    assert f"{HELD_OUT} episodes of {EPISODES + HELD_OUT} were held out" in texts(app)
    assert "Share of the episodes held out" not in [one.label for one in app.select_slider]
    assert html(app).count("that they were not mined from, the rules are right") == 1


@pytest.mark.parametrize("mode", ["forbid", "both"])
def test_of_two_actions_it_counts_what_rules_forbid(mined: MinedFiles, mode: str) -> None:
    at = replace(AT, never=0.1) if mode == "both" else never_thresholds(0.1, AT.support)
    forbidding = address(opened_mined(mined.cartpole), mode=mode, epsilon="0.1")
    app = open_page("evidence", **forbidding)
    judged, rules, numbers = mined.data.judged(at), mined.data.at(at), metrics(app)
    assert judged is not None
    assert numbers["Rules"] == f"{len(rules):,}"
    assert numbers["Held-out fidelity"] == share_text(judged.fidelity.share or 0.0, decimals=1)
    assert judged_sentence(judged) in html(app)
    assert sorted(app.dataframe[0].value["Held out"]) == sorted(
        held_out_text(rule.held_out) for rule in rules
    )
    assert judged_sentence(judged) in html(open_page("thresholds", **forbidding))
    with patch.object(MinedData, "counted", return_value=False):  # as of more actions
        assert "not how often it did another that is forbidden" in texts(
            open_page("evidence", **forbidding)
        )


def test_rules_that_forbid_of_a_file_with_nothing_held_out(mined: MinedFiles) -> None:
    identifier = opened_mined(mined.pendulum)
    app = open_page("evidence", data=identifier, mode="forbid", epsilon="0.1", support="0.01")
    assert list(metrics(app)) == ["Rules"]
    assert int(metrics(app)["Rules"]) > 0
    assert "Nothing was held out when these steps were mined" in texts(app)


def test_other_names_change_no_count(mined: MinedFiles) -> None:
    app = open_page("demonstrations")
    identifier = upload_mined(app, mined.cartpole)
    before = sorted(open_page("rules", **address(identifier)).dataframe[0].value["States"])
    app.switch_page("names.py").run()
    key = app.data_editor[0].key
    rows = {2: {"Name": "lean"}}
    app.session_state[key] = {"edited_rows": rows, "added_rows": [], "deleted_rows": []}
    app.run()
    assert not app.exception
    again = open_page("rules", **address(identifier))  # they are kept with it
    table = again.dataframe[0].value
    assert "lean" in " ".join(table["When"])
    assert sorted(table["States"]) == before


# --- what a sample can tell, and what not -------------------------------------------------------


def test_edits_are_counted_on_the_sample_and_say_so(mined: MinedFiles) -> None:
    app = open_page("edit", **address(opened_mined(mined.cartpole)))
    assert f"What edits change is counted on {PART}." in html(app)
    assert f"Regrowing a part of the tree {NEEDED}" in texts(app)
    app.button(key="edit_switch").click().run()
    assert not app.exception
    assert f"of {SAMPLE:,} sampled states" in html(app)
    rules = rules_at(mined)
    assert metrics(app)["Rules in force"] == f"{len(rules) - 1:,}"
    app.switch_page("difference.py").run()
    assert not app.exception
    assert f"The states of this page are of {PART}." in texts(app)


@pytest.mark.parametrize(("mode", "of_sample"), [("forbid", False), ("both", True)])
def test_what_both_kinds_of_rules_come_to_is_of_the_sample_and_says_so(
    mined: MinedFiles, mode: str, of_sample: bool
) -> None:
    app = open_page("thresholds", **address(opened_mined(mined.cartpole), mode=mode))
    assert not app.exception
    assert "Freedom" in metrics(app)
    assert (f"Coverage, fidelity and freedom are of {PART}." in texts(app)) == of_sample


@pytest.mark.parametrize(
    ("page", "about", "what"),
    [
        ("evidence", "Learning curve", "A learning curve"),
        ("evidence", "Stability", "How often a rule comes back"),
        ("evidence", "Contradictions", "Looking for contradictions"),
        ("evidence", "Leave episodes out", "Leaving episodes out"),
        ("names", "", "Trying a formula"),
        ("episodes", "", "Going through an episode"),
        ("improve", "", "Improving rules"),
    ],
)
def test_what_needs_the_steps_says_so(mined: MinedFiles, page: str, about: str, what: str) -> None:
    app = open_page(page, **address(opened_mined(mined.cartpole), about=about))
    assert not errors(app)
    assert f"{what} {NEEDED}" in texts(app)


def test_every_page_opens(mined: MinedFiles) -> None:
    identifier = opened_mined(mined.cartpole)
    for page in ("what_if", "replay", "shield", "ablation", "audit", "learning", "library"):
        assert not errors(open_page(page, **address(identifier)))
    assert f"The ranges and medians of features are of {PART}." in texts(
        open_page("what_if", **address(identifier))
    )


def test_a_report_is_made_of_it(mined: MinedFiles) -> None:
    app = open_page("report", **address(opened_mined(mined.cartpole), frames="0"))
    app.button(key="run_report").click().run()
    finished(app, "report")
    assert not errors(app)
    (frame,) = app.get("iframe")
    report = " ".join(base64.b64decode(frame.proto.src.split(",", 1)[1]).decode().split())
    assert f"for {STEPS:,} steps in {EPISODES} episodes" in report
    assert f"this report was made with {PART}" in report
    rules = rules_at(mined)
    assert share_text(rules.coverage) in report
    assert f"{max(rule.samples for rule in rules):,} states)" in report
    assert mined.data.sample.whole.digest in report


def test_rules_of_another_divider_get_no_numbers_of_its_trees(mined: MinedFiles) -> None:
    demonstrations = load_demonstrations(DATA / "pendulum.parquet").select(range(5))
    rules = mine_rules(demonstrations, supp_min=0.01, conf_min=0.8, divider=3)
    app = open_page("report", data=opened_mined(mined.pendulum))
    upload_rules(app, "three.json", rules_to_json(rules).encode())
    (error,) = errors(app)
    assert error.startswith(f"Mining at divider 3 {NEEDED}")


def test_a_downloaded_sample_says_that_it_is_one(mined: MinedFiles) -> None:
    again = read_demonstrations(as_file(mined.data.sample), "sample.parquet")
    assert len(again) == SAMPLE
    assert f"these are {PART}" in again.notes


def test_a_rule_of_which_no_state_is_here_says_so(mined: MinedFiles) -> None:
    rules, (tree,) = rules_at(mined), mined.data.trees
    none = np.zeros(0, dtype=np.int64)
    bare = replace(tree, sample_order=none, sample_place=none)
    assert "None of its states is in the sample" in features_of(bare, rules[0], mined.data.sample)
    assert "Example states" in features_of(tree, rules[0], mined.data.sample)
