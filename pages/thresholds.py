"""Thresholds: how many rules, how long and how good, at every pair of thresholds at once.

A moved slider runs the fragment "controls" and nothing else. The maps are not part of it: they hold
every pair of thresholds already, and only the mark that lies over them moves. The table is drawn by
it in a place of its own, since every further fragment would cost a run of its own.
"""

from __future__ import annotations

import streamlit as st

from sarl_dashboard.components.edits_notice import without_edits_notice
from sarl_dashboard.jobs import cross_fitting
from sarl_dashboard.state import in_force, rule_base
from sarl_dashboard.state.compact_set import chosen_compact
from sarl_dashboard.state.data import require_demonstrations
from sarl_dashboard.state.mined import grown_trees, tried_on
from sarl_dashboard.state.thresholds import DEMAND, chosen_divider, chosen_mode, chosen_thresholds
from sarl_dashboard.text import escaped
from sarl_dashboard.views.thresholds.combinations import combinations_choice
from sarl_dashboard.views.thresholds.controls import mode_choice, show_controls
from sarl_dashboard.views.thresholds.display import DIVIDER, LARGEST, TRADE_OFFS, chosen_display
from sarl_dashboard.views.thresholds.divider import show_divider
from sarl_dashboard.views.thresholds.maps import (
    let_numbers_be_drawn,
    show_maps,
    show_surfaces,
)
from sarl_dashboard.views.thresholds.trade_offs import show_trade_offs

st.title("Thresholds")
demonstrations = require_demonstrations()
trees = grown_trees(demonstrations, chosen_divider())
compact = chosen_compact(demonstrations)
forbids = chosen_mode() != DEMAND
st.caption(
    "A rule must apply to at least a certain share of the states (support), and the expert must "
    "have done there what it demands often enough (confidence), or what it forbids seldom enough "
    "(epsilon)."
)
mode_choice()
without_edits_notice()
if not rule_base.at_thresholds() and compact is None:
    st.caption(
        f":material/info: In force are other rules: {escaped(in_force.title())}. Moving a slider "
        "puts those at the thresholds in force."
    )
top = st.container()
combinations_choice()
display = chosen_display(trees, compact, tried_on())
thresholds = chosen_thresholds()
landscape = display.landscape(thresholds)
maps = st.container()
# The best trade-offs are those of coverage and fidelity, and rules that forbid want freedom, too.
names = [LARGEST, *([] if forbids else [TRADE_OFFS]), *([DIVIDER] if display.is_divided else [])]
tabs = dict(
    zip(names, st.tabs(names, key="details", on_change="rerun", bind="query-params"), strict=True)
)
table = None
if TRADE_OFFS in tabs and tabs[TRADE_OFFS].open:
    with tabs[TRADE_OFFS]:
        show_trade_offs(display)
elif DIVIDER in tabs and tabs[DIVIDER].open:
    with tabs[DIVIDER]:
        show_divider(demonstrations, display.dimension)
else:
    table = tabs[LARGEST].empty()
with top:
    show_controls(display, landscape, table)
let_numbers_be_drawn()
with maps:
    if display.surfaces:
        show_surfaces(display, landscape, thresholds)
    else:
        show_maps(display, landscape)
cross_fitting.make_ready()
