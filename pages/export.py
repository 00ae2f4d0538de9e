"""Export: the rules as code, as a table, and on paper; rounded to what changes no decision."""

from __future__ import annotations

from functools import partial

import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import SarlError
from sarl_core.explaining.exports.export import Prepared, vectors_name
from sarl_core.explaining.html.rule_matrix import LEGEND, matrix_document, matrix_html
from sarl_core.mining.editing.rounding import digits_of
from sarl_core.mining.language import counted
from sarl_core.mining.rules import RuleSet
from sarl_core.shielding.projection import Projection
from sarl_dashboard.components.settings import offered_rule_sets, projection_choice
from sarl_dashboard.state import compact_set
from sarl_dashboard.state.agents import PROJECTIONS
from sarl_dashboard.state.data import all_demonstrations, require_demonstrations
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE
from sarl_dashboard.text import file_name, in_full
from sarl_dashboard.views.export.files import (
    MIMES,
    PREVIEW,
    content_of,
    matrix_of,
    picture_of,
    prepared_for,
    vectors_of,
)

FORMATS = {
    "JSON": ".json",
    "CSV": ".csv",
    "Markdown": ".md",
    "Python": ".py",
    "C": ".c",
    "ONNX": ".onnx",
}
WHAT = {
    "JSON": "The rule file: every number in full, as it stands; all of this project reads it.",
    "CSV": "A line a rule, for a spreadsheet.",
    "Markdown": "A table for a wiki or a repository.",
    "Python": "One function that needs nothing but Python 3.",
    "C": "One function in C99 that needs nothing but the language.",
    "ONNX": "A model for ONNX runtimes; writing it needs the package onnx.",
}
FILE, MATRIX = "File", "Rules by features"
LINES = 120


def chosen_rules() -> tuple[RuleSet, str]:
    """The rules to carry away; where there are none to be had, say why and stop."""
    choices = offered_rule_sets([CHOSEN, COMPACT, EDITED, OWN_FILE])
    default = COMPACT if compact_set.in_force() and COMPACT in choices else CHOSEN
    choice = st.selectbox(
        "Rules",
        choices,
        index=choices.index(default),
        key="carry",
        bind="query-params",
        help="At the thresholds: those in the sidebar. Compact: a small set that is shipped for "
        "this environment. Edited: as they stand on the Edit page. Own file: rules you saved.",
    )
    uploaded = None
    if choice == OWN_FILE:
        uploaded = st.file_uploader("Rule file (.json)", key="carry_file")
        if uploaded is None:
            st.info("Upload a rule file to export its rules.", icon=":material/upload_file:")
            st.stop()
    try:
        rule_set, digest = rules_for(choice, uploaded)
    except SarlError as error:
        st.error(in_full(str(error)), icon=":material/error:")
        st.stop()
    assert rule_set is not None
    return rule_set, digest


def say_rounding(prepared: Prepared, demonstrations: Demonstrations) -> None:
    """What rounding did, and which thresholds stayed."""
    rounding = prepared.rounding
    if rounding is None:
        return
    with st.grid(3, min_column_width=150, gap="small"):
        st.metric("Decisions changed", f"{prepared.changed:,}", border=True)
        st.metric("Thresholds rounded", f"{rounding.rounded:,}", border=True)
        st.metric("Left as they are", f"{len(rounding.kept):,}", border=True)
    st.caption(
        f"Counted with the shield itself on {counted(len(demonstrations), 'demonstrated step')}: "
        "each is decided by the same rule, with the same action, before and after."
        if not prepared.changed
        else "Some decisions changed; export without rounding."
    )
    if rounding.kept:
        with st.expander(f"{counted(len(rounding.kept), 'threshold')} left as they are"):
            st.dataframe(
                {
                    "Feature": [
                        prepared.rule_set.source.features[kept.feature].name
                        for kept in rounding.kept
                    ],
                    "Threshold": [repr(kept.threshold) for kept in rounding.kept],
                    "Digits": [digits_of(kept.threshold) for kept in rounding.kept],
                    "Why": [kept.why for kept in rounding.kept],
                    "Rules": [", ".join(kept.rules[:5]) for kept in rounding.kept],
                },
                hide_index=True,
                height="content" if len(rounding.kept) <= 10 else 380,
            )


