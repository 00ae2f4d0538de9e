"""What rounding did to the thresholds."""

from __future__ import annotations

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import sample_text
from sarl_core.explaining.exports.export import Prepared
from sarl_core.mining.editing.rounding import digits_of
from sarl_core.mining.language import counted


def show_rounding(prepared: Prepared, demonstrations: Demonstrations) -> None:
    """What rounding did, and which thresholds stayed.

    Args:
        prepared: The rules as they are exported; nothing is said where none were rounded.
        demonstrations: On which decisions were counted.
    """
    rounding = prepared.rounding
    if rounding is None:
        return
    unrounded = rounding.unrounded
    of_steps = counted(len(demonstrations), "demonstrated step")
    if demonstrations.sample_of is not None:
        of_steps = sample_text(demonstrations)
    with st.grid(3, min_column_width=150, gap="small"):
        st.metric("Decisions changed", f"{prepared.changed:,}", border=True)
        st.metric("Thresholds rounded", f"{rounding.rounded:,}", border=True)
        st.metric("Left as they are", f"{len(unrounded):,}", border=True)
    st.caption(
        f"Counted with the shield itself on {of_steps}: "
        "each is decided by the same rule, with the same action, before and after."
        if not prepared.changed
        else "Some decisions changed; export without rounding."
    )
    if unrounded:
        features = prepared.rule_set.source.features
        with st.expander(f"{counted(len(unrounded), 'threshold')} left as they are"):
            st.dataframe(
                {
                    "Feature": [features[each.feature].name for each in unrounded],
                    "Threshold": [repr(each.threshold) for each in unrounded],
                    "Digits": [digits_of(each.threshold) for each in unrounded],
                    "Why": [each.why for each in unrounded],
                    "Rules": [", ".join(each.rules[:5]) for each in unrounded],
                },
                hide_index=True,
                height="content" if len(unrounded) <= 10 else 380,
            )
