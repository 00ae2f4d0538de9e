"""Reading a rule file: nothing in it that is not understood."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence, Set
from dataclasses import replace
from itertools import pairwise
from typing import Annotated, Any, Generic, Literal, TypeVar

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import asdict, astuple

from sarl_core.demonstrations.dataset import Feature, with_derived
from sarl_core.demonstrations.derived import Combination, Definition, DerivedFeature
from sarl_core.demonstrations.fields import Indicator
from sarl_core.demonstrations.requirements import LARGEST
from sarl_core.demonstrations.splits import Splits
from sarl_core.documents import (
    LARGEST_WHOLE,
    Count,
    MisfitError,
    NotNegative,
    Number,
    Share,
    conformed,
    parse_json,
)
from sarl_core.environments.formulas import Formula
from sarl_core.errors import InputError, quoted
from sarl_core.mining.evidence import DataBox, HeldOut
from sarl_core.mining.labels import MAX_DIVIDER, LabelledDimension
from sarl_core.mining.rule_contents import RuleContents
from sarl_core.mining.rule_files.writing import FORMAT, VERSIONS, usually_demands
from sarl_core.mining.rules import Condition, Kind, Operator, Origin, Rule, Thresholds
from sarl_core.mining.tree import Learner, Source


def read_rules(text: str | bytes, name: str) -> RuleContents:
    """Read the text of a rule file.

    Args:
        text: JSON, UTF-8.
        name: Of the file, for errors.

    Returns:
        What is in it.

    Raises:
        InputError: If it is no rule file, or holds anything this version does not know.
    """
    try:
        document = parse_json(text, finite=False)
    except InputError as error:
        raise InputError(f"{name}: {error}") from error
    except ValueError as error:
        raise InputError(
            f"{name} is not JSON ({error}); give a rule file that `mine` wrote"
        ) from error
    if not isinstance(document, dict) or document.get("format") != FORMAT:
        raise InputError(
            f"{name} is not a rule file (its format is not {FORMAT!r}); give one that `mine` wrote"
        )
    version = document.get("version")
    if isinstance(version, bool) or version not in VERSIONS:
        raise InputError(
            f"{name} has version {quoted(version)} of the rule format, and this program reads "
            f"versions {VERSIONS[0]} to {VERSIONS[-1]}; use a program of its version"
        )
    kind: Any = _Document[_HeldOutPairs] if version == 1 else _Document[_HeldOut]
    try:
        contents: RuleContents = conformed(document, kind).read()
    except MisfitError as error:
        raise InputError(f"{name}: {error}; mend it or mine the rules again") from error
    return contents


# What a file may say. Nothing else: whatever stands there beside is refused by its name.
_FromOne = Annotated[int, Meta(ge=1, le=LARGEST_WHOLE)]
_Whole = Annotated[int, Meta(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]
_Action = Annotated[float, Meta(ge=-LARGEST, le=LARGEST)]


class DocumentPart(Struct, forbid_unknown_fields=True):
    """A part of a document that holds nothing that is not known."""


class _Indicator(DocumentPart):
    column: Annotated[str, Meta(min_length=1)]
    value: Annotated[str, Meta(min_length=1)]
    otherwise: str = ""


class _Definition(DocumentPart):
    terms: tuple[tuple[int, Number], tuple[int, Number]] | None = None
    formula: str | None = None

    def read(self, observed: Sequence[Feature]) -> Definition:
        if (self.terms is None) == (self.formula is None):
            raise MisfitError("there must be either 'terms' or a 'formula'", "derived")
        try:
            if self.formula is not None:
                return Formula.parse(self.formula, [feature.name for feature in observed])
            assert self.terms is not None
            combination = Combination(self.terms)
        except InputError as error:
            # Without the advice, which is for whoever types it.
            what, _, _ = str(error).rpartition("; ")
            raise MisfitError(what or str(error), "derived") from error
        for place in combination.features:
            if not 0 <= place < len(observed):
                what = f"there is no feature {quoted(place)} among the {len(observed)} before it"
                raise MisfitError(what, "derived")
        return combination


class _Feature(DocumentPart):
    name: str
    unit: str = ""
    indicator: _Indicator | None = None
    derived: _Definition | None = None
    splits: list[Any] | None = None
    binary: bool = False

    def read(self, observed: Sequence[Feature]) -> Feature:
        if self.derived is None:
            return self._plain()
        if self.indicator is not None:
            raise MisfitError("a derived feature says nothing of a column of words", "indicator")
        plain, definition = self._plain(), self.derived.read(observed)
        if isinstance(definition, Combination):
            # It is called what it is, whatever the file calls it.
            (called,) = with_derived(tuple(observed), [DerivedFeature(definition)])[len(observed) :]
            plain = replace(plain, name=called.name, unit=called.unit)
        return replace(plain, derived=definition)

    def _plain(self) -> Feature:
        said = self.indicator
        indicator = None if said is None else Indicator(*astuple(said))
        if self.splits is None:
            return Feature(self.name, self.unit, indicator)
        if not all(isinstance(row, list) and len(row) == 3 for row in self.splits):
            raise MisfitError("'splits' must be a threshold and the two values around it each")
        try:
            splits = conformed(self.splits, list[tuple[Number, float | None, float | None]])
        except MisfitError as error:
            raise MisfitError("'splits' holds something that is no number") from error
        rows = [
            (one, -math.inf if below is None else below, math.inf if above is None else above)
            for one, below, above in splits
        ]
        thresholds, below, above = np.array(rows, dtype=np.float64).reshape(-1, 3).T
        apart = np.isfinite(thresholds) & (below <= thresholds) & (thresholds < above)
        if not apart.all() or not (np.diff(thresholds) > 0).all():
            raise MisfitError("'splits' are not in ascending order, each between its two values")
        splits_of = Splits(thresholds, below, above, self.binary)
        return Feature(self.name, self.unit, indicator, splits=splits_of)


class _Discrete(DocumentPart, tag_field="kind", tag="discrete"):
    name: str
    labels: tuple[str, ...]
    first: _Whole = 0
    codes: tuple[_Whole, ...] = ()

    def read(self) -> LabelledDimension:
        if not self.labels:
            raise MisfitError("'labels' is empty")
        if self.codes and len(self.codes) != len(self.labels):
            raise MisfitError(f"'codes' must be {len(self.labels)} numbers, one a label")
        if any(after <= before for before, after in pairwise(self.codes)):
            raise MisfitError("'codes' must ascend")
        return LabelledDimension(self.name, self.labels, first=self.first, codes=self.codes)


class _Interval(DocumentPart, tag_field="kind", tag="interval"):
    name: str
    edges: list[_Action]
    bounds_from: str = "action space"

    def read(self) -> LabelledDimension:
        edges = self.edges
        single = len(edges) == 2 and edges[0] == edges[1]
        if not single and (len(edges) < 3 or sorted(set(edges)) != edges):
            raise MisfitError(
                "'edges' must be three or more numbers in ascending order, or one number twice"
            )
        return LabelledDimension.of_edges(self.name, edges, bounds_from=self.bounds_from)


class _Thresholds(DocumentPart):
    support: Share
    confidence: Share
    lift: NotNegative = 0.0
    max_depth: Count | None = None
    never: Annotated[float, Meta(gt=0.0, lt=1.0)] | None = None
    demands: bool | None = None

    def read(self, kinds: Set[Kind]) -> Thresholds:
        if self.never is None and self.demands is not None:
            raise MisfitError("'demands' stands beside 'never' alone", "thresholds")
        demands = usually_demands(self.never, kinds) if self.demands is None else self.demands
        return Thresholds(**asdict(self) | {"demands": demands})


class _Demonstrations(DocumentPart):
    digest: str
    steps: _FromOne
    episodes: _FromOne


class _Condition(DocumentPart, gc=False):
    feature: int
    op: Operator
    threshold: Number


class _Box(DocumentPart):
    least: tuple[Number, ...]
    low: tuple[Number, ...]
    high: tuple[Number, ...]
    most: tuple[Number, ...]

    def read(self, n_features: int) -> DataBox:
        for name, values in asdict(self).items():
            if len(values) != n_features:
                raise MisfitError(f"{name!r} must be {n_features} numbers", "box")
        for least, low, high, most in zip(*astuple(self), strict=True):
            if not least <= low <= high <= most:
                raise MisfitError("the values are not in the order least, low, high, most", "box")
        return DataBox(*astuple(self))


class _HeldOutPairs(DocumentPart):
    """Of version 1, which did not say in how many episodes they lie."""

    samples: Count
    correct: Count

    def read(self) -> HeldOut:
        return self._checked(HeldOut(self.samples, self.correct, 0, None, None, None))

    def _checked(self, held_out: HeldOut) -> HeldOut:
        for name in ("correct", "episodes"):
            if (value := getattr(held_out, name)) > held_out.samples:
                most = f"not a whole number from 0 to {held_out.samples}"
                raise MisfitError(f"{name!r} is {value}, {most}", "held_out")
        return held_out


class _HeldOut(_HeldOutPairs):
    episodes: Count
    share: Share | None
    low: Share | None
    high: Share | None

    def read(self) -> HeldOut:
        if (self.share is None) != (self.episodes == 0):
            raise MisfitError("'share' does not match its episodes", "held_out")
        low, high = self.low, self.high
        if (low is None) != (high is None) or (low is not None and high is not None and low > high):
            raise MisfitError("'low' and 'high' are no interval", "held_out")
        return self._checked(HeldOut(*astuple(self)))


_Held = TypeVar("_Held", bound=_HeldOutPairs)
_P = TypeVar("_P")
_T = TypeVar("_T")


class _Rule(DocumentPart, Generic[_Held]):
    id: str
    dimension: int
    conditions: list[_Condition]
    support: Share
    confidence: Share
    lift: NotNegative
    samples: Count
    action: int | None = None
    kind: Kind = "do"
    forbids: tuple[int, ...] = ()
    instead: tuple[int, ...] = ()
    length: int | None = None
    enabled: bool = True
    origin: Origin = "mined"
    demonstrated_value: _Action | None = None
    pinned: bool = False
    box: _Box | None = None
    held_out: _Held | None = None

    def read(self, actions: Sequence[LabelledDimension], n_features: int, steps: int) -> Rule:
        for number, condition in enumerate(self.conditions, start=1):
            if not 0 <= condition.feature < n_features:
                what = f"there is no feature {quoted(condition.feature)}"
                raise MisfitError(what, f"conditions {number}")
        if not 0 <= self.dimension < len(actions):
            raise MisfitError(f"there is no action dimension {quoted(self.dimension)}")
        action = self._action(actions[self.dimension].n_labels)
        if self.length not in (None, len(self.conditions)):
            raise MisfitError(f"'length' does not match its {len(self.conditions)} conditions")
        if self.samples > steps:
            raise MisfitError(f"'samples' is {self.samples}, not a whole number from 0 to {steps}")
        entries = asdict(self) | {"action": action}
        del entries["length"], entries["kind"]
        entries["conditions"] = tuple(Condition(*astuple(one)) for one in self.conditions)
        entries["box"] = self.box and self.box.read(n_features)
        entries["held_out"] = self.held_out and self.held_out.read()
        return Rule(**entries)

    def _action(self, n_labels: int) -> int:
        """What a rule demands, or what comes first where it forbids.

        Raises:
            MisfitError: If it is neither a rule that demands nor one that forbids.
        """
        if self.kind == "do":
            if self.action is None:
                raise MisfitError("'action' is missing")
            if self.forbids or self.instead or self.origin == "probed":
                what = "a rule that says what to do has no 'forbids', no 'instead' and no probes"
                raise MisfitError(what)
            if not 0 <= self.action < n_labels:
                what = f"the action {quoted(self.action)} is none of the {n_labels} labels"
                raise MisfitError(what)
            return self.action
        if self.action is not None:
            raise MisfitError("a never-rule has 'forbids' and no 'action'")
        if not self.forbids or list(self.forbids) != sorted(set(self.forbids)):
            raise MisfitError("'forbids' must be one label or more, ascending, each once")
        if sorted((*self.forbids, *self.instead)) != list(range(n_labels)):
            raise MisfitError(
                f"'forbids' and 'instead' together must be the {n_labels} labels, each once"
            )
        if not self.instead:
            raise MisfitError("a never-rule must leave one label or more: 'instead' is empty")
        return self.instead[0]


RuleDocument = _Rule[_HeldOut]
"""A rule as it may stand in a file; `read` makes one of it."""


def each(parts: Iterable[_P], place: str, read: Callable[[_P], _T]) -> tuple[_T, ...]:
    """What is made of the parts of a list.

    Raises:
        MisfitError: If one of them does not fit; it says which.
    """
    made = []
    for number, part in enumerate(parts, start=1):
        try:
            made.append(read(part))
        except MisfitError as error:
            raise MisfitError(error.what, f"{place} {number}", *error.place) from error
    return tuple(made)


def _features(entries: Sequence[_Feature], version: int) -> tuple[Feature, ...]:
    """The features: those that are observed, and behind them what is derived from them."""
    observed: list[Feature] = []
    behind = False

    def read(entry: _Feature) -> Feature:
        nonlocal behind
        if entry.derived is not None and version == 1:
            what = "version 1 of the format knows no 'derived'; it came with version 2"
            raise MisfitError(what)
        if entry.derived is None and behind:
            raise MisfitError("it is observed and stands behind a derived one")
        feature = entry.read(observed)
        behind = entry.derived is not None
        if not behind:
            observed.append(feature)
        return feature

    features = each(entries, "features", read)
    names = Counter(feature.name for feature in features)
    for number, feature in enumerate(features, start=1):
        if not feature.name.strip():
            raise MisfitError("the name is empty", f"features {number}")
        if names[feature.name] > 1:
            raise MisfitError(f"the name {quoted(feature.name)} stands twice", f"features {number}")
    return features


class _Document(DocumentPart, Generic[_Held]):
    format: str
    version: int
    env_id: str
    features: list[_Feature]
    actions: list[_Discrete | _Interval]
    thresholds: _Thresholds
    divider: Annotated[int, Meta(ge=2, le=MAX_DIVIDER)]
    demonstrations: _Demonstrations
    rules: list[_Rule[_Held]]
    cut: Literal["thresholds", "leaves"] = "thresholds"
    learner: Learner = "exact"

    def read(self) -> RuleContents:
        if self.version == 1 and (
            self.thresholds.never is not None or any(one.kind != "do" for one in self.rules)
        ):
            raise MisfitError("version 1 of the format knows no never-rules; they came with 2")
        features = _features(self.features, self.version)
        actions = each(self.actions, "actions", lambda action: action.read())
        if not features or not actions:
            raise MisfitError("there are no features or no actions")
        mined = self.demonstrations
        rules = each(
            self.rules, "rules", lambda rule: rule.read(actions, len(features), mined.steps)
        )
        doubled = [one for one, count in Counter(rule.id for rule in rules).items() if count > 1]
        if doubled:
            raise MisfitError(f"the rule id {quoted(doubled[0])} stands twice")
        return RuleContents(
            rules,
            actions,
            Source(self.env_id, features, mined.digest, mined.steps, mined.episodes),
            self.thresholds.read({rule.kind for rule in rules}),
            self.divider,
            self.cut,
            self.learner,
        )
