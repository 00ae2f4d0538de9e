"""Formulas and conditions over an observation, read from a small fixed grammar, never run as code.

A person writes ``gap / (own speed - lead speed)`` or ``abs(pole angle) > 0.2 or gap <= 3``.
There are numbers, names of features, ``+ - * /``, ``min``, ``max``, ``abs`` and parentheses, and in
conditions ``< <= > >=``, ``and``, ``or``, ``not``. A name is written as it is, spaces included; in
quotation marks where it has other signs or one of these words: ``'vehicle 2: x' < 0.1``. Capitals
do not matter, nor whether its words are parted by spaces or underscores: ``own_speed``.
"""

from __future__ import annotations

import difflib
import math
import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sarl_core.decimals import decimal_text
from sarl_core.environments.feature_order import plain_names, shortened
from sarl_core.errors import InputError, quoted, require

MAX_LENGTH = 500  # signs
MAX_DEPTH = 50  # parentheses in each other
MAX_OPERATIONS = 200

_WORDS = ("and", "or", "not")
_TOKEN = re.compile(
    r"""\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)|(?P<word>[^\W\d]\w*)"""
    r"""|'(?P<single>[^']*)'|"(?P<double>[^"]*)"|(?P<sign><=|>=|[-+*/<>(),]))"""
)
_BARE = re.compile(r"\w+")
_DIGITS = "0123456789"
_GRAMMAR = (
    "write numbers, names of features, + - * /, min, max, abs, parentheses, and in conditions "
    "< <= > >=, and, or, not"
)


@dataclass(frozen=True)
class Constant:
    """A number.

    Attributes:
        value: Finite.
    """

    value: float


@dataclass(frozen=True)
class FeatureValue:
    """A feature of the observation.

    Attributes:
        index: Its column.
    """

    index: int


@dataclass(frozen=True)
class Operation:
    """What is done with one, two or more operands, from left to right.

    Attributes:
        name: As in the grammar; ``-`` of one operand is its negative.
        operands: At least one.
    """

    name: str
    operands: tuple[Node, ...]

    @property
    def is_truth(self) -> bool:
        """Whether its value is a truth value."""
        return self.name in _COMPARISONS or self.name in _WORDS


Node: TypeAlias = Constant | FeatureValue | Operation


@dataclass(frozen=True)
class _Parsed:
    """What `Formula` and `StateCondition` share.

    Attributes:
        text: As it was written.
        feature_names: Of the observations it is about, d.
        root: What is worked out.
    """

    text: str
    feature_names: tuple[str, ...]
    root: Node

    is_truth: ClassVar[bool]

    @classmethod
    def parse(cls, text: str, feature_names: Sequence[str]) -> Self:
        """Read one.

        Args:
            text: In the grammar of this module.
            feature_names: Of the observations, d.

        Returns:
            It, ready to be worked out.

        Raises:
            InputError: If it is not of the grammar, names a feature that there is not, is too long
                or too deep, or is a condition where a number is needed or the other way round;
                with the place.
        """
        parsed = parse(text, feature_names)
        if not isinstance(parsed, cls):
            raise InputError(
                f"{quoted(text)} is a number and no condition; compare it, as {text.strip()} > 0"
                if cls.is_truth
                else f"{quoted(text)} is a condition and no number; leave the comparison out"
            )
        return parsed

    def __str__(self) -> str:
        """As it was written."""
        return self.text

    @property
    def features(self) -> tuple[int, ...]:
        """Indices of the features that it asks about, ascending, each once."""
        indices: set[int] = set()
        nodes = [self.root]
        while nodes:
            node = nodes.pop()
            if isinstance(node, FeatureValue):
                indices.add(node.index)
            elif isinstance(node, Operation):
                nodes += node.operands
        return tuple(sorted(indices))

    def values(self, observations: ArrayLike) -> NDArray[np.float64]:
        """Work it out, in float64 from float32 observations, from left to right.

        Args:
            observations: One state (d,), or N of them (N, d).

        Returns:
            Shape () or (N,). A division by zero is infinite. NaN where there is no value, as of
            0/0; of a condition 1 where it is true, 0 where it is not, NaN where that cannot be
            said because a part of it has no value.

        Raises:
            InputError: If the states have not d features.
        """
        with np.errstate(all="ignore"):
            states = np.asarray(observations, dtype=np.float32).astype(np.float64)
            d = len(self.feature_names)
            if states.ndim not in (1, 2) or states.shape[-1] != d:
                raise InputError(
                    f"{quoted(self.text)} is about {d} features and the observations have the "
                    f"shape {states.shape}; give one state ({d},) or several (N, {d})"
                )
            value = _value(self.root, states)
        return np.array(np.broadcast_to(value, states.shape[:-1]))


