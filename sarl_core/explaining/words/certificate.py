"""What a certificate says and does not say, in sentences."""

from __future__ import annotations

from sarl_core.mining.language import counted
from sarl_core.rollouts.failures import rate_text
from sarl_core.studies.certificate import Certificate, Subject
from sarl_core.studies.sequential_test import SequentialTest, Verdict

LIMITS = (
    "It is a statement about episodes that begin as these did, about this agent, these rules and "
    "this version of the environment, and about nothing else; it does not say how bad a failure is."
)


def percent_text(share: float) -> str:
    """A share as it was asked for, with all its digits.

    Args:
        share: 0 to 1.

    Returns:
        As "0.1 %".
    """
    return f"{round(100 * share, 10):g} %"


def verdict_text(certificate: Certificate) -> str:
    """What has been shown, in one sentence.

    Args:
        certificate: Whatever its verdict.

    Returns:
        As "Certified with 95 % certainty: at most 1 % of the episodes fail.".
    """
    test, certified = certificate.test, certificate.verdict.certified
    if certified is None:
        return (
            f"Undecided after {counted(certificate.verdict.episodes, 'episode')}: neither that at "
            f"most {percent_text(test.at_most)} of the episodes fail is shown, nor that more do."
        )
    word, than = ("Certified", "at most") if certified else ("Refused", "more than")
    return (
        f"{word} with {percent_text(test.certainty)} certainty: {than} "
        f"{percent_text(test.at_most)} of the episodes fail."
    )


def subject_text(subject: Subject) -> str:
    """Who was tested where.

    Args:
        subject: Of a certificate.

    Returns:
        As "novice in CartPole-v1, shielded by 2 rules".
    """
    return f"{subject.agent} in {subject.env_id}, shielded by {counted(subject.rules, 'rule')}"


def certificate_facts(certificate: Certificate) -> list[tuple[str, str]]:
    """What was tested, and what came of it.

    Args:
        certificate: Whatever its verdict.

    Returns:
        Names and values.
    """
    subject = certificate.subject
    facts = [
        ("verdict", verdict_text(certificate)),
        ("tested", subject_text(subject)),
        ("a failure is", subject.failure),
        ("failures", rate_text(certificate.rate)),
        ("seeds", f"{certificate.seed} to {certificate.last_seed}"),
        ("rules", subject.rules_digest),
    ]
    if subject.agent_digest:
        facts.append(("agent", subject.agent_digest))
    facts.append(("environment", subject.package or "of a package that is not known"))
    facts += [("note", note) for note in certificate.notes]
    return facts


def progress_text(verdict: Verdict, more: int | None) -> str:
    """How far a test is.

    Args:
        verdict: So far.
        more: Episodes that it takes at least to certify; None where that cannot be any more.

    Returns:
        As "120 episodes, 0 failures, 179 more at least".
    """
    failures = counted(verdict.failures, "failure")
    if verdict.undecided:
        failures += f", {verdict.undecided:,} not known"
    rest = "it cannot be certified any more" if more is None else f"{more:,} more at least"
    return f"{counted(verdict.episodes, 'episode')}, {failures}, {rest}"


def plan_text(test: SequentialTest) -> str:
    """How many episodes a test takes, in one sentence.

    Args:
        test: Before it begins.

    Returns:
        As "Without a failure 299 episodes certify 1 %, with one 1,034; after 2,990 it ends
        undecided.".
    """
    first, *others = test.certified
    then = f", with one {others[0]:,}" if others else ""
    return (
        f"Without a failure {counted(first, 'episode')} certify {percent_text(test.at_most)}"
        f"{then}; after {test.episodes:,} the test ends undecided."
    )
