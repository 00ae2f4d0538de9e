"""Paper: its figures and claims, made again here, each beside what the paper says."""

from __future__ import annotations

from collections import Counter

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.mining.language import counted
from sarl_core.paper.chance import chance_text
from sarl_core.paper.report import REPORT, Entry, Report
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import FULL_MINUTES, replication
from sarl_core.paper.verdicts import VERDICTS
from sarl_dashboard.session import is_dark
from sarl_dashboard.text import in_full
from sarl_dashboard.views.paper import studies

CLAIMS = "Claims"
ALL = "all"
PLAIN = {"displayModeBar": False}


def load() -> Report:
    """The report; where there is none, say how to make it and stop the page."""
    try:
        found = studies.report()
    except SarlError as error:
        st.error(in_full(str(error)), icon=":material/error:")
        st.caption("This makes it again:")
        st.code(studies.COMMAND, language="sh")
        st.stop()
    if found is None or not found.studies:
        st.info(
            "Nothing has been reproduced yet. This command, where the dashboard runs, makes every "
            f"figure; it takes about {FULL_MINUTES} minutes on two cores.",
            icon=":material/terminal:",
        )
        st.code(studies.COMMAND, language="sh")
        st.stop()
    return found


def show_all_claims(found: Report) -> None:
    """Every claim of the paper, with a count of the verdicts."""
    claims = [claim for entry in found.studies.values() for claim in entry.claims]
    counts = Counter(claim.verdict for claim in claims)
    st.markdown(
        f"Of {counted(len(claims), 'claim')} of the paper, our numbers agree with "
        f"**{counts['agrees']}**, agree partly with **{counts['partly']}**, and do not agree with "
        f"**{counts['does not agree']}**; **{counts['cannot be judged']}** cannot be judged."
    )
    if by_chance := chance_text(claims):
        st.markdown(by_chance)
    wanted = st.segmented_control(
        "Verdict",
        [ALL, *VERDICTS],
        default=ALL,
        key="verdict",
        bind="query-params",
        required=True,
        format_func=str.capitalize,
        label_visibility="collapsed",
    )
    if not any(wanted in (ALL, claim.verdict) for claim in claims):
        st.caption("There is no such claim.")
    for entry in found.studies.values():
        chosen = tuple(claim for claim in entry.claims if wanted in (ALL, claim.verdict))
        if chosen:
            st.markdown(f"**{entry.place}. {entry.title}**")
            studies.show_claims(chosen, beside=False)
    st.caption(
        "Each verdict is decided by a rule, from the numbers alone: over several recordings of "
        "several experts, since one recording is one draw. Who has the demonstrations of another "
        "expert may see how far that carries."
    )


def show_study(name: str, entry: Entry | None) -> None:
    """One figure, with what the paper says of it beside it."""
    study = STUDIES[name]
    st.subheader(f"{study.place}. {study.title}")
    if entry is None:
        st.info(
            f"{study.place} has not been made yet. This command makes it:",
            icon=":material/terminal:",
        )
        st.code(f"python -m sarl_core reproduce --figure {name} --out data/paper", language="sh")
        return
    st.caption(study.about)
    if entry.quick:
        st.warning(
            "This comes from a quick run, which shows that everything works; its numbers mean "
            "little.",
            icon=":material/bolt:",
        )
    try:
        frame = studies.table(name, entry)
        parts = study.parts(frame)
    except SarlError as error:
        st.error(in_full(str(error)), icon=":material/error:")
        return
    st.caption(f"Made from {replication(frame)} for each environment.")
    part = parts[0]
    if len(parts) > 1:
        part = (
            st.segmented_control(
                "Part",
                parts,
                default=parts[0],
                key=f"part_{name}",
                bind="query-params",
                required=True,
                label_visibility="collapsed",
            )
            or parts[0]
        )
    left, right = st.columns([3, 2], gap="large")
    with left:
        drawn = studies.drawings(name, entry, part, dark=is_dark())
        for number, drawing in enumerate(drawn):
            st.markdown(f"**{drawing.title}**")
            st.plotly_chart(
                drawing.figure, key=f"drawing_{name}_{number}", config=PLAIN, alt=drawing.alt
            )
    with right:
        studies.show_claims(entry.claims, beside=True)
    how_made(entry)
    downloads(entry)


def downloads(entry: Entry) -> None:
    """The files of a study, and the report."""
    files = entry.files
    with st.container(horizontal=True):
        if (studies.FOLDER / files["page"]).is_file():
            st.download_button(
                "Page (HTML)",
                lambda: studies.whole_page(entry),
                files["page"],
                "text/html",
                key="page_file",
                on_click="ignore",
                icon=":material/download:",
            )
        for label, kind, mime in (
            ("Picture (PNG)", "picture", "image/png"),
            ("Data (CSV)", "table", "text/csv"),
        ):
            path = studies.FOLDER / files[kind]
            if path.is_file():
                st.download_button(
                    label,
                    path.read_bytes(),
                    files[kind],
                    mime,
                    key=f"{kind}_file",
                    on_click="ignore",
                    icon=":material/download:",
                )
        download_report()


def download_report() -> None:
    """The report as it is."""
    st.download_button(
        "All numbers (JSON)",
        (studies.FOLDER / REPORT).read_bytes(),
        REPORT,
        "application/json",
        key="report_file",
        on_click="ignore",
        icon=":material/download:",
    )


def how_made(entry: Entry) -> None:
    """Command, seeds and versions."""
    with st.expander("How this was made"):
        versions = ", ".join(f"{name} {version}" for name, version in entry.versions.items())
        st.markdown(
            f"On {entry.made}, within {max(1, round(entry.seconds / 60))} min, with {versions}."
        )
        st.code(entry.command.replace("DIR", "data/paper"), language="sh")
        st.json({"settings": entry.settings, "inputs": entry.inputs}, expanded=2)


# --- the page ----------------------------------------------------------------------------------

st.title("Paper")
st.caption(
    "The figures and claims of the paper behind this method, made again: over several recordings "
    "of several experts of each task, with 95 % intervals."
)
report = load()
places = {STUDIES[name].place: name for name in STUDIES}
shown = (
    st.segmented_control(
        "Show",
        [CLAIMS, *places],
        default=CLAIMS,
        key="figure",
        bind="query-params",
        required=True,
        label_visibility="collapsed",
    )
    or CLAIMS
)
if shown == CLAIMS:
    show_all_claims(report)
    download_report()
else:
    show_study(places[shown], report.studies.get(places[shown]))
