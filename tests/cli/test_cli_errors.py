"""What a user can get wrong on the command line: one line, the right code, nothing written."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sarl_core.cli.app import main

ROOT = Path(__file__).resolve().parents[2]
CART = str(ROOT / "data" / "demonstrations" / "cartpole.parquet")
PENDULUM = str(ROOT / "data" / "demonstrations" / "pendulum.parquet")


@pytest.fixture
def fail(capsys, tmp_path, monkeypatch):
    """Run a command line that is to fail; give its sentence. Nothing may be left behind."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments, code=2):
        before = sorted(tmp_path.rglob("*"))
        assert main([str(argument) for argument in arguments]) == code
        printed = capsys.readouterr()
        assert printed.out == ""
        lines = printed.err.splitlines()
        assert len(lines) == 1, printed.err
        assert lines[0].startswith("error: ")
        assert "Traceback" not in lines[0]
        assert sorted(tmp_path.rglob("*")) == before
        return lines[0]

    return call


MINE = ("mine", CART, "--support", "0.1", "--confidence", "0.9", "--out", "rules.json")
LANDSCAPE = ("landscape", CART, "--out", "landscape.json")
EVALUATE = ("evaluate", "--env", "CartPole-v1", "--agent", "novice")
RENDER = ("render", "--env", "CartPole-v1", "--agent", "novice", "--out", "replay.gif")
RECORD = ("record", "--env", "CartPole-v1", "--agent", "novice", "--steps", "9", "--out", "r.csv")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("evalute",), "evaluate"),
        ((*MINE, "--support", "abc"), "for '--support': this is no number; give one such as 0.5"),
        ((*MINE, "--divider", "1.5"), "'--divider': this is no whole number; give one such as 5"),
        ((*MINE, "--learner", "none"), "for '--learner': 'none' is not one of 'exact', 'hist"),
        (("--nonsense",), "--nonsense"),
        (("check",), "FILE"),
        (("mine", CART, "--support", "0.1", "--out", "rules.json"), "--confidence"),
        (("check", CART, "extra"), "extra"),
        (("check", "missing.parquet"), "missing.parquet"),
        (("check", CART, "--env", "NoSuch-v0"), "NoSuch-v0"),
        (("mine", CART, "--out", "rules.json"), "--setting"),
        ((*MINE, "--setting", "filtered"), "--setting"),
        (("mine", CART, "--support", "0.1", "--setting", "filtered", "--out", "r.json"), "both"),
        (("mine", CART, "--setting", "strict", "--out", "rules.json"), "strict"),
        ((*MINE, "--support", "1.5"), "support is 1.5"),
        ((*MINE, "--support", "nan"), "support is nan"),
        ((*MINE, "--confidence", "-0.1"), "confidence is -0.1"),
        ((*MINE, "--support", "lots"), "--support"),
        ((*MINE, "--lift", "-1"), "lift is -1"),
        ((*MINE, "--divider", "1"), "--divider"),
        ((*MINE, "--divider", "1000"), "divider is 1000"),
        ((*MINE, "--max-depth", "-2"), "--max-depth"),
        ((*MINE, "--out", "rules.txt"), ".json"),
        ((*MINE, "--out", "nowhere/rules.json"), "nowhere"),
        ((*LANDSCAPE, "--supports", "0:0.5"), "'0:0.5'"),
        ((*LANDSCAPE, "--supports", "a:b:c"), "--supports"),
        ((*LANDSCAPE, "--supports", "0:0.5:0"), "step"),
        ((*LANDSCAPE, "--supports", "0.5:0:0.1"), "below"),
        ((*LANDSCAPE, "--confidences", "0:2:0.1"), "from 0 to 1"),
        ((*LANDSCAPE, "--confidences", "0:1:nan"), "--confidences"),
        ((*LANDSCAPE, "--confidences", "0:1:1e-9"), "larger step"),
        (
            (*LANDSCAPE, "--supports", "0:1:0.0004", "--confidences", "0:1:0.0004"),
            "larger steps",
        ),
        ((*LANDSCAPE, "--never", "0:0.5:0.1"), "above 0 and below 1"),
        ((*LANDSCAPE, "--never", "0.1"), "--never is '0.1'"),
        ((*LANDSCAPE, "--never", "0.1:0.2:0.1", "--confidences", "0:1:0.1"), "leave out"),
        ((*LANDSCAPE, "--out", "landscape.pdf"), ".png"),
        ((*LANDSCAPE, "--out", "nowhere/landscape.png"), "nowhere"),
        ((*EVALUATE, "--env", "NoSuch-v0"), "NoSuch-v0"),
        ((*EVALUATE, "--env", "no_such_module:Env-v0"), "no_such_module"),
        ((*EVALUATE, "--agent", "genius"), "genius"),
        ((*EVALUATE, "--agent", "missing.npz"), "missing.npz"),
        ((*EVALUATE, "--env", "Acrobot-v1", "--agent", "expert"), "expert"),
        ((*EVALUATE, "--episodes", "0"), "--episodes"),
        ((*EVALUATE, "--episodes", "many"), "--episodes"),
        ((*EVALUATE, "--seed", "-1"), "--seed"),
        ((*EVALUATE, "--projection", "sideways"), "sideways"),
        ((*EVALUATE, "--rules", "missing.json"), "missing.json"),
        ((*EVALUATE, "--rules", CART), "cartpole.parquet"),
        ((*RENDER, "--out", "replay.avi"), ".mp4"),
        ((*RENDER, "--out", "nowhere/replay.gif"), "nowhere"),
        ((*RENDER, "--side-by-side"), "--rules"),
        ((*RECORD, "--out", "r.xlsx"), ".parquet"),
        ((*RECORD, "--out", "nowhere/r.csv"), "nowhere"),
        ((*RECORD, "--steps", "0"), "--steps"),
        (("train-expert", "--env", "Acrobot-v1", "--out", "e.npz"), "Acrobot-v1"),
        (("train-expert", "--env", "CartPole-v1", "--out", "e.zip"), ".npz"),
    ],
    ids=lambda value: " ".join(value)[-60:] if isinstance(value, tuple) else "",
)
def test_what_a_user_got_wrong_is_one_line_and_code_2(arguments, words, fail):
    assert words in fail(*arguments)


