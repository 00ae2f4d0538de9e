"""What stands in a result or a note, as far as a page can show it; none of it is taken for HTML."""

from __future__ import annotations

import io

import pandas as pd
import streamlit as st
from PIL import Image

from sarl_core.errors import SarlError
from sarl_core.library import Item, Library
from sarl_core.library.logs import log_file_name
from sarl_core.library.results import note_text, result_view
from sarl_dashboard.components.downloads import MIMES, download
from sarl_dashboard.components.tables import table_height
from sarl_dashboard.text import file_name, refuse

_ROWS = 500  # of a table, or lines of a document
_HIGHEST = 460  # pixels
_LARGEST = 100 * 2**20  # bytes of a picture or a film that goes to a browser


def show_content(opened: Library, item: Item) -> None:
    """A note's text; of a result a picture, a film, a table or a text, and its file.

    Args:
        opened: Where it is.
        item: Any; of demonstrations and rules nothing stands here.
    """
    if not item.files:
        return
    try:
        if item.kind == "note":
            st.text(note_text(opened, item))
        elif item.kind == "result":
            _show_result(opened, item)
        elif item.kind == "log":
            path = opened.path(item)
            if path.suffix in MIMES:
                download(
                    "Download", path.read_bytes, log_file_name(item), key="library_file_of_log"
                )
    except SarlError as error:
        refuse(error)


def _show_result(opened: Library, item: Item) -> None:
    path = opened.path(item)
    if path.suffix in (".gif", ".png", ".mp4") and item.size > _LARGEST:
        st.caption("It is too large to be shown here; its file is below.")
    elif path.suffix in (".gif", ".png"):
        _picture(path.read_bytes())
    elif path.suffix == ".mp4":
        st.video(path.read_bytes())
    view = result_view(path, _ROWS)
    if view.rows:
        heads = [f"{head} ({place})" for place, head in enumerate(view.rows[0])]
        unique = len(set(view.rows[0])) == len(view.rows[0])
        table = pd.DataFrame(view.rows[1:], columns=list(view.rows[0]) if unique else heads)
        st.dataframe(table, hide_index=True, height=table_height(len(table), 12))
    if view.lines:
        st.code("\n".join(view.lines), language=None, height=_HIGHEST)
    if view.more:
        st.caption("This is its beginning; the file holds all of it.")
    if path.suffix == ".html":
        st.caption("A page that opens by itself, in any browser.")
    if path.suffix in MIMES:
        name = f"{file_name(item.name)}{path.suffix}"
        download(f"Download {path.suffix}", path.read_bytes, name, key="library_file_of_result")


def _picture(content: bytes) -> None:
    try:
        with Image.open(io.BytesIO(content)) as picture:
            picture.load()
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError):
        st.caption("The picture cannot be shown; its file is below.")
        return
    st.image(content)
