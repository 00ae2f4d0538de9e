"""What the server makes of the secrets that say who vouches for visitors."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from threading import Event

import pytest
from streamlit import config

from sarl_core import InputError
from sarl_dashboard import providers, session
from sarl_dashboard.components.journey import sign_in

ROOT = Path(__file__).resolve().parents[2]
SECRET = "0123456789abcdef" * 4
PROVIDER = f'[auth]\nclient_id = "dashboard"\ncookie_secret = "{SECRET}"\n'


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Where the secrets are looked for: a file, and whatever a test names beside it."""
    before = config.get_option("secrets.files")
    monkeypatch.setattr(providers, "_named", Event())
    look(tmp_path / "nowhere.toml", tmp_path / "secrets.toml")
    yield tmp_path
    config.set_option("secrets.files", before)
    providers.st.secrets._reset()


def look(*places: Path) -> None:
    config.set_option("secrets.files", [str(place) for place in places])
    providers.st.secrets._reset()


def test_who_is_named_vouches_for_visitors_from_then_on(folder: Path) -> None:
    providers.check()
    assert not providers.are_named()
    secrets = folder / "secrets.toml"
    secrets.write_text('password = "of something else"\n')
    providers.check()
    assert not providers.are_named()
    for text, count in ((PROVIDER, 2), ("", 0), ("[auth", 0)):
        secrets.write_text(text)
        providers.st.secrets._reset()
        assert len(providers.section()) == count
        assert providers.are_named()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"[auth", r"the secrets cannot be read \(.*secrets\.toml: Expected.*\); let whoever"),
        (b"\xff", r"the secrets cannot be read \(.*utf-8.*\); let whoever"),
        (b"[auth]\n", "'auth' in the secrets names nobody; the guide"),
        (b"auth = 3\n", "'auth' in the secrets names nobody"),
        (b"[[auth]]\nclient_id = 'x'\n", "'auth' in the secrets names nobody"),
        (b"[auth]\nclient_id = 'x'\n", "'cookie_secret' in the secrets is none, and who knows"),
        (b"[auth]\ncookie_secret = ''\n", "'cookie_secret' in the secrets is none"),
        (
            b"[auth]\ncookie_secret = 'what this prints: openssl rand -hex 32'\n",
            "'cookie_secret' in the secrets is none",
        ),
    ],
)
def test_secrets_that_do_not_do_are_refused_at_the_start(
    folder: Path, content: bytes, sentence: str
) -> None:
    (folder / "secrets.toml").write_bytes(content)
    with pytest.raises(InputError, match=sentence):
        providers.check()


def test_places_that_cannot_be_read_are_refused_at_the_start(folder: Path) -> None:
    good = folder / "secrets.toml"
    good.write_text(PROVIDER)
    providers.check()
    other = folder / "other.toml"
    other.mkdir()  # as engines make where the file to be mounted is not there
    plain = folder / "sarl"
    plain.write_text(PROVIDER)
    for place in (other, plain, folder / "not there"):
        look(good, place)
        with pytest.raises(InputError, match="the secrets cannot be read"):
            providers.check()


def test_a_folder_of_secrets_names_somebody_or_is_refused(folder: Path) -> None:
    place = folder / "kubernetes"
    provider = place / "auth"
    provider.mkdir(parents=True)
    look(place)
    with pytest.raises(InputError, match="the secrets cannot be read"):
        providers.check()
    (provider / "client_id").write_text("dashboard")
    look(place)
    with pytest.raises(InputError, match="names nobody"):  # a single file is no table
        providers.check()
    (provider / "cookie_secret").write_text(SECRET)
    look(place)
    providers.check()
    assert providers.are_named()


@pytest.mark.parametrize("content", [b"[auth", b"\xff", b"auth = 3\n", b"", None])
def test_nobody_comes_in_when_they_break_while_the_server_runs(
    folder: Path, content: bytes | None
) -> None:
    secrets = folder / "secrets.toml"
    secrets.write_text(PROVIDER)
    providers.check()  # and nobody has come yet when it breaks
    if content is None:
        secrets.unlink()
        secrets.mkdir()
    else:
        secrets.write_bytes(content)
    providers.st.secrets._reset()
    assert session.needs_sign_in()
    assert not session.is_signed_in()
    assert not sign_in.is_admitted()
    assert sign_in._providers() == [""]


def test_the_dashboard_does_not_start_with_secrets_that_do_not_do(tmp_path: Path) -> None:
    secrets = tmp_path / ".streamlit" / "secrets.toml"
    secrets.parent.mkdir()
    secrets.write_text("[auth]\n")
    done = subprocess.run(
        [sys.executable, "-m", "streamlit", "run", "app.py", "--server.port", "0"],
        cwd=ROOT,
        env=os.environ | {"HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 1
    assert "error: 'auth' in the secrets names nobody" in done.stderr
    assert "Traceback" not in done.stdout + done.stderr
