"""Where every visit begins: page settings, what is chosen (in the sidebar), navigation."""

from __future__ import annotations

import sys

import streamlit as st

from sarl_core.explaining.templates import style_sheet
from sarl_dashboard.components.sidebar import require_data, sidebar
from sarl_dashboard.session import ICON, settle
from sarl_dashboard.state.url import (
    absurd_parameters,
    begin_run,
    say_left_out,
    show_left_out,
    without,
)

st.set_page_config(
    page_title="SARL Explorer",
    page_icon=str(ICON),  # a named icon would come from the network
    layout="wide",
    initial_sidebar_state="auto",
)

PAGES = [
    st.Page(
        "demonstrations.py",
        title="Demonstrations",
        icon=":material/dataset:",
        default=True,
        url_path="start",  # never seen: the default page is at "/"
    ),
    st.Page(
        "episodes.py",
        title="Episodes",
        icon=":material/timeline:",
    ),
    st.Page(
        "names.py",
        title="Names",
        icon=":material/label:",
    ),
    st.Page(
        "thresholds.py",
        title="Thresholds",
        icon=":material/tune:",
    ),
    st.Page(
        "rules.py",
        title="Rules",
        icon=":material/rule:",
    ),
    st.Page(
        "evidence.py",
        title="Evidence",
        icon=":material/verified:",
    ),
    st.Page(
        "what_if.py",
        title="What if",
        icon=":material/help_center:",
    ),
    st.Page(
        "edit.py",
        title="Edit",
        icon=":material/edit:",
    ),
    st.Page(
        "difference.py",
        title="Difference",
        icon=":material/difference:",
    ),
    st.Page(
        "export.py",
        title="Export",
        icon=":material/ios_share:",
    ),
    st.Page(
        "report.py",
        title="Report",
        icon=":material/summarize:",
    ),
    st.Page(
        "replay.py",
        title="Replay",
        icon=":material/play_circle:",
    ),
    st.Page(
        "shield.py",
        title="Shield",
        icon=":material/shield:",
    ),
    st.Page(
        "audit.py",
        title="Audit",
        icon=":material/fact_check:",
    ),
    st.Page(
        "ablation.py",
        title="Ablation",
        icon=":material/content_cut:",
    ),
    st.Page(
        "library.py",
        title="Library",
        icon=":material/inventory_2:",
    ),
    st.Page(
        "improve.py",
        title="Improve",
        icon=":material/trending_up:",
    ),
    st.Page(
        "learning.py",
        title="Learning",
        icon=":material/school:",
    ),
    st.Page(
        "paper.py",
        title="Paper",
        icon=":material/article:",
    ),
]
# Other addresses of a page: one that is guessed by who knows the rest, and one that it once had.
ALIASES = {"demonstrations": "Demonstrations", "carry": "Export"}
aliases = [
    st.Page(lambda: None, title=title, url_path=path, visibility="hidden")
    for path, title in ALIASES.items()
]
page = st.navigation([*PAGES, *aliases], expanded=True)
if page in aliases:
    meant = next(other for other in PAGES if other.title == page.title)
    st.switch_page(meant, query_params=st.query_params.to_dict())
begin_run(page.title)
if absurd := absurd_parameters():
    # Widgets take their values from the address before anything here could mend them.
    say_left_out(absurd, page.title)
    st.switch_page(page, query_params=without(absurd))
st.html(style_sheet())
show_left_out(page.title)
sidebar(with_thresholds=page.title != "Thresholds")
try:
    if page.title != "Library":
        require_data(page.title)
    page.run()
finally:  # also where the page ends early
    settle(page.title, len(sys.modules))