def show_file(prepared: Prepared, key: str, form: str, projection: Projection, name: str) -> None:
    """The file: its beginning, and the downloads."""
    suffix = FORMATS[form]
    try:
        content = content_of((key, suffix, projection), suffix, projection, prepared.rule_set)
    except SarlError as error:
        st.error(in_full(str(error)), icon=":material/error:")
        return
    whole = f"{name}{suffix}"
    with st.container(horizontal=True, vertical_alignment="center"):
        st.download_button(
            f"Download {suffix}",
            content,
            file_name=whole,
            mime=MIMES[suffix],
            type="primary",
            on_click="ignore",
            icon=":material/download:",
            key="carry_download",
        )
        st.download_button(
            "Test vectors",
            partial(vectors_of, (key, projection), projection, prepared.rule_set),
            file_name=vectors_name(whole),
            mime="text/csv",
            on_click="ignore",
            icon=":material/fact_check:",
            key="carry_vectors",
            help="States at every threshold and one step either side, with the rule and the action "
            "that must come out",
        )
        st.caption(f"{WHAT[form]} {len(content) / 1024:,.1f} kB.")
    if suffix == ".onnx":
        kind = "int64" if not prepared.rule_set.actions[0].is_interval else "float32"
        st.markdown(
            f"Inputs: `state` (B, {len(prepared.rule_set.source.features)}) float32 and `proposed` "
            f"(B, {len(prepared.rule_set.actions)}) {kind}. Outputs: `executed`, alike, `rule` "
            "int64, the index of the rule in force or -1, and `invalid` (B, 1), whether the state "
            "or the action is none that the rules can be asked about."
        )
        return
    lines = content.decode().splitlines()
    st.code("\n".join(lines[:LINES]), language=PREVIEW[suffix], height=460, line_numbers=True)
    if len(lines) > LINES:
        st.caption(f"The first {LINES} of {len(lines):,} lines.")


def show_matrix(prepared: Prepared, key: str, name: str, demonstrations: Demonstrations) -> None:
    """Rules by features, a page at a time."""
    matrix = matrix_of((key, demonstrations.digest), prepared.rule_set, demonstrations)
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
        st.download_button(
            "HTML, all rules",
            partial(matrix_document, matrix),
            file_name=f"{name}-matrix.html",
            mime="text/html",
            on_click="ignore",
            icon=":material/print:",
            key="matrix_html",
            help="Opens without a network and prints on A4",
        )
        st.download_button(
            "PNG, this page",
            partial(picture_of, (key, demonstrations.digest, page), matrix, page),
            file_name=f"{name}-matrix-{page}.png",
            mime="image/png",
            on_click="ignore",
            icon=":material/image:",
            key="matrix_png",
        )
    st.caption(LEGEND)
    st.html(matrix_html(matrix, matrix.page(page)))


@st.fragment
def export(demonstrations: Demonstrations) -> None:
    """The settings and what comes of them; nothing else on the page does."""
    with st.container(border=True):
        left, middle, right = st.columns([4, 5, 3], gap="medium")
        with left:
            rules, digest = chosen_rules()
        with middle:
            chosen = st.pills(
                "Format",
                list(FORMATS),
                default="JSON",
                key="format",
                bind="query-params",
                required=True,
                wrap=True,  # else the last ones are cut off on a telephone
            )
            form = chosen or "JSON"  # a link may end in "format="
            projection: Projection = PROJECTIONS[0]
            if rules.actions[0].is_interval and form in ("Python", "C", "ONNX"):
                projection = projection_choice()
        with right:
            rounded = st.toggle(
                "Round thresholds",
                value=True,
                key="rounded",
                bind="query-params",
                help="To the fewest digits that change no decision on the demonstrations",
            )
            merged = st.toggle(
                "Merge conditions",
                key="merged",
                bind="query-params",
                help="Several conditions on one feature become one interval, and each rule stands "
                "by itself: easier to read, slower to execute",
            )
    everything = all_demonstrations()
    assert everything is not None
    key = repr((digest, everything.digest if rounded else "", merged))
    try:
        carried = prepared_for(key, rules, everything if rounded else None, merged=merged)
    except SarlError as error:
        more = " Or switch rounding off." if rounded and rules.rules else ""
        st.error(f"{in_full(str(error))}{more}", icon=":material/error:")
        return
    say_rounding(carried, everything)
    view = st.segmented_control(
        "View",
        [FILE, MATRIX],
        default=FILE,
        key="carry_view",
        bind="query-params",
        required=True,
        label_visibility="collapsed",
    )
    stem = f"rules-{file_name(rules.source.env_id)}"
    if view == MATRIX:
        show_matrix(carried, key, stem, demonstrations)
    else:
        show_file(carried, key, form, projection, stem)


st.title("Export")
st.caption(
    "Carry the rules into other code, onto paper, or to somebody else, and check with test vectors "
    "that they decide there as here. The rules are learned from demonstrations: they guarantee "
    "nothing."
)
export(require_demonstrations())
