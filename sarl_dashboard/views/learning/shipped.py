"""The studies that are shipped, and the commands that make them again."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import streamlit as st

from sarl_core.errors import SarlError
from sarl_core.learning.arms import ARMS
from sarl_core.learning.study_files import LearningStudy, load_study
from sarl_core.mining.language import counted, threshold_text
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_dashboard.cache import cached
from sarl_dashboard.jobs import learning
from sarl_dashboard.state.data import SHIPPED_SETS, uncombined_demonstrations
from sarl_dashboard.state.rule_files import COMPACT_ENDINGS, RULES_FOLDER
from sarl_dashboard.text import escaped, refuse
from sarl_dashboard.views.learning.study import show_study


@cached(show_spinner="Reading the study …")
def shipped(folder: Path, stamp: int) -> LearningStudy:
    """A study that is shipped."""
    return load_study(folder)


def shipped_studies() -> dict[str, LearningStudy]:
    """Those that can be read, by the names of their folders."""
    studies = {}
    for plan in sorted(learning.STUDIES.glob("*/plan.json")):
        try:
            studies[plan.parent.name] = shipped(plan.parent, plan.stat().st_mtime_ns)
        except (SarlError, OSError) as error:
            refuse(error)
    return studies


def title_of(study: LearningStudy) -> str:
    """Environment and rules of a study, in a few words."""
    rules = study.settings.get("rules")
    by = f", {counted(int(rules['count']), 'rule')}" if isinstance(rules, dict) else ""
    return f"{task_of(study)}{by}"


def task_of(study: LearningStudy) -> str:
    """What the task of a study is called."""
    names = {env_id: label for label, env_id in SHIPPED_SETS.values()}
    return names.get(study.env_id, study.env_id)


def show_shipped() -> None:
    """The study that was made for this page."""
    studies = shipped_studies()
    if not studies:
        st.info(
            "No study is shipped. Under “Your own” you can let agents learn here.",
            icon=":material/school:",
        )
        return
    demonstrations = uncombined_demonstrations()
    env_id = demonstrations.env_id if demonstrations is not None else ""
    fitting = [name for name, study in studies.items() if study.env_id == env_id]
    if not fitting:  # what was learned in another task says nothing of this one
        tasks = dict.fromkeys(task_of(study) for study in studies.values())
        st.info(
            f"For {escaped(env_id or 'these data')} no study is shipped: make one under “Your "
            f"own”, or choose other data in the sidebar, such as {escaped(' or '.join(tasks))}.",
            icon=":material/school:",
        )
        return
    name = fitting[0]
    if len(fitting) > 1:
        name = st.segmented_control(
            "Study",
            fitting,
            default=name,
            format_func=lambda each: title_of(studies[each]),
            key=f"study_{name}",
            required=True,
            label_visibility="collapsed",
        )
    study = studies[name]
    show_study(study, "shipped")
    with st.expander("Make it again", icon=":material/terminal:"):
        for command in commands(study):
            st.code(command, language="sh", wrap_lines=True)
        st.caption("The same versions on the same kind of machine give the same numbers.")


def commands(study: LearningStudy) -> list[str]:
    """The command lines that make a study again."""
    rules = study.settings.get("rules")
    first, file = [], ""
    if isinstance(rules, dict):
        shipped_file = shipped_rules().get(str(rules["digest"]))
        file = f" --rules {shipped_file or 'rules.json'}"
        data = {env_id: data for data, (_, env_id) in SHIPPED_SETS.items()}.get(study.env_id, "")
        if shipped_file is None:
            first = [
                f"python -m sarl_core mine data/demonstrations/{data}.parquet --support "
                f"{threshold_text(rules['support'])} --confidence "
                f"{threshold_text(rules['confidence'])} --out rules.json"
            ]
    names = ["all"] if len(study.arms) == len(ARMS) else [arm.name for arm in study.arms]
    arms = " ".join(f"--arm {name}" for name in names)
    return [
        *first,
        f"python -m sarl_core learn --env {study.env_id}{file} {arms} --steps {study.steps} "
        f"--seeds {len(study.seeds)} --figures --out learned",
    ]


@cached()
def shipped_rules() -> dict[str, str]:
    """The shipped rule files, by what tells their rules from others."""
    files = {}
    endings = tuple(f"_{ending}.json" for ending in COMPACT_ENDINGS.values())
    for path in sorted(RULES_FOLDER.glob("*.json")):
        if not path.name.endswith(endings):
            continue
        with suppress(SarlError):
            files[rules_digest(RuleSet.load(path))] = f"data/rules/{path.name}"
    return files