def test_json_leaves_standard_output_empty_after_an_error(fail):
    assert "missing" in fail("check", "missing.csv", "--json")


def test_rules_of_another_environment_are_refused(capsys, fail, tmp_path):
    rules = tmp_path / "rules.json"
    arguments = ("mine", PENDULUM, "--support", "0.01", "--confidence", "0.9")
    assert main([*arguments, "--out", str(rules)]) == 0
    capsys.readouterr()
    assert "Pendulum-v1" in fail(*EVALUATE, "--rules", rules)
    assert "Pendulum-v1" in fail(*RENDER, "--rules", rules)


def test_a_rule_file_from_another_version_is_refused(fail, tmp_path):
    (tmp_path / "rules.json").write_text('{"format": "sarl-rules", "version": 99}')
    assert "99" in fail(*EVALUATE, "--rules", "rules.json")


def test_a_folder_is_no_file(fail, tmp_path):
    (tmp_path / "folder.json").mkdir()
    assert "is a folder" in fail(*MINE[:-1], "folder.json")


def test_bad_data_is_the_readers_sentence(fail, tmp_path):
    (tmp_path / "bad.csv").write_text("episode,step,obs_x,action\n0,0,1.0,0\n0,1,nan,1\n")
    sentence = fail("check", "bad.csv")
    assert "bad.csv" in sentence
    assert "x" in sentence


def test_failed_work_is_code_1(fail, monkeypatch):
    import kaleido

    def no_browser(*_, **__):
        raise RuntimeError("No browser was found. Install one.")

    monkeypatch.setattr(kaleido, "Kaleido", no_browser)
    assert "Chromium" in fail("landscape", CART, "--out", "landscape.png", code=1)


@pytest.mark.parametrize(
    ("browser", "why"),
    [
        ("/bin/false", "could not be started; set BROWSER_PATH to one that works, or write .html"),
        ("/nowhere/chromium", "does not exist; set BROWSER_PATH to one that works, or write .html"),
    ],
)
def test_a_browser_that_does_not_work_is_named(fail, monkeypatch, browser, why):
    monkeypatch.setenv("BROWSER_PATH", browser)
    told = fail("landscape", CART, "--out", "landscape.png", code=1)
    assert told.strip().endswith(f"'{browser}', to which BROWSER_PATH is set, {why}")


def test_where_there_is_no_browser_it_is_said_what_to_do(fail, monkeypatch):
    from choreographer.browsers.chromium import Chromium

    monkeypatch.setattr(Chromium, "find_browser", lambda **_: None)
    told = fail("landscape", CART, "--out", "landscape.png", code=1)
    assert "there is none; install one and, if it is not found, set BROWSER_PATH" in told
    assert "('" not in told


def test_what_nobody_expected_is_one_line_and_with_debug_a_traceback(fail, monkeypatch, capsys):
    def broken(*_, **__):
        raise ZeroDivisionError("two\nlines")

    monkeypatch.setattr("sarl_core.demonstrations.formats.load_demonstrations", broken)
    assert "ZeroDivisionError: two lines" in fail("check", CART, code=1)
    assert main(["check", CART, "--debug"]) == 1
    printed = capsys.readouterr().err
    assert "Traceback" in printed
    assert printed.splitlines()[-1].startswith("error: ZeroDivisionError")


def test_control_c_is_one_line_and_code_130(tmp_path):
    out = tmp_path / "long.csv"
    process = subprocess.Popen(
        [
            sys.executable,
            "-m",
            "sarl_core",
            "record",
            "--env",
            "CartPole-v1",
            "--agent",
            "novice",
            "--steps",
            "100000000",
            "--out",
            str(out),
        ],
        cwd=ROOT,
        env={**os.environ},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # Whoever starts the tests in the background has them ignore it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    # Only a program that has come to its work can be interrupted in it.
    busy = Path(f"/proc/{process.pid}/maps")
    while "multiarray" not in busy.read_text() and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    printed, complaints = process.communicate(timeout=60)
    # Python ends by the signal itself where it came in the midst of an exec, as while a dataclass
    # is made; for a shell both are 130.
    assert process.returncode in (130, -signal.SIGINT)
    assert printed == ""
    assert complaints.splitlines() == ["error: stopped; nothing was written"]
    assert list(tmp_path.iterdir()) == []
