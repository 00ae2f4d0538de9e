"""A study of learning in words and figures: they follow from its numbers."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core.decimals import rounded_text
from sarl_core.explaining.figures.learning import (
    afterwards_figure,
    arm_colour,
    curves_figure,
    outcome_figure,
)
from sarl_core.explaining.words.learning import HEADINGS, finding, table_rows, verdict
from sarl_core.learning.arms import ARMS
from sarl_core.learning.curves import Columns, Trial
from sarl_core.learning.study_files import ComparedAgent, LearningRun, LearningStudy, load_study
from sarl_core.learning.summary import summarise_compared, summarise_study

STUDIES = Path(__file__).parents[2] / "data" / "learning"
RULES = {"count": 3274, "support": 0.0, "confidence": 1.0, "digest": ""}


def a_run(arm: str, seed: int, crashes: int, alone: float) -> LearningRun:
    curve = Columns(
        **{
            "ends": [(index + 1) * 100 for index in range(10)],
            "returns": [float(index * 10) for index in range(10)],
            "lengths": [100] * 10,
            "crashed": [index < crashes for index in range(10)],
            "interventions": [50 - index for index in range(10)],
            "covered": [100] * 10,
            "shielded": [ARMS[arm].shielded] * 10,
        }
    ).read()
    trial = Trial((alone - 1, alone + 1), 1, 0.0, 0.0)
    return LearningRun(ARMS[arm], seed, 1000, curve, trial, Trial((150.0, 150.0), 0, 0.5, 1.0))


def a_study(*runs: LearningRun) -> LearningStudy:
    arms = tuple(arm for arm in ARMS.values() if any(run.arm == arm for run in runs))
    seeds = tuple(sorted({run.seed for run in runs}))
    settings = {"rules": RULES, "trial_episodes": 2}
    return LearningStudy("LunarLander-v3", 1000, settings, arms, seeds, runs)


@pytest.fixture
def study() -> LearningStudy:
    return a_study(
        a_run("none", 0, 10, -190.0),
        a_run("none", 1, 8, -170.0),
        a_run("override", 0, 2, -560.0),
        a_run("override", 1, 2, -580.0),
        a_run("handover", 0, 3, 210.0),
        a_run("handover", 1, 1, 190.0),
        a_run("mask", 0, 9, -200.0),
        a_run("penalty", 0, 7, 100.0),
    )


def test_rules_that_forbid_and_a_penalty_stand_in_the_conditions(study: LearningStudy) -> None:
    forbidding = {"rules": {**RULES, "forbidding": RULES["count"]}, "penalty": 5.0}
    told = replace(study, settings={**study.settings, **forbidding})
    last = finding(told, summarise_study(told))[-1]
    assert f"{RULES['count']:,} never-rules, a penalty of 5 where there is one, 1,000 steps" in last
    told = replace(study, settings={**study.settings, "rules": {**RULES, "forbidding": 1}})
    assert "; 1 of them forbid), 1,000 steps" in finding(told, summarise_study(told))[-1]


def test_the_best_arm_is_named_first_with_its_numbers(study: LearningStudy) -> None:
    answer = finding(study, summarise_study(study))[0]
    assert answer.startswith("Safe while learning and good afterwards: “Imitate, then hand over”.")
    for number in ("2 times", "9 times", "201", "−179", "50 %"):
        assert number in answer


def test_the_others_are_sorted_by_what_they_are(study: LearningStudy) -> None:
    paragraphs = finding(study, summarise_study(study))
    (safe,) = [text for text in paragraphs if text.startswith("Safe while learning, but")]
    assert "“Override” (2 times; afterwards −570)" in safe
    (good,) = [text for text in paragraphs if text.startswith("Good afterwards, but")]
    assert "penalty" in good
    (neither,) = [text for text in paragraphs if text.startswith("Neither")]
    assert "“Mask”" in neither
    assert not any(text.startswith("Also") for text in paragraphs)


def test_conditions_and_what_the_rules_are_worth_are_said(study: LearningStudy) -> None:
    paragraphs = finding(study, summarise_study(study))
    assert any("speak in nearly every state" in text and "150" in text for text in paragraphs)
    assert "3,274 rules (support 0, confidence 1)" in paragraphs[-1]
    assert "2 learners of each kind" in paragraphs[-1]
    (alone,) = [text for text in paragraphs if text.startswith("Without any shield")]
    assert "“No shield” failed 9 times while learning, in 90 % of its episodes" in alone
    assert "Mind" not in alone


def test_rules_that_only_forbid_do_not_act_for_the_learner(study: LearningStudy) -> None:
    forbidding = replace(
        study,
        runs=tuple(
            replace(run, shielded=replace(run.shielded, freedom=0.3))
            for run in study.runs
            if run.shielded is not None
        ),
    )
    paragraphs = finding(forbidding, summarise_study(forbidding))
    assert not any("speak in nearly every state" in text for text in paragraphs)


def test_a_learner_that_is_as_safe_without_a_shield_is_not_passed_over() -> None:
    study = a_study(
        a_run("none", 0, 10, -190.0), a_run("handover", 0, 3, 210.0), a_run("none-replay", 0, 3, 0)
    )
    paragraphs = finding(study, summarise_study(study))
    (alone,) = [text for text in paragraphs if text.startswith("Without any shield")]
    assert "Mind that “No shield, replay” failed no more often" in alone


def test_rules_that_no_threshold_cut_are_called_by_what_they_are() -> None:
    study = a_study(a_run("none", 0, 1, 2.0))
    study = replace(study, settings={**study.settings, "rules": {**RULES, "cut": "leaves"}})
    assert "3,274 rules (every leaf of its tree)" in finding(study, summarise_study(study))[-1]


def test_where_no_arm_is_both_that_is_said() -> None:
    study = a_study(a_run("none", 0, 10, 500.0), a_run("override", 0, 1, 20.0))
    assert finding(study, summarise_study(study))[0].startswith("No way to learn was both")


def test_without_the_learner_alone_there_is_no_verdict() -> None:
    study = a_study(a_run("override", 0, 1, 20.0))
    summaries = summarise_study(study)
    assert "run it too" in finding(study, summaries)[0]
    assert verdict(summaries[0]) == "–"


@pytest.mark.parametrize(
    ("env_id", "why"),
    [
        ("Pendulum-v1", "No end of this environment's episodes is a failure, so"),
        ("mine:Own-v0", "Nothing says which ends of this environment's episodes are failures, so"),
    ],
)
def test_where_nothing_is_known_of_failures_nothing_is_said(
    study: LearningStudy, env_id: str, why: str
) -> None:
    other = replace(study, env_id=env_id)
    summaries = summarise_study(other)
    told = finding(other, summaries)
    assert told[0].startswith(why)
    assert not any("fail" in text for text in told[1:])
    places = [HEADINGS.index(name) for name in HEADINGS if "ail" in name]
    assert len(places) == 2
    assert {row[place] for row in table_rows(summaries) for place in places} == {"–"}
    document = summaries[0].to_dict()
    assert document["crashes"] is document["mean_crashes"] is None
    assert document["alone"]["crash_rate"] is None


def test_an_empty_study_says_so() -> None:
    assert finding(a_study(), ()) == ["No run is finished yet."]


def test_the_table_has_a_row_an_arm_under_its_headings(study: LearningStudy) -> None:
    rows = table_rows(summarise_study(study))
    assert all(len(row) == len(HEADINGS) for row in rows)
    table = {row[0]: dict(zip(HEADINGS, row, strict=True)) for row in rows}
    assert table["No shield"]["Failures while learning"] == "9 (8–10)"
    assert table["No shield"]["Changed"] == "–"
    assert table["Mask"]["Failures while learning"] == "9"
    assert table["Override"]["Verdict"] == "safe, not good"
    assert table["Imitate, then hand over"]["Verdict"] == "safe and good"
    assert table["Imitate, then hand over"]["Return after"] == "200 (190 to 210)"


def test_freedom_is_said_where_it_was_kept(study: LearningStudy) -> None:
    runs = tuple(
        replace(run, shielded=replace(run.shielded, freedom=0.2 if run.arm.name == "mask" else 0.0))
        for run in study.runs
        if run.shielded is not None
    )
    free = replace(study, runs=runs)
    summaries = summarise_study(free)
    (told,) = [text for text in finding(free, summaries) if text.startswith("Freedom")]
    assert told == (
        "Freedom with the shield on: from 0 % to 20 % of the choice is left to the agent, by who "
        "acts."
    )
    column = HEADINGS.index("Freedom, shield on")
    table = {row[0]: row[column] for row in table_rows(summaries)}
    assert (table["Mask"], table["Override"]) == ("20 %", "0 %")
    assert summaries[0].to_dict()["shielded"]["freedom"] == 0.0
    assert not any("Freedom" in text for text in finding(study, summarise_study(study)))


def test_an_agent_for_comparison_stands_below_and_is_a_line(study: LearningStudy) -> None:
    trial = Trial((70.0, 90.0), 1, 0.0, 0.0, failed=(True, False))
    beside = replace(
        study, compared=ComparedAgent("crane:operator", trial, replace(trial, crashes=0))
    )
    summaries, compared = summarise_study(beside), summarise_compared(beside)
    assert any(
        "“crane:operator” without the shield returns 80.0 and fails in 50 %, and with it returns "
        "80.0 and fails in 0 %" in text
        for text in finding(beside, summaries)
    )
    *_, last = table_rows(summaries, compared)
    row = dict(zip(HEADINGS, last, strict=True))
    assert row["Way to learn"] == "crane:operator, for comparison"
    assert (row["Failures while learning"], row["Return after"], row["Shield on"]) == (
        "–",
        "80.0",
        "80.0",
    )
    assert compared is not None
    assert compared.to_dict()["alone"]["crash_rate"] == 0.5
    (line,) = [
        shape for shape in outcome_figure(summaries, compared).layout.shapes if shape.y0 == 80
    ]
    assert line.y1 == 80
    assert afterwards_figure(summaries, compared).layout.yaxis.ticktext[-1] == "crane:operator"


@pytest.mark.parametrize(
    ("value", "text"),
    [(-191.4, "−191"), (0.2, "0"), (-0.2, "0"), (1234.5, "1,234"), (float("nan"), "–")],
)
def test_values_for_people(value: float, text: str) -> None:
    assert rounded_text(value) == text


def test_no_name_stands_on_another_on_a_narrow_screen() -> None:
    study = load_study(STUDIES / "cartpole")
    figure = outcome_figure(summarise_study(study))
    names = [one for one in figure.layout.annotations if one.text.startswith("<b>")]
    assert len(names) == len(study.arms)
    (left, right), (bottom, top) = figure.layout.xaxis.range, figure.layout.yaxis.range
    boxes = []
    for one in names:  # as wide as letters are on average
        x = 295 * (one.x - left) / (right - left) + one.xshift
        y = 380 * (one.y - bottom) / (top - bottom) + one.yshift
        long = 6.5 * (len(one.text) - 7)
        boxes.append((x - long, x, y) if one.xanchor == "right" else (x, x + long, y))
    for place, (start, end, y) in enumerate(boxes):
        for other_start, other_end, other_y in boxes[:place]:
            assert end <= other_start or other_end <= start or abs(y - other_y) > 14


def test_each_arm_has_a_colour() -> None:
    colours = {name: arm_colour(arm) for name, arm in ARMS.items()}
    shielded = [colour for name, colour in colours.items() if ARMS[name].shielded]
    assert len(set(shielded)) == len(shielded)
    assert colours["none"] == colours["none-replay"]


def test_curves_are_means_in_bands(study: LearningStudy) -> None:
    figure = curves_figure(study)
    lines = [trace for trace in figure.data if trace.mode == "lines" and trace.name]
    crashes = {trace.name: trace.y for trace in lines if trace.yaxis == "y2"}
    assert crashes["No shield"][-1] == 9.0  # of 10 and 8
    assert crashes["Override"][-1] == 2.0
    changed = {trace.name for trace in lines if trace.yaxis == "y3"}
    assert "No shield" not in changed
    assert "Override" in changed
    assert {trace.name for trace in lines if trace.showlegend} == {arm.title for arm in study.arms}


def test_curves_of_a_run_at_work_end_where_it_is() -> None:
    run = a_run("none", 0, 3, 0.0)
    curve = Columns(**{name: column[:5] for name, column in run.curve.to_dict().items()}).read()
    half = replace(run, curve=curve, done=500, alone=None, shielded=None)
    figure = curves_figure(a_study(half))
    (crashes,) = [trace for trace in figure.data if trace.name and trace.yaxis == "y2"]
    assert max(crashes.x) == 500
    assert figure.layout.xaxis.range == (0, 1000)


def test_a_run_without_an_episode_draws_nothing_and_breaks_nothing() -> None:
    run = a_run("none", 0, 3, 0.0)
    empty = Columns(**{name: [] for name in run.curve.to_dict()}).read()
    study = a_study(replace(run, curve=empty, done=10, alone=None, shielded=None))
    assert not curves_figure(study).data


def test_outcomes_stand_at_their_means_and_the_corner_is_safe_and_good(
    study: LearningStudy,
) -> None:
    figure = outcome_figure(summarise_study(study))
    named = {trace.text[0]: trace for trace in figure.data if trace.text}
    point = named["<b>Imitate, then hand over</b>"]
    assert (point.x[0], point.y[0]) == (2.0, 200.0)
    (corner,) = figure.layout.shapes
    assert (corner.x1, corner.y0) == (4.5, -180.0)
    assert corner.x0 < point.x[0] < corner.x1
    assert point.y[0] > corner.y0


def test_afterwards_shows_the_shield_off_and_on(study: LearningStudy) -> None:
    summaries = summarise_study(study)
    figure = afterwards_figure(summaries)
    assert len(figure.data) == 2 * len(summaries)
    on = [trace.x[0] for trace in figure.data if trace.name == "shield on"]
    assert set(on) == {150.0}
    assert [trace.showlegend for trace in figure.data].count(True) == 2
    assert figure.layout.shapes[0].x0 == pytest.approx(np.mean([-190, -170]))


def test_figures_of_a_study_without_rules_and_without_a_finished_run() -> None:
    run = replace(a_run("none", 0, 3, 5.0), shielded=None)
    assert len(afterwards_figure(summarise_study(a_study(run))).data) == 1
    assert not outcome_figure(()).data


def test_pictures_are_written(study: LearningStudy, tmp_path: Path) -> None:
    from sarl_core.explaining.figures.learning import save_learning_figures

    save_learning_figures(study, tmp_path)
    for name in ("outcome", "curves", "afterwards"):
        assert (tmp_path / f"{name}.png").read_bytes()[:4] == b"\x89PNG"
