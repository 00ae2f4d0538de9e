"""What the expert did: choose or upload demonstrations, and look at what is in them."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_dashboard.components.downloads import as_file, download
from sarl_dashboard.session import end_page
from sarl_dashboard.state.data import mined_data, uncombined_demonstrations
from sarl_dashboard.state.thresholds import chosen_divider
from sarl_dashboard.views.demonstrations.actions import show_actions
from sarl_dashboard.views.demonstrations.features import show_features
from sarl_dashboard.views.demonstrations.overview import (
    contents_of,
    counted_contents,
    leave_episodes_out,
    show_columns,
    show_overview,
)
from sarl_dashboard.views.demonstrations.upload import upload_section

st.title("Demonstrations")
st.caption(
    "What the expert did: at every step a state and the action taken in it, the pairs that rules "
    "are mined from."
)
demonstrations = uncombined_demonstrations()
upload_section(expanded=demonstrations is None)
if demonstrations is None:
    st.info(
        "Nothing has been uploaded in this session. Upload a file above, or choose a shipped "
        "set in the sidebar.",
        icon=":material/upload_file:",
    )
    end_page()
mined = mined_data()
contents = contents_of(demonstrations) if mined is None else counted_contents(mined)
divider = chosen_divider()
show_overview(demonstrations, contents)
show_columns(demonstrations)
leave_episodes_out()
show_actions(demonstrations, divider, mined)
show_features(demonstrations, contents.rows, divider)
name = demonstrations.env_id.rsplit("/", 1)[-1].rsplit(":", 1)[-1] or "demonstrations"
name += "-sample" if mined is not None else ""
of = "the sample " if mined is not None else ""
with st.container(horizontal=True):
    for kind, extension in (("Parquet", ".parquet"), ("CSV", ".csv")):
        download(
            f"Download {of}as {kind}",
            partial(as_file, demonstrations, extension),
            f"{name}{extension}",
            key=f"download_{extension[1:]}",
        )
