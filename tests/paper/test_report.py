from __future__ import annotations

import copy
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from msgspec.structs import asdict

from sarl_core import InputError
from sarl_core.paper.report import (
    REPORT,
    Entry,
    PaperReport,
    read_report,
    report_document,
    write_report,
)
from sarl_core.paper.studies import STUDIES, find_study
from sarl_core.paper.tables import read_table, write_table
from sarl_core.paper.verdicts import Claim
from tests.paper.frames import landscapes

ENTRY = Entry(
    place="Figure 2",
    title="Number of rules",
    quick=False,
    command="python -m sarl_core reproduce --figure 2 --out DIR",
    made="2026-01-02",
    seconds=3.5,
    settings={"seeds": {"tree": 0}, "supports": [0.0, 0.05]},
    inputs={"CartPole-v1": {"demonstrations": "ab", "expert": "cd"}},
    versions={"python": "3.11.2"},
    files={"table": "figure_2.csv", "page": "figure_2.html", "picture": "figure_2.png"},
    numbers={"CartPole-v1": {"greatest": 1508.0}},
    claims=(
        Claim("Rules – many.", "Figure 2", "1,508 rules.", "agrees", "By count.", {"n": 1508.0}),
    ),
)


def document() -> dict[str, Any]:
    return copy.deepcopy(report_document(PaperReport({"2": ENTRY})))


def write(folder: Path, content: object) -> Path:
    path = folder / REPORT
    path.write_text(json.dumps(content))
    return path


def test_a_report_comes_back_as_it_was(tmp_path: Path) -> None:
    report = PaperReport({"2": ENTRY})
    write_report(report, tmp_path)
    assert read_report(tmp_path) == report
    assert [path.name for path in tmp_path.iterdir()] == [REPORT]
    assert "Rules – many." in (tmp_path / REPORT).read_text(encoding="utf-8")


def test_where_there_is_none_there_is_none(tmp_path: Path) -> None:
    assert read_report(tmp_path) is None
    assert read_report(tmp_path / "nowhere") is None


def test_what_is_no_number_is_null(tmp_path: Path) -> None:
    claim = Claim("a", "b", "c", "partly", "d", {"nan": math.nan})
    numbers = {"none": math.inf, "many": [1.0, math.nan], "count": 3}
    entry = Entry(**{**asdict(ENTRY), "numbers": numbers, "claims": (claim,)})
    write_report(PaperReport({"2": entry}), tmp_path)
    found = read_report(tmp_path)
    assert found is not None
    assert found.studies["2"].numbers == {"none": None, "many": [1.0, None], "count": 3}
    assert found.studies["2"].claims[0].numbers == {"nan": None}


def changed(*path: str | int, value: object) -> dict[str, Any]:
    whole = document()
    at: Any = whole
    for key in path[:-1]:
        at = at[key]
    at[path[-1]] = value
    return whole


def without(*path: str | int) -> dict[str, Any]:
    whole = document()
    at: Any = whole
    for key in path[:-1]:
        at = at[key]
    del at[path[-1]]
    return whole


