"""Paper: its figures and claims, made again here, each beside what the paper says."""

from __future__ import annotations

import streamlit as st

from sarl_core.paper.studies import STUDIES
from sarl_dashboard.components.settings import switch
from sarl_dashboard.views.paper.claims import show_all_claims
from sarl_dashboard.views.paper.report_files import require_report
from sarl_dashboard.views.paper.study import report_download, show_study

CLAIMS = "Claims"
NAMES = {study.place: name for name, study in STUDIES.items()}

st.title("Paper")
st.caption(
    "The figures and claims of the paper behind this method, made again: over several recordings "
    "of several experts of each task, with 95 % intervals."
)
report = require_report()
place = switch("Show", "figure", [CLAIMS, *NAMES])
if place == CLAIMS:
    show_all_claims(report.studies.values())
    report_download()
else:
    show_study(NAMES[place], report.studies.get(NAMES[place]))
