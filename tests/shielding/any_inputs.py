"""Rule sets of every kind of action, and observations and actions of every kind, good and bad."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import strategies as st

from sarl_core.demonstrations.dataset import Feature
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.labels import LabelledDimension
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Condition, Rule, Thresholds
from sarl_core.mining.tree import Source

VALUES = (-1.0, -0.5, -0.25, 0.0, 0.1, 0.25, 0.5, 1.0, 1.5)
DTYPES = ("<f4", ">f4", "f8", ">f8", "f2", "i1", "u1", "i4", ">i4", "i8", "u8", "?", "O", "g")


def _labels(count):
    return tuple(map(str, range(count)))


ACTIONS = {
    "discrete": (LabelledDimension("push", _labels(3)),),
    "discrete from -4": (LabelledDimension("push", _labels(5), first=-4),),
    "discrete from 250": (LabelledDimension("push", _labels(9), first=250),),
    "several discrete": (
        LabelledDimension("gear", _labels(3), first=-1),
        LabelledDimension("horn", _labels(2)),
    ),
    "continuous": (LabelledDimension.of_edges("torque", (-2.0, -2 / 3, 2 / 3, 2.0)),),
    "several continuous": (
        LabelledDimension.of_edges("hip", (-1.0, 0.0, 1.0)),
        LabelledDimension.of_edges("knee", (-1.0, -1 / 3, 1 / 3, 1.0)),
        LabelledDimension.of_edges("valve", (0.0, 33.3, 66.6, 100.0)),
    ),
}


@st.composite
def rule_sets(draw, kinds=tuple(ACTIONS)):
    """Rules that overlap, some placed, some off, some with a box; of three features or of one."""
    actions = ACTIONS[draw(st.sampled_from(kinds))]
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    d = draw(st.sampled_from([1, 3]))
    rules = []
    for number in range(draw(st.integers(1, 8))):
        dimension = int(rng.integers(len(actions)))
        action = actions[dimension]
        label = int(rng.integers(action.n_labels))
        box = np.sort(rng.choice(VALUES, (2, d)), axis=0).tolist()
        rules.append(
            Rule(
                f"{dimension}.{number}",
                dimension,
                tuple(
                    Condition(
                        int(rng.integers(d)),
                        "<=" if rng.random() < 0.5 else ">",
                        float(rng.choice([*VALUES, 0.30000000001, 1e300, -1e300])),
                    )
                    for _ in range(rng.integers(0, 3))
                ),
                label,
                0.1,
                1.0,
                1.0,
                5,
                enabled=bool(rng.random() < 0.85),
                origin="manual" if rng.random() < 0.4 else "mined",
                box=DataBox(*map(tuple, box * 2)) if rng.random() < 0.3 else None,
                demonstrated_value=action.centre(label) if action.is_interval else None,
            )
        )
    features = tuple(Feature(f"x{index}") for index in range(d))
    return RuleSet(
        tuple(rules), actions, Source("", features, "none", 100, 1), Thresholds(0.0, 0.0)
    )


def contained(draw, values, dtype, *, flat=False):
    """The numbers in some container, of some dtype and in some shape."""
    with np.errstate(all="ignore"):
        array = np.array(values).astype(dtype)
    if array.dtype == object:
        array = np.array(
            [Fraction(x) if x == x and abs(x) < 9 else x for x in values], dtype=object
        )
    kind = draw(
        st.sampled_from(["array", "list", "tuple", "scalars", "read-only", "strided", "unmasked"])
    )
    if not flat and len(array) == 1 and draw(st.booleans()):
        array = array.reshape(())
        if draw(st.booleans()):
            return array[()]
    elif not flat and draw(st.integers(0, 3)) == 0:
        array = array.reshape(draw(st.sampled_from([(1, -1), (-1, 1)])))
    if kind == "list":
        return array.tolist()
    if kind == "tuple" and array.ndim:
        return tuple(array.tolist())
    if kind == "scalars" and array.ndim == 1:
        return list(array)
    if kind == "read-only":
        array.flags.writeable = False
    if kind == "strided" and array.ndim == 1:
        return np.repeat(array, 2)[::2]
    if kind == "unmasked":
        return np.ma.array(array, mask=False)
    return array


@st.composite
def numbers(draw, values, size, *, flat=False):
    """As many numbers as asked for, in some container."""
    chosen = [draw(values) for _ in range(size)]
    return contained(draw, chosen, draw(st.sampled_from(DTYPES)), flat=flat)


def _bad(size):
    """What is no state of `size` features, and no action of so many dimensions."""
    good = [0.0] * size
    return st.sampled_from(
        [
            None,
            "0",
            "left",
            b"\0\0\0\0",
            {},
            {0},
            [],
            [good],
            [*good, 0.0],
            good[1:],
            np.zeros((2, size, 2)),
            [None] * size,
            ["0"] * size,
            np.array(["0"] * size),
            np.zeros(size, dtype=complex),
            np.zeros(size, dtype="datetime64[s]"),
            np.ma.array(good, mask=[True] + [False] * (size - 1)),
            np.ma.masked,
            [np.nan, *good[1:]],
            [*good[1:], np.inf],
            np.array([-np.inf, *good[1:]], dtype=np.float32),
            np.array([1e300, *good[1:]]),
            [10**400, *good[1:]],
            [[0.0], [0.0, 1.0]],
            object(),
        ]
    )


@st.composite
def observations(draw, rule_set):
    """A state of the rules' features, in three of four cases."""
    d = len(rule_set.source.features)
    if draw(st.integers(0, 3)) == 0:
        return draw(_bad(d))
    values = st.sampled_from([*VALUES, 0.3, 3.4e38, -3.4e38]) | st.floats(-2, 2)
    return draw(numbers(values, d, flat=True))


@st.composite
def proposals(draw, rule_set):
    """An action of the rules' space, or a number that may be none, or what is none."""
    m = len(rule_set.actions)
    case = draw(st.integers(0, 5))
    if case == 0:
        return draw(_bad(m))
    if case == 1:
        odd = st.sampled_from([-0.9, 0.5, np.nan, np.inf, -4.0, 252.0, 1e20, 1e300, 2.0**63, 254.0])
        return draw(numbers(odd, m))
    if rule_set.actions[0].is_interval:
        edges = [edge for action in rule_set.actions for edge in action.edges]
        near = [
            float(np.nextafter(np.float32(edge), np.float32(turn)))
            for edge in edges
            for turn in (-9e9, 9e9)
        ]
        return draw(numbers(st.sampled_from([*edges, *near, -1e6, 1e6]) | st.floats(-2, 2), m))
    first, count = rule_set.actions[0].first, rule_set.actions[0].n_labels
    if m == 1 and draw(st.booleans()):
        return draw(st.integers(first - 1, first + count))
    return draw(numbers(st.integers(first - 1, first + count), m))
