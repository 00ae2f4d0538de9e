"""What importing loads, in a fresh interpreter."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

import sarl_core
import sarl_core.library

ROOT = Path(__file__).resolve().parents[1]
LEARNERS = {"torch", "stable_baselines3"}
HEAVY = LEARNERS | {
    "numpy",
    "scipy",
    "sklearn",
    "pandas",
    "pyarrow",
    "gymnasium",
    "plotly",
    "imageio",
    "PIL",
    "streamlit",
}


def loaded_after(code: str) -> set[str]:
    """The top-level modules that some code loads."""
    done = subprocess.run(
        [
            sys.executable,
            "-c",
            f"{code}\nimport json, sys\nprint(json.dumps(list(sys.modules)), file=sys.stderr)",
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    modules = json.loads(done.stderr.splitlines()[-1])
    assert any(name.startswith("sarl_core") for name in modules)
    return {name.split(".")[0] for name in modules}


def test_importing_the_package_loads_nothing_heavy():
    assert not loaded_after("import sarl_core") & (HEAVY | {"typer", "rich"})


def test_help_loads_nothing_heavy():
    assert (
        not loaded_after("from sarl_core.cli.app import main\nassert main(['--help']) == 0") & HEAVY
    )


@pytest.mark.parametrize(
    "call",
    [
        "main(['check', 'data/demonstrations/cartpole.parquet'])",
        "main(['evaluate', '--env', 'CartPole-v1', '--agent', 'expert', '--episodes', '1'])",
    ],
)
def test_work_without_a_learner_loads_none(call):
    assert not loaded_after(f"from sarl_core.cli.app import main\nassert {call} == 0") & LEARNERS


def test_mining_and_shielding_load_no_learner():
    names = "grow_policy_trees, mine_rules, load_demonstrations, Shield, ShieldedEnv, rollout"
    assert not loaded_after(f"from sarl_core import {names}") & LEARNERS


@pytest.mark.parametrize("package", [sarl_core, sarl_core.library])
def test_every_public_name_is_there(package):
    for name in package.__all__:
        assert getattr(package, name).__name__ == name
    assert package.__all__
    assert set(package.__all__) <= set(dir(package))


def test_an_unknown_name_is_told():
    with pytest.raises(AttributeError, match="nonsense"):
        _ = sarl_core.nonsense


def test_a_page_run_leaves_the_import_path_alone():
    # An import in another thread passes over a folder when one before it is taken away meanwhile.
    code = """
import app, sys
from streamlit.runtime.scriptrunner.exec_code import modified_sys_path
before = list(sys.path)
with modified_sys_path("pages/_router.py"):
    assert sys.path == before
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_a_first_look_loads_no_database(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path))
    looking = "from tests.app.screens import open_page\nopen_page('thresholds')"
    assert not loaded_after(looking) & {"sqlalchemy", "alembic"}
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("missing", ["", "sys.modules['sklearn'] = None"])
def test_garbage_is_looked_for_once_the_dashboard_has_begun(missing: str) -> None:
    code = f"""
import gc, sys, threading
{missing}
import app
for thread in threading.enumerate():
    if thread is not threading.main_thread() and thread.daemon:
        thread.join(60)
assert gc.isenabled()
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.mark.parametrize(("begin", "looks"), [("import streamlit", 1), ("import app", 0)])
def test_a_start_looks_neither_at_other_packages_nor_at_all_modules(begin: str, looks: int) -> None:
    code = f"""
{begin}
import importlib.metadata
from streamlit.components.v2.component_manager import BidiComponentManager
looks = []
importlib.metadata.distributions = lambda **_: looks.append(1) or []
BidiComponentManager().discover_and_register_components()
import inspect
inspect.stack = lambda: looks.append(2) or [(None, "page.py")]
import streamlit as st
st.empty()
assert len(looks) == 2 * {looks}, looks
"""
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


@pytest.mark.parametrize("package", sorted(LEARNERS))
def test_a_learner_that_is_not_installed_is_told_with_what_to_do(package: str) -> None:
    calls = [
        "from sarl_core import ShieldedVecEnv",
        "import sarl_core; sarl_core.ShieldedVecEnv",
        "from sarl_core import make_agent; make_agent('untrained', 'CartPole-v1')",
        "from sarl_core import rollout; rollout('CartPole-v1', 'untrained', episodes=1)",
    ]
    code = (
        "import sys\n"
        "class Missing:\n"
        "    def find_spec(self, name, path=None, target=None):\n"
        f"        if name == {package!r}:\n"
        "            raise ModuleNotFoundError(f'No module named {name!r}', name=name)\n"
        "sys.meta_path.insert(0, Missing())\n"
        "from sarl_core import WorkError\n"
        f"for call in {calls!r}:\n"
        "    try:\n"
        "        exec(call)\n"
        "    except WorkError as error:\n"
        "        print(error)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == len(calls) * [
        f"this needs {package}, which is not installed; run pip install 'sarl-explorer[learning]'"
    ]
