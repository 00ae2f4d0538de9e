"""Several arms and seeds: readable at any moment, stopped and taken up again, summed up."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from stable_baselines3 import PPO

from sarl_core import InputError, RuleSet, WorkError, load_demonstrations, mine_rules
from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.learning.arms import ARMS, arms_named
from sarl_core.learning.curves import Columns, Trial
from sarl_core.learning.run import LearningResult, learn
from sarl_core.learning.study import LearningPlan, run_study
from sarl_core.learning.study_files import (
    LearningRun,
    LearningStudy,
    load_run,
    load_study,
    policy_path,
    save_run,
)
from sarl_core.learning.summary import best, reference, summarise_study
from sarl_core.progress import CancelledError

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


@pytest.fixture(scope="module")
def plan() -> LearningPlan:
    mined = mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.9)
    few = replace(mined, rules=mined.rules[:1])
    arms = arms_named(["none", "imitate"])
    return LearningPlan("CartPole-v1", few, arms, 400, (0, 1), episodes=2)


@pytest.fixture(scope="module")
def done(plan: LearningPlan, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A finished study; not to be changed."""
    folder = tmp_path_factory.mktemp("study")
    run_study(plan, folder)
    yield folder
    assert load_study(folder).complete


def test_a_finished_study_holds_every_run_and_no_checkpoint(plan: LearningPlan, done: Path) -> None:
    study = load_study(done)
    assert study.complete
    assert [run.name for run in study.runs] == ["none-0", "imitate-0", "none-1", "imitate-1"]
    assert all(run.done == 400 for run in study.runs)
    names = {path.relative_to(done).as_posix() for path in done.rglob("*") if path.is_file()}
    assert names == {
        "plan.json",
        "rules.json",
        "results.json",
        "curves.csv",
        *(f"runs/{run.name}.json" for run in study.runs),
        *(f"policies/{run.name}.npz" for run in study.runs),
    }
    assert plan.rules is not None
    assert RuleSet.load(done / "rules.json").rules == plan.rules.rules


def test_the_tables_say_what_the_runs_say(done: Path, tmp_path: Path) -> None:
    whole = load_study(done)
    for name in ("plan.json", "results.json", "curves.csv"):
        shutil.copy(done / name, tmp_path)
    tables = load_study(tmp_path)
    assert [run.name for run in tables.runs] == [run.name for run in whole.runs]
    for one, other in zip(tables.runs, whole.runs, strict=True):
        assert one.curve.to_dict() == other.curve.to_dict()
        assert (one.alone, one.shielded, one.done) == (other.alone, other.shielded, other.done)
    with (done / "curves.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == sum(len(run.curve) for run in whole.runs)
    assert sum(int(row["crashed"]) for row in rows) == sum(run.curve.crashes for run in whole.runs)


def test_results_are_for_json_and_say_with_which_versions(done: Path) -> None:
    results = json.loads((done / "results.json").read_text())
    assert {"gymnasium", "torch", "stable_baselines3"} <= set(results["versions"])
    assert results["rules"]["count"] == 1
    assert [entry["arm"] for entry in results["summary"]] == ["none", "imitate"]


def test_stopped_in_its_second_run_the_first_is_kept_and_the_rest_follows(
    plan: LearningPlan, done: Path, tmp_path: Path
) -> None:
    with pytest.raises(CancelledError, match=r"1 of 4 runs are finished and kept in"):
        run_study(plan, tmp_path, progress=lambda steps, total: steps <= 400)
    stopped = load_study(tmp_path)
    assert [run.name for run in stopped.finished] == ["none-0"]
    assert not stopped.complete
    assert len(json.loads((tmp_path / "results.json").read_text())["runs"]) == 1
    before = (tmp_path / "runs" / "none-0.json").read_bytes()
    told = []
    study = run_study(plan, tmp_path, progress=lambda steps, total: told.append((steps, total)))
    assert study.complete
    assert (tmp_path / "runs" / "none-0.json").read_bytes() == before
    assert told[0] == (400, 1600)
    assert told[-1] == (1600, 1600)
    whole = {run.name: run for run in load_study(done).runs}
    assert study.runs[2].curve.to_dict() == whole["none-1"].curve.to_dict()


def test_more_arms_and_seeds_may_be_asked_for_later(plan: LearningPlan, tmp_path: Path) -> None:
    run_study(replace(plan, arms=(ARMS["none"],), seeds=(0,)), tmp_path)
    before = (tmp_path / "runs" / "none-0.json").read_bytes()
    study = run_study(replace(plan, arms=arms_named(["none", "mask"]), seeds=(0,)), tmp_path)
    assert study.complete
    assert [run.name for run in study.runs] == ["none-0", "mask-0"]
    assert (tmp_path / "runs" / "none-0.json").read_bytes() == before


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"steps": 401}, "number of steps"),
        ({"rules": None}, "rule set"),
        ({"episodes": 99}, "number of episodes"),
    ],
)
def test_a_folder_of_another_study_is_refused(
    plan: LearningPlan, done: Path, change: dict[str, object], said: str
) -> None:
    other = replace(plan, arms=(ARMS["none"],), **change)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=f"a study with another {said}"):
        run_study(other, done)


