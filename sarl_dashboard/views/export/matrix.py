"""The table of rules by features."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.exports.rule_matrix_png import matrix_png
from sarl_core.explaining.html.rule_matrix import (
    LEGEND,
    RuleMatrix,
    matrix_document,
    matrix_html,
    rule_matrix,
)
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.cache import cached
from sarl_dashboard.components.downloads import download


@cached()
def matrix_of(rule_set: RuleSet, demonstrations: Demonstrations) -> RuleMatrix:
    """The rules by features."""
    return rule_matrix(rule_set, demonstrations)


@cached()
def picture_of(rule_set: RuleSet, demonstrations: Demonstrations, page: int) -> bytes:
    """One page of them as a picture."""
    matrix = matrix_of(rule_set, demonstrations)
    return matrix_png(matrix, matrix.page(page))


def show_matrix(rule_set: RuleSet, stem: str, demonstrations: Demonstrations) -> None:
    """Rules by features, a page at a time.

    Args:
        rule_set: As it is exported.
        stem: How the names of its files begin.
        demonstrations: Whose values are drawn behind the rules.
    """
    matrix = matrix_of(rule_set, demonstrations)
    page = 1
    if st.session_state.get("matrix_page", 1) > matrix.pages:
        st.session_state["matrix_page"] = matrix.pages  # of other rules there were more
    with st.container(horizontal=True, vertical_alignment="bottom"):
        if matrix.pages > 1:
            page = st.number_input(
                f"Page, of {matrix.pages}",
                1,
                matrix.pages,
                key="matrix_page",
                bind="query-params",
                width=140,
            )
        download(
            "HTML, all rules",
            partial(matrix_document, matrix),
            f"{stem}-matrix.html",
            key="matrix_html",
            icon="print",
            meaning="Opens without a network and prints on A4",
        )
        download(
            "PNG, this page",
            partial(picture_of, rule_set, demonstrations, page),
            f"{stem}-matrix-{page}.png",
            key="matrix_png",
            icon="image",
        )
    st.caption(LEGEND)
    st.html(matrix_html(matrix, matrix.page(page)))
