"""Figures 2 and 3: number and mean length of the rules over support and confidence."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from sarl_core.explaining.language import counted
from sarl_core.mining.landscape import (
    PAPER_CONFIDENCES,
    PAPER_SUPPORTS,
    Landscape,
    threshold_landscape,
)
from sarl_core.reproducing.shipped import (
    PAPER_DIVIDER,
    demonstrations_of,
    environment_name,
    environments,
    trees_of,
)
from sarl_core.reproducing.study import Claim, Drawing, Effort, Frames, Study, judge
from sarl_core.reproducing.words import percent
from sarl_core.rollouts.progress import Progress, report

if TYPE_CHECKING:
    import pandas as pd

Size = Literal["rule_count", "mean_length"]

PAPER_ENVIRONMENT = "CartPole-v1"  # the one that the paper draws
_LAYERS = ("rule_count", "mean_length", "coverage", "fidelity")
_COLUMNS = ("environment", "divider", "support", "confidence", *_LAYERS)
_MIDDLE = (0.25, 0.75)  # of the confidence scale
_NEAR = 0.9  # of the greatest value
_ALIKE, _SOMEWHAT = 0.8, 0.5  # rank correlations


def measure(_: Effort, progress: Progress | None) -> pd.DataFrame:
    """The landscape of every shipped environment over the paper's grid.

    Args:
        _: Takes a few seconds, whatever the effort.
        progress: Called with (environments done, in all); returning False stops.

    Returns:
        One row a cell: `environment`, `divider` (0 for discrete actions), `support`,
        `confidence`, `rule_count`, `mean_length`, `coverage`, `fidelity`.
    """
    import pandas as pd

    ids = environments()
    parts = []
    report(progress, 0, len(ids))
    for done, env_id in enumerate(ids, 1):
        found = threshold_landscape(trees_of(env_id), PAPER_SUPPORTS, PAPER_CONFIDENCES)
        supports, confidences = np.meshgrid(found.supports, found.confidences, indexing="ij")
        discrete = demonstrations_of(env_id).is_discrete
        parts.append(
            pd.DataFrame(
                {
                    "environment": env_id,
                    "divider": 0 if discrete else PAPER_DIVIDER,
                    "support": supports.ravel(),
                    "confidence": confidences.ravel(),
                    **{layer: getattr(found, layer).ravel() for layer in _LAYERS},
                }
            )
        )
        report(progress, done, len(ids))
    return pd.concat(parts, ignore_index=True)


def landscape_of(frame: pd.DataFrame, env_id: str) -> Landscape:
    """The landscape of one environment, out of the table.

    Args:
        frame: What `measure` gives.
        env_id: In it.

    Returns:
        Without the parts of single action dimensions.
    """
    rows = frame[frame["environment"] == env_id]
    supports, confidences = np.unique(rows["support"]), np.unique(rows["confidence"])

    def layer(name: str) -> NDArray[Any]:
        return rows[name].to_numpy().reshape(len(supports), len(confidences))

    return Landscape(
        supports=supports,
        confidences=confidences,
        rule_count=layer("rule_count").astype(np.int64),
        mean_length=layer("mean_length").astype(np.float64),
        coverage=layer("coverage").astype(np.float64),
        fidelity=layer("fidelity").astype(np.float64),
    )


def _environments(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(frame["environment"].unique().tolist())


def _parts(frame: pd.DataFrame) -> tuple[str, ...]:
    return tuple(environment_name(env_id) for env_id in _environments(frame))


def _draw(frame: pd.DataFrame, part: str, dark: bool, layer: Size) -> tuple[Drawing, ...]:
    from sarl_core.explaining.threshold_figures import LAYERS, heatmap, surface

    env_id = next(one for one in _environments(frame) if environment_name(one) == part)
    found = landscape_of(frame, env_id)
    what = f"{LAYERS[layer].title}, {part}"
    flat, raised = heatmap(found, layer, dark=dark), surface(found, layer, dark=dark)
    flat.update_layout(height=380)
    raised.update_layout(height=380, scene_camera_eye={"x": 1.4, "y": -1.5, "z": 0.9})
    return (
        Drawing(what, flat, alt=f"{what}: a map over minimum support and minimum confidence"),
        Drawing(f"{what}, as a surface", raised, alt=f"{what}: the same as a surface"),
    )


def _settings(_: Effort) -> dict[str, Any]:
    return {
        "supports": PAPER_SUPPORTS.tolist(),
        "confidences": PAPER_CONFIDENCES.tolist(),
        "divider": PAPER_DIVIDER,
        "environments": list(environments()),
        "seeds": {"tree": 0},
    }


def _numbers(frame: pd.DataFrame, layer: Size) -> dict[str, Any]:
    """The greatest value of a layer, where it stands, and the value at the paper's corner."""
    found = {}
    for env_id in _environments(frame):
        one = landscape_of(frame, env_id)
        values = np.asarray(getattr(one, layer), dtype=np.float64)
        row, column = np.unravel_index(int(values.argmax()), values.shape)
        found[env_id] = {
            "greatest": float(values.max()),
            "at_support": float(one.supports[row]),
            "at_confidence": float(one.confidences[column]),
            "at_support_0_confidence_1": float(values[0, -1]),
        }
    return found