@dataclass(frozen=True)
class Formula(_Parsed):
    """A number over an observation, as a derived feature or a cost."""

    is_truth = False

    def value(self, state: Sequence[float]) -> float:
        """As `values`, of one state of d float32 numbers: no array is made of it."""
        return _number(self.root, state)

    def over(self, places: Sequence[int], names: Sequence[str]) -> Formula:
        """The same of features in another order, or under other names.

        Args:
            places: For each of the d features its index among the others.
            names: Of the others.

        Returns:
            A formula whose text names those.

        Raises:
            InputError: If the text would be too long, or a name cannot stand in one.
        """
        return Formula.parse(written(self.root, [names[place] for place in places]), names)


@dataclass(frozen=True)
class StateCondition(_Parsed):
    """What is true or false of an observation, as a failure."""

    is_truth = True


def parse(text: str, feature_names: Sequence[str]) -> Formula | StateCondition:
    """Read a formula or a condition, whichever it is.

    Args:
        text: In the grammar of this module.
        feature_names: Of the observations, d.

    Returns:
        It, ready to be worked out.

    Raises:
        InputError: As `Formula.parse`.
    """
    require(text, str, "a formula must be text", "write one, as 'gap / speed'")
    if len(text) > MAX_LENGTH:
        raise InputError(
            f"the formula {quoted(text)} has {len(text):,} signs, more than {MAX_LENGTH:,}; "
            "shorten it"
        )
    names = tuple(feature_names)
    root = _Parser(text, names).whole()
    kind = StateCondition if _is_truth(root) else Formula
    return kind(text.strip(), names, root)


class _Token(NamedTuple):
    """A piece of the text; `kind` is number, word, name (in quotation marks), sign or end."""

    kind: str
    text: str
    place: int


