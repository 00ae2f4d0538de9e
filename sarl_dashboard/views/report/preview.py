"""The button that makes a report, and the report as it looks in a browser."""

from __future__ import annotations

import base64
from functools import partial

import streamlit as st

from sarl_core.explaining.report.pdf import can_print
from sarl_core.explaining.report.report import Report
from sarl_core.explaining.words.sign_off import sign_off_text
from sarl_core.mining.language import counted
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.job import Place
from sarl_dashboard.jobs.report import ReportOrder, print_cache, printing, report_cache, reporting
from sarl_dashboard.text import escaped

PLACE = Place[Report]("report")
PRINTED = Place[bytes]("report_on_paper")
PREVIEW = 900  # pixels


def report_of(order: ReportOrder, name: str) -> None:
    """The button or the progress, and the report.

    Args:
        order: What is asked for.
        name: Of the data, for the file.
    """

    def outcome(at_work: bool) -> None:
        report = report_cache().get(order.key)
        in_full = min(order.wishes.in_full, len(order.rule_set))
        run_bar(
            PLACE,
            Offer(
                key=order.key,
                start=lambda: reporting(order),
                about=f"{counted(len(order.rule_set), 'rule')}, {in_full:,} of them in full"
                f"{'; made already' if report is not None else ''}.",
                complete=report is not None,
                cancelled="Cancelled; nothing was kept.",
                label="Make the report",
                icon=":material/summarize:",
            ),
        )
        if order.wishes.sign_off is not None:
            st.caption(escaped(sign_off_text(order.wishes.sign_off)))
        if report is None and not at_work and not order.comparison:
            st.markdown(
                ":material/info: :gray[A report says more with results in it: run agents with the "
                "rules and without on the page Measure first, and come back.]"
            )

    watched(PLACE, outcome)
    report = report_cache().get(order.key)
    if report is not None and not PLACE.at_work:
        show(order, report, name)


def show(order: ReportOrder, report: Report, name: str) -> None:
    """The report itself."""
    content = report.html.encode()
    if report.without:
        st.info(f"The report has no pictures: {escaped(report.without)}.", icon=":material/info:")
    with st.container(horizontal=True, vertical_alignment="center"):
        download("Download the report", content, f"report-{name}.html", key="report_file")
        download("Download the slides", lambda: report.slides, f"slides-{name}.html", key="slides")
        keep_result_button(content, f"report-{name}.html", key="keep_report")
        st.caption(
            f"One HTML file of {len(content) / 1e6:.1f} MB with "
            f"{counted(report.pictures, 'picture')}. It opens without a network, in any browser, "
            "and prints on A4; the slides hold one rule each.",
            width="content",
        )
    if can_print():
        watched(PRINTED, partial(_on_paper, order, report, name))
    # As an address of its own the file has no access to this page, whatever names are in it.
    st.iframe(
        f"data:text/html;base64,{base64.b64encode(content).decode('ascii')}",
        height=PREVIEW,
        alt="The report as it looks in a browser",
    )


def _on_paper(order: ReportOrder, report: Report, name: str, at_work: bool) -> None:
    """The report as a PDF, or the button that prints it."""
    printed = print_cache().get(order.key)
    if printed is not None and not at_work:
        download("Download as PDF", printed, f"report-{name}.pdf", key="report_pdf")
        return
    run_bar(
        PRINTED,
        Offer(
            key=order.key,
            start=lambda: printing(order, report),
            about="For paper: a browser on the server prints it.",
            complete=False,
            cancelled="Cancelled; nothing was kept.",
            label="Make the PDF",
            icon=":material/print:",
            type="secondary",
        ),
    )