def test_a_folder_that_cannot_be_made_is_said(plan: LearningPlan, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="cannot be made"):
        run_study(plan, tmp_path / "file" / "study")


@pytest.mark.parametrize(
    ("change", "fragment"),
    [
        ({"steps": 0}, "steps is 0"),
        ({"steps": 10**9}, "more than"),
        ({"arms": ()}, "nothing to learn"),
        ({"seeds": ()}, "nothing to learn"),
        ({"episodes": 0}, "episodes is 0"),
        ({"seeds": (0, 90)}, "seed is 90"),  # it would see what all are tried on
        ({"env_id": "LunarLander-v3"}, "4 features"),
        ({"penalty": 2.0}, "no arm learns with one"),
        ({"penalty": np.nan}, "the penalty is nan"),
    ],
)
def test_a_plan_that_cannot_be_learned_is_refused(
    plan: LearningPlan, change: dict[str, object], fragment: str
) -> None:
    with pytest.raises(InputError, match=fragment):
        replace(plan, **change)  # type: ignore[arg-type]


def test_a_penalty_is_what_was_said_and_stands_in_the_study(
    plan: LearningPlan, tmp_path: Path
) -> None:
    alike = replace(plan, arms=arms_named(["override", "penalty"]), seeds=(0,), penalty=0.0)
    learned = {}
    for place, penalty in enumerate((0.0, 50.0)):
        folder = tmp_path / str(place)
        study = run_study(replace(alike, penalty=penalty), folder)
        assert study.settings["penalty"] == penalty
        learned[penalty] = [
            MlpPolicy.load(policy_path(folder, arm, 0)).weights[-1] for arm in alike.arms
        ]
    assert np.array_equal(*learned[0.0])
    assert not np.array_equal(*learned[50.0])
    with pytest.raises(InputError, match="another penalty"):
        run_study(replace(alike, penalty=1.0), tmp_path / "1")


@pytest.mark.parametrize("text", ["", "[]", "{", '{"format": "other"}', "\ud7ff"])
@pytest.mark.parametrize("name", ["plan.json", "runs/none-0.json"])
def test_a_damaged_file_is_named(done: Path, tmp_path: Path, name: str, text: str) -> None:
    folder = tmp_path / "study"
    shutil.copytree(done, folder)
    (folder / name).write_text(text)
    with pytest.raises(InputError, match=name.rsplit("/", 1)[-1]) as caught:
        load_study(folder)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change", [{"version": 2}, {"arm": "other"}, {"alone": {"returns": []}}, {"curve": {}}]
)
def test_a_run_of_another_version_or_with_a_part_missing_is_refused(
    done: Path, tmp_path: Path, change: dict[str, object]
) -> None:
    document = json.loads((done / "runs" / "none-0.json").read_text())
    path = tmp_path / "none-0.json"
    path.write_text(json.dumps(document | change))
    with pytest.raises(InputError):
        load_run(path)


# --- what a study says --------------------------------------------------------------------------


