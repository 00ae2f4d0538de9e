"""The paper's claims beside our numbers, and the verdict on each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from html import escape

import streamlit as st

from sarl_core.mining.language import counted
from sarl_core.paper.chance import chance_text, how_decided
from sarl_core.paper.report import Entry
from sarl_core.paper.verdicts import VERDICTS, Claim, Verdict

ALL = "all"
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


def show_all_claims(entries: Iterable[Entry]) -> None:
    """Every claim of the paper, with a count of the verdicts.

    Args:
        entries: What the report says of each study.
    """
    claims_of = {f"{entry.place}. {entry.title}": entry.claims for entry in entries}
    claims = [claim for own in claims_of.values() for claim in own]
    counts = Counter(claim.verdict for claim in claims)
    st.markdown(
        f"Of {counted(len(claims), 'claim')} of the paper, our numbers agree with "
        f"**{counts['agrees']}**, agree partly with **{counts['partly']}**, and do not agree with "
        f"**{counts['does not agree']}**; **{counts['cannot be judged']}** cannot be judged."
    )
    if by_chance := chance_text(claims):
        st.markdown(by_chance)
    verdict = st.segmented_control(
        "Verdict",
        [ALL, *VERDICTS],
        default=ALL,
        key="verdict",
        bind="query-params",
        required=True,
        format_func=str.capitalize,
        label_visibility="collapsed",
    )
    if not any(verdict in (ALL, claim.verdict) for claim in claims):
        st.caption("There is no such claim.")
    for heading, own in claims_of.items():
        chosen = tuple(claim for claim in own if verdict in (ALL, claim.verdict))
        if chosen:
            st.markdown(f"**{heading}**")
            show_claims(chosen, beside=False)
    st.caption(
        "Each verdict is decided by a rule, from the numbers alone: over several recordings of "
        "several experts, since one recording is one draw. Who has the demonstrations of another "
        "expert may see how far that carries."
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
