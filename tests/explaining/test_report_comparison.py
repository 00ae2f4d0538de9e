from __future__ import annotations

import gc
import hashlib
import json
from dataclasses import replace
from pathlib import Path

import pytest

from sarl_core import InputError, load_demonstrations, mine_rules
from sarl_core.environments.environment import Environment
from sarl_core.explaining.report.comparison import (
    ResultFile,
    compared,
    read_results,
    results_from_text,
    results_of,
)
from sarl_core.explaining.report.outcomes import outcomes_note
from sarl_core.rollouts.episode_files import episodes_from_json, episodes_to_json
from sarl_core.rollouts.episodes import rollout
from sarl_core.studies.comparison import Arm, Comparison, compare

DATA = Path(__file__).parents[2] / "data"
HEADER = "arm,episodes,mean,std,iqm,iqm_low,iqm_high"


@pytest.fixture(scope="module")
def comparison() -> Comparison:
    rules = mine_rules(
        load_demonstrations(DATA / "demonstrations" / "cartpole.parquet"),
        supp_min=0.005,
        conf_min=0.95,
    )
    arms = (Arm("novice, no shield", "novice"), Arm("novice, filtered", "novice", rules))
    return compare("CartPole-v1", arms, episodes=4, seed=7)


def test_the_table_of_the_page_reads_as_what_was_run(comparison: Comparison, tmp_path) -> None:
    frame = comparison.to_frame()
    frame.insert(0, "seed", comparison.seed)
    frame.insert(0, "environment", comparison.env_id)
    path = tmp_path / "comparison.csv"
    frame.to_csv(path, index=False)
    found = read_results(path)
    file = ResultFile("comparison.csv", hashlib.sha256(path.read_bytes()).hexdigest())
    assert found == tuple(replace(one, file=file) for one in results_of(comparison))
    assert [one.mean for one in found] == [one.returns.mean() for one in comparison.episodes]
    assert (found[0].rules, found[0].changed) == (None, None)
    assert found[1].rules == 5
    assert found[0].crashes == 1.0
    shown = compared(found)
    assert shown is not None
    assert "in CartPole-v1, from seed 7 on" in shown.sentences[0]
    assert [row.name for row in shown.rows] == ["novice, no shield", "novice, filtered"]


def test_the_document_of_evaluate_is_one_result(comparison: Comparison) -> None:
    alone, shielded = comparison.episodes
    for episodes, ruled in ((alone, False), (shielded, True)):
        (one,) = results_from_text(json.dumps(episodes.to_dict()), "novice.json")
        assert one.name == "novice"
        assert (one.seed, one.episodes) == (7, 4)
        assert one.iqm == episodes.statistics.iqm
        assert (one.covered is not None) == ruled


def test_what_a_failure_was_is_said_as_the_file_tells(comparison: Comparison) -> None:
    known, other = results_of(comparison)
    assert "It fails if the pole falls or the cart leaves its track." in outcomes_note([known])
    of_somebody = Environment("CartPole-v1", failure="abs(pole_angle) > 0.1")
    played = rollout(of_somebody, "novice", episodes=2, keep_steps=False)
    (read,) = results_from_text(json.dumps(played.to_dict()), "novice.json")
    own = "it comes to a step at which abs(pole_angle) > 0.1 is true."
    assert f"It fails if {own}" in outcomes_note([read])
    assert "fails if" not in outcomes_note([replace(read, failure="")])
    both = outcomes_note([read, other])
    assert f"In “novice” it fails if {own}" in both
    assert f"In “{other.name}” it fails if the pole falls" in both
    again = episodes_from_json(episodes_to_json(played), name="episodes")
    assert again.failure == played.failure == read.failure


def test_without_results_there_is_nothing_to_show() -> None:
    assert compared(()) is None


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("arm,mean\nx,1\n", "r.csv", "no column 'episodes'"),
        (f"{HEADER}\n", "r.csv", "0 rows"),
        (f"{HEADER}\nx,3,nan,1,1,1,1\n", "r.csv", "'mean'"),
        (f"{HEADER}\nx,3,1,1,,1,1\n", "r.csv", "'iqm'"),
        (f"{HEADER}\nx,3,1,1,5,1,2\n", "r.csv", "does not hold its value"),
        (f"{HEADER}\n" + "x,3,1,1,1,1,1\n" * 201, "r.csv", "201 rows"),
        ("{", "r.json", "not JSON"),
        ("[" * 100_000, "r.json", "not JSON"),
        ("{}", "r.json", "no episodes"),
        ('{"episodes": [1], "summary": {"mean": true}}', "r.json", "'mean'"),
    ],
)
def test_what_is_no_comparison_is_refused(text: str, name: str, words: str) -> None:
    gc.collect()  # at the bottom of the deepest text nothing of other tests can be let go of
    with pytest.raises(InputError, match=words) as caught:
        results_from_text(text, name)
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere\.csv.* page Measure"):
        read_results(tmp_path / "nowhere.csv")
    path = tmp_path / "r.csv"
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="no text"):
        read_results(path)
