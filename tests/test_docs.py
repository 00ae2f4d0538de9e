"""The guide: its examples run as they stand there, page by page, and its pages are all there."""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

import sarl_core
from docs.scripts import compact_table, freedom, large_page
from sarl_core import load_demonstrations, mine_never_rules, mine_rules, with_combinations
from sarl_core.explaining.figures.rules.freedom import FreedomPoint, point_front
from sarl_core.mining.language import sentence

from .examples import ROOT, run

DOCS = ROOT / "docs"
PAGES = sorted(DOCS.rglob("*.md"))
FENCE = re.compile(r'^```(python|sh|c)(?: title="([\w.]+)")?\n(.*?)^```$', re.MULTILINE | re.DOTALL)


class Block(NamedTuple):
    """A block of code of a page.

    Attributes:
        language: python, sh or c.
        file: The file that it is, "" where it is to be run.
        code: What it says.
    """

    language: str
    file: str
    code: str


def blocks(page: Path) -> list[Block]:
    return [Block(*found) for found in FENCE.findall(page.read_text(encoding="utf-8"))]


WITH_EXAMPLES = [page for page in PAGES if blocks(page)]


@pytest.fixture
def folder(tmp_path):
    """A folder as that of a reader: shipped data beside, and the command on the path."""
    shutil.copytree(ROOT / "data", tmp_path / "data")
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    command = tmp_path / "bin" / "sarl"
    command.parent.mkdir()
    # As pip writes it: the folder it is called in is not where Python looks for modules.
    command.write_text(
        f"#!{sys.executable}\nimport sys\nsys.path.insert(0, {str(ROOT)!r})\n"
        "from sarl_core.__main__ import run\nrun()\n"
    )
    command.chmod(command.stat().st_mode | stat.S_IXUSR)
    return tmp_path


@pytest.mark.parametrize("page", WITH_EXAMPLES, ids=lambda page: page.stem)
def test_the_examples_of_a_page_run_in_their_order(page, folder):
    for block in blocks(page):
        if block.file:
            (folder / block.file).write_text(block.code, encoding="utf-8")
        elif block.language == "python":
            run([sys.executable, "-c", block.code], folder, library=ROOT)
        else:
            assert block.language == "sh"
            run(["bash", "-euc", block.code], folder, library=ROOT)


def test_every_guide_and_how_to_that_names_commands_has_examples_that_run():
    told = [
        page
        for page in PAGES
        if page.parent.name == "how_to"
        or page.name in ("headless.md", "explaining.md", "first_walk.md")
    ]
    assert len(told) >= 8
    assert set(told) <= set(WITH_EXAMPLES)


def test_every_public_name_stands_in_the_reference():
    reference = (DOCS / "reference" / "python.md").read_text(encoding="utf-8")
    named = set(re.findall(r"^::: sarl_core\.(?:\w+\.)*(\w+)$", reference, flags=re.MULTILINE))
    assert named == set(sarl_core.__all__)


def test_every_key_of_a_rule_file_stands_in_its_page(tmp_path):
    def keys(part: object) -> set[str]:
        if isinstance(part, dict):
            return set(part) | set().union(*map(keys, part.values()))
        return set().union(*map(keys, part)) if isinstance(part, list) else set()

    demonstrations = load_demonstrations(ROOT / "data/demonstrations/pendulum.parquet")
    mine_rules(demonstrations, supp_min=0.05, conf_min=0.7).save(tmp_path / "interval.json")
    files = [tmp_path / "interval.json", *(ROOT / "data" / "rules").glob("*_compact.json")]
    told = (DOCS / "reference" / "files.md").read_text(encoding="utf-8")
    for file in files:
        for key in keys(json.loads(file.read_text())):
            assert f"`{key}`" in told, key


@pytest.mark.parametrize(
    ("page", "confidence", "pairs"),
    [
        ("guides/explaining.md", 0.9, []),
        ("guides/two_features.md", 0.95, [("cart velocity", "pole angular velocity")]),
        ("how_to/combinations.md", 0.95, None),
    ],
)
def test_a_sentence_that_the_guide_quotes_is_one_of_the_product(page, confidence, pairs):
    (quoted,) = re.findall(r"^> (.+)$", (DOCS / page).read_text("utf-8"), flags=re.MULTILINE)
    demonstrations = load_demonstrations(ROOT / "data/demonstrations/cartpole.parquet")
    if pairs != []:
        demonstrations = with_combinations(demonstrations, pairs=pairs)
    assert quoted in mine_rules(demonstrations, supp_min=0.005, conf_min=confidence).to_text()


def test_the_never_rule_that_the_guide_quotes_is_one_of_the_product():
    quoted, *_ = re.findall(r"^> (.+)$", freedom.PAGE.read_text("utf-8"), flags=re.MULTILINE)
    demonstrations = load_demonstrations(ROOT / "data/demonstrations/lunar_lander.parquet")
    rules = mine_never_rules(demonstrations, epsilon=0.05, supp_min=0.005)
    assert quoted in [sentence(rule, rules) for rule in rules]


def test_the_table_of_the_compact_sets_is_that_of_what_was_measured():
    page = compact_table.PAGE.read_text(encoding="utf-8")
    assert compact_table.with_rules(page) == page
    readme = compact_table.README.read_text(encoding="utf-8")
    assert compact_table.with_table(readme) == readme


def test_the_tables_of_large_data_are_those_of_what_was_measured():
    page = large_page.PAGE.read_text(encoding="utf-8")
    assert large_page.with_tables(page, json.loads(large_page.JSON.read_text())) == page


def test_the_table_of_freedom_is_that_of_what_was_measured():
    page = freedom.PAGE.read_text(encoding="utf-8")
    assert freedom.with_table(page, json.loads(freedom.JSON.read_text())) == page


def test_on_the_front_of_freedom_is_what_no_other_beats():
    def point(failures, free):
        return FreedomPoint("never", 1, "", free, failures, 10, 0.0, 1.0)

    best = [point(1, 0.0), point(5, 0.6), point(9, 1.0)]
    beaten = [point(2, 0.0), point(5, 0.5), point(6, 0.6), point(9, 0.9)]
    assert point_front([*beaten, *best[::-1]]) == best


def test_the_guide_is_built_and_every_link_leads_somewhere(tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)],
        cwd=ROOT,
        env={**os.environ, "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    commands = (tmp_path / "reference" / "commands.html").read_text(encoding="utf-8")
    assert "--lower-bound" in commands
    assert 'id="train-expert"' in commands
    assert "one of refuse, drop; default: refuse" in commands
    assert "--stop-with-input" not in commands  # for the dashboard alone
    reference = (tmp_path / "reference" / "python.html").read_text(encoding="utf-8")
    assert "supp_min" in reference


def test_pictures_that_are_shipped_are_shown():
    told = "\n".join(page.read_text(encoding="utf-8") for page in [*PAGES, ROOT / "README.md"])
    for picture in (DOCS / "pictures").iterdir():
        assert picture.name in told, picture.name
