"""Where a page needs the steps themselves and has a sample of a mined file: what it says then."""

from __future__ import annotations

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.samples import needs_steps_text, sample_text
from sarl_dashboard.text import in_full


def say_steps_needed(what: str, demonstrations: Demonstrations) -> bool:
    """Say that something needs the steps themselves, where they are not here.

    Args:
        what: As "the learning curve".
        demonstrations: The chosen ones.

    Returns:
        Whether it was said: then there is nothing to show.
    """
    if demonstrations.sample_of is None:
        return False
    st.info(in_full(needs_steps_text(what, demonstrations)), icon=":material/data_usage:")
    return True


def say_of_sample(what: str, demonstrations: Demonstrations) -> None:
    """Say that a sample stands for the steps; nothing where all are here.

    Args:
        what: Made of it, in the plural and with a capital, as "The bars below".
        demonstrations: The chosen ones.
    """
    if len(demonstrations) < demonstrations.whole.steps:
        st.caption(f":material/data_usage: {what} are of {sample_text(demonstrations)}.")
