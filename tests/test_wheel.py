"""The wheel: everything that the product needs is in it, and works from another folder."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the wheel was unpacked, as pip does it."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)],
        cwd=ROOT,
        check=True,
        capture_output=True,
    )
    (wheel,) = folder.glob("*.whl")
    site = folder / "site-packages"
    with zipfile.ZipFile(wheel) as file:
        file.extractall(site)
    return site


def run(site: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, *arguments],
        cwd=site.parent,
        env=os.environ | {"PYTHONPATH": str(site)},
        capture_output=True,
        text=True,
        check=False,
    )


def test_what_the_product_needs_is_in_it(installed: Path) -> None:
    names = {path.relative_to(installed).as_posix() for path in installed.rglob("*")}
    for folder in ("sarl_core", "sarl_dashboard", "data", "pages"):
        within = {"data": "sarl_core/", "pages": "sarl_dashboard/"}.get(folder, "")
        here = {
            f"{within}{path.relative_to(ROOT).as_posix()}"
            for path in (ROOT / folder).rglob("*")
            if "__pycache__" not in path.parts and path.name != "plotly.min.js"  # made when needed
        }
        assert len(here) > 15
        assert here <= names
    assert {"sarl_dashboard/app.py", "sarl_dashboard/.streamlit/config.toml"} <= names
    (entries,) = installed.glob("*.dist-info/entry_points.txt")
    assert "sarl = sarl_core.__main__:run" in entries.read_text()


def test_shipped_data_are_found_from_another_folder(installed: Path) -> None:
    code = (
        "import sarl_core, sarl_core.shipped as shipped\n"
        "from sarl_core.agents.agent import shipped_experts\n"
        "print(sarl_core.__file__, shipped.DATA, len(shipped_experts()), sep='\\n')"
    )
    done = run(installed, "-c", code)
    module, data, experts = done.stdout.splitlines()
    assert Path(module).is_relative_to(installed)
    assert Path(data) == installed / "sarl_core" / "data"
    assert int(experts) == 5
    played = run(
        installed, "-m", "sarl_core", "evaluate", "--env", "CartPole-v1", "--agent", "expert"
    )
    assert played.returncode == 0, played.stderr


@pytest.mark.parametrize(
    ("module", "extra", "arguments"),
    [
        ("streamlit", "dashboard", ("app",)),
        ("torch", "learning", ("evaluate", "--env", "CartPole-v1", "--agent", "untrained")),
    ],
)
def test_what_is_not_installed_is_told_with_what_to_do(
    installed: Path, module: str, extra: str, arguments: tuple[str, ...]
) -> None:
    code = (
        "import sys, importlib.util as util\n"
        "from sarl_core.cli.app import main\n"
        "class Missing:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {module!r}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Missing())\n"
        f"sys.exit(main({list(arguments)!r}))"
    )
    done = run(installed, "-c", code)
    assert done.returncode == 1
    assert done.stderr.strip() == (
        f"error: this needs {module}, which is not installed; "
        f"run pip install 'sarl-explorer[{extra}]'"
    )
