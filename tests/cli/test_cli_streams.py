"""No command dies of its standard output or error, and none leaves its file unwritten."""

from __future__ import annotations

import json
import os
import resource
import shlex
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
CART = "data/demonstrations/cartpole.parquet"
COMMANDS = {
    "check": f"check {CART}",
    "mine": f"mine {CART} --support 0.005 --confidence 0.9 --out OUT/rules.json",
    "evaluate": "evaluate --env CartPole-v1 --agent novice --episodes 2 --seed 1",
}


def shell(line: str, out: Path, redirect: str, **environment: str) -> subprocess.CompletedProcess:
    """Run a command of ours with its streams sent somewhere by a shell."""
    command = f"{shlex.quote(sys.executable)} -m sarl_core {line.replace('OUT', str(out))}"
    return subprocess.run(
        ["bash", "-c", f"set -o pipefail; {command} {redirect}"],
        cwd=ROOT,
        env={**os.environ, **environment},
        capture_output=True,
        check=False,
    )


@pytest.mark.parametrize(
    ("name", "redirect", "unbuffered"),
    [
        ("check", ">&-", ""),
        ("check", "| true", "1"),
        ("mine", "<&- >&- 2>&-", ""),
        ("mine", "| true", "1"),
        ("evaluate", "| true", ""),
        ("evaluate", ">&-", "1"),
    ],
)
def test_a_closed_output_ends_nothing(
    name: str, redirect: str, unbuffered: str, tmp_path: Path
) -> None:
    done = shell(COMMANDS[name], tmp_path, redirect, PYTHONUNBUFFERED=unbuffered)
    assert (done.returncode, done.stderr) == (0, b"")
    assert [path.name for path in tmp_path.iterdir()] == ["rules.json"] * (name == "mine")


@pytest.mark.parametrize("name", ["check", "mine"])
def test_an_answer_that_is_lost_is_said_and_the_file_is_there(name: str, tmp_path: Path) -> None:
    done = shell(COMMANDS[name], tmp_path, ">/dev/full")
    assert done.returncode == 1
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith("error: the answer could not be written to standard output (No space")
    assert [path.name for path in tmp_path.iterdir()] == ["rules.json"] * (name == "mine")


def test_an_error_does_not_end_up_on_standard_output() -> None:
    done = shell("check missing.csv", Path(), "2>&-")
    assert (done.returncode, done.stdout) == (2, b"")


@pytest.mark.parametrize("name", ["check", "mine"])
def test_an_output_of_ascii_gets_ascii(name: str, tmp_path: Path) -> None:
    done = shell(COMMANDS[name], tmp_path, "", PYTHONIOENCODING="ascii")
    assert done.returncode == 0, done.stderr
    text = done.stdout.decode("ascii")
    assert text
    assert "?" not in text


def test_names_that_ascii_lacks_survive_in_json(tmp_path: Path) -> None:
    rows = "\n".join(f"{i // 10},{i % 10},{i * 0.5},{i % 2}" for i in range(40))
    file = tmp_path / "größe.csv"
    file.write_text(f"episode,step,obs_größe,action\n{rows}\n", encoding="utf-8")
    answer = shell(f"check {shlex.quote(str(file))} --json", tmp_path, "", PYTHONIOENCODING="ascii")
    assert answer.returncode == 0, answer.stderr
    assert "größe" in json.dumps(json.loads(answer.stdout.decode("ascii")), ensure_ascii=False)


def test_a_film_that_no_player_opens_is_not_written(tmp_path: Path) -> None:
    out = tmp_path / "x.mp4"
    out.write_bytes(b"the old film")
    done = subprocess.run(
        [*(sys.executable, "-m", "sarl_core", "render", "--env", "CartPole-v1"),
         *("--agent", "novice", "--seed", "1", "--out", str(out))],
        cwd=ROOT,
        capture_output=True,
        check=False,
        # No file may become larger, as where a disk is full.
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (8192, 8192)),
    )  # fmt: skip
    assert done.returncode == 1
    (line,) = done.stderr.decode().splitlines()
    assert line.startswith(f"error: {out} could not be encoded")
    assert b"Wrote" not in done.stdout
    assert out.read_bytes() == b"the old film"
    assert list(tmp_path.iterdir()) == [out]


def test_a_request_to_end_clears_up(tmp_path: Path) -> None:
    process = subprocess.Popen(
        [*(sys.executable, "-m", "sarl_core", "render", "--env", "LunarLander-v3"),
         *("--agent", "expert", "--seed", "1", "--out", str(tmp_path / "x.mp4"))],
        cwd=ROOT,
        env={**os.environ, "TMPDIR": str(tmp_path)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )  # fmt: skip
    while not list(tmp_path.glob(".sarl.unfinished-*")) and process.poll() is None:
        time.sleep(0.02)
    process.terminate()
    printed, complaints = process.communicate(timeout=60)
    # To a shell both are 130. Python ends itself by the signal where a library saw the interrupt.
    assert process.returncode in (130, -signal.SIGINT)
    assert printed == ""
    assert complaints.splitlines() == ["error: stopped; nothing was written"]
    assert list(tmp_path.iterdir()) == []
