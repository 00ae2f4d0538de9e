"""What a rule set holds and a rule file says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rules import Rule, Thresholds
from sarl_core.mining.tree import Learner, Source


@dataclass(frozen=True)
class RuleContents:
    """Rules, with what they were mined from and how; `RuleSet` says what each is."""

    rules: tuple[Rule, ...]
    actions: tuple[LabelledDimension, ...]
    source: Source
    thresholds: Thresholds
    divider: int = 2
    cut: Literal["thresholds", "leaves"] = "thresholds"
    learner: Learner = "exact"
