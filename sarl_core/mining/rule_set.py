"""A rule set: rules, what they were mined from and how; a sequence, a frame, text, a file."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, overload

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.files import as_path, whole_file
from sarl_core.limits import limited_bytes
from sarl_core.mining.action_words import says_label, says_text
from sarl_core.mining.edit_counts import edits_counted, is_plain, reading_order, regrown_text
from sarl_core.mining.evidence import HeldOut
from sarl_core.mining.language import (
    Wording,
    conditions_text,
    counted,
    exact_condition,
    formula_texts,
    limits_text,
    share_text,
)
from sarl_core.mining.rule_contents import RuleContents
from sarl_core.mining.rule_files.reading import read_rules
from sarl_core.mining.rule_files.writing import file_parts, write_rules
from sarl_core.mining.rules import Rule, as_numbered, name_at
from sarl_core.notebooks import MOST_ROWS, table_html

if TYPE_CHECKING:
    import pandas as pd

_NUMBERS = {
    "support": np.float64,
    "confidence": np.float64,
    "lift": np.float64,
    "joint_support": np.float64,
    "samples": np.int64,
    "length": np.int64,
    "merged_length": np.int64,
    "enabled": np.bool_,
    "pinned": np.bool_,
}
"""What a frame has of each rule as a number or a flag."""


@dataclass(frozen=True, repr=False)
class RuleSet(RuleContents, Sequence[Rule]):
    """Rules, with what they were mined from and how; a sequence of its rules.

    Attributes:
        rules: Rules of one action dimension never overlap unless a person added some.
        actions: Action dimensions and their labels.
        source: Environment, features and fingerprint of the demonstrations.
        thresholds: In force when it was mined.
        divider: Number of intervals of continuous dimensions.
        cut: Where the paths were cut: at the first node that reaches the thresholds
            (Algorithm 1), or nowhere, so that every leaf is a rule and every state is covered.
        learner: What chose the queries of the trees.
    """

    def __len__(self) -> int:
        """Number of rules."""
        return len(self.rules)

    def __iter__(self) -> Iterator[Rule]:
        """The rules in their order."""
        return iter(self.rules)

    def __contains__(self, rule: object) -> bool:
        """Whether a rule is one of the set."""
        return rule in self.rules

    @overload
    def __getitem__(self, place: int) -> Rule: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[Rule, ...]: ...
    def __getitem__(self, place: int | slice) -> Rule | tuple[Rule, ...]:
        """The rule at a place, from 0; of a slice, those rules alone."""
        return self.rules[place]

    def __repr__(self) -> str:
        """Its size, as `RuleSet('CartPole-v1', rules=12, support>=0.005, confidence>=0.95)`."""
        if self.cut == "leaves":
            return f"RuleSet({self.source.env_id!r}, rules={len(self)}, every leaf)"
        return (
            f"RuleSet({self.source.env_id!r}, rules={len(self)}, "
            f"support>={self.thresholds.support:g}, confidence>={self.thresholds.confidence:g})"
        )

    def _repr_html_(self) -> str:
        """The first rules as a table, for a notebook."""
        first = self.rules[:MOST_ROWS]
        rows = (
            (
                self.name_of(rule),
                conditions_text(rule, self),
                says_text(rule, self.actions[rule.dimension]),
                share_text(rule.support),
                share_text(rule.confidence),
                f"{rule.samples:,}",
            )
            for rule in first
        )
        header = ("rule", "when", "then", "support", "confidence", "states")
        return table_html(repr(self), header, rows, more=len(self) - len(first))

    @property
    def rule_count(self) -> int:
        """Number of rules."""
        return len(self.rules)

    @property
    def mean_length(self) -> float:
        """Mean number of queries a rule, 0 without rules."""
        return sum(rule.length for rule in self.rules) / max(len(self), 1)

    @property
    def coverage(self) -> float:
        """Share of pairs to which a rule applies, averaged over action dimensions.

        NaN with never-rules: they overlap, and only the pairs know what they cover together.
        """
        if self.forbids:
            return float("nan")
        pairs = self.source.steps * len(self.actions)
        return sum(rule.samples for rule in self.rules) / pairs

    @property
    def fidelity(self) -> float:
        """Share of the covered pairs whose label the rule gives; NaN where none is covered.

        NaN with never-rules, too.
        """
        if self.forbids:
            return float("nan")
        covered = sum(rule.samples for rule in self.rules)
        return sum(rule.correct for rule in self.rules) / covered if covered else float("nan")

    @cached_property
    def forbids(self) -> bool:
        """Whether any of the rules is a never-rule."""
        return any(rule.forbids for rule in self.rules)

    @cached_property
    def names(self) -> Mapping[str, str]:
        """What people call the rules, by id: R1 to Rn (`as_numbered`)."""
        return {rule.id: name_at(place) for place, rule in enumerate(as_numbered(self.rules))}

    def name_of(self, rule: Rule) -> str:
        """What people call a rule; its id is for files and links.

        Args:
            rule: One of the set.

        Returns:
            As "R12".
        """
        return self.names[rule.id]

    def of_dimension(self, dimension: int) -> tuple[Rule, ...]:
        """The rules of one action dimension.

        Args:
            dimension: Its index.

        Returns:
            In their order.
        """
        return tuple(rule for rule in self.rules if rule.dimension == dimension)

    @cached_property
    def digest(self) -> str:
        """Fingerprint (blake2b, 32 hex digits) of all that a rule file says.

        With it, of what is known of the data around thresholds: rules that are written differently
        for people have different ones. `rules_digest` leaves that out.
        """
        digest = hashlib.blake2b(digest_size=16)
        for part in file_parts(self):
            # A caller may have given half of a pair that UTF-8 cannot write.
            digest.update(part.encode(errors="surrogatepass"))
        return digest.hexdigest()

    def to_frame(self) -> pd.DataFrame:
        """One row a rule, in their order.

        Returns:
            `name` (as "R1"), `id`, `dimension` and `action` in words, `rule` as a sentence,
            `conditions` in path order with thresholds at full precision, then numbers and
            flags as `Rule` has them; what held-out episodes say under `held_out_samples` and so
            on, NaN where there are none.
        """
        import pandas as pd

        wording, conditions = Wording(self), exact_texts(self)
        return pd.DataFrame(
            {
                "name": [self.name_of(rule) for rule in self],
                "id": [rule.id for rule in self],
                "dimension": [self.actions[rule.dimension].name for rule in self],
                "action": [says_label(rule, self.actions[rule.dimension]) for rule in self],
                "rule": [wording.sentence(rule, evidence=False) for rule in self],
                "conditions": list(conditions),
                **{
                    column: np.array(
                        [
                            wording.merged_length(rule)
                            if column == "merged_length"
                            else getattr(rule, column)
                            for rule in self
                        ],
                        dtype=dtype,
                    )
                    for column, dtype in _NUMBERS.items()
                },
                "origin": [rule.origin for rule in self],
                **{
                    f"held_out_{column}": np.array(
                        [getattr(rule.held_out, column, None) for rule in self], dtype=np.float64
                    )
                    for column in HeldOut._fields
                },
            }
        )

    def to_text(self) -> str:
        """The rules for reading.

        Returns:
            What they were mined from and how, then every rule as a sentence, by action
            dimension: those that a person placed in their order, then the most general first.
        """
        source = self.source
        lines = [
            f"Rules for {source.env_id or 'an unnamed environment'}",
            f"Mined from {counted(source.steps, 'step')} in "
            f"{counted(source.episodes, 'episode')}: {limits_text(self)}.",
            self._counts_text(),
            "They were learned from examples and guarantee nothing.",
        ]
        if formulas := formula_texts(self):
            lines += ["", "Formulas that they ask about:", *(f"  {one}" for one in formulas)]
        wording = Wording(self)
        for index, dimension in enumerate(self.actions):
            rules = reading_order(self.of_dimension(index))
            lines += ["", f"{dimension.name}: {counted(len(rules), 'rule')}", ""]
            lines += [
                f"{self.name_of(rule):>5}. {wording.sentence(rule)}{_mark(rule)}" for rule in rules
            ]
        if any(rule.placed for rule in self.rules):
            lines += ["", "Rules written by hand or pinned come before the others, in their order."]
        return "\n".join(lines) + "\n"

    def _counts_text(self) -> str:
        """How many rules there are, how long they are, and how far they hold."""
        rules, one = counted(self.rule_count, "rule"), self.rule_count == 1
        if not self.rules:
            return f"{rules}; no state is covered."
        length = (
            counted(self.rules[0].length, "condition")
            if one
            else f"{self.mean_length:.2f} conditions on average"
        )
        rest = f"{sum(rule.kind == 'never' for rule in self.rules):,} of them forbid"
        if not is_plain(self):
            rest = edits_counted(self)
        elif not self.forbids:
            they, are = ("it covers", "is") if one else ("they cover", "are")
            rest = (
                f"{they} {share_text(self.coverage)} of the states and {are} right in "
                f"{share_text(self.fidelity)} of those{regrown_text(self)}"
            )
        return f"{rules}, {length}; {rest}."

    def save(self, path: str | Path) -> None:
        """Write the rule file; it appears whole or not at all.

        It has version 2 where rules were tried on episodes held out, else version 1.

        Args:
            path: A `.json` file.

        Raises:
            InputError: If it has another ending, or the folder does not exist.
            WorkError: If it cannot be written to.
        """
        with whole_file(as_path(path, ending=".json")) as unfinished:
            write_rules(self, unfinished)

    @classmethod
    def load(cls, path: str | Path) -> RuleSet:
        """Read a rule file, as `load_rules` does."""
        return load_rules(path)


def _mark(rule: Rule) -> str:
    """What a person made of a rule, as " (pinned, off)" or " (regrown)"."""
    marks = ["by hand"] if rule.origin == "manual" else ["pinned"] if rule.pinned else []
    marks += ["regrown"] * rule.regrown + ["off"] * (not rule.enabled)
    return f" ({', '.join(marks)})" if marks else ""


def load_rules(path: str | Path) -> RuleSet:
    """Read a rule file.

    Args:
        path: A `.json` file, of version 1 or 2.

    Returns:
        The rule set.

    Raises:
        InputError: If it cannot be read, is no rule file, or holds anything this version does not
            know.
    """
    path = as_path(path)
    try:
        text = limited_bytes(path)
    except InputError as error:
        raise InputError(f"{path}: {error}") from error
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); give a rule file") from error
    return rules_from_json(text, name=str(path))


def rules_from_json(text: str | bytes, *, name: str = "the rule file") -> RuleSet:
    """Read the text of a rule file.

    Args:
        text: JSON, UTF-8.
        name: Of the file, for errors.

    Returns:
        The rule set.

    Raises:
        InputError: If it is no rule file, or holds anything this version does not know.
    """
    return RuleSet(**vars(read_rules(text, name)))


def obeying_labels(rule_set: RuleContents) -> NDArray[np.bool_]:
    """Which labels each rule lets be.

    Args:
        rule_set: R rules.

    Returns:
        Shape (R, L) for the L labels of the dimension that has most.
    """
    most = max(dimension.n_labels for dimension in rule_set.actions)
    every = np.arange(most)
    rows = [rule.obeyed_by(every) for rule in rule_set.rules]
    return np.array(rows, dtype=np.bool_).reshape(-1, most)


def exact_texts(rule_set: RuleContents) -> Iterator[str]:
    """The conditions of rules with their thresholds at full precision.

    Args:
        rule_set: Any number of rules.

    Yields:
        Of each rule the queries in path order, joined by "and"; "always" where there is none.
    """
    exact = cache(partial(exact_condition, features=rule_set.source.features))
    return (" and ".join(map(exact, rule.conditions)) or "always" for rule in rule_set.rules)


def rules_to_json(rule_set: RuleSet) -> str:
    """A rule set as the text of a rule file.

    Args:
        rule_set: To write.

    Returns:
        JSON; numbers read back as the same floats.
    """
    return "".join(file_parts(rule_set))


def rules_digest(rule_set: RuleSet) -> str:
    """Fingerprint of rules, whatever file they came in.

    Args:
        rule_set: The rules.

    Returns:
        As `RuleSet.digest`, without what is known of the data around thresholds: that is no part
        of the rules.
    """
    bare = rule_set.source.with_splits([None] * len(rule_set.source.features))
    return replace(rule_set, source=bare).digest