STUDY = ("studies", "2")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ([], "format"),
        ({}, "format"),
        ({"format": "sarl-rules", "version": 2}, "format"),
        (changed("version", value=1), "version is 1"),
        (changed("studies", value=[]), "studies"),
        (without(*STUDY, "files"), "'2'"),
        (changed(*STUDY, "more", value=1), "'2'"),
        (changed(*STUDY, value=None), "'2'"),
        (changed(*STUDY, "place", value=2), "'place'"),
        (changed(*STUDY, "quick", value="no"), "'quick'"),
        (changed(*STUDY, "seconds", value="long"), "'seconds'"),
        (changed(*STUDY, "seconds", value=True), "'seconds'"),
        (changed(*STUDY, "numbers", value=[]), "'numbers'"),
        (changed(*STUDY, "files", "table", value="../secret.csv"), "files"),
        (changed(*STUDY, "files", "table", value="/etc/passwd"), "files"),
        (changed(*STUDY, "files", "table", value=".."), "files"),
        (changed(*STUDY, "files", "page", value="a\\b"), "files"),
        (changed(*STUDY, "files", "page", value=7), "files"),
        (without(*STUDY, "files", "picture"), "files"),
        (changed(*STUDY, "claims", value={}), "claims"),
        (changed(*STUDY, "claims", 0, value="agrees"), "claims"),
        (changed(*STUDY, "claims", 0, "verdict", value="wonderful"), "claims"),
        (changed(*STUDY, "claims", 0, "ours", value=None), "claims"),
        (changed(*STUDY, "claims", 0, "by_chance", value=1.5), "claims"),
        (changed(*STUDY, "claims", 0, "by_chance", value="often"), "claims"),
        (changed(*STUDY, "claims", 0, "constructed", value=None), "claims"),
        (changed(*STUDY, "claims", 0, "numbers", value={"n": "many"}), "claims"),
        (without(*STUDY, "claims", 0, "where"), "claims"),
    ],
)
def test_what_is_no_report_is_refused_in_a_sentence(
    content: object, words: str, tmp_path: Path
) -> None:
    path = write(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_report(tmp_path)
    sentence = str(caught.value)
    assert words in sentence
    assert str(path) in sentence
    assert "choose another folder" in sentence
    assert "\n" not in sentence


@pytest.mark.parametrize("content", [b"", b"{", b"\xff\xfe\x00", b"[" * 100_000])
def test_what_is_no_json_is_refused_too(content: bytes, tmp_path: Path) -> None:
    (tmp_path / REPORT).write_bytes(content)
    with pytest.raises(InputError, match="no report of this program"):
        read_report(tmp_path)


def test_a_huge_file_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sarl_core.paper.report.MAX_BYTES", 10)
    write_report(PaperReport({"2": ENTRY}), tmp_path)
    with pytest.raises(InputError, match="more than"):
        read_report(tmp_path)


# --- tables --------------------------------------------------------------------------------------

FRAME = landscapes({"CartPole-v1": np.arange(12).reshape(3, 4) / 7})


def test_a_table_comes_back_to_the_last_bit(tmp_path: Path) -> None:
    path = tmp_path / "figure_3.csv"
    write_table(FRAME, path)
    pd.testing.assert_frame_equal(read_table(STUDIES["3"], path), FRAME, check_exact=True)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "a,b\n1,2\n",
        FRAME.drop(columns="support").to_csv(index=False),
        FRAME.iloc[:0].to_csv(index=False),
        FRAME.iloc[:-1].to_csv(index=False),
        FRAME.assign(rule_count="many").to_csv(index=False),
        '"' * 99,
    ],
)
def test_a_damaged_table_is_refused_in_a_sentence(content: str, tmp_path: Path) -> None:
    path = tmp_path / "figure_2.csv"
    path.write_text(content)
    with pytest.raises(InputError) as caught:
        read_table(STUDIES["2"], path)
    assert "figure_2.csv is not the table of Figure 2" in str(caught.value)
    assert "--figure 2" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_table_is_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"figure_2.csv cannot be read .*--figure 2"):
        read_table(STUDIES["2"], tmp_path / "figure_2.csv")


# --- names ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["4", " 4", "figure 4", "Figure_4", "Fig. 4", "fig.4"])
def test_a_figure_goes_by_its_number(name: str) -> None:
    assert find_study(name).place == "Figure 4"


@pytest.mark.parametrize("name", ["table-1", "Table 1", "table_1"])
def test_the_table_goes_by_its_name(name: str) -> None:
    assert find_study(name).place == "Table 1"


@pytest.mark.parametrize("name", ["", "8", "0", "-2", "2.5", "all", "table"])
def test_what_the_paper_does_not_have_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="choose from 2, 3, table-1, 4, 5, 6, 7, divider"):
        find_study(name)


def test_figure_1_holds_no_data() -> None:
    with pytest.raises(InputError, match="drawing of the method"):
        find_study("1")
