"""What the page Measure certifies: that a shielded agent fails in at most so many episodes."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import replace

import streamlit as st

from sarl_core.environments.environment import as_environment
from sarl_core.environments.failures import no_failures_text
from sarl_core.errors import SarlError
from sarl_core.explaining.words.certificate import (
    LIMITS,
    certificate_facts,
    plan_text,
    progress_text,
    verdict_text,
)
from sarl_core.rollouts.seeds import CERTIFIED
from sarl_core.studies.certificate import Certificate
from sarl_core.studies.certificate_files import certificate_to_json
from sarl_core.studies.sequential_test import SequentialTest, sequential_test
from sarl_dashboard.components.downloads import download
from sarl_dashboard.components.journey.words import with_words
from sarl_dashboard.components.keeping import keep_result_button
from sarl_dashboard.components.run_bar import Offer, bars_at_work, run_bar, watched
from sarl_dashboard.jobs.certificates import CERTIFICATE, WantedCertificate, certifying
from sarl_dashboard.state.agents import AGENTS
from sarl_dashboard.text import escaped, refuse
from sarl_dashboard.views.shield.lines import ShieldLine

CERTAINTIES = (90, 95, 99)
_ICONS = {True: "verified", False: "gpp_bad", None: "pending"}


def certify_section(lines: Sequence[ShieldLine]) -> None:
    """The form, the button or the progress, and what came of it.

    Args:
        lines: What the page compares; those with rules can be certified.
    """
    st.header("Certify")
    st.caption(
        "Whether at most so many episodes of a shielded agent fail: a test that stops as soon as "
        "it is shown. What is certified holds for this agent, these rules and episodes that begin "
        "as these do; not for any other, and it does not say how bad a failure is."
    )
    shielded = [line for line in lines if line.arm.rules is not None]
    if not shielded:
        st.caption("Choose a shield above: there is none to certify.")
        bars_at_work(CERTIFICATE)
        return
    if why := no_failures_text(shielded[0].row.env_id):
        st.info(f"There is nothing to certify: {why}.", icon=":material/block:")
        bars_at_work(CERTIFICATE)
        return
    line, at_most, certainty = _choices(shielded)
    try:
        wanted = _wanted(line, sequential_test(at_most, certainty))
    except SarlError as error:
        refuse(error)
        bars_at_work(CERTIFICATE)
        return

    def outcome(at_work: bool) -> None:
        verdict = wanted.verdict
        complete = verdict.certified is not None or verdict.episodes == wanted.test.episodes
        about = plan_text(wanted.test)
        if verdict.episodes and not complete:
            more = wanted.test.least_more(verdict.episodes, verdict.failures + verdict.undecided)
            about = f"So far {progress_text(verdict, more)}."
        run_bar(
            CERTIFICATE,
            Offer(
                key=wanted.key,
                start=lambda: certifying(wanted),
                about=about,
                complete=complete,
                cancelled="Cancelled. The episodes that had been finished are kept; Certify goes "
                "on from there.",
                label="Certify",
                icon=":material/verified:",
                type="secondary",
            ),
        )
        if complete:
            _show(wanted.certificate())

    watched(CERTIFICATE, outcome)


def _choices(shielded: Sequence[ShieldLine]) -> tuple[ShieldLine, float, float]:
    """Which agent and shield, the rate, and the certainty."""
    by_name = {line.row.name: line for line in shielded}
    with st.grid(3, min_column_width=150, gap="small"):
        name = st.selectbox(
            "Certify which",
            list(by_name),
            key="certify_which",
            bind="query-params",
            help=with_words("One agent with one of the shields above."),
        )
        at_most = st.number_input(
            "At most, % of the episodes",
            0.0,
            50.0,
            1.0,
            step=0.1,
            format="%g",
            key="at_most",
            bind="query-params",
            help=with_words(
                "The rate of failures that is to be certified. Without a failure 299 episodes "
                "certify 1 %, and 2,995 certify 0.1 %, with 95 % certainty."
            ),
        )
        certainty = st.selectbox(
            "Certainty, %",
            CERTAINTIES,
            index=1,
            key="certainty",
            bind="query-params",
            help=with_words(
                "How rarely such a test misleads: at 95 % at most one in twenty certifies a rate "
                "that is higher, and one in twenty refuses one that is not."
            ),
        )
    return by_name[name], round(float(at_most or 0.0) / 100, 10), certainty / 100


def _wanted(line: ShieldLine, test: SequentialTest) -> WantedCertificate:
    """What is asked for, on seeds that nothing was chosen by."""
    row = replace(line.row, seed=CERTIFIED, agent=replace(line.chosen, seed=CERTIFIED))
    return WantedCertificate(row, test, _command(line, test))


def _command(line: ShieldLine, test: SequentialTest) -> str:
    """What certifies the same rules from their file; "" where the agent has no name there."""
    if line.agent not in AGENTS:
        return ""
    words = ["certify", *as_environment(line.row.env_id).words, "--rules", "rules.json"]
    words += ["--at-most", f"{test.at_most:g}", "--certainty", f"{test.certainty:g}"]
    words += ["--agent", line.agent, "--seed", str(CERTIFIED)]
    if line.row.projection != "centre":
        words += ["--projection", line.row.projection]
    if line.row.outside != "act":
        words += ["--outside", line.row.outside]
    return f"python -m sarl_core {shlex.join(words)}"


def _show(certificate: Certificate) -> None:
    """The verdict, what was tested, and the file."""
    certified = certificate.verdict.certified
    say = {True: st.success, False: st.warning, None: st.info}[certified]
    say(
        f"**{escaped(verdict_text(certificate))}** {LIMITS}",
        icon=f":material/{_ICONS[certified]}:",
    )
    facts = certificate_facts(certificate)[1:]
    st.dataframe(
        {"What": [name.capitalize() for name, _ in facts], "Value": [value for _, value in facts]},
        hide_index=True,
        height="content",
        key="certificate_table",
    )
    name = certificate.subject.env_id.rsplit("/", 1)[-1].rsplit(":", 1)[-1]
    file = f"certificate-{name}-{certificate.subject.rules_digest[:8]}.json"
    with st.container(horizontal=True):
        content = certificate_to_json(certificate)
        download("Download certificate", lambda: content, file, key="certificate_json")
        keep_result_button(content, file, key="keep_certificate")
