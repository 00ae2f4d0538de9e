"""Report: the rules in one file, for people who know only the task."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import streamlit as st
from streamlit.runtime.uploaded_file_manager import UploadedFile

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError, SarlError
from sarl_core.explaining.report.comparison import Result, results_from_text
from sarl_core.explaining.report.provenance import command_line, mining_command
from sarl_core.explaining.report.report import Report, Wishes
from sarl_core.explaining.report.tally import report_rules
from sarl_core.explaining.report.thresholds import read_card
from sarl_core.mining.language import counted
from sarl_core.mining.rule_set import RuleSet
from sarl_dashboard.jobs.report import (
    Order,
    Reporting,
    as_results,
    comparison_of_session,
    kept_report,
    order_key,
)
from sarl_dashboard.state.data import (
    UPLOAD,
    chosen_dataset,
    data_key,
    raw_demonstrations,
    require_demonstrations,
)
from sarl_dashboard.state.edits import offered as edits_offered
from sarl_dashboard.state.mined import grown_trees
from sarl_dashboard.state.rule_choice import EDITED, rules_for
from sarl_dashboard.state.rule_files import CHOSEN, COMPACT, OWN_FILE, PAPERS, compact_file
from sarl_dashboard.text import escaped, in_full

JOB = "_job_report"
PREVIEW = 900  # pixels
RULE_SETS = (CHOSEN, *PAPERS, COMPACT, EDITED, OWN_FILE)


@dataclass(frozen=True, eq=False)
class Choices:
    """What the widgets say."""

    rules: str
    rule_file: UploadedFile | None
    in_full: int
    frames: int
    with_session: bool
    files: list[UploadedFile]


# --- what is asked for -------------------------------------------------------------------------


def offered() -> list[str]:
    """The rules one may choose."""
    there = {COMPACT: compact_file().is_file(), EDITED: edits_offered()}
    return [name for name in RULE_SETS if there.get(name, True)]


def settings(has_comparison: bool) -> Choices:
    """The widgets.

    Args:
        has_comparison: Whether this visitor has run one on the page Shield.
    """
    with st.container(border=True):
        with st.grid(3, min_column_width=150, gap="small"):
            rules = st.selectbox(
                "Rules",
                offered(),
                key="report_rules",
                bind="query-params",
                help="At the thresholds: those in the sidebar. Filtered: support 0.005, confidence "
                "0.95. Unfiltered: support 0, confidence 1. Compact: a small set that is shipped "
                "for this task. Edited: those you changed on the page Edit. Own file: rules you "
                "saved.",
            )
            in_full = st.number_input(
                "Rules in full",
                0,
                300,
                60,
                key="in_full",
                bind="query-params",
                help="So many rules with evidence, conditions and pictures, those that apply most "
                "often. The others stand in a table.",
            )
            frames = st.number_input(
                "Pictures a rule",
                0,
                6,
                3,
                key="frames",
                bind="query-params",
                help="States in which the rule applies, from episodes that the shipped expert "
                "plays, or a novice held to the rules.",
            )
        rule_file = None
        if rules == OWN_FILE:
            rule_file = st.file_uploader("Rule file (.json)", key="report_rule_file")
        with_session = False
        if has_comparison:
            with_session = st.checkbox(
                "With the comparison you ran on the page Shield",
                value=True,
                key="with_comparison",
                bind="query-params",
            )
        with st.expander("Add results from files"):
            files = st.file_uploader(
                "CSV of the page Shield, or JSON of `evaluate --json`",
                accept_multiple_files=True,
                key="report_results",
            )
    return Choices(rules, rule_file, int(in_full or 0), int(frames or 0), with_session, files)


def order(choices: Choices, demonstrations: Demonstrations) -> Order:
    """What the widgets ask for.

    Raises:
        InputError: If it cannot be had.
    """
    rule_set, digest = rules_for(choices.rules, choices.rule_file)
    if rule_set is None:
        raise InputError("there are no rules to report; choose some")
    report_rules(rule_set, demonstrations)
    results, result_names = results_of_choices(choices, demonstrations)
    card = chosen_card(choices)
    rules_path, data_path = file_names(choices)
    wishes = Wishes(
        in_full=choices.in_full,
        frames=choices.frames,
        commands=commands(choices, rule_set, demonstrations, rules_path, data_path, result_names),
        rules_name=rules_path.rsplit("/", 1)[-1],
        demonstrations_name=data_path.rsplit("/", 1)[-1],
    )
    grown = None
    if rule_set.cut == "thresholds":
        grown = grown_trees(demonstrations, rule_set.divider)
    key = order_key(f"{digest} {data_key()}", demonstrations, wishes, results)
    return Order(key, rule_set, demonstrations, wishes, card, results, grown)


def results_of_choices(
    choices: Choices, demonstrations: Demonstrations
) -> tuple[tuple[Result, ...], tuple[str, ...]]:
    """The results to show, and the names of their files."""
    found: list[Result] = []
    names = []
    if choices.with_session:
        comparison, name = comparison_of_session(demonstrations.env_id)
        found += as_results(comparison)
        names += [name] if name else []
    for file in choices.files:
        content = file.getvalue()
        try:
            found += results_from_text(content.decode("utf-8-sig"), file.name)
        except UnicodeDecodeError as error:
            raise InputError(f"{file.name} is no text; give a CSV or JSON file") from error
        names.append(file.name)
    return tuple(found), tuple(names)


def chosen_card(choices: Choices) -> Mapping[str, Any] | None:
    """The card of the shipped compact rules."""
    return read_card(compact_file()) if choices.rules == COMPACT else None


def file_names(choices: Choices) -> tuple[str, str]:
    """Of the rules and of the demonstrations, as the command line would name them."""
    name = chosen_dataset()
    data = f"data/demonstrations/{name}.parquet"
    if name == UPLOAD:
        data = str(st.session_state.get("_upload_name") or "demonstrations.parquet")
    rules = "rules.json"
    if choices.rules == COMPACT:
        rules = f"data/rules/{compact_file().name}"
    elif choices.rule_file is not None:
        rules = choices.rule_file.name
    return rules, data


def commands(
    choices: Choices,
    rule_set: RuleSet,
    demonstrations: Demonstrations,
    rules_path: str,
    data_path: str,
    result_names: tuple[str, ...],
) -> tuple[str, ...]:
    """How the report is made again; () where a file alone does not hold what it is made of."""
    raw = raw_demonstrations()
    if raw is None or raw.digest != demonstrations.digest:
        return ()  # episodes are held out or left out, or things have other names
    mined = None
    if choices.rules not in (COMPACT, OWN_FILE):
        mined = mining_command(rule_set, rules_path, data_path, demonstrations)
    again = command_line(
        "report",
        rules_path,
        {
            "--demonstrations": data_path,
            "--comparison": list(result_names),
            "--in-full": None if choices.in_full == Wishes.in_full else choices.in_full,
            "--frames": None if choices.frames == Wishes.frames else choices.frames,
            "--out": "report.html",
        },
    )
    return (mined, again) if mined else (again,)


# --- the work ----------------------------------------------------------------------------------


def job() -> Reporting | None:
    """The report that this visitor asked for last."""
    found = st.session_state.get(JOB)
    return found if isinstance(found, Reporting) else None


def working() -> bool:
    """Whether it is being made."""
    asked = job()
    return asked is not None and asked.running


def start(wanted: Order) -> None:
    """Make a report; for a callback."""
    st.session_state[JOB] = Reporting(wanted)


def bar(wanted: Order, *, made: bool) -> None:
    """The button, or how far the work is."""
    asked = job()
    if asked is not None and asked.running:
        with st.container(horizontal=True, vertical_alignment="center"):
            st.progress(asked.share, asked.text)
            st.button("Cancel", icon=":material/close:", on_click=asked.cancel, key="cancel_report")
        return
    with st.container(horizontal=True, vertical_alignment="center"):
        st.button(
            "Make the report",
            type="primary",
            icon=":material/summarize:",
            key="make_report",
            on_click=start,
            args=(wanted,),
            disabled=made,
        )
        full = min(wanted.wishes.in_full, len(wanted.rule_set))
        told = counted(len(wanted.rule_set), "rule")
        st.caption(
            f"{told}, {full:,} of them in full{'; made already' if made else ''}.",
            width="content",
        )
    if asked is not None and asked.order.key == wanted.key:
        if asked.error is not None:
            st.error(in_full(str(asked.error)), icon=":material/error:")
        elif asked.cancelled and not made:
            st.info("Cancelled; nothing was kept.", icon=":material/pause_circle:")


def show(report: Report, name: str) -> None:
    """The report itself."""
    content = report.html.encode()
    if report.without:
        st.info(f"The report has no pictures: {escaped(report.without)}.", icon=":material/info:")
    with st.container(horizontal=True, vertical_alignment="center"):
        st.download_button(
            "Download the report",
            content,
            f"report-{name}.html",
            "text/html",
            key="report_file",
            on_click="ignore",
            icon=":material/download:",
        )
        st.caption(
            f"One HTML file of {len(content) / 1e6:.1f} MB with "
            f"{counted(report.pictures, 'picture')}. It opens without a network, in any browser, "
            "and prints on A4.",
            width="content",
        )
    # As an address of its own the file has no access to this page, whatever names are in it.
    st.iframe(
        f"data:text/html;base64,{base64.b64encode(content).decode('ascii')}",
        height=PREVIEW,
        alt="The report as it looks in a browser",
    )


# --- the page ----------------------------------------------------------------------------------

st.title("Report")
st.caption(
    "The rules in one file for people who know only the task: what was demonstrated, every rule in "
    "words with its evidence and pictures, what the rules do not reach, and what nobody promises."
)
data = require_demonstrations()
session_comparison, _ = comparison_of_session(data.env_id)
chosen = settings(session_comparison is not None)
if chosen.rules == OWN_FILE and chosen.rule_file is None:
    st.info("Upload the rule file that the report is to be about.", icon=":material/upload_file:")
    st.stop()
try:
    asked_for = order(chosen, data)
except SarlError as error:
    st.error(in_full(str(error)), icon=":material/error:")
    st.stop()
at_work = working()


@st.fragment(run_every=1.0 if at_work else None)
def outcome() -> None:
    """The button or the progress, and the report."""
    if at_work != working():
        st.rerun()  # as a whole: from now on every second, or no longer
    made = kept_report(asked_for.key)
    bar(asked_for, made=made is not None)
    if made is not None and not at_work:
        show(made, chosen_dataset().replace("_", "-"))
    elif not at_work and not asked_for.comparison:
        st.markdown(
            ":material/info: :gray[A report says more with results in it: run agents with the "
            "rules and without on the page Shield first, and come back.]"
        )


outcome()
