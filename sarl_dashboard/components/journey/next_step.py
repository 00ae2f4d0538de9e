"""Where to go on from a page: one step further on the way from data to what is handed over."""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.state.data import raw_demonstrations

# By a page's title: the file of the page that follows it, and what is done there.
NEXT = {
    "Overview": ("demonstrations.py", "Look at what the expert did"),
    "Demonstrations": ("names.py", "Name features and actions, or add a formula"),
    "Names": ("episodes.py", "Step through the episodes"),
    "Episodes": ("thresholds.py", "Choose how many rules there are, and how good"),
    "Thresholds": ("rules.py", "All rules, with the evidence behind each"),
    "Rules": ("evidence.py", "How sure each rule is"),
    "Evidence": ("what_if.py", "Ask what the rules do in one state"),
    "What if": ("edit.py", "Change the rules"),
    "Edit": ("difference.py", "Compare two rule sets"),
    "Compare": ("replay.py", "Watch the rules act as a shield"),
    "Replay": ("shield.py", "Measure what the shield is worth over many episodes"),
    "Measure": ("ablation.py", "See what each rule is worth"),
    "Worth of each rule": ("audit.py", "Hold the rules against a log"),
    "Audit": ("report.py", "Write a report for people who know only the task"),
    "Report": ("export.py", "Carry the rules into other programs"),
    "Export": ("library.py", "Keep the rules, and approve them"),
    "Library": ("overview.py", "See what has been done for these data"),
    "Improve": ("shield.py", "Measure what rules are worth over many episodes"),
    "Learning": ("research/paper.py", "See the paper's figures, made again"),
    "Paper": ("overview.py", "Back to the overview"),
}
_WITHOUT_DATA = ("Overview", "Library", "Learning", "Paper", "Audit")


def next_step(page: str) -> None:
    """The step that follows, at the end of a page.

    Args:
        page: Its title. A page that needs data and has none says itself what to do.
    """
    if page not in _WITHOUT_DATA and raw_demonstrations() is None:
        return
    file, label = NEXT[page]
    with st.container(key="go_on"):
        st.page_link(file, label=f"Next: {label[:1].lower()}{label[1:]}", icon=":material/east:")
