"""What tests of several pages share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from sarl_dashboard.state import library as state


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A library of a test's own."""
    monkeypatch.setenv("SARL_LIBRARY", str(tmp_path / "library"))
    monkeypatch.setenv("SARL_AUTHOR", "Ada")
    yield tmp_path / "library"
    for opened in state._OPENED.values():
        opened.close()
    state._OPENED.clear()
