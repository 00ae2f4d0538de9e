"""What comes with the product: experts, demonstrations, rule sets, studies."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent

DATA = _PACKAGE / "data"
"""The folder of it all. Installed, it is part of the package; in a checkout it stands beside."""
if not DATA.is_dir():
    DATA = _PACKAGE.parent / "data"