# --- the claims of Figure 2 ----------------------------------------------------------------------


def count_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the number of rules.

    Args:
        frames: With the table of Figure 2.

    Returns:
        Its claims and ours.
    """
    frame = frames["2"]
    found = {env_id: landscape_of(frame, env_id) for env_id in _environments(frame)}
    return (
        _most_rules(found),
        _fewer_with_less_confidence(found),
        _fewer_with_more_confidence(found),
        _fewer_with_more_support(found),
    )


def _most_rules(found: dict[str, Landscape]) -> Claim:
    holds = {env_id: bool(_is_corner(one.rule_count)) for env_id, one in found.items()}
    cart = found[PAPER_ENVIRONMENT].rule_count
    return Claim(
        paper="A rule set has the most rules where nothing is filtered, at support 0 and "
        "confidence 1.",
        where="Figure 2",
        ours=f"Cart Pole has {int(cart[0, -1]):,} rules there, the most of all settings; so it is "
        f"in {_of(holds)}."
        if holds[PAPER_ENVIRONMENT]
        else f"Cart Pole has {int(cart[0, -1]):,} rules there and up to {int(cart.max()):,} "
        f"elsewhere; it is as the paper says in {_of(holds)}.",
        verdict=judge(all(holds.values()), any(holds.values())),
        decided_by="Agrees if no other cell has more rules, in every environment; partly, in some.",
        numbers={f"rules_{env_id}": float(one.rule_count[0, -1]) for env_id, one in found.items()},
    )


def _fewer_with_less_confidence(found: dict[str, Landscape]) -> Claim:
    holds = {env_id: bool((np.diff(one.rule_count[0]) >= 0).all()) for env_id, one in found.items()}
    cart = found[PAPER_ENVIRONMENT]
    row = cart.rule_count[0]
    drop = int(np.diff(row).argmax())
    return Claim(
        paper="At support 0, the number of rules falls continuously as less confidence is asked.",
        where="Figure 2",
        ours=f"It never rises on the way down, in {_of(holds)}. On Cart Pole it falls from "
        f"{int(row[-1]):,} to {int(row[0]):,}; the largest single drop is from "
        f"{int(row[drop + 1]):,} to {int(row[drop]):,} rules, between confidence "
        f"{cart.confidences[drop + 1]:g} and {cart.confidences[drop]:g}.",
        verdict=judge(all(holds.values()), any(holds.values())),
        decided_by="Agrees if the number never rises from one confidence of the grid to the next "
        "lower one, in every environment; partly, in some.",
        numbers={
            "rules_at_confidence_1": float(row[-1]),
            "rules_at_confidence_0": float(row[0]),
            "largest_drop": float(np.diff(row).max()),
        },
    )


def _fewer_with_more_confidence(found: dict[str, Landscape]) -> Claim:
    one = found[PAPER_ENVIRONMENT]
    middle = int(np.searchsorted(one.confidences, 0.5))
    fewer = one.rule_count[:, -1] < one.rule_count[:, middle]
    more = one.rule_count[:, -1] > one.rule_count[:, middle]
    return Claim(
        paper="If more confidence is asked, fewer rules are found.",
        where="text on Figure 2",
        ours=f"On Cart Pole, asking confidence 1 in place of {one.confidences[middle]:g} gives "
        f"fewer rules at {int(fewer.sum())} of {len(fewer)} minimum supports, and more at "
        f"{int(more.sum())}."
        + (
            " At support 0 it gives more, as the paper says one sentence before." if more[0] else ""
        ),
        verdict=judge(bool(fewer.all()), bool(fewer.any())),
        decided_by="Compares the two on Cart Pole; agrees if there are fewer at every minimum "
        "support of the grid, partly at some.",
        numbers={"fewer_at": float(fewer.sum()), "more_at": float(more.sum())},
    )


def _fewer_with_more_support(found: dict[str, Landscape]) -> Claim:
    holds = {
        env_id: bool((np.diff(one.rule_count, axis=0) <= 0).all()) for env_id, one in found.items()
    }
    supports, cart = found[PAPER_ENVIRONMENT].supports, found[PAPER_ENVIRONMENT].rule_count
    return Claim(
        paper="If more support is asked, fewer rules are found.",
        where="text on Figure 2",
        ours=f"The number never rises with the support, at any confidence, in {_of(holds)}. On "
        f"Cart Pole at confidence 1 it falls from {int(cart[0, -1]):,} at support 0 to "
        f"{counted(int(cart[1, -1]), 'rule')} at {supports[1]:g}.",
        verdict=judge(all(holds.values()), any(holds.values())),
        decided_by="Agrees if the number never rises from one support of the grid to the next, in "
        "every environment; partly, in some.",
        numbers={"rules_at_0": float(cart[0, -1]), "rules_at_next": float(cart[1, -1])},
    )


# --- the claims of Figure 3 ----------------------------------------------------------------------


def length_claims(frames: Frames) -> tuple[Claim, ...]:
    """What the paper says of the length of rules.

    Args:
        frames: With the table of Figure 3.

    Returns:
        Its claims and ours.
    """
    frame = frames["3"]
    found = {env_id: landscape_of(frame, env_id) for env_id in _environments(frame)}
    return (_longest_rules(found), _middle(found), _same_way(found))


def _longest_rules(found: dict[str, Landscape]) -> Claim:
    holds = {env_id: bool(_is_corner(one.mean_length)) for env_id, one in found.items()}
    one = found[PAPER_ENVIRONMENT]
    corner, greatest = float(one.mean_length[0, -1]), float(one.mean_length.max())
    row, column = np.unravel_index(int(one.mean_length.argmax()), one.mean_length.shape)
    return Claim(
        paper="Rules are longest, too, at support 0 and confidence 1.",
        where="Figure 3",
        ours=f"On Cart Pole they have {corner:.1f} conditions there on average, and {greatest:.1f} "
        f"at support {one.supports[row]:g} and confidence {one.confidences[column]:g}. The "
        f"greatest mean stands where the paper says in {_of(holds)}.",
        verdict=judge(all(holds.values()), any(holds.values()) or bool(corner >= _NEAR * greatest)),
        decided_by="Agrees if no other cell has longer rules, in every environment; partly, in "
        f"some, or if Cart Pole's stand within {percent(1 - _NEAR)} of the greatest.",
        numbers={"at_support_0_confidence_1": corner, "greatest": greatest},
    )


def _middle(found: dict[str, Landscape]) -> Claim:
    one = found[PAPER_ENVIRONMENT]
    places = greatest_at(one)
    inside = (places >= _MIDDLE[0]) & (places <= _MIDDLE[1])
    moved = places < one.confidences[-1]
    return Claim(
        paper="Above support 0, the longest rules move to the middle of the confidence scale.",
        where="Figure 3",
        ours=f"On Cart Pole they stand in the middle half of the scale at {int(inside.sum())} of "
        f"{len(places)} minimum supports above 0, and below confidence 1 at {int(moved.sum())}: "
        f"from {places[0]:.2f} at support {one.supports[1]:g} to {places[-1]:.2f} at "
        f"{one.supports[-1]:g}.",
        verdict=judge(bool(inside.all()), bool(moved.any())),
        decided_by="The confidence with the longest rules, the mean of several if they tie; agrees "
        "if it lies from 0.25 to 0.75 at every support of the grid above 0, partly if it is below "
        "1 at some.",
        numbers={"in_the_middle": float(inside.sum()), "below_1": float(moved.sum())},
    )


def greatest_at(landscape: Landscape) -> NDArray[np.float64]:
    """At which confidence rules are longest, for each minimum support above the first.

    Args:
        landscape: S supports.

    Returns:
        Shape (S - 1,); the mean of several confidences that tie.
    """
    lengths = landscape.mean_length[1:]
    ties = lengths == lengths.max(axis=1, keepdims=True)
    return np.asarray((ties * landscape.confidences).sum(axis=1) / ties.sum(axis=1))


def _same_way(found: dict[str, Landscape]) -> Claim:
    from scipy.stats import spearmanr

    alike = {
        env_id: float(spearmanr(one.rule_count.ravel(), one.mean_length.ravel()).statistic)
        for env_id, one in found.items()
    }
    cart, least = alike[PAPER_ENVIRONMENT], min(alike, key=lambda env_id: alike[env_id])
    return Claim(
        paper="Support and confidence influence the number of rules and their length in the same "
        "way.",
        where="text on Figure 3",
        ours=f"Over the grid, number and length rank alike with a correlation of {cart:.2f} on "
        f"Cart Pole (1 is the same order); the least is {alike[least]:.2f}, on "
        f"{environment_name(least)}.",
        verdict=judge(
            min(alike.values()) >= _ALIKE, cart >= _SOMEWHAT or max(alike.values()) >= _ALIKE
        ),
        decided_by=f"Rank correlation over the cells; agrees from {_ALIKE} in every environment, "
        f"partly from {_SOMEWHAT} on Cart Pole or {_ALIKE} in some.",
        numbers=alike,
    )


def _is_corner(values: NDArray[Any]) -> bool:
    return bool(values[0, -1] == values.max())


def _of(holds: dict[str, bool]) -> str:
    return f"{sum(holds.values())} of {len(holds)} environments"


_ABOUT = (
    "over the paper's grid, minimum supports from 0 to 0.5 and minimum confidences from 0 to 1 by "
    "0.05, for the shipped demonstrations of every environment. The paper draws Cart Pole. Exact: "
    "every cell is what mining at its thresholds gives."
)

COUNT = Study(
    name="2",
    place="Figure 2",
    title="Number of rules",
    about=f"How many rules there are {_ABOUT}",
    measure=measure,
    settings=_settings,
    numbers=lambda frame: _numbers(frame, "rule_count"),
    claims=count_claims,
    parts=_parts,
    draw=lambda frame, part, dark: _draw(frame, part, dark, "rule_count"),
    columns=_COLUMNS,
)
LENGTH = Study(
    name="3",
    place="Figure 3",
    title="Mean length of a rule",
    about=f"How many conditions a rule has on average {_ABOUT}",
    measure=measure,
    settings=_settings,
    numbers=lambda frame: _numbers(frame, "mean_length"),
    claims=length_claims,
    parts=_parts,
    draw=lambda frame, part, dark: _draw(frame, part, dark, "mean_length"),
    columns=_COLUMNS,
)
