"""The part of a report that says what is certified of its rules."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from sarl_core.errors import InputError
from sarl_core.explaining.words.certificate import (
    LIMITS,
    certificate_facts,
    subject_text,
    verdict_text,
)
from sarl_core.mining.rule_set import RuleSet, rules_digest
from sarl_core.studies.certificate import Certificate
from sarl_core.studies.certificate_files import certificate_from


@dataclass(frozen=True)
class CertificatesPart:
    """What is certified, or was to be.

    Attributes:
        tables: Of each certificate names and values, the verdict first.
        verdicts: What each has shown of whom, in sentences.
        certified: The agents of whom one holds, by name.
        limits: What none of them says.
    """

    tables: tuple[tuple[tuple[str, str], ...], ...]
    verdicts: tuple[str, ...]
    certified: frozenset[str]
    limits: str = LIMITS

    def holds_for(self, agent: str | None) -> bool:
        """Whether a limit of failures is certified.

        Args:
            agent: Of this agent under the rules; of any where None, as the rules act for all alike.

        Returns:
            False where a test was refused or came to no end.
        """
        return bool(self.certified) if agent is None else agent in self.certified


def certificates_part(
    rule_set: RuleSet, given: Sequence[Certificate], card: Mapping[str, Any] | None
) -> CertificatesPart:
    """What is certified of rules.

    Args:
        rule_set: As they were given.
        given: Certificates to show.
        card: Of the rule file, which may hold one under `certificate`; None without a card.

    Returns:
        The part of the report.

    Raises:
        InputError: If a certificate is of other rules.
    """
    digest = rules_digest(rule_set)
    for one in given:
        if one.subject.rules_digest != digest:
            raise InputError(
                f"the certificate is of other rules ({one.subject.rules_digest}) than the report "
                f"({digest}); certify these with `sarl certify`, or leave it out"
            )
    carried: list[Certificate] = []
    with suppress(InputError):  # a card says what it can
        carried.append(certificate_from((card or {}).get("certificate"), name="the card"))
    known = [one for one in carried if one.subject.rules_digest == digest]
    every = dict.fromkeys((*given, *known))
    return CertificatesPart(
        tuple(_table(one) for one in every),
        tuple(f"{verdict_text(one)} Tested was {subject_text(one.subject)}." for one in every),
        frozenset(one.subject.agent for one in every if one.verdict.certified),
    )


def _table(certificate: Certificate) -> tuple[tuple[str, str], ...]:
    facts = [
        (f"{name[0].upper()}{name[1:]}", value) for name, value in certificate_facts(certificate)
    ]
    if certificate.made:
        facts.append(("Made", certificate.made))
    if certificate.command:
        facts.append(("Made by", certificate.command))
    return tuple(facts)
