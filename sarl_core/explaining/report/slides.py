"""A report as slides: what it comes to, one rule each, how sure it is, and what to decide."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from typing import Any

from sarl_core.explaining.templates import render, whole_percents

BESIDE_RULES = 5
"""How many slides there are beside those of the rules."""


def slides_document(parts: Mapping[str, Any]) -> str:
    """Slides of the rules that a report has in full.

    Args:
        parts: What the report's own template is filled with.

    Returns:
        One HTML document that opens without a network. Its only script turns the slides, and no
        other is let run.
    """
    code = render("documents/slides_script")
    digest = base64.b64encode(hashlib.sha256(code.encode()).digest()).decode("ascii")
    cards = [card for group in parts["rules"].groups for card in group.cards]
    return whole_percents(
        render("documents/slides", **parts, cards=cards, code=code, code_digest=digest)
    )
