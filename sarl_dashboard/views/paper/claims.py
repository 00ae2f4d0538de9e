"""The paper's claims beside our numbers, and the verdict on each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

import streamlit as st

from sarl_core.explaining.templates import render
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
    rows = [(one, _DOTS[one.verdict], how_decided(one)) for one in claims]
    st.html(render("parts/claims", rows=rows, beside=beside))
