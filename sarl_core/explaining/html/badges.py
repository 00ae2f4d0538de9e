"""Small words on coloured ground that say how rules met an action, in HTML without script."""

from __future__ import annotations

from html import escape
from typing import Literal

Ground = Literal["changed", "allowed", "beyond", "plain"]

BADGE_STYLE = """<style>
.sarl-badge { display: inline-block; padding: 0 0.5rem; border-radius: 0.5rem;
  margin-right: 0.4rem; font-size: 0.85rem; background: rgba(128,140,150,0.18); }
.sarl-changed { background: rgba(213,94,0,0.2); }
.sarl-allowed { background: rgba(0,158,115,0.2); }
.sarl-beyond { background: rgba(194,24,91,0.2); }
</style>"""


def badge(text: str, ground: Ground = "plain") -> str:
    """A badge.

    Args:
        text: What it says.
        ground: What its colour says.

    Returns:
        HTML; `BADGE_STYLE` has to stand before the first.
    """
    return f'<span class="sarl-badge sarl-{ground}">{escape(text)}</span>'
