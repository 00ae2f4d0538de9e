"""What is kept: one's own things and those that are shared, to open, share, remove and carry."""

from __future__ import annotations

import streamlit as st

from sarl_core.errors import InputError, SarlError
from sarl_dashboard.state import library
from sarl_dashboard.text import refuse
from sarl_dashboard.views.library.at_work import show_work
from sarl_dashboard.views.library.chosen import show_chosen
from sarl_dashboard.views.library.listing import choose_item, import_form, removed_items, room

st.title("Library")
st.caption("What you have made or uploaded is kept here: open it, share it, carry it elsewhere.")
show_work(library.author())
try:
    opened = library.library()
    item = choose_item(opened, library.author())
    if item is not None:
        try:
            show_chosen(opened, item, library.author())
        except InputError as error:  # as where its file is missing; the others are here
            refuse(error)
    import_form(opened, library.author())
    removed_items(opened, library.author())
    room(opened, library.author())
except SarlError as error:
    refuse(error)
    st.caption("Everything else works; what you make is kept for this visit only.")