class _Parser:
    """Recursive descent, the loosest binding first."""

    def __init__(self, text: str, names: tuple[str, ...]) -> None:
        self.text, self.names = text, names
        self.tokens = self._tokens()
        self.at = self.depth = self.operations = 0

    def whole(self) -> Node:
        if self.tokens[0].kind == "end":
            raise InputError(f"the formula is empty; {_GRAMMAR}")
        root = self._any()
        if self._next().kind != "end":
            raise self._error("is not expected here")
        return root

    def _tokens(self) -> list[_Token]:
        tokens, place = [], 0
        end = len(self.text.rstrip())
        while place < end:
            match = _TOKEN.match(self.text, place)
            if match is None or match.end() == place:
                place += len(self.text[place:]) - len(self.text[place:].lstrip())
                raise self._error(
                    "is not part of a formula", _Token("sign", self.text[place], place)
                )
            kind = str(match.lastgroup)
            named = kind in ("single", "double")
            tokens.append(_Token("name" if named else kind, match[kind], match.start(kind) - named))
            place = match.end()
        return [*tokens, _Token("end", "", len(self.text))]

    def _next(self) -> _Token:
        return self.tokens[self.at]

    def _is(self, *texts: str) -> bool:
        return self._next().kind in ("sign", "word") and self._next().text in texts

    def _take(self) -> _Token:
        self.at += 1
        return self.tokens[self.at - 1]

    def _error(self, what: str, token: _Token | None = None, advice: str = _GRAMMAR) -> InputError:
        token = token or self._next()
        piece = "the end" if token.kind == "end" else quoted(token.text)
        return InputError(
            f"in the formula {quoted(self.text)}, {piece} (sign {token.place + 1}) {what}; {advice}"
        )

    def _operation(self, token: _Token, name: str, operands: Sequence[Node]) -> Operation:
        self.operations += 1
        if self.operations > MAX_OPERATIONS:
            raise InputError(
                f"the formula {quoted(self.text)} has more than {MAX_OPERATIONS} operations; "
                "shorten it"
            )
        for operand in operands:
            if _is_truth(operand) != (name in _WORDS):
                needs = "conditions" if name in _WORDS else "numbers"
                raise self._error(
                    f"is put to what are no {needs}",
                    token,
                    "compare numbers with < <= > >=, and join what is compared with and, or, not",
                )
        return Operation(name, tuple(operands))

    def _chain(self, inner: Callable[[], Node], *names: str) -> Node:
        node = inner()
        while self._is(*names):
            token = self._take()
            node = self._operation(token, token.text, (node, inner()))
        return node

    def _any(self) -> Node:
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self._error(f"lies more than {MAX_DEPTH} deep", advice="shorten the formula")
        node = self._chain(self._and, "or")
        self.depth -= 1
        return node

    def _and(self) -> Node:
        return self._chain(self._not, "and")

    def _not(self) -> Node:
        return self._prefixed("not", self._not) or self._comparison()

    def _prefixed(self, name: str, inner: Callable[[], Node]) -> Node | None:
        """What stands behind a prefix, which may stand there again."""
        if not self._is(name):
            return None
        self.depth += 1
        if self.depth > MAX_DEPTH:
            raise self._error(f"lies more than {MAX_DEPTH} deep", advice="shorten the formula")
        token = self._take()
        node = self._operation(token, name, (inner(),))
        self.depth -= 1
        return node

    def _comparison(self) -> Node:
        node = self._sum()
        if not self._is(*_COMPARISONS):
            return node
        token = self._take()
        node = self._operation(token, token.text, (node, self._sum()))
        if self._is(*_COMPARISONS):
            raise self._error("compares again", advice="join two comparisons with and")
        return node

    def _sum(self) -> Node:
        return self._chain(self._product, "+", "-")

    def _product(self) -> Node:
        return self._chain(self._signed, "*", "/")

    def _signed(self) -> Node:
        return self._prefixed("-", self._signed) or self._operand()

    def _operand(self) -> Node:
        token = self._next()
        if token.kind == "number":
            value = float(self._take().text)
            if not np.isfinite(value):
                raise self._error("is too large a number", token)
            return Constant(value)
        if token.kind == "name":
            return self._feature(self._take())
        if self._is("("):
            self._take()
            node = self._any()
            self._close()
            return node
        if token.kind == "word" and token.text not in _WORDS:
            if token.text in _FUNCTIONS and self.tokens[self.at + 1].text == "(":
                return self._function(self._take())
            return self._feature(self._words())
        raise self._error("stands where a number, a feature or a parenthesis is needed")

    def _function(self, token: _Token) -> Node:
        self._take()
        operands = [self._any()]
        while self._is(","):
            self._take()
            operands.append(self._any())
        self._close()
        if (len(operands) == 1) != (token.text == "abs"):
            raise self._error(
                f"has {len(operands)} operand{'s' if len(operands) > 1 else ''}",
                token,
                "give abs one, and min and max two or more",
            )
        return self._operation(token, token.text, operands)

    def _close(self) -> None:
        if not self._is(")"):
            raise self._error("stands where a closing parenthesis is needed")
        self._take()

    def _words(self) -> _Token:
        """A name as it is: words and numbers side by side, which nothing else of the grammar is."""
        parts = [first := self._take()]
        while self._next().kind in ("word", "number") and self._next().text not in _WORDS:
            parts.append(self._take())
        return _Token("word", " ".join(part.text for part in parts), first.place)

    def _feature(self, token: _Token) -> FeatureValue:
        if token.text in self.names:
            return FeatureValue(self.names.index(token.text))
        plain = plain_names((token.text, *self.names))
        if plain[1:].count(plain[0]) == 1:
            return FeatureValue(plain[1:].index(plain[0]))
        near = difflib.get_close_matches(token.text, self.names, n=1)
        raise self._error(
            "is no feature",
            token,
            f"did you mean {near[0]!r}?"
            if near
            else f"the features are {shortened(self.names)} (a name with other signs than letters, "
            "digits and spaces stands in quotation marks)",
        )


