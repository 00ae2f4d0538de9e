"""What a server is made of says nothing that is not so."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

from benchmarks.deployment.container import build_context, steps
from benchmarks.deployment.machines import variables
from sarl_core.serving.limits import ServerLimits
from sarl_core.serving.settings import read_settings

ROOT = Path(__file__).resolve().parents[2]
DEPLOYMENT = ROOT / "examples" / "deployment"


def test_the_shipped_settings_are_the_usual_ones_and_those_of_the_guide(tmp_path: Path) -> None:
    shipped = read_settings(DEPLOYMENT / "server.toml").limits
    assert shipped == ServerLimits(memory_gib=6)
    guide = (ROOT / "docs" / "guides" / "server.md").read_text(encoding="utf-8")
    (tmp_path / "guide.toml").write_text(re.findall(r"```toml\n(.*?)```", guide, re.DOTALL)[0])
    assert read_settings(tmp_path / "guide.toml").limits == shipped


def test_the_proxy_takes_what_the_server_takes() -> None:
    proxy = (DEPLOYMENT / "nginx.conf").read_text()
    largest = int(re.findall(r"client_max_body_size (\d+)m", proxy)[0])
    assert read_settings(DEPLOYMENT / "server.toml").limits.upload_mb < largest


def test_the_container_is_built_from_what_there_is() -> None:
    lines = (DEPLOYMENT / "Containerfile").read_text().splitlines()
    copied = [line.split()[1:-1] for line in lines if re.match(r"COPY (?!--)", line)]
    names = [name for sources in copied for name in sources]
    assert len(names) > 8
    assert [name for name in names if not (ROOT / name).exists()] == []
    left_in = (DEPLOYMENT / "Containerfile.dockerignore").read_text()
    assert [name for name in names if f"!{name}\n" not in left_in] == []


def test_what_is_put_aside_lies_on_disk_and_not_in_memory() -> None:
    container = (DEPLOYMENT / "Containerfile").read_text()
    folder = re.findall(r"\bTMPDIR=(\S+)", container)[0]
    assert folder in re.findall(r"^VOLUME (.*)$", container, re.MULTILINE)[0].split()
    assert f'"find {folder} -mindepth 1 -delete; exec sarl app"' in container
    compose = (DEPLOYMENT / "compose.yaml").read_text()
    assert re.search(rf"^      - {folder}(\s|$)", compose, re.MULTILINE)
    in_memory = re.findall(r"^    tmpfs: (/[^:\s]+)", compose, re.MULTILINE)
    assert in_memory
    assert folder not in in_memory


def test_the_secrets_to_fill_in_are_all_that_signing_in_needs() -> None:
    secrets = tomllib.loads((DEPLOYMENT / "secrets.example.toml").read_text())
    assert set(secrets["auth"]) == {
        *("redirect_uri", "cookie_secret", "client_id", "client_secret", "server_metadata_url"),
    }


def test_what_tries_the_example_reads_every_step_of_it(tmp_path: Path) -> None:
    known = {"DATABASE_PASSWORD": "secret"}
    compose = variables((DEPLOYMENT / "compose.yaml").read_text(), known)
    assert "postgresql://sarl:secret@database/sarl" in compose
    words = [word for word, _ in steps((DEPLOYMENT / "Containerfile").read_text())]
    assert words.count("FROM") == 2
    assert words[-1] == "CMD"
    (tmp_path / "Containerfile").write_text("# Which\nRUN one \\\n && two\n\nUSER sarl\n")
    assert steps((tmp_path / "Containerfile").read_text()) == [
        ("RUN", "one   && two"),
        ("USER", "sarl"),
    ]


def test_what_may_be_copied_is_what_the_list_lets_in(tmp_path: Path) -> None:
    build_context(ROOT, DEPLOYMENT / "Containerfile.dockerignore", tmp_path / "context")
    top = {path.name for path in (tmp_path / "context").iterdir()}
    assert {"app.py", "sarl_core", "pages", ".streamlit"} <= top
    assert not {"tests", "docs", "CHANGELOG.md", ".git"} & top
