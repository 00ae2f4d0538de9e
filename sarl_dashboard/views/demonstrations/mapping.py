"""The form that asks which column of an uploaded table is what."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import streamlit as st

from sarl_core.demonstrations.formats import ColumnPreview, ColumnRole
from sarl_core.demonstrations.formats.mapping.joined import never_together
from sarl_core.demonstrations.formats.mapping.roles import TOGETHER, RoleName, roles_document
from sarl_core.errors import InputError

FEATURES, ACTIONS = "map_observations", "map_actions"
SINGLE_COLUMNS: dict[RoleName, str] = {
    "episode": "Episode: which run a row is of",
    "step": "Step: which row of the run",
    "reward": "Reward",
    "terminated": "Ended by itself",
    "truncated": "Ended by a limit",
    "first": "First of its run",
    "last": "Last of its run",
    "time": "Time",
}
_KINDS = {"labels": "one of several choices", "continuous": "an amount"}
_MOST_UNITS = 40  # features whose units are asked for one by one
_MOST_KINDS = 12


def fill_in(previews: Sequence[ColumnPreview]) -> None:
    """Choose what the columns seem to be, before the form is drawn for the first time.

    Args:
        previews: Of the uploaded table.
    """
    by_role: dict[str, list[ColumnPreview]] = {}
    for one in previews:
        if one.role is not None:
            by_role.setdefault(one.role.role, []).append(one)
    state = st.session_state
    state[FEATURES] = [one.name for one in by_role.get("feature", ())]
    state[ACTIONS] = [one.name for one in by_role.get("action", ())]
    for role in SINGLE_COLUMNS:
        state[f"map_{role}"] = next((one.name for one in by_role.get(role, ())), None)
    state["map_together"] = False
    for one in previews:
        kind = one.role.kind if one.role is not None else None
        state[f"map_kind {one.name}"] = kind or one.kind_as_action
        state[f"map_unit {one.name}"] = one.role.unit if one.role is not None else ""
        state[f"map_low {one.name}"] = state[f"map_high {one.name}"] = None


def mapping_form(previews: Sequence[ColumnPreview], read: Callable[[], None]) -> None:
    """Ask which column is what.

    Args:
        previews: Of the uploaded table.
        read: Reads it with what is chosen then.
    """
    names = [one.name for one in previews]
    by_name = {one.name: one for one in previews}
    with st.container(border=True):
        st.markdown("**Which column is what?**")
        _preview(previews)
        st.multiselect(
            "Features: what the expert saw, in their order",
            names,
            key=FEATURES,
            on_change=_claim,
            args=(FEATURES,),
        )
        st.multiselect(
            "Actions: what the expert did", names, key=ACTIONS, on_change=_claim, args=(ACTIONS,)
        )
        _ask_kinds([by_name[name] for name in st.session_state[ACTIONS]])
        with st.grid("auto", min_column_width=190):
            for role, label in SINGLE_COLUMNS.items():
                key = f"map_{role}"
                st.selectbox(
                    label,
                    names,
                    key=key,
                    placeholder="none",
                    index=None,
                    on_change=_claim,
                    args=(key,),
                )
        _ask_units(st.session_state[FEATURES])
        st.caption("A column that is chosen nowhere is not used.")
        with st.container(horizontal=True):
            st.button("Read with these columns", on_click=read, type="primary")
            if st.session_state[FEATURES] and st.session_state[ACTIONS]:
                st.download_button(
                    "Save as columns.json",
                    lambda: roles_document(chosen_roles(names), {}),
                    "columns.json",
                    on_click="ignore",
                    help="For the command line: `--columns columns.json`.",
                )


def chosen_roles(names: Sequence[str]) -> dict[str, ColumnRole]:
    """What was chosen in the form.

    Args:
        names: All columns of the table.

    Returns:
        The role of each.

    Raises:
        InputError: If nothing was chosen as a feature, or as an action.
    """
    state = st.session_state
    features, actions = state[FEATURES], state[ACTIONS]
    if not features or not actions:
        raise InputError(
            f"there are no {'actions' if features else 'features'} in the form; choose at least "
            "one column"
        )
    roles = {
        name: ColumnRole("feature", unit=str(state.get(f"map_unit {name}") or "").strip())
        for name in features
    }
    if len(actions) > 1 and state.get("map_together"):
        roles[TOGETHER.join(actions)] = ColumnRole("action")
    else:
        roles |= {name: _action(name) for name in actions}
    for role in SINGLE_COLUMNS:
        column = state[f"map_{role}"]
        if column is not None:
            roles[column] = ColumnRole(role)
    used = {*features, *actions, *roles}
    return roles | {name: ColumnRole("ignore") for name in names if name not in used}


def _action(name: str) -> ColumnRole:
    """The role of one action, with its bounds if it is an amount."""
    state = st.session_state
    kind = state.get(f"map_kind {name}")
    if kind != "continuous":
        return ColumnRole("action", kind=kind)
    return ColumnRole(
        "action", kind=kind, low=state.get(f"map_low {name}"), high=state.get(f"map_high {name}")
    )


def _claim(key: str) -> None:
    """Let what was chosen in one field leave the others: a column is one thing."""
    state = st.session_state
    chosen = state[key]
    claimed = set(chosen if isinstance(chosen, list) else [chosen])
    for other in (FEATURES, ACTIONS):
        if other != key:
            state[other] = [name for name in state[other] if name not in claimed]
    for role in SINGLE_COLUMNS:
        other = f"map_{role}"
        if other != key and state[other] in claimed:
            state[other] = None


def _preview(previews: Sequence[ColumnPreview]) -> None:
    st.dataframe(
        {
            "Column": [one.name for one in previews],
            "First rows": [",  ".join(one.first) for one in previews],
            "Holds": [one.holds for one in previews],
            "Seems to be": [
                "unclear" if one.role is None else _SEEMS.get(one.role.role, one.role.role)
                for one in previews
            ],
            "Why": [one.why for one in previews],
        },
        hide_index=True,
        height="content" if len(previews) <= 12 else 460,
    )


_SEEMS = {"ignore": "not used", "terminated": "ended by itself", "truncated": "ended by a limit"}


def _ask_kinds(actions: Sequence[ColumnPreview]) -> None:
    """Ask whether numbers are choices or amounts, and whether columns of 1 and 0 are one action."""
    if never_together([one.ones for one in actions]):
        st.toggle(
            "These columns are one action: never are two of them 1 in the same row",
            key="map_together",
        )
        if st.session_state["map_together"]:
            return
    for one in actions[:_MOST_KINDS]:
        if one.kind_as_action is None:
            continue
        with st.container(horizontal=True, vertical_alignment="bottom"):
            st.segmented_control(
                f"{one.name} is",
                list(_KINDS),
                format_func=_KINDS.__getitem__,
                key=f"map_kind {one.name}",
                required=True,
            )
            if st.session_state[f"map_kind {one.name}"] == "continuous":
                for end, label in (("low", "Least possible"), ("high", "Greatest possible")):
                    st.number_input(
                        f"{label} {one.name}",
                        value=None,
                        key=f"map_{end} {one.name}",
                        placeholder="as demonstrated",
                        width=220,
                    )


def _ask_units(features: Sequence[str]) -> None:
    if not 0 < len(features) <= _MOST_UNITS:
        return
    with st.expander("Units (optional)"), st.grid("auto", min_column_width=150):
        for name in features:
            st.text_input(name, key=f"map_unit {name}", placeholder="as m/s", max_chars=24)
