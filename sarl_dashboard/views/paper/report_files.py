"""What was reproduced of the paper, read from files and kept by what is in them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st
from markupsafe import Markup

from sarl_core.errors import SarlError
from sarl_core.explaining.templates import render
from sarl_core.paper.report import REPORT, Entry, PaperReport, read_report
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import FULL_MINUTES, Drawing
from sarl_core.paper.tables import read_table
from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached
from sarl_dashboard.session import end_page
from sarl_dashboard.text import refuse

if TYPE_CHECKING:
    import pandas as pd

FOLDER = DATA / "paper"
COMMAND = "python -m sarl_core reproduce --out data/paper"


def stamp_of(path: Path) -> str:
    """What tells the content of a file from another's; "" where it cannot be read."""
    try:
        return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
    except OSError:
        return ""


@cached()
def _report(folder: Path, stamp: str) -> PaperReport | None:
    return read_report(folder)


def report() -> PaperReport | None:
    """The report as it is now; None where there is none.

    Raises:
        InputError: If it cannot be used.
    """
    return _report(FOLDER, stamp_of(FOLDER / REPORT))


def require_report() -> PaperReport:
    """The report; where there is none, say how to make it and stop the page."""
    try:
        reproduced = report()
    except SarlError as error:
        refuse(error)
        st.caption("This makes it again:")
        st.code(COMMAND, language="sh", wrap_lines=True)
        end_page()
    if reproduced is None or not reproduced.studies:
        st.info(
            "Nothing has been reproduced yet. This command, where the dashboard runs, makes every "
            f"figure; it takes about {FULL_MINUTES} minutes on two cores.",
            icon=":material/terminal:",
        )
        st.code(COMMAND, language="sh", wrap_lines=True)
        end_page()
    return reproduced


@cached()
def _table(name: str, path: Path, stamp: str) -> pd.DataFrame:
    return read_table(STUDIES[name], path)


def table(name: str, entry: Entry) -> pd.DataFrame:
    """The table of a study.

    Raises:
        InputError: If it is missing or damaged.
    """
    path = FOLDER / entry.files["table"]
    return _table(name, path, stamp_of(path))


@cached(show_spinner="Drawing …")
def _drawings(name: str, path: Path, stamp: str, part: str, dark: bool) -> tuple[Drawing, ...]:
    return STUDIES[name].draw(_table(name, path, stamp), part, dark)


def drawings(name: str, entry: Entry, part: str, *, dark: bool) -> tuple[Drawing, ...]:
    """The figures of a study, drawn once.

    Args:
        name: Of the study.
        entry: What the report says of it.
        part: One of its parts.
        dark: Whether the ground is dark.

    Returns:
        Shared between sessions; nobody may change them.
    """
    path = FOLDER / entry.files["table"]
    return _drawings(name, path, stamp_of(path), part, dark)


def whole_page(entry: Entry) -> str:
    """The page of a study with all it needs in it, for a download."""
    from plotly.offline import get_plotlyjs

    from sarl_core.paper.sheets import SCRIPT

    text = (FOLDER / entry.files["page"]).read_text(encoding="utf-8")
    beside = render("parts/script", source=SCRIPT, code="")
    within = render("parts/script", source=None, code=Markup(get_plotlyjs()))
    return text.replace(beside, within, 1)
