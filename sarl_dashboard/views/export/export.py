"""The settings of an export and what comes of them."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_dashboard.components.keeping import keep_rules_form
from sarl_dashboard.components.settings import switch
from sarl_dashboard.state import in_force
from sarl_dashboard.state.data import all_demonstrations
from sarl_dashboard.text import in_full
from sarl_dashboard.views.export.command import command_of
from sarl_dashboard.views.export.files import prepared_for, show_file
from sarl_dashboard.views.export.matrix import show_matrix
from sarl_dashboard.views.export.rounding import show_rounding
from sarl_dashboard.views.export.settings import settings

FILE, MATRIX = "File", "Rules by features"


@st.fragment
def show_export(demonstrations: Demonstrations) -> None:
    """Everything that answers to the settings.

    Args:
        demonstrations: The chosen ones.
    """
    chosen = settings()
    everything = all_demonstrations()
    assert everything is not None
    try:
        prepared = prepared_for(
            chosen.rule_set, everything if chosen.rounded else None, merged=chosen.merged
        )
    except SarlError as error:
        more = " Or switch rounding off." if chosen.rounded and chosen.rule_set.rules else ""
        st.error(f"{in_full(str(error))}{more}", icon=":material/error:")
        return
    show_rounding(prepared, everything)
    view = switch("View", "carry_view", [FILE, MATRIX])
    if view == MATRIX:
        show_matrix(prepared.rule_set, chosen.stem, demonstrations)
    else:
        show_file(prepared.rule_set, chosen)
        keep_rules_form(
            prepared.rule_set,
            in_force=chosen.rules == in_force.kind(),
            command=partial(command_of, chosen, demonstrations),
        )
