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
        help="What the expert did: choose a shipped set or upload your own, and look at it.",
    ),
    st.Page(
        "names.py",
        title="Names",
        icon=":material/label:",
        help="What features, units, actions and labels are called, everywhere.",
    ),
    st.Page(
        "thresholds.py",
        title="Thresholds",
        icon=":material/tune:",
        help="How many rules, how long and how good, at every pair of thresholds.",
    ),
    st.Page(
        "rules.py",
        title="Rules",
        icon=":material/rule:",
        help="Every rule in plain language, with the evidence behind it.",
    ),
    st.Page(
        "evidence.py",
        title="Evidence",
        icon=":material/verified:",
        help="How sure each rule is, and whether the demonstrations are enough and agree.",
    ),
    st.Page(
        "what_if.py",
        title="What if",
        icon=":material/help_center:",
        help="One state: what the shield would do in it, why, and what would change that.",
    ),
    st.Page(
        "edit.py",
        title="Edit",
        icon=":material/edit:",
        help="Switch rules off, pin them, move them, add your own, and see what it changes.",
    ),
    st.Page(
        "difference.py",
        title="Difference",
        icon=":material/difference:",
        help="Two rule sets side by side: their rules, and the states they decide differently.",
    ),
    st.Page(
        "carry.py",
        title="Export",
        icon=":material/ios_share:",
        help="Carry the rules away: as code, as a table, on paper.",
    ),
    st.Page(
        "report.py",
        title="Report",
        icon=":material/summarize:",
        help="The rules in one file, for people who know only the task.",
    ),
    st.Page(
        "replay.py",
        title="Replay",
        icon=":material/play_circle:",
        help="An agent in its environment, with the rules as a shield and without.",
    ),
    st.Page(
        "shield.py",
        title="Shield",
        icon=":material/shield:",
        help="What a shield is worth: agents with the rules and without, over many episodes.",
    ),
    st.Page(
        "ablation.py",
        title="Ablation",
        icon=":material/content_cut:",
        help="What each rule is worth: the same episodes again, with one rule taken out.",
    ),
    st.Page(
        "improve.py",
        title="Improve",
        icon=":material/trending_up:",
        help="The expert answers where the rules lead, and few rules are made of its answers.",
    ),
    st.Page(
        "learning.py",
        title="Learning",
        icon=":material/school:",
        help="Agents learn under the shield, and show what they are worth without it.",
    ),
    st.Page(
        "paper.py",
        title="Paper",
        icon=":material/article:",
        help="The figures and claims of the paper behind the method, made again.",
    ),
]
# Who knows the other addresses guesses this one.
GUESSED = st.Page(
    lambda: None, title="Demonstrations", url_path="demonstrations", visibility="hidden"
)
page = st.navigation([*PAGES, GUESSED], expanded=True)
if page == GUESSED:
    st.switch_page(PAGES[0], query_params=st.query_params.to_dict())
sidebar(thresholds_shown=page.title != "Thresholds")
page.run()
state.settle(page.title)
