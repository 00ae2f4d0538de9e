"""What holds for the files of the project, whatever is in them."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import tomllib
from collections import Counter
from importlib import metadata
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("sarl_core", "sarl_dashboard")
PRODUCT = (*PACKAGES, "pages")
FOLDERS = (*PRODUCT, "tests", "benchmarks", "docs", "examples")
OURS = {*FOLDERS, "app"}
# Used by name and not by import.
TOOLS = {
    "hatchling",
    "import-linter",
    "mkdocs",
    "mkdocs-material",
    "mkdocstrings",
    "mkdocstrings-python",
    "mypy",
    "pandas-stubs",
    "pre-commit",
    "pytest-xdist",
    "ruff",
}
# The product imports it inside one function, and says what to do where it is missing.
OPTIONAL = {"onnx"}


def python_files() -> list[Path]:
    found = [ROOT / "app.py"]
    for folder in FOLDERS:
        found += sorted((ROOT / folder).rglob("*.py"))
    return found


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(name: str) -> dict[str, str]:
    """Package and version of each line that is more than a comment."""
    found = {}
    for line in (ROOT / name).read_text().splitlines():
        line = line.split("#")[0].strip()
        line = re.sub(r"; platform_machine in [\"'][\w ]+[\"']$", "", line)
        if line and not line.startswith("-r "):
            match = re.fullmatch(r"([A-Za-z0-9_.-]+)(?:\[[a-z0-9,]+\])?==([0-9][0-9a-z.]*)", line)
            assert match, f"{line!r} in {name} is no exact pin"
            found[normal(match[1])] = match[2]
    return found


def imported(files: list[Path]) -> set[str]:
    """Top-level names that files import from elsewhere."""
    names = set()
    for path in files:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                names |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.split(".")[0])
    return names - OURS - set(sys.stdlib_module_names)


def packages_of(modules: set[str]) -> set[str]:
    """The packages that bring modules."""
    homes = metadata.packages_distributions()
    return {normal(home) for module in modules for home in homes.get(module, [])[:1]}


def test_every_pin_is_what_the_tests_ran_with():
    for package, version in (pins("requirements.txt") | pins("requirements-dev.txt")).items():
        assert metadata.version(package).split("+")[0] == version, package


def test_what_the_product_imports_is_pinned_and_what_is_pinned_is_used():
    files = [
        path for path in python_files() if path.relative_to(ROOT).parts[0] in (*PRODUCT, "app.py")
    ]
    by_name = {"kaleido", "imageio-ffmpeg", "highway-env", "psycopg", "authlib", "httpx"}
    assert packages_of(imported(files)) - OPTIONAL | by_name == set(pins("requirements.txt"))


def test_what_tests_and_benchmarks_import_is_pinned():
    known = set(pins("requirements.txt")) | set(pins("requirements-dev.txt"))
    brought = packages_of(imported(python_files()))
    assert brought <= known
    assert set(pins("requirements-dev.txt")) <= brought | TOOLS


def test_the_lower_ends_that_are_tested_are_those_of_the_ranges():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    del extras["dashboard"]  # there is one Streamlit
    ranges = [*project["dependencies"], *(line for extra in extras.values() for line in extra)]
    lowest = pins("requirements-lowest.txt")
    for line in ranges:
        name, least = re.match(r"([\w-]+)(?:\[\w+\])?>=([\d.]+)", line).groups()
        tested = lowest[normal(name)]
        assert tested.startswith(least), line
        assert set(tested[len(least) :]) <= {".", "0"}, line


@pytest.mark.parametrize(
    "name",
    [
        "requirements.txt",
        "requirements-lowest.txt",
        "requirements-dev.txt",
        "pyproject.toml",
        "Makefile",
        ".ci/run",
    ],
)
def test_no_registry_and_no_path_of_one_machine(name):
    text = (ROOT / name).read_text()
    assert "://" not in text.replace("http://localhost", "")
    assert "--index" not in text
    assert "--find-links" not in text
    assert not re.search(r"(?<![\w.])/(home|root|work|Users|tmp|opt)\b", text)


def test_no_python_file_has_grown_into_two_ideas():
    lengths = {
        path.relative_to(ROOT).as_posix(): len(path.read_text().splitlines())
        for path in python_files()
    }
    assert len(lengths) > 50
    assert {name: length for name, length in lengths.items() if length > 600} == {}


def test_imports_go_one_way():
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [linter, "--no-cache"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize(
    ("crossing", "name"),
    [
        ("sarl_core.errors", "streamlit"),
        ("sarl_core.__main__", "sarl_dashboard.text"),
        ("sarl_core.demonstrations.checks", "sarl_core.demonstrations.dataset"),
        ("sarl_core.mining.rules", "sarl_core.mining.editing.edits"),
        ("sarl_core.explaining.words.fork", "sarl_core.explaining.figures.gaps"),
        ("sarl_dashboard.state.url", "pages.evidence"),
        ("sarl_dashboard.views.edit.table", "sarl_dashboard.views.replay.steps"),
        ("pages.edit", "pages.replay"),
    ],
)
def test_the_contracts_would_notice_who_crosses_a_line(tmp_path, crossing, name):
    """The lines are drawn where the design draws them: a copy that crosses one is refused."""
    copy_of_the_product(tmp_path)
    with tmp_path.joinpath(*crossing.split(".")).with_suffix(".py").open("a") as file:
        file.write(f"\nimport {name}\n")
    assert f"{crossing} -> {name}" in refused(tmp_path)


@pytest.mark.parametrize("package", ["sarl_core", "sarl_core/mining", "sarl_dashboard"])
def test_the_contracts_would_notice_a_folder_without_a_place(tmp_path, package):
    copy_of_the_product(tmp_path)
    folder = tmp_path / package / "elsewhere"
    folder.mkdir()
    (folder / "__init__.py").touch()
    assert f"{package.replace('/', '.')}.elsewhere" in refused(tmp_path)


def copy_of_the_product(folder):
    (folder / "pyproject.toml").write_text((ROOT / "pyproject.toml").read_text())
    for path in [path for name in (*PACKAGES, "pages") for path in (ROOT / name).rglob("*.py")]:
        copy = folder / path.relative_to(ROOT)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(path.read_text())


def refused(folder):
    """What the linter says against a copy."""
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [linter, "--no-cache"], cwd=folder, capture_output=True, text=True, check=False
    )
    assert done.returncode != 0
    return done.stdout


def test_no_folder_holds_more_files_than_one_finds_something_in():
    files = [
        path.relative_to(ROOT)
        for folder in (*PRODUCT, "data", "examples")
        for path in (ROOT / folder).rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    ]
    # A figure as a table, a page and a picture is one thing to find.
    things = {(path.parent, path.name.split(".")[0] or path.name) for path in files}
    counts = Counter(folder.as_posix() for folder, _ in things)
    assert len(counts) > 40
    assert {name: count for name, count in counts.items() if count > 20} == {}


def test_one_loop_steps_environments():
    """The player's; what a wrapper passes on is no loop."""
    stepping = {
        path.relative_to(ROOT).as_posix()
        for path in python_files()
        if path.relative_to(ROOT).parts[0] in PRODUCT
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call)
        if re.fullmatch(r"(.+\.)?env\.step", ast.unparse(node.func))
    }
    assert stepping == {"sarl_core/rollouts/player.py", "sarl_core/shielding/wrappers.py"}


