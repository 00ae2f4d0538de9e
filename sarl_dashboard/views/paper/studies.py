"""What was reproduced of the paper, read from files and kept by what is in them."""

from __future__ import annotations

import hashlib
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import streamlit as st

from sarl_core.paper.chance import how_decided
from sarl_core.paper.report import REPORT, Entry, Report, read_report
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import Drawing
from sarl_core.paper.tables import read_table
from sarl_core.paper.verdicts import Claim, Verdict
from sarl_core.shipped import DATA
from sarl_dashboard.cache import cached

if TYPE_CHECKING:
    import pandas as pd


FOLDER = DATA / "paper"
COMMAND = "python -m sarl_core reproduce --out data/paper"

# A dot and a word: who cannot tell the colours reads the word.
_DOTS: dict[Verdict, str] = {
    "agrees": "#009E73",
    "partly": "#E69F00",
    "does not agree": "#D55E00",
    "cannot be judged": "#8a949c",
}
_STYLE = """<style>
.claims { font-size: 0.95rem; }
.claims .claim { display: grid; grid-template-columns: 9em minmax(0, 5fr) minmax(0, 6fr);
  gap: 0.3em 1.6em; padding: 0.75em 0; border-top: 1px solid rgba(128, 128, 128, 0.3); }
.claims.beside .claim { grid-template-columns: minmax(0, 1fr); }
.claims.beside .claim:first-child { border-top: none; padding-top: 0.2em; }
.claims .who { opacity: 0.72; font-size: 0.85em; }
.claims .verdict { font-weight: 600; white-space: nowrap; }
.claims .dot { display: inline-block; width: 0.65em; height: 0.65em; border-radius: 50%;
  margin-right: 0.5em; }
.claims details { opacity: 0.72; font-size: 0.85em; margin-top: 0.2em; }
.claims summary { cursor: pointer; width: fit-content; }
@media (max-width: 900px) { .claims .claim { grid-template-columns: minmax(0, 1fr); } }
</style>"""


def stamp(path: Path) -> str:
    """What tells the content of a file from another's; "" where it cannot be read."""
    try:
        return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()
    except OSError:
        return ""


@cached()
def _report(folder: Path, digest: str) -> Report | None:
    return read_report(folder)


def report() -> Report | None:
    """The report as it is now; None where there is none.

    Raises:
        InputError: If it cannot be used.
    """
    return _report(FOLDER, stamp(FOLDER / REPORT))


@cached()
def _table(name: str, path: Path, digest: str) -> pd.DataFrame:
    return read_table(STUDIES[name], path)


def table(name: str, entry: Entry) -> pd.DataFrame:
    """The table of a study.

    Raises:
        InputError: If it is missing or damaged.
    """
    path = FOLDER / entry.files["table"]
    return _table(name, path, stamp(path))


@cached(show_spinner="Drawing …")
def _drawings(
    name: str, digest: str, part: str, dark: bool, _frame: pd.DataFrame
) -> tuple[Drawing, ...]:
    return STUDIES[name].draw(_frame, part, dark)


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
    frame = table(name, entry)
    return _drawings(name, stamp(FOLDER / entry.files["table"]), part, dark, frame)


def whole_page(entry: Entry) -> str:
    """The page of a study with all it needs in it, for a download."""
    from plotly.offline import get_plotlyjs

    from sarl_core.paper.sheets import SCRIPT

    text = (FOLDER / entry.files["page"]).read_text(encoding="utf-8")
    return text.replace(
        f'<script src="{SCRIPT}"></script>', f"<script>{get_plotlyjs()}</script>", 1
    )


def show_claims(claims: tuple[Claim, ...], *, beside: bool) -> None:
    """Claims with our numbers.

    Args:
        claims: To show.
        beside: Whether they stand beside a figure, in a narrow column.
    """
    rows = [
        '<div class="claim">'
        f'<div class="verdict"><span class="dot" style="background:{_DOTS[one.verdict]}"></span>'
        f"{escape(one.verdict.capitalize())}</div>"
        f'<div><div class="who">The paper, {escape(one.where)}</div>{escape(one.paper)}</div>'
        f'<div><div class="who">Here</div>{escape(one.ours)}'
        f"<details><summary>How this is decided</summary>{escape(how_decided(one))}</details></div>"
        "</div>"
        for one in claims
    ]
    kind = "claims beside" if beside else "claims"
    st.html(f'{_STYLE}<div class="{kind}">{"".join(rows)}</div>')
