"""What the server makes of the secrets that say who vouches for visitors."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from streamlit import config

from sarl_core import InputError
from sarl_dashboard import providers, session
from sarl_dashboard.components.journey import sign_in

PROVIDER = '[auth]\nclient_id = "dashboard"\n'


@pytest.fixture
def secrets(tmp_path: Path) -> Iterator[Path]:
    before = config.get_option("secrets.files")
    path = tmp_path / "secrets.toml"
    config.set_option("secrets.files", [str(tmp_path / "nowhere.toml"), str(path)])
    forget()
    yield path
    config.set_option("secrets.files", before)
    forget()


def forget() -> None:
    providers.are_named.cache_clear()
    providers.st.secrets._reset()


def test_who_is_named_vouches_for_visitors(secrets: Path) -> None:
    assert not providers.are_named()
    secrets.write_text(PROVIDER)
    assert not providers.are_named()  # it is the start that decides
    forget()
    assert providers.are_named()
    forget()
    secrets.write_text('password = "of something else"\n')
    assert not providers.are_named()


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[auth", r"secrets\.toml cannot be read \(Expected .*\); let whoever runs"),
        ("[auth]\n", r"'auth' in the secrets .*secrets\.toml names nobody; the guide"),
        ("auth = 3\n", r"'auth' in the secrets .* names nobody"),
    ],
)
def test_secrets_that_name_nobody_are_refused_at_the_start(
    secrets: Path, text: str, sentence: str
) -> None:
    secrets.write_text(text)
    with pytest.raises(InputError, match=sentence):
        providers.are_named()


def test_a_folder_in_their_place_is_refused(secrets: Path) -> None:
    secrets.mkdir()  # as engines make where the file to be mounted is not there
    with pytest.raises(InputError, match=r"cannot be read \(Is a directory\)"):
        providers.are_named()


def test_nobody_comes_in_when_they_break_while_the_server_runs(
    secrets: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    secrets.write_text(PROVIDER)
    assert providers.are_named()
    secrets.write_text("[auth")
    providers.st.secrets._reset()
    monkeypatch.setattr(session.st, "user", SimpleNamespace())  # as it then is
    assert session.needs_sign_in()
    assert not session.is_signed_in()
    assert not sign_in.is_admitted()
    assert sign_in._providers() == [""]