PAGES = [path for path in sorted((ROOT / "pages").rglob("*.py")) if path.name != "_router.py"]


@pytest.mark.parametrize("page", PAGES, ids=lambda path: path.stem)
def test_a_page_is_the_order_of_its_screen_and_nothing_else(page):
    text = page.read_text(encoding="utf-8")
    defined = [
        node.lineno
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    ]
    assert defined == []
    assert len(text.splitlines()) <= 150


def test_a_class_name_is_one_thing():
    homes = Counter(
        node.name
        for path in python_files()
        if path.relative_to(ROOT).parts[0] in PRODUCT
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert {name for name, count in homes.items() if count > 1} == set()


# Each of them can stand for anything: a rule, a row, a path, a sentence.
EMPTY_WORDS = {"found", "asked", "told", "kept", "shown"}


def defined_names(tree: ast.Module) -> set[str]:
    """Names of what a file defines: variables, attributes, parameters, functions, classes."""
    names = set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name) | ast.AsyncFunctionDef(name) | ast.ClassDef(name):
                names.add(name)
            case ast.Name(name, ast.Store()) | ast.Attribute(_, name, ast.Store()) | ast.arg(name):
                names.add(name)
            case ast.alias(_, str(name)) | ast.MatchAs(_, str(name)) | ast.MatchStar(str(name)):
                names.add(name)
            case ast.ExceptHandler(_, str(name)):
                names.add(name)
    return names


def words_of(name: str) -> set[str]:
    return set(re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower().split("_"))


def test_a_name_says_what_it_is():
    empty = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in python_files()
        if path.relative_to(ROOT).parts[0] in PRODUCT
        for name in defined_names(ast.parse(path.read_text(encoding="utf-8")))
        if words_of(name) & EMPTY_WORDS
    }
    assert empty == set()
