"""The list of what is kept, what was removed, and what comes from elsewhere."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from datetime import datetime
from functools import partial
from pathlib import Path

import pandas as pd
import streamlit as st

from sarl_core.errors import InputError, SarlError
from sarl_core.library import Item, Library
from sarl_core.library.bundles import ENDING, import_bundle
from sarl_core.mining.language import counted
from sarl_dashboard.components.lists.rows import row_choice
from sarl_dashboard.components.tables import rows_selected_anew, select_row, table_height
from sarl_dashboard.state.url import set_url_choice, url_name
from sarl_dashboard.text import refuse

KINDS = {
    "demonstrations": "Demonstrations",
    "rules": "Rules",
    "result": "Result",
    "note": "Note",
    "log": "Log",
}
_FORMS = {
    ".csv": "a table",
    ".gif": "a film",
    ".html": "a page",
    ".json": "an answer",
    ".mp4": "a film",
    ".png": "a picture",
}


def choose_item(opened: Library, author: str) -> Item | None:
    """The list; the thing that is chosen in it or that a link names, None where none is."""
    named = url_name("item")
    item = None
    if named:
        try:
            item = opened.item(named)
        except InputError as error:  # all that is kept is still here
            refuse(error)
    items = opened.items(author)
    if not items:
        st.info(
            "Nothing is kept yet. Upload demonstrations on the page Demonstrations: they are kept "
            "at once. What somebody exported can be brought here below; on the command line, "
            "`sarl library add` keeps results and notes.",
            icon=":material/inventory_2:",
        )
        return item
    kinds = [kind for kind in KINDS if any(item.kind == kind for item in items)]
    if len(kinds) > 1:
        chosen = st.segmented_control(
            "Kind", kinds, format_func=KINDS.__getitem__, key="library_kind"
        )
        items = [one for one in items if chosen in (None, one.kind)]
    text = st.text_input("Search", key="library_search", placeholder="a name, or an author")
    wanted = text.strip().lower()
    items = [one for one in items if wanted in f"{one.name} {one.author}".lower()]
    if not items:
        st.caption("Nothing here has that in its name.")
        return item
    identifiers = [one.id for one in items]
    row = identifiers.index(named) if named in identifiers else None
    select_row(row, "library_table")
    st.dataframe(
        _table(items, author),
        hide_index=True,
        height=table_height(len(items), 12),
        on_select=partial(_choose, identifiers, row),
        selection_mode="single-row",
        selection_default={"selection": {"rows": [] if row is None else [row]}},
        key="library_table",
        column_config={
            "Kept": st.column_config.DatetimeColumn(format="D MMM YYYY, HH:mm"),
            "Name": st.column_config.TextColumn(width="medium"),
        },
    )
    row_choice(
        "library_table", [one.name for one in items], row, partial(_choose, identifiers, row)
    )
    if item is None:
        st.caption(f"{counted(len(items), 'thing')}. Choose a row to open, share or remove it.")
    return item


def _choose(identifiers: Sequence[str], drawn: int | None) -> None:
    """Let the address name the row that was chosen, where another one was drawn."""
    rows = rows_selected_anew("library_table", drawn)
    if rows is not None:
        set_url_choice("item", identifiers[rows[0]] if rows else "")


def _table(items: list[Item], author: str) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "Name": [item.name for item in items],
            "Kind": [KINDS[item.kind] for item in items],
            "About": [about(item) for item in items],
            "Author": ["you" if item.author == author else item.author for item in items],
            "Kept": pd.to_datetime([_local(item.created) for item in items]),
            "Approved by": [", ".join(one.author for one in item.approvals) for item in items],
            "Shared": [item.shared for item in items],
            "Size": [size_text(item.size) for item in items],
        }
    )


def about(item: Item) -> str:
    """What is in a thing, in a few words."""
    details = item.details
    parts = []
    for key, noun in (
        ("steps", "step"),
        ("episodes", "episode"),
        ("rules", "rule"),
        ("edits", "edit"),
    ):
        number = details.get(key)
        if isinstance(number, int):
            parts.append(counted(number, noun))
    if "certificate" in details:
        parts.append("a certificate")
    elif item.kind == "result" and item.files:
        parts.append(_FORMS.get(item.files[0].ending, item.files[0].ending))
    return ", ".join(parts)


def size_text(size: int) -> str:
    """Bytes as people say them."""
    return f"{size / 1e6:,.1f} MB" if size >= 10**5 else f"{size / 1e3:,.1f} kB"


def _local(time: datetime) -> datetime:
    """As the server's clock shows it."""
    return time.astimezone().replace(tzinfo=None)


def import_form(opened: Library, author: str) -> None:
    """Bring what somebody exported."""
    with st.expander("Bring what was exported elsewhere", icon=":material/move_to_inbox:"):
        file = st.file_uploader(f"A {ENDING} file", type=[ENDING[1:]], key="library_file")
        if file is None or st.session_state.get("_library_read") == file.file_id:
            return
        st.session_state["_library_read"] = file.file_id
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"file{ENDING}"
            path.write_bytes(file.getvalue())
            try:
                items = import_bundle(opened, path, author=author)
            except SarlError as error:
                refuse(str(error).replace(str(path), file.name))
                return
        st.toast(f"{counted(len(items), 'thing')} kept.", icon=":material/check:")
        st.rerun()


def removed_items(opened: Library, author: str) -> None:
    """What was removed, to be brought back."""
    items = opened.items(author, removed=True)
    if not items:
        return
    with st.expander(f"Removed ({len(items):,})", icon=":material/delete:"):
        st.caption("Gone for good 30 days after it was removed.")
        for item in items[:20]:
            with st.container(horizontal=True, vertical_alignment="center"):
                st.button(
                    "Bring back",
                    key=f"restore_{item.id}",
                    icon=":material/undo:",
                    on_click=_restore,
                    args=(opened, item, author),
                )
                st.markdown(f":small[{KINDS[item.kind]}]")
                st.text(item.name)


def _restore(opened: Library, item: Item, author: str) -> None:
    try:
        opened.restore(item.id, author=author)
    except SarlError as error:
        st.session_state["_library_error"] = str(error)


def room(opened: Library, author: str) -> None:
    """How much is kept, and that a quota is near."""
    if problem := st.session_state.pop("_library_error", ""):
        refuse(problem)
    usage = opened.usage(author)
    if usage.warning:
        st.warning(f"{usage.warning[0].upper()}{usage.warning[1:]}.", icon=":material/database:")
    st.caption(f"You keep {size_text(usage.author)} of {usage.quota.author / 1e9:,.0f} GB.")
