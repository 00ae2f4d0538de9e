"""Who stands for rules, in a sentence."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any


@dataclass(frozen=True)
class Approval:
    """That somebody has approved something by name.

    Attributes:
        author: Who.
        note: What was said to it.
        created: When.
    """

    author: str
    note: str
    created: datetime

    @property
    def document(self) -> dict[str, Any]:
        """Itself as JSON has it."""
        return {"author": self.author, "note": self.note, "created": self.created.isoformat()}


@dataclass(frozen=True)
class SignOff:
    """Who approved a rule set as it stands, as far as it is known here.

    Attributes:
        approvals: The first first, one an author; () where nobody did.
        is_known: Whether a library holds these very rules.
    """

    approvals: tuple[Approval, ...] = ()
    is_known: bool = False


def sign_off_of(approvals: Iterable[Approval]) -> SignOff:
    """The sign-off of rules that a library holds, perhaps several times.

    Args:
        approvals: Of each time that they are in it.

    Returns:
        Of each author what was said last.
    """
    latest = {one.author: one for one in sorted(approvals, key=lambda one: one.created)}
    return SignOff(tuple(sorted(latest.values(), key=lambda one: one.created)), is_known=True)


def sign_off_text(sign_off: SignOff | None) -> str:
    """Whether rules are approved, in a sentence.

    Args:
        sign_off: Of the rules; None where it could not be looked up.

    Returns:
        As "Approved by Ada on 3 May 2026: held against the logs." (the day in UTC, so that it is
        one day everywhere), a sentence an author; "Not approved by anybody."; "" for None.
    """
    if sign_off is None:
        return ""
    return " ".join(map(approval_text, sign_off.approvals)) or "Not approved by anybody."


def approvals_document(sign_off: SignOff | None) -> list[dict[str, Any]] | None:
    """Who approved rules, as JSON has it.

    Args:
        sign_off: Of the rules; None where it could not be looked up.

    Returns:
        None where no library that is known here holds these rules.
    """
    if sign_off is None or not sign_off.is_known:
        return None
    return [one.document for one in sign_off.approvals]


def approval_text(approval: Approval) -> str:
    """That somebody has approved something, as a sentence of `sign_off_text`."""
    created = approval.created.astimezone(UTC)
    text = f"Approved by {_line(approval.author)} on {created.day} {created:%B %Y}"
    if note := _line(approval.note):
        text += f": {note}"
    return text if text.endswith((".", "!", "?")) else f"{text}."


def _line(text: str) -> str:
    """Text from people on one line, without signs that cannot be seen."""
    return " ".join("".join(sign if sign.isprintable() else " " for sign in text).split())
