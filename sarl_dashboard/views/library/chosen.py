"""One thing that is kept: what is known of it, and what may be done with it."""

from __future__ import annotations

import re
import tempfile
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.explaining.words.sign_off import approval_text
from sarl_core.library import Item, Library
from sarl_core.library.bundles import ENDING, export_bundle
from sarl_core.library.contents import rules_of
from sarl_core.library.items import UNLISTED
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.state import in_force
from sarl_dashboard.state.data import SHIPPED_SETS, all_demonstrations, choose_dataset
from sarl_dashboard.state.rule_choice import comparison_address
from sarl_dashboard.state.url import set_url_choice
from sarl_dashboard.text import escaped, file_name
from sarl_dashboard.views.library.contents import show_content
from sarl_dashboard.views.library.listing import KINDS, about, size_text
from sarl_dashboard.views.library.notes import show_notes, show_results, show_sources

# Of a page here: what came from elsewhere leads nowhere else.
_ADDRESS = re.compile(r"[a-z_]+\?[\w%=&+.,|~*-]*")


def show_chosen(opened: Library, item: Item, author: str) -> None:
    """All that is known of a thing, and buttons.

    Args:
        opened: Where it is.
        item: The thing.
        author: Who looks.
    """
    own = item.author == author
    if item.removed is not None:
        st.info(
            f"{escaped(item.name)} was removed"
            + (": it can be brought back below." if own else f" by {escaped(item.author)}."),
            icon=":material/delete:",
        )
        return
    with st.container(border=True):
        st.header(escaped(item.name))
        facts = [
            KINDS.get(item.kind, "Kept for a link"),
            about(item),
            size_text(item.size) if item.files else "",
        ]
        st.caption(
            f"{' · '.join(filter(None, facts))} · "
            f"kept by {escaped('you' if own else item.author)} on "
            f"{item.created.astimezone():%d %B %Y, %H:%M}"
        )
        if item.command:
            st.code(item.command, language="sh", wrap_lines=True)
        for approval in item.approvals:
            st.markdown(f":material/verified: {escaped(approval_text(approval))}")
        show_content(opened, item)
        address = str(item.details.get("address", ""))
        if _ADDRESS.fullmatch(address):
            st.link_button(
                "Open it where it was made", f"./{address}", icon=":material/open_in_new:"
            )
        show_sources(opened, item)
        _buttons(opened, item, author, own=own)
        st.caption(f"On the command line: `library:{item.id}`")
        if item.kind == "rules":
            _rules(opened, item, author)
        show_results(opened, item, author)
        show_notes(opened, item, author)


def _buttons(opened: Library, item: Item, author: str, *, own: bool) -> None:
    with st.container(horizontal=True, vertical_alignment="center"):
        if item.kind == "demonstrations":
            st.button(
                "Open",
                type="primary",
                icon=":material/dataset:",
                key="library_open",
                on_click=choose_dataset,
                args=(item.id,),
                help="Every page then works on them; the address is a link for others.",
            )
        if item.kind == "rules":
            st.button(
                "Put in force",
                type="primary",
                icon=":material/rule:",
                key="library_in_force",
                on_click=_put_in_force,
                args=(opened, item),
                help="On every page, with the data that they are from; the address is a link for "
                "others.",
            )
        if item.kind == "log":
            st.page_link(
                "audit.py",
                label="Hold rules against it",
                icon=":material/fact_check:",
                query_params={"log": item.id},
            )
        if item.kind in UNLISTED:
            return
        download(
            "To carry elsewhere",
            partial(_bundle, opened, item),
            f"{file_name(item.name)}{ENDING}",
            key="library_export",
            meaning="With all that it was made of, its earlier versions and the notes, as one file",
        )
        if not own:
            return
        st.toggle(
            "Shared with all",
            value=item.shared,
            key=f"share_{item.id}",
            on_change=_change,
            args=(opened.share, item, author),
            kwargs={"shared": not item.shared},
            help=with_words(
                "It then stands in everybody's list. Whoever has its link may look anyway."
            ),
        )
        st.button(
            "Remove",
            icon=":material/delete:",
            key="library_remove",
            on_click=_change,
            args=(opened.remove, item, author),
            help="For 30 days it can be brought back below.",
        )
    st.text_input(
        "Name",
        value=item.name,
        key=f"name_{item.id}",
        max_chars=200,
        on_change=_rename,
        args=(opened, item, author),
    )


def _rules(opened: Library, item: Item, author: str) -> None:
    """What the rules say, their versions, and who stands for them."""
    rule_set = rules_of(opened, item)
    with st.expander(f"The rules in words ({len(rule_set):,})", icon=":material/rule:"):
        st.text(rule_set.to_text())
    versions = opened.versions(item.id)
    if len(versions) > 1:
        with st.expander(f"Versions ({len(versions):,})", icon=":material/history:"):
            for one in versions:
                mark = "this one" if one.id == item.id else "open"
                who = ", ".join(approval.author for approval in one.approvals)
                row = st.container(horizontal=True, vertical_alignment="center", gap="small")
                row.button(
                    f"{one.created.astimezone():%d %b %Y, %H:%M:%S} · {about(one)}"
                    + (f" · approved by {escaped(who)}" if who else ""),
                    key=f"version_{one.id}",
                    disabled=one.id == item.id,
                    help=mark,
                    type="tertiary",
                    on_click=set_url_choice,
                    args=("item", one.id),
                )
                if one.id != item.id:
                    row.page_link(
                        "difference.py",
                        label="Compare with it",
                        icon=":material/difference:",
                        query_params=comparison_address(one.id, item.id),
                    )
    with st.expander("Approve this version", icon=":material/verified:"):
        st.caption(
            "You say by your name that you stand for these very rules. A change makes another "
            "version, for which nobody stands yet."
        )
        st.text_area("Note", key=f"approval_{item.id}", max_chars=10_000)
        st.button(
            f"Approve as {escaped(author)}",
            key="library_approve",
            on_click=_approve,
            args=(opened, item, author),
        )


def _put_in_force(opened: Library, item: Item) -> None:
    """Choose the rules, and the data that they were made from, kept or shipped."""
    data = ""
    for identifier in item.came_from:
        with suppress(SarlError):
            source = opened.item(identifier)
            if source.kind == "demonstrations" and source.removed is None:
                data = source.id
    data = data or _shipped_for(str(item.details.get("environment", "")))
    if data:
        choose_dataset(data)
    in_force.choose(item.id)


def _shipped_for(environment: str) -> str:
    """The shipped data of an environment; "" where there are none, or others of it are chosen."""
    chosen = None
    with suppress(SarlError):
        chosen = all_demonstrations()
    if chosen is not None and chosen.env_id == environment:
        return ""
    return next((name for name, (_, one) in SHIPPED_SETS.items() if one == environment), "")


def _approve(opened: Library, item: Item, author: str) -> None:
    note = st.session_state.get(f"approval_{item.id}") or ""
    _change(opened.approve, item, author, note=note)


def _bundle(opened: Library, item: Item) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"bundle{ENDING}"
        export_bundle(opened, [item.id], path)
        return path.read_bytes()


def _change(change: Any, item: Item, author: str, **named: Any) -> None:
    try:
        change(item.id, author=author, **named)
    except SarlError as error:
        st.session_state["_library_error"] = str(error)


def _rename(opened: Library, item: Item, author: str) -> None:
    name = st.session_state[f"name_{item.id}"]
    try:
        opened.rename(item.id, name, author=author)
    except SarlError as error:
        st.session_state["_library_error"] = str(error)
