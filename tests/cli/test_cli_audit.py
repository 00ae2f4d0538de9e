"""The command `audit`, as a nightly job and as a person call it."""

import csv
import json
from itertools import pairwise
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq
import pytest

from sarl_core import load_demonstrations
from sarl_core.cli.app import main

RULES = "data/rules/cartpole_compact.json"
LOG = "data/demonstrations/cartpole.parquet"


def test_it_answers_in_one_document(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["audit", RULES, LOG, "--json", "--fail-on", "breaks>0.9"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["steps"] == 15_000
    assert document["failed_on"] == []
    assert sum(rule["broken"] for rule in document["rules"]) == document["broken"]
    assert sum(one["broken"] for one in document["episodes"]) == document["broken"]
    assert document["drift"]["compared"] == len(document["drift"]["features"]) + len(
        document["drift"]["rules"]
    )


def test_it_fails_a_job_with_a_code_of_its_own(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["audit", RULES, LOG, "--json", "--fail-on", "coverage>50%"]) == 3
    out, error = capsys.readouterr()
    assert json.loads(out)["failed_on"] == ["coverage>50%"]
    assert "coverage>50% holds: coverage is 1" in error


def test_a_log_without_times_says_how_to_give_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["audit", RULES, LOG, "--fail-on", "worst_minute>5"]) == 3
    out, error = capsys.readouterr()
    assert "--column t=time" in out
    assert "worst_minute>5 counts as if it held: worst_minute is not known" in error


def test_it_writes_a_page_and_tables(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "audited"
    assert main(["audit", RULES, LOG, "--out", str(out), "--compare", LOG]) == 0
    said = capsys.readouterr().out
    assert "Nothing shows that the two logs differ" in said
    with (out / "steps.csv").open() as file:
        steps = list(csv.DictReader(file))
    document = json.loads((out / "audit.json").read_text())
    assert len(steps) == document["steps"]
    assert sum(step["broken"] == "true" for step in steps) == document["broken"]
    assert {path.name for path in out.iterdir()} == {
        "audit.json",
        "audit.html",
        "steps.csv",
        "rules.csv",
        "episodes.csv",
    }
    page = (out / "audit.html").read_text()
    assert "<script" not in page
    assert "Does it still look like the demonstrations?" in page


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--fail-on", "brakes>1"], "which is no measure"),
        (["--compare", "data/demonstrations/pendulum.parquet"], "pendulum.parquet: the rules ask"),
        (["--out", "no/such/folder"], "cannot be made"),
    ],
)
def test_what_cannot_be_is_one_sentence(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["audit", RULES, LOG, *arguments]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.count("\n") == 1
    assert said in error


HEAD = (
    "episode,step,obs_cart position,obs_cart velocity,obs_pole angle,"
    "obs_pole angular velocity,action\n"
)


def test_a_growing_log_is_followed_line_by_line_until_it_is_stopped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.csv"
    log.write_text(HEAD)
    more = iter(["0,0,0,0,0.1,0,1\n0,1,0,0,0.1,0,0\n0,2,0", ",0,0.1,0,0\n", None])

    def wait(seconds: float) -> None:
        text = next(more)
        if text is None:
            raise KeyboardInterrupt
        with log.open("a") as file:
            file.write(text)

    monkeypatch.setattr("time.sleep", wait)
    asked = ["audit", RULES, str(log), "--follow", "--json", "--fail-on", "breaks>0.6"]
    assert main(asked) == 3
    out, error = capsys.readouterr()
    assert "note: 2 steps, 1 broken (50 %)\n" in error
    assert "note: 3 steps, 2 broken (67 %); breaks>0.6 holds\n" in error
    assert json.loads(out)["broken"] == 2


def test_a_log_that_is_rotated_ends_with_what_was_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.csv"
    log.write_text(HEAD + "0,0,0,0,0.1,0,1\n0,1,0,0,0.1,0,0\n")
    monkeypatch.setattr("time.sleep", lambda seconds: log.write_text(HEAD))
    assert main(["audit", RULES, str(log), "--follow", "--json"]) == 2
    out, error = capsys.readouterr()
    assert json.loads(out)["steps"] == 2
    assert "run.csv was rotated" in error
    assert main(["audit", RULES, LOG, "--follow"]) == 2
    assert "cannot be followed" in capsys.readouterr().err


def test_a_line_that_cannot_be_read_ends_with_what_was_read_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.csv"
    before = HEAD + "0,0,0,0,0.1,0,1\n0,1,0,0,0.1,0,0\n"
    log.write_text(before)

    def wait(seconds: float) -> None:
        with log.open("a") as file:
            file.write("0,2,0,oops,0.1,0,0\n")

    monkeypatch.setattr("time.sleep", wait)
    assert main(["audit", RULES, str(log), "--follow", "--json"]) == 2
    out, error = capsys.readouterr()
    assert json.loads(out)["steps"] == 2
    assert "holds 'oops' in row 3" in error


def test_steps_that_lack_a_value_are_counted_and_do_not_end_a_job(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.csv"
    rows = ["0,0,0,0,0.1,0,1", "0,1,0,nan,0.1,0,0", "0,2,0,0,,0,0", "0,3,0,0,0.1,0,0"]
    log.write_text(HEAD + "\n".join(rows) + "\n")
    assert main(["audit", RULES, str(log), "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["steps"], document["gaps"], document["missing_steps"]) == (2, 1, 2)
    assert "2 of 4 steps lack a value and were left out" in document["notes"][0]
    assert main(["audit", RULES, str(log), "--json", "--missing", "refuse"]) == 2


def test_a_column_of_another_name_is_a_feature_of_the_rules(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = load_demonstrations(LOG).select(range(2))
    columns = dict(zip(["px", *log.feature_names[1:]], log.observations.T, strict=True))
    frame = pd.DataFrame({"episode": log.episodes, **columns, "action": log.actions})
    frame.to_csv(tmp_path / "log.csv", index=False)
    command = ["audit", RULES, str(tmp_path / "log.csv"), "--json"]
    assert main(command) == 2
    assert "with --column 'COLUMN=feature as cart position'" in capsys.readouterr().err
    command += ["--column", "px=feature as cart position"]
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == len(log)
    # What was said is of the log: what the rules were mined from has columns of its own.
    assert main([*command, "--demonstrations", LOG]) == 0


# --- on a cluster --------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The log in three files, cut anywhere."""
    table = pq.read_table(LOG)
    (tmp_path / "logs").mkdir()
    for number, (first, end) in enumerate(pairwise((0, 4_321, 4_400, 15_000))):
        path = tmp_path / "logs" / f"part-{number}.parquet"
        pq.write_table(table.slice(first, end - first), path, row_group_size=2_000)
    return tmp_path / "logs"


def test_a_cluster_gives_the_document_of_one_memory(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    more = ["--demonstrations", LOG, "--compare", str(folder), "--fail-on", "coverage>50%"]
    documents = []
    for place, cluster in enumerate(([], ["--cluster", "local:2"])):
        out = tmp_path / f"audited-{place}"
        command = ["audit", RULES, str(folder), *more, *cluster]
        assert main([*command, "--out", str(out), "--json"]) == 3
        documents.append(capsys.readouterr().out)
    assert documents[0] == documents[1]
    whole, far = (tmp_path / f"audited-{place}" for place in range(2))
    assert {path.name for path in whole.iterdir()} - {path.name for path in far.iterdir()} == {
        "steps.csv"
    }
    for path in far.iterdir():
        assert path.read_bytes() == (whole / path.name).read_bytes()


def test_a_cluster_says_what_it_does_not_write(
    folder: Path, tmp_path: Path, running_cluster: str, capsys: pytest.CaptureFixture[str]
) -> None:
    pattern = str(folder / "*.parquet")
    out = tmp_path / "audited"
    assert main(["audit", RULES, pattern, "--cluster", running_cluster, "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "It has no steps.csv: the steps stay in the files." in said
    assert "15,000 in 30 episodes" in said


@pytest.mark.parametrize(
    ("log", "arguments", "said"),
    [
        (LOG, ["--follow"], "--follow reads lines of text while they are written"),
        (LOG, ["--out", "no/such/folder"], "the folder no/such/folder cannot be made: no/such"),
        (LOG, ["--out", LOG], "cartpole.parquet is a file; give a folder"),
        ("data/rules", [], "data/rules: this folder holds no Parquet file; give one that does"),
        ("no/*.parquet", [], "no/*.parquet: no file has a name of this pattern"),
        (LOG, ["--compare", "data/rules"], "data/rules: this folder holds no Parquet file"),
        ("data/demonstrations/pendulum.parquet", [], "pendulum.parquet: the rules ask about 4"),
    ],
)
def test_what_a_cluster_cannot_do_is_one_sentence(
    log: str,
    arguments: list[str],
    said: str,
    running_cluster: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["audit", RULES, log, "--cluster", running_cluster, *arguments]) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.count("\n") == 1
    assert said in error


def test_what_does_not_fit_in_the_demonstrations_is_no_fault_of_the_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = tmp_path / "other.csv"
    other.write_text("episode,obs_gap,action\n" + "0,0.5,0\n" * 20)
    assert main(["audit", RULES, LOG, "--demonstrations", str(other)]) == 2
    said = capsys.readouterr().err
    assert f"{other}: " in said
    assert LOG not in said
    assert "the demonstrations have" in said