def written(root: Node, names: Sequence[str]) -> str:
    """A formula as text that is read as the same one.

    Args:
        root: What is worked out.
        names: Of the features.

    Returns:
        With no more parentheses than it takes.
    """
    if isinstance(root, Constant):
        return decimal_text(root.value)
    if isinstance(root, FeatureValue):
        return _written_name(names[root.index], names)
    if root.name in _FUNCTIONS:
        return f"{root.name}({', '.join(written(one, names) for one in root.operands)})"
    rank = _rank(root)
    # What follows an operation of the same rank was in parentheses: from left to right.
    texts = [
        text if _rank(one) + (place > 0) <= rank else f"({text})"
        for place, one in enumerate(root.operands)
        for text in [written(one, names)]
    ]
    if len(texts) == 1:
        return f"{root.name}{' ' if root.name in _WORDS else ''}{texts[0]}"
    return f" {root.name} ".join(texts)


def _rank(node: Node) -> int:
    """How loosely a node binds."""
    if not isinstance(node, Operation) or node.name in _FUNCTIONS:
        return 0
    if len(node.operands) == 1:
        return 1 if node.name == "-" else 5
    ranks = {"*": 2, "/": 2, "+": 3, "-": 3, "and": 6, "or": 7}
    return ranks.get(node.name, 4)


def _written_name(name: str, names: Sequence[str]) -> str:
    """A name as it is where that is read as one, else in quotation marks."""
    words = name.split()
    bare = (
        all(map(_BARE.fullmatch, words)) and " ".join(words) == name and words[0][0] not in _DIGITS
    )
    if bare and not {*words} & {*_WORDS, *_FUNCTIONS}:
        return name
    for mark in "'\"":
        if mark not in name:
            return f"{mark}{name}{mark}"
    raise InputError(
        f"the feature {quoted(name)} has both quotation marks in its name, and no formula can "
        f"name it; rename it ({shortened(names)})"
    )


def _is_truth(node: Node) -> bool:
    return isinstance(node, Operation) and node.is_truth


def _value(node: Node, states: NDArray[np.float64]) -> Any:
    if isinstance(node, Constant):
        return np.float64(node.value)
    if isinstance(node, FeatureValue):
        return states[..., node.index]
    first, *others = (_value(operand, states) for operand in node.operands)
    if not others:
        return _OF_ONE[node.name](first)
    for other in others:
        first = _OF_TWO[node.name](first, other)
    return first


def _number(node: Node, state: Sequence[float]) -> float:
    """The same of one state, in plain Python."""
    if isinstance(node, FeatureValue):
        return state[node.index]
    if isinstance(node, Constant):
        return node.value
    first, *others = (_number(operand, state) for operand in node.operands)
    if not others:
        return abs(first) if node.name == "abs" else -first
    for other in others:
        first = _NUMBER_OF_TWO[node.name](first, other)
    return first


def _quotient(a: float, b: float) -> float:
    if b:
        return a / b
    if not a or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1.0, b)


def _compared(how: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    return lambda a, b: np.where(np.isnan(a) | np.isnan(b), np.nan, how(a, b))


_COMPARISONS: dict[str, Callable[[Any, Any], Any]] = {
    "<": _compared(np.less),
    "<=": _compared(np.less_equal),
    ">": _compared(np.greater),
    ">=": _compared(np.greater_equal),
}
_FUNCTIONS = ("min", "max", "abs")
_OF_ONE: dict[str, Callable[[Any], Any]] = {
    "-": np.negative,
    "abs": np.abs,
    "not": lambda a: 1.0 - a,
}
_OF_TWO: dict[str, Callable[[Any, Any], Any]] = {
    **_COMPARISONS,
    "+": np.add,
    "-": np.subtract,
    "*": np.multiply,
    "/": np.divide,
    # Which of two zeros comes out is not left to the machine.
    "min": lambda a, b: np.where(np.isnan(a) | (a < b), a, b),
    "max": lambda a, b: np.where(np.isnan(a) | (a > b), a, b),
    # What is true whatever the part without a value would be, is true; likewise what is false.
    "and": lambda a, b: np.where((a == 0.0) | (b == 0.0), 0.0, a * b),
    "or": lambda a, b: np.where((a == 1.0) | (b == 1.0), 1.0, a + b),
}
_NUMBER_OF_TWO: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": _quotient,
    "min": lambda a, b: a if math.isnan(a) or a < b else b,
    "max": lambda a, b: a if math.isnan(a) or a > b else b,
}
