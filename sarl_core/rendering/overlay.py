"""The strips above and below a scene: who acts, how it stands, and what the shield does and why.

They extend the picture and cover nothing of it. Everything they say is of the step that is shown:
text that stayed longer would name rules that are no longer in force. Who wants to read it pauses.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sarl_core.agents.spaces import Actions
from sarl_core.decimals import rounded_text
from sarl_core.mining.action_words import done_text
from sarl_core.mining.labels import LabelledDimension
from sarl_core.rendering.canvas import INKS, PAPER_INDEX, TRACK_INDEX, Canvas, fitted, wrapped
from sarl_core.rendering.film import Film
from sarl_core.rollouts.steps import StepTable

TOP, BOTTOM = 56, 128  # heights of the strips
GAP = 16  # between two panels
LEAST_WIDTH = 440  # a narrower scene is enlarged, so that the text has room

_MARGIN = 14
_BAR = 6
_SMALL, _LINE, _LINES = 13, 17, 4  # of the reason: size, from line to line, most lines
_MINUS = re.compile(r"(?<![\w.])-(?=\.?\d|infinite)")


@dataclass(frozen=True, eq=False)
class Panel:
    """One episode as a picture.

    Attributes:
        title: As "novice, shielded".
        subtitle: As "LunarLander-v3 · seed 1".
        film: T + 1 scenes: one before each step, and the last state.
        steps: The T steps.
        shielded: Whether there was a shield.
        describe_rule: A sentence for the index of a rule.
        dimensions: Of the actions, with their names.
        fps: Pictures a second.
    """

    title: str
    subtitle: str
    film: Film
    steps: StepTable
    shielded: bool
    describe_rule: Callable[[int], str]
    dimensions: tuple[LabelledDimension, ...]
    fps: float

    @property
    def scale(self) -> int:
        """How many times larger a scene is shown."""
        return -(-LEAST_WIDTH // self.film.size[1])

    @property
    def size(self) -> tuple[int, int]:
        """Height and width with the strips."""
        height, width = self.film.size
        return TOP + height * self.scale + BOTTOM, width * self.scale

    def picture(self, number: int) -> NDArray[np.uint8]:
        """Scene and strips.

        Args:
            number: 0 to T; T and more show the last state.

        Returns:
            Indexes into the film's palette, shape `size`.
        """
        number = min(number, len(self.steps))
        scene = self.film.indexes(number)
        if self.scale > 1:
            scene = scene.repeat(self.scale, axis=0).repeat(self.scale, axis=1)
        height, width = self.size
        canvas = Canvas(height, width)
        canvas.pixels[TOP : height - BOTTOM] = scene
        self._write_top(canvas, number)
        if number == len(self.steps):
            self._write_end(canvas)
        else:
            self._write_step(canvas, number)
        self._draw_bar(canvas, number)
        return canvas.pixels

    def _write_top(self, canvas: Canvas, number: int) -> None:
        width = canvas.pixels.shape[1]
        right = width - _MARGIN
        canvas.text(
            _MARGIN, 8, fitted(self.title, 18, width - 190, bold=True), 18, INKS.text, bold=True
        )
        canvas.text(_MARGIN, 32, fitted(self.subtitle, 13, width - 190), 13, INKS.quiet)
        gained = rounded_text(float(self._gained[number]), 1)
        canvas.text_right(right, 10, f"return {gained}", 15, INKS.text)
        canvas.text_right(right, 32, f"step {number} of {len(self.steps)}", 13, INKS.quiet)

    def _write_step(self, canvas: Canvas, step: int) -> None:
        top, width = canvas.pixels.shape[0] - BOTTOM, canvas.pixels.shape[1]
        right = width - _MARGIN
        caption = self.caption(step)
        ink, on_ink = {
            "CHANGED": (INKS.changed, INKS.on_changed),
            "AGREES": (INKS.agreed, INKS.on_agreed),
        }.get(caption.mark, (INKS.quiet, INKS.on_quiet))
        left = _MARGIN
        if caption.mark == "CHANGED":
            canvas.box(0, top, width, 4, INKS.changed.full)
        if caption.mark:
            left = canvas.label(left, top + 12, caption.mark, 12, ink, on_ink) + 10
        action = typeset(caption.action)
        canvas.text(
            left, top + 12, fitted(action, 16, right - left, bold=True), 16, INKS.text, bold=True
        )
        ink = INKS.text if caption.has_rule else INKS.quiet
        reason = typeset(caption.reason)
        for line, text in enumerate(wrapped(reason, _SMALL, width - 2 * _MARGIN, _LINES)):
            canvas.text(_MARGIN, top + 40 + _LINE * line, text, _SMALL, ink)

    def _write_end(self, canvas: Canvas) -> None:
        top, count = canvas.pixels.shape[0] - BOTTOM, len(self.steps)
        left = canvas.label(_MARGIN, top + 12, "ENDED", 12, INKS.text, INKS.on_text) + 10
        gained = rounded_text(float(self._gained[-1]), 1)
        canvas.text(
            left, top + 12, f"after {count} steps, return {gained}", 16, INKS.text, bold=True
        )
        if self.shielded:
            changed = int(self.steps.intervened.sum())
            lines = [f"The shield changed {changed} of {count} actions."]
            outside = int(self.steps.outside.sum())
            if outside:
                lines.append(f"At {outside} steps the state was outside the data behind the rule.")
            unchecked = int(self.steps.is_invalid.sum())
            if unchecked:
                lines.append(f"At {unchecked} steps no rule was asked, for want of valid numbers.")
            for line, text in enumerate(lines):
                canvas.text(_MARGIN, top + 40 + _LINE * line, text, _SMALL, INKS.quiet)

    @cached_property
    def _edges(self) -> NDArray[np.int64]:
        """Where each step begins on the bar, and where the last one ends."""
        count = len(self.steps)
        return np.arange(count + 1) * (self.size[1] - 2 * _MARGIN) // max(1, count)

    @cached_property
    def _marks(self) -> NDArray[np.uint8]:
        """The whole bar: at every pixel whether the shield changed, agreed, or had no rule."""
        marks = np.full(self._edges[-1], TRACK_INDEX, dtype=np.uint8)
        kinds = np.where(
            self.steps.intervened,
            INKS.changed.full,
            np.where(self.steps.covered, INKS.agreed.full, INKS.quiet.full),
        )
        # Where several steps share a pixel, a change is shown before anything else.
        for kind in (INKS.quiet.full, INKS.agreed.full, INKS.changed.full):
            for step in np.flatnonzero(kinds == kind).tolist():
                begin, end = int(self._edges[step]), int(self._edges[step + 1])
                marks[begin : max(begin + 1, end)] = kind
        return marks

    @cached_property
    def _gained(self) -> NDArray[np.float64]:
        """The return before each step, and at the end, added up in order."""
        return np.concatenate([[0.0], np.cumsum(self.steps.reward)])

    def _draw_bar(self, canvas: Canvas, number: int) -> None:
        """The steps so far along the whole episode."""
        top, length, reached = self.size[0] - _BAR - 11, len(self._marks), int(self._edges[number])
        canvas.box(_MARGIN, top, length, _BAR, TRACK_INDEX)
        canvas.pixels[top : top + _BAR, _MARGIN : _MARGIN + reached] = self._marks[:reached]
        canvas.box(_MARGIN + min(reached, length - 2), top - 3, 2, _BAR + 6, INKS.text.full)

    def caption(self, step: int) -> Caption:
        """What the strip says of a step.

        Args:
            step: Which.

        Returns:
            Its words.
        """
        done = self.executed_text(step)
        if not self.shielded:
            return Caption("", done, "No shield: every action is executed as proposed.", False)
        invalid = self.steps.invalid[step]
        if invalid is not None:
            reason = f"No rule was asked, and the action stays as it is: {invalid}."
            return Caption("NOT CHECKED", done, reason, False)
        rules = [int(rule) for rule in self.steps.rules[step] if rule >= 0]
        if not rules:
            reason = "No rule applies to this state: the action stays as it is."
            return Caption("NO RULE", done, reason, False)
        outside = bool(self.steps.outside[step])
        if not self.steps.intervened[step]:
            reason = " ".join(map(self.describe_rule, rules))
            if outside:
                reason = (
                    f"Outside the data behind it, the rule leaves the action as it is: {reason}"
                )
                return Caption("ABSTAINS", done, reason, True)
            return Caption("AGREES", done, reason, True)
        proposed, executed = self.steps.proposed[step], self.steps.executed[step]
        changed = np.flatnonzero(proposed != executed).tolist()
        reason = " ".join(self.describe_rule(int(self.steps.rules[step, at])) for at in changed)
        action = (
            f"{self._words(proposed, changed, executed)} → "
            f"{self._words(executed, changed, proposed)}"
        )
        return Caption(
            "CHANGED", action, f"{'Outside the data behind it: ' if outside else ''}{reason}", True
        )

    def executed_text(self, step: int) -> str:
        """The action that the environment got.

        Args:
            step: At which.

        Returns:
            As "fire main engine" or "torque -1.2".
        """
        executed = self.steps.executed[step]
        return self._words(executed, range(len(executed)), executed)

    def _words(self, action: Actions, dimensions: Iterable[int], beside: Actions) -> str:
        return ", ".join(
            done_text(float(action[at]), self.dimensions[at], beside=(float(beside[at]),))
            for at in dimensions
        )


class Caption(NamedTuple):
    """What the lower strip says.

    Attributes:
        mark: CHANGED, AGREES, ABSTAINS, NO RULE, NOT CHECKED, or "" without a shield.
        action: What is done; where it was changed, also what was proposed.
        reason: The rule in force.
        has_rule: Whether `reason` is a rule.
    """

    mark: str
    action: str
    reason: str
    has_rule: bool


def side_by_side_picture(panels: tuple[Panel, ...], number: int) -> NDArray[np.uint8]:
    """Panels beside each other; one that has ended stays on its last state.

    Args:
        panels: One or two, of one environment and one palette.
        number: Of the picture.

    Returns:
        Indexes into the palette, shape (height, width).
    """
    pictures = [panel.picture(number) for panel in panels]
    gap = np.full((pictures[0].shape[0], GAP), PAPER_INDEX, dtype=np.uint8)
    parts = [pictures[0]]
    for picture in pictures[1:]:
        parts += [gap, picture]
    return np.concatenate(parts, axis=1)


def typeset(text: str) -> str:
    """A text with true minus signs.

    Args:
        text: As it stands elsewhere.

    Returns:
        As "torque −1.2".
    """
    return _MINUS.sub("−", text)
