"""Where every visit begins: page settings, what is chosen (in the sidebar), navigation."""

from __future__ import annotations

import sys

import streamlit as st

from sarl_core.explaining.templates import style_sheet
from sarl_dashboard.components.journey.brand import ICON, show_logo
from sarl_dashboard.components.journey.first_run import show_first_run, take_up
from sarl_dashboard.components.journey.growing import require_trees
from sarl_dashboard.components.journey.next_step import next_step
from sarl_dashboard.components.journey.sign_in import (
    is_admitted,
    link_before_sign_in,
    show_sign_in,
    show_signed_in,
)
from sarl_dashboard.components.journey.words import words_button
from sarl_dashboard.components.sidebar import (
    require_data,
    require_rules,
    sidebar,
    threshold_parameters,
)
from sarl_dashboard.session import settle
from sarl_dashboard.state import data_words, in_force, library
from sarl_dashboard.state.data import settle_choices
from sarl_dashboard.state.thresholds import take_over_moved
from sarl_dashboard.state.url import (
    absurd_parameters,
    begin_run,
    bring_along,
    end_run,
    say_left_out,
    show_left_out,
    without,
    write_url,
)

# The tab's title is that of the page.
st.set_page_config(page_icon=ICON, layout="wide", initial_sidebar_state="auto")

# The way from data to what is handed over.
SECTIONS = {
    "Start": [
        st.Page("overview.py", title="Overview", icon=":material/home:", default=True),
    ],
    "1 Data": [
        st.Page("demonstrations.py", title="Demonstrations", icon=":material/dataset:"),
        st.Page("names.py", title="Names", icon=":material/label:"),
        st.Page("episodes.py", title="Episodes", icon=":material/timeline:"),
    ],
    "2 Rules": [
        st.Page("thresholds.py", title="Thresholds", icon=":material/tune:"),
        st.Page("rules.py", title="Rules", icon=":material/rule:"),
        st.Page("evidence.py", title="Evidence", icon=":material/verified:"),
    ],
    "3 Understand and change": [
        st.Page("what_if.py", title="What if", icon=":material/help_center:"),
        st.Page("edit.py", title="Edit", icon=":material/edit:"),
        st.Page("difference.py", title="Compare", icon=":material/difference:", url_path="compare"),
    ],
    "4 Try the shield": [
        st.Page("replay.py", title="Replay", icon=":material/play_circle:"),
        st.Page("shield.py", title="Measure", icon=":material/shield:", url_path="measure"),
        st.Page(
            "ablation.py",
            title="Worth of each rule",
            icon=":material/content_cut:",
            url_path="worth",
        ),
        st.Page("audit.py", title="Audit", icon=":material/fact_check:"),
    ],
    "5 Hand over": [
        st.Page("report.py", title="Report", icon=":material/summarize:"),
        st.Page("export.py", title="Export", icon=":material/ios_share:"),
        st.Page("library.py", title="Library", icon=":material/inventory_2:"),
    ],
    "Research": [
        st.Page("research/improve.py", title="Improve", icon=":material/trending_up:"),
        st.Page("research/learning.py", title="Learning", icon=":material/school:"),
        st.Page("research/paper.py", title="Paper", icon=":material/article:"),
    ],
}
# What can be looked at whichever rules are in force.
WITHOUT_RULES = ("Overview", "Demonstrations", "Names", "Library", "Improve", "Learning", "Paper")
PAGES = [page for pages in SECTIONS.values() for page in pages]
# Addresses that pages once had.
ALIASES = {
    "carry": "Export",
    "difference": "Compare",
    "shield": "Measure",
    "ablation": "Worth of each rule",
}
aliases = [
    st.Page(lambda: None, title=title, url_path=path, visibility="hidden")
    for path, title in ALIASES.items()
]
take_over_moved()  # before it is said what they are
bring_along(threshold_parameters())
admitted = is_admitted()
page = st.navigation(
    SECTIONS | {"Start": [*SECTIONS["Start"], *aliases]},
    position="sidebar" if admitted else "hidden",
    expanded=True,
)
if not admitted:
    st.html(style_sheet())
    show_logo()
    show_sign_in(page.url_path)
    st.stop()
if page is PAGES[0] and not st.query_params and (link := link_before_sign_in()):
    wanted = next(other for other in (*PAGES, *aliases) if other.url_path == link.page)
    st.switch_page(wanted, query_params=link.query)
if page in aliases:
    meant = next(other for other in PAGES if other.title == page.title)
    st.switch_page(meant, query_params=without())
begin_run(page.title)
if absurd := absurd_parameters():
    # Widgets take their values from the address before anything here could mend them.
    say_left_out(absurd, page.title)
    st.switch_page(page, query_params=without(absurd))
st.html(style_sheet())
show_logo()
left_out = st.empty()
show_left_out(page.title, left_out)
try:
    settle_choices()
    data_words.take_up()
    in_force.take_up()
    take_up()
    sidebar(with_thresholds=page.title != "Thresholds")
    show_signed_in()
finally:
    write_url()
library.say()
words_button()
try:
    if page.title != "Library":
        require_data(page.title)
    if page.title not in WITHOUT_RULES:
        require_trees(page.title)
        require_rules(page.title)
    show_first_run(page.title)
    page.run()
    next_step(page.title)
    library.say()
finally:  # also where the page ends early: then it has said itself what to do
    end_run(page.title)
    settle(page.title, len(sys.modules))
    show_left_out(page.title, left_out)
