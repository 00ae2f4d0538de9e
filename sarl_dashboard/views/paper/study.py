"""One figure of the paper, made again, beside what the paper says of it."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.paper.report import REPORT, Entry
from sarl_core.paper.studies import STUDIES
from sarl_core.paper.study import replication
from sarl_dashboard.components.chart import chart
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.settings import switch
from sarl_dashboard.session import is_dark
from sarl_dashboard.text import refuse
from sarl_dashboard.views.paper import report_files
from sarl_dashboard.views.paper.claims import show_claims


def show_study(name: str, entry: Entry | None) -> None:
    """One figure, with what the paper says of it beside it.

    Args:
        name: Of the study.
        entry: What the report says of it; None where it has not been made.
    """
    study = STUDIES[name]
    st.header(f"{study.place}. {study.title}")
    if entry is None:
        st.info(
            f"{study.place} has not been made yet. This command makes it:",
            icon=":material/terminal:",
        )
        command = f"python -m sarl_core reproduce --figure {name} --out data/paper"
        st.code(command, language="sh", wrap_lines=True)
        return
    st.caption(study.about)
    if entry.quick:
        st.warning(
            "This comes from a quick run, which shows that everything works; its numbers mean "
            "little.",
            icon=":material/bolt:",
        )
    try:
        frame = report_files.table(name, entry)
        parts = study.parts(frame)
    except SarlError as error:
        refuse(error)
        return
    st.caption(f"Made from {replication(frame)} for each environment.")
    part = parts[0]
    if len(parts) > 1:
        part = switch("Part", f"part_{name}", parts)
    left, right = st.columns([3, 2], gap="large")
    with left:
        drawings = report_files.drawings(name, entry, part, dark=is_dark())
        for number, drawing in enumerate(drawings):
            st.markdown(f"**{drawing.title}**")
            chart(drawing.figure, f"drawing_{name}_{number}", drawing.alt)
    with right:
        show_claims(entry.claims, beside=True)
    how_made(entry)
    downloads(entry)


def downloads(entry: Entry) -> None:
    """The files of a study, and the report."""
    files = entry.files
    with st.container(horizontal=True):
        if (report_files.FOLDER / files["page"]).is_file():
            download(
                "Page (HTML)",
                lambda: report_files.whole_page(entry),
                files["page"],
                key="page_file",
            )
        picture = ("Picture (PNG)", files["picture"], "picture_file")
        for label, name, key in (picture, ("Data (CSV)", files["table"], "table_file")):
            path = report_files.FOLDER / name
            if path.is_file():
                download(label, path.read_bytes(), name, key=key)
        report_download()


def report_download() -> None:
    """The report, every number in it."""
    download(
        "All numbers (JSON)", (report_files.FOLDER / REPORT).read_bytes(), REPORT, key="report_file"
    )


def how_made(entry: Entry) -> None:
    """Command, seeds and versions."""
    with st.expander("How this was made"):
        versions = ", ".join(f"{name} {version}" for name, version in entry.versions.items())
        st.markdown(
            f"On {entry.made}, within {max(1, round(entry.seconds / 60))} min, with {versions}."
        )
        st.code(entry.command.replace("DIR", "data/paper"), language="sh", wrap_lines=True)
        st.json({"settings": entry.settings, "inputs": entry.inputs}, expanded=2)
