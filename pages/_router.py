"""Where every visit begins: page settings, what is chosen (in the sidebar), navigation."""

from __future__ import annotations

import sys
from pathlib import Path

import streamlit as st

# Pages are run as scripts; the house and the shared state are found from here.
for folder in (Path(__file__).parents[1], Path(__file__).parent):
    if str(folder) not in sys.path:
        sys.path.insert(0, str(folder))

import _state as state  # noqa: E402  # found by the lines above
from _sidebar import sidebar  # noqa: E402
from _url import absurd_parameters, say_left_out, show_left_out, without  # noqa: E402

st.set_page_config(
    page_title="SARL Explorer",
    page_icon=str(Path(__file__).parent / "icon.png"),  # a named icon would come from the network
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
        "carry.py",
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
        "ablation.py",
        title="Ablation",
        icon=":material/content_cut:",
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
# Who knows the other addresses guesses this one.
GUESSED = st.Page(
    lambda: None, title="Demonstrations", url_path="demonstrations", visibility="hidden"
)
page = st.navigation([*PAGES, GUESSED], expanded=True)
if page == GUESSED:
    st.switch_page(PAGES[0], query_params=st.query_params.to_dict())
if absurd := absurd_parameters():
    # Widgets take their values from the address before anything here could mend them.
    say_left_out(absurd, page.title)
    st.switch_page(page, query_params=without(absurd))
show_left_out(page.title)
sidebar(thresholds_shown=page.title != "Thresholds")
page.run()
state.settle(page.title)
