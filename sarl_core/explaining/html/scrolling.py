"""What is wider than the screen says that it scrolls sideways, and only then.

In HTML without script: where there is something to scroll, the scroll itself drives an animation
(in browsers that know it), which fades the side that hides something and shows a line that says so.
"""

from __future__ import annotations

from html import escape

HINT = "Wider than the screen: scroll sideways for the rest."

# The mask is wider than what it covers by one fade, and is moved along as one scrolls: at the start
# the left fade lies outside, at the end the right one. Where nothing scrolls, both do.
WIDE_STYLE = """<style>
.sarl-wide-box { timeline-scope: --sarl-wide; }
.sarl-wide { overflow-x: auto; max-width: 100%; scroll-timeline: --sarl-wide inline; }
.sarl-wide-hint { max-height: 0; overflow: hidden; visibility: hidden; font-size: 0.8rem;
  line-height: 1.4; opacity: 0.7; }
@keyframes sarl-wide { from { mask-size: calc(100% + 40px) 100%; mask-position: -40px 0; }
  to { mask-size: calc(100% + 40px) 100%; mask-position: 0 0; } }
@keyframes sarl-wide-hint { from, to { max-height: 3rem; margin-bottom: 0.4rem;
  visibility: visible; } }
@supports (animation-timeline: scroll()) {
  .sarl-wide { animation: sarl-wide linear; animation-timeline: --sarl-wide;
    mask: linear-gradient(to right, transparent, #000000 40px, #000000 calc(100% - 40px),
      transparent) -40px 0 / calc(100% + 80px) 100% no-repeat; }
  .sarl-wide-hint { animation: sarl-wide-hint linear; animation-timeline: --sarl-wide; } }
@media print { .sarl-wide { overflow: visible; mask: none; animation: none; }
  .sarl-wide-hint { display: none; } }
</style>"""


def wide_html(inner: str, label: str) -> str:
    """Something that scrolls sideways within itself where there is not enough room.

    Args:
        inner: HTML of it.
        label: What it shows, for those who do not see it.

    Returns:
        HTML; `WIDE_STYLE` has to stand before the first. Keys scroll it, too.
    """
    return (
        f'<div class="sarl-wide-box"><div class="sarl-wide-hint">{HINT}</div>'
        f'<div class="sarl-wide" role="region" tabindex="0" aria-label="{escape(label)}">'
        f"{inner}</div></div>"
    )