def test_one_that_diverges_is_told_and_the_others_run(
    plan: LearningPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def diverge(self: PPO) -> None:
        self.policy.action_net.weight.data.fill_(float("nan"))

    monkeypatch.setattr("stable_baselines3.PPO.train", diverge)  # of "none"; not of "imitate"
    with pytest.raises(
        WorkError, match=r"1 of 2 runs are finished .* 1 failed \(No shield"
    ) as told:
        run_study(replace(plan, seeds=(0,)), tmp_path)
    assert "\n" not in str(told.value)
    results = json.loads((tmp_path / "results.json").read_text())
    assert [summary["arm"] for summary in results["summary"]] == ["imitate"]


def test_when_the_disk_is_full_what_is_finished_is_summed_up(
    plan: LearningPlan, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = []

    def second_fails(*arguments: object, **settings: object) -> LearningResult:
        begun.append(arguments)
        if len(begun) > 1:
            raise WorkError("the disk is full")
        return learn(*arguments, **settings)  # type: ignore[arg-type]

    monkeypatch.setattr("sarl_core.learning.study.learn", second_fails)
    with pytest.raises(WorkError, match="full"):
        run_study(plan, tmp_path)
    assert len(begun) == 2
    results = json.loads((tmp_path / "results.json").read_text())
    assert [summary["arm"] for summary in results["summary"]] == ["none"]


def a_run(arm: str, seed: int, crashes: int, alone: float, steps: int = 1000) -> LearningRun:
    """A run of ten episodes of which some crashed."""
    curve = Columns(
        **{
            "ends": [(index + 1) * steps // 10 for index in range(10)],
            "returns": [float(index) for index in range(10)],
            "lengths": [steps // 10] * 10,
            "crashed": [index < crashes for index in range(10)],
            "interventions": [10 - index for index in range(10)],
            "covered": [50] * 10,
            "shielded": [ARMS[arm].shielded] * 10,
        }
    ).read()
    trial = Trial((alone - 1, alone + 1), 1, 0.0, 0.0)
    return LearningRun(ARMS[arm], seed, steps, curve, trial, Trial((5.0, 5.0), 0, 0.5, 1.0))


def a_study(*runs: LearningRun) -> LearningStudy:
    arms = tuple(arm for arm in ARMS.values() if any(run.arm == arm for run in runs))
    seeds = tuple(sorted({run.seed for run in runs}))
    settings = {"rules": None, "trial_episodes": 2}
    return LearningStudy("CartPole-v1", 1000, settings, arms, seeds, runs)


@pytest.mark.parametrize(
    ("crashes", "alone", "safe", "good"),
    [
        (5, 10.0, True, True),  # at most half, and at least as much: the edges count
        (6, 10.0, False, True),
        (5, 9.9, True, False),
        (6, 9.9, False, False),
    ],
)
def test_safe_and_good_are_measured_by_the_learner_alone(
    crashes: int, alone: float, safe: bool, good: bool
) -> None:
    plain, shielded = summarise_study(
        a_study(a_run("none", 0, 10, 10.0), a_run("mask", 0, crashes, alone))
    )
    assert (plain.safe, plain.good) == (None, None)
    assert (shielded.safe, shielded.good) == (safe, good)


def test_an_off_policy_learner_is_measured_by_its_own_kind() -> None:
    summaries = summarise_study(
        a_study(
            a_run("none", 0, 10, 100.0),
            a_run("none-replay", 0, 4, 1.0),
            a_run("replay", 0, 3, 2.0),
        )
    )
    assert (summaries[2].safe, summaries[2].good) == (False, True)
    found = reference(summaries, ARMS["replay"])
    assert found is not None
    assert found.arm.name == "none-replay"


def test_without_the_learner_alone_nothing_is_judged() -> None:
    (summary,) = summarise_study(a_study(a_run("override", 0, 1, 50.0)))
    assert summary.safe is None
    assert best([summary]) is None


def test_the_best_is_the_one_that_returns_most_of_those_that_are_both() -> None:
    summaries = summarise_study(
        a_study(
            a_run("none", 0, 10, 10.0),
            a_run("override", 0, 1, 5.0),
            a_run("mask", 0, 2, 20.0),
            a_run("imitate", 0, 5, 30.0),
            a_run("handover", 0, 9, 90.0),
        )
    )
    found = best(summaries)
    assert found is not None
    assert found.arm.name == "imitate"


def test_the_best_is_chosen_by_other_episodes_than_it_is_told_by() -> None:
    def returns(arm: str, first: float, second: float) -> LearningRun:
        trial = Trial((first, first, second, second), 0, 0.0, 0.0)
        return replace(a_run(arm, 0, 1, 0.0), alone=trial)

    summaries = summarise_study(
        a_study(
            replace(returns("none", 0.0, 0.0), curve=a_run("none", 0, 9, 0.0).curve),
            returns("mask", 30.0, 10.0),
            returns("imitate", 10.0, 90.0),  # the higher mean, by luck that was not asked
        )
    )
    found = best(summaries)
    assert found is not None
    assert (found.arm.name, found.alone.halves) == ("mask", (30.0, 10.0))


def test_where_failures_are_not_known_nothing_is_called_safe() -> None:
    study = replace(
        a_study(a_run("none", 0, 9, 1.0), a_run("mask", 0, 1, 9.0)), env_id="module:Unknown-v0"
    )
    assert [summary.safe for summary in summarise_study(study)] == [None, None]


def test_seeds_are_averaged_and_shown() -> None:
    (summary,) = summarise_study(a_study(a_run("none", 0, 2, 10.0), a_run("none", 1, 6, 30.0)))
    assert summary.crashes == (2, 6)
    assert summary.mean_crashes == 4
    assert summary.alone.means == (10.0, 30.0)
    assert summary.alone.mean == 20.0
    assert summary.alone.crash_rate == 0.5
    assert summary.learning_return == 4.5
    assert summary.late_return == 9.0  # of the last tenth of the steps
    assert summary.intervention_rate == pytest.approx(55 / 1000)
    assert summary.late_intervention_rate == pytest.approx(1 / 100)


def test_unfinished_runs_do_not_count(tmp_path: Path) -> None:
    (tmp_path / "runs").mkdir()
    run = replace(a_run("none", 0, 2, 10.0), alone=None, shielded=None, done=700)
    save_run(tmp_path, run)
    again = load_run(tmp_path / "runs" / "none-0.json")
    assert not again.finished
    assert again.done == 700
    np.testing.assert_array_equal(again.curve.ends, run.curve.ends)
    assert summarise_study(a_study(again)) == ()
