"""The exported file and its test vectors, written once for each choice."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_core.explaining.exports.export import (
    Prepared,
    export_content,
    export_vectors,
    prepare,
    vectors_name,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_dashboard.cache import cached
from sarl_dashboard.components.downloads import download
from sarl_dashboard.text import refuse
from sarl_dashboard.views.export.settings import Settings

LINES = 120


@cached(show_spinner="Rounding, and counting what changes …")
def prepared_for(
    key: str, _rule_set: RuleSet, _demonstrations: Demonstrations | None, *, merged: bool
) -> Prepared:
    """Rules rounded and merged as was asked.

    Args:
        key: Tells the rules and the demonstrations from all others.
        _rule_set: To carry away.
        _demonstrations: On which no decision may change; None for no rounding.
        merged: Whether conditions on one feature become one interval.

    Returns:
        The rules, and what rounding did.

    Raises:
        SarlError: If there is nothing to export, or the demonstrations are for other rules.
    """
    return prepare(_rule_set, merged=merged, demonstrations=_demonstrations)


@cached(show_spinner="Writing …")
def content_of(key: str, suffix: str, projection: Projection, _rule_set: RuleSet) -> bytes:
    """The file."""
    return export_content(_rule_set, suffix, projection)


@cached()
def vectors_of(key: str, projection: Projection, _rule_set: RuleSet) -> bytes:
    """Its test vectors, made when asked for."""
    return export_vectors(_rule_set, projection)


def show_file(prepared: Prepared, key: str, settings: Settings) -> None:
    """The file: its beginning, and the downloads.

    Args:
        prepared: The rules as they are exported.
        key: Tells them from all others.
        settings: What was asked for.
    """
    form, projection = settings.form, settings.projection
    try:
        content = content_of(key, form.suffix, projection, prepared.rule_set)
    except SarlError as error:
        refuse(error)
        return
    name = f"{settings.stem}{form.suffix}"
    with st.container(horizontal=True, vertical_alignment="center"):
        download(f"Download {form.suffix}", content, name, key="carry_download", look="primary")
        download(
            "Test vectors",
            partial(vectors_of, key, projection, prepared.rule_set),
            vectors_name(name),
            key="carry_vectors",
            icon="fact_check",
            meaning="States at every threshold and one step either side, with the rule and the "
            "action that must come out",
        )
        st.caption(f"{form.meaning} {len(content) / 1024:,.1f} kB.")
    if form.suffix == ".onnx":
        kind = "int64" if not prepared.rule_set.actions[0].is_interval else "float32"
        st.markdown(
            f"Inputs: `state` (B, {len(prepared.rule_set.source.features)}) float32 and `proposed` "
            f"(B, {len(prepared.rule_set.actions)}) {kind}. Outputs: `executed`, alike, `rule` "
            "int64, the index of the rule in force or -1, and `invalid` (B, 1), whether the state "
            "or the action is none that the rules can be asked about."
        )
        return
    lines = content.decode().splitlines()
    st.code("\n".join(lines[:LINES]), language=form.language, height=460, line_numbers=True)
    if len(lines) > LINES:
        st.caption(f"The first {LINES} of {len(lines):,} lines.")
