"""What a settings file may say of limits, and how a mistake in it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core import InputError
from sarl_core.serving.limits import VARIABLE, ServerLimits
from sarl_core.serving.settings import read_settings

LIMITS = """
[agents]
jobs = "crane_task:operator"

[limits]
upload_mb = 50
jobs = 4
jobs_each = 1
memory_gib = 2.5
"""


def written(folder: Path, text: str, name: str = "server.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_limits_that_are_not_named_stay_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    limits = read_settings(written(tmp_path, LIMITS)).limits
    assert limits == ServerLimits(upload_mb=50, jobs=4, jobs_each=1, memory_gib=2.5)
    assert limits.learning_steps == ServerLimits().learning_steps
    monkeypatch.setenv(VARIABLE, limits.to_text())
    assert ServerLimits.of_process() == limits


@pytest.mark.parametrize(("jobs", "each"), [(1, 3), (2, 1), (3, 2), (4, 3), (60, 3)])
def test_jobs_alone_leave_a_place_for_others(tmp_path: Path, jobs: int, each: int) -> None:
    limits = read_settings(written(tmp_path, f"[limits]\njobs = {jobs}")).limits
    assert (limits.jobs, limits.jobs_each) == (jobs, each)


def test_a_file_that_names_limits_is_for_many(tmp_path: Path) -> None:
    assert read_settings(written(tmp_path, "[limits]")).for_many
    assert not read_settings(written(tmp_path, "[agents]")).for_many


def test_limits_are_the_usual_ones_where_nobody_says_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delenv(VARIABLE, raising=False)
    assert ServerLimits.of_process() == ServerLimits()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[limits]\njobs = 3\nuplod_mb = 5", "line 3: 'uplod_mb' is not known"),
        ("# ours\n\n[limts]\njobs = 3", "line 3: 'limts' is not known"),
        ("[agents]\njobs = 'a:b'\n[limits]\njobs = 'four'", "line 4: 'jobs' is 'four'"),
        ("[limits]\njobs = 2.5", "line 2: 'jobs' is 2.5"),
        ("[limits]\njobs = true", "line 2: 'jobs' is True"),
        ("[limits]\njobs = 0", "line 2: 'jobs' is 0, not a whole number from 1 to 1000"),
        ("[limits]\nmemory_gib = -1", "line 2: 'memory_gib' is -1"),
        ("[limits]\njobs = 2\njobs_each = 2", "line 3: 'jobs_each' is 2 and 'jobs' is 2"),
        ("[limits]\njobs_each = 7", "line 2: 'jobs_each' is 7 and 'jobs' is 6"),
        ("[[environments]]\nid = 'A-v0'\n[[environments]]\nid = 3", "line 4: 'id' is 3"),
        ("[limits]\njobs = 2\njobs = 3\n", "line 3"),
        ("limits = 3", "line 1: 'limits' is 3"),
    ],
)
def test_a_mistake_is_named_with_its_line(tmp_path: Path, text: str, said: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(InputError) as refused:
        read_settings(path)
    sentence = str(refused.value)
    assert said in sentence
    assert str(path) in sentence
    assert "\n" not in sentence


def test_a_mistake_in_json_is_named_with_its_line_too(tmp_path: Path) -> None:
    text = '{\n "limits": {\n  "jobs": "four"\n }\n}'
    with pytest.raises(InputError, match="line 3: 'jobs' is 'four'"):
        read_settings(written(tmp_path, text, "server.json"))
