"""What is chosen, and the cached ways to everything that follows from it.

The URL holds every choice. Widgets that can bind themselves to it; the choices that cannot (the
data set, whose name on screen is not its name in the URL, and the rule, which is a selection in
a table) go through `url_choice`.
"""

from __future__ import annotations

import gc
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, cast

import _hold_out
import _names
import numpy as np
import streamlit as st
from _cache import cached, visit
from _hold_out import Parts
from _url import set_url_choice, url_choice
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.names import digest_of_pairs
from sarl_core.errors import SarlError
from sarl_core.explaining.tables import TopRules, top_rules
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.envelope import with_boxes
from sarl_core.mining.episode_counts import EpisodeCounts
from sarl_core.mining.holding_out import count_held_out, with_held_out
from sarl_core.mining.landscape import Landscape, threshold_landscape
from sarl_core.mining.pareto import ParetoPoint, pareto_front
from sarl_core.mining.rule_names import renamed_trees
from sarl_core.mining.rules import FILTERED, RuleSet, Thresholds
from sarl_core.mining.tree import PolicyTree, grow_policy_trees

SHIPPED = {
    "lunar_lander": ("Lunar Lander", "LunarLander-v3"),
    "cartpole": ("Cart Pole", "CartPole-v1"),
    "pendulum": ("Pendulum", "Pendulum-v1"),
    "bipedal_walker": ("Bipedal Walker", "BipedalWalker-v3"),
    "lunar_lander_continuous": ("Lunar Lander, continuous", "LunarLanderContinuous-v3"),
}
UPLOAD = "upload"
DEFAULT_DATA = "lunar_lander"
MIN_DIVIDER, MAX_DIVIDER = 2, 16
MAX_LIFT = 20.0
MAX_DEPTH = 64  # 0 is no limit
DATA_FOLDER = Path(__file__).parents[1] / "data" / "demonstrations"


# --- what is chosen ----------------------------------------------------------------------------


def dataset_names() -> tuple[str, ...]:
    """What the URL parameter `data` may be: the shipped sets, and "upload"."""
    return (*SHIPPED, UPLOAD)


def dataset_label(name: str) -> str:
    """What a data set is called on screen."""
    return SHIPPED[name][0] if name in SHIPPED else "Your upload"


def chosen_dataset() -> str:
    """Name of the chosen data set, one of `dataset_names`."""
    return url_choice("data", dataset_names(), DEFAULT_DATA)


def choose_dataset(name: str) -> None:
    """Choose a data set, with all its episodes; for callbacks."""
    _hold_out.leave_out(())
    set_url_choice("data", name, DEFAULT_DATA)


def set_upload(demonstrations: Demonstrations, *, file_name: str = "") -> None:
    """Keep uploaded demonstrations for this session, and choose them.

    Args:
        demonstrations: Read and checked.
        file_name: Shown where the data is named.
    """
    visit().bring(demonstrations.digest)
    st.session_state["_upload"] = demonstrations
    st.session_state["_upload_name"] = file_name
    choose_dataset(UPLOAD)


def uploaded() -> Demonstrations | None:
    """The demonstrations uploaded in this session, if any."""
    return cast("Demonstrations | None", st.session_state.get("_upload"))


def raw_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations as they were read; None while nothing is uploaded.

    A shipped file that cannot be read is said on the page, which then stops.
    """
    name = chosen_dataset()
    if name == UPLOAD:
        return uploaded()
    try:
        return shipped_demonstrations(name)
    except SarlError as error:
        st.error(str(error), icon=":material/error:")
        st.stop()


# The way of the data: as it was read (`raw_demonstrations`), under the names given to it
# (`all_demonstrations`), less what is left out, less what is held out (`_hold_out`). What rules are
# mined from is what remains.


def all_demonstrations() -> Demonstrations | None:
    """The chosen demonstrations with every episode; None while nothing is uploaded."""
    raw = raw_demonstrations()
    return None if raw is None else _names.named(raw)


def data_key() -> str:
    """What tells the data that rules are mined from, whatever names were given to them."""
    raw, choice = raw_demonstrations(), _hold_out.chosen()
    drawn = (choice.share, choice.seed) if choice.share else ()
    return repr(("" if raw is None else raw.digest, choice.left_out, drawn))


def parts() -> Parts | None:
    """What is mined from and what is held out; None while nothing is uploaded."""
    demonstrations = all_demonstrations()
    return None if demonstrations is None else _hold_out.parted(demonstrations)


def chosen_demonstrations() -> Demonstrations | None:
    """The demonstrations that rules are mined from, and every page works on.

    None while nothing is uploaded.
    """
    found = parts()
    return None if found is None else found.mined


def held_out() -> Demonstrations | None:
    """The episodes that rules are tried on; None where nothing is held out."""
    found = parts()
    return None if found is None else found.held_out


def held_out_digest() -> str:
    """What tells the held-out episodes from others; "" where nothing is held out."""
    return _digest(held_out())


def require_demonstrations() -> Demonstrations:
    """The chosen demonstrations; where there are none, say what to do and stop the page."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None:
        st.info(
            "Nothing has been uploaded in this session. Upload a file on the Demonstrations "
            "page, or choose a shipped set in the sidebar.",
            icon=":material/upload_file:",
        )
        st.page_link(
            "demonstrations.py", label="Go to Demonstrations", icon=":material/arrow_forward:"
        )
        st.stop()
    return demonstrations


def _number(name: str, default: float, low: float, high: float) -> float:
    """A number that a widget of some page holds; else the URL's; else the default."""
    value: Any = st.session_state.get(name)
    if value is None:
        value = st.query_params.get(name, default)
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = default
    if not (math.isfinite(number) and low <= number <= high):
        number = default
    return number


def chosen_limits() -> tuple[float, int | None]:
    """Minimum lift and maximum depth in force (URL: lift, depth; depth 0 is no limit)."""
    return _number("lift", 0.0, 0.0, MAX_LIFT), int(_number("depth", 0, 0, MAX_DEPTH)) or None


def chosen_thresholds() -> Thresholds:
    """The thresholds in force (URL: support, confidence, and those of `chosen_limits`)."""
    return Thresholds(
        _number("support", FILTERED.support, 0.0, 1.0),
        _number("confidence", FILTERED.confidence, 0.0, 1.0),
        *chosen_limits(),
    )


def choose_thresholds(thresholds: Thresholds) -> None:
    """Put thresholds in force; for callbacks, and before the sliders are drawn."""
    for name, value in (
        ("support", thresholds.support),
        ("confidence", thresholds.confidence),
        ("lift", thresholds.lift),
        ("depth", thresholds.max_depth or 0),
    ):
        if st.session_state.get(name) != value:
            st.session_state[name] = value


def chosen_divider() -> int:
    """Number of intervals of continuous actions (URL: divider)."""
    return int(_number("divider", MIN_DIVIDER, MIN_DIVIDER, MAX_DIVIDER))


def choose_divider(divider: int) -> None:
    """Choose a divider; for callbacks, and before its slider is drawn."""
    if st.session_state.get("divider") != divider:
        st.session_state["divider"] = divider


# --- what follows, cached ----------------------------------------------------------------------
# Streamlit samples large arguments when it hashes them, so everything large is passed with a
# leading underscore and stands in the key by its digest.


@cached(show_spinner="Reading the demonstrations …")
def shipped_demonstrations(name: str) -> Demonstrations:
    """A shipped set.

    Args:
        name: One of `SHIPPED`.

    Returns:
        Its demonstrations, shared between sessions (they are immutable).
    """
    from sarl_core.demonstrations.formats import load_demonstrations

    return load_demonstrations(DATA_FOLDER / f"{name}.parquet")


@cached(show_spinner="Growing the decision tree …")
def _grown(pairs: str, divider: int, _demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    return grow_policy_trees(_demonstrations, divider=divider)


@cached()
def _trees(digest: str, divider: int, _demonstrations: Demonstrations) -> tuple[PolicyTree, ...]:
    # Other names make no other tree.
    grown = _grown(digest_of_pairs(_demonstrations), divider, _demonstrations)
    return renamed_trees(grown, _demonstrations)


def trees(demonstrations: Demonstrations, divider: int) -> tuple[PolicyTree, ...]:
    """The trees of demonstrations, one an action dimension; grown once.

    Args:
        demonstrations: N pairs.
        divider: Number of intervals of continuous actions; without meaning for discrete ones.

    Returns:
        Shared between sessions (they are immutable).
    """
    if demonstrations.is_discrete:
        divider = MIN_DIVIDER
    return _trees(demonstrations.digest, divider, demonstrations)


def _key(grown: tuple[PolicyTree, ...]) -> tuple[str, int]:
    return grown[0].source.digest, grown[0].divider


@cached()
def _rule_set(
    key: tuple[str, int],
    thresholds: Thresholds,
    digests: tuple[str, str],
    _trees: tuple[PolicyTree, ...],
    _parts: Parts | None,
) -> RuleSet:
    mined = mine_rules(
        _trees,
        supp_min=thresholds.support,
        conf_min=thresholds.confidence,
        lift_min=thresholds.lift,
        max_depth=thresholds.max_depth,
    )
    if _parts is None:
        return mined
    boxed = with_boxes(mined, _parts.mined)
    return boxed if _parts.held_out is None else with_held_out(boxed, _parts.held_out)


def rule_set(
    grown: tuple[PolicyTree, ...] | None = None, thresholds: Thresholds | None = None
) -> RuleSet:
    """The rule set in force, or that of other trees and thresholds.

    Args:
        grown: Trees; those of the chosen data and divider where not given.
        thresholds: The chosen ones where not given.

    Returns:
        Mined once for each combination. Rules of the chosen data carry their data boxes and what
        the held-out episodes say of them.
    """
    if grown is None:
        grown = trees(require_demonstrations(), chosen_divider())
    found = parts()
    if found is not None and found.mined.digest != grown[0].source.digest:
        found = None
    digests = ("", "") if found is None else (found.mined.digest, _digest(found.held_out))
    return _rule_set(_key(grown), thresholds or chosen_thresholds(), digests, grown, found)


def _digest(demonstrations: Demonstrations | None) -> str:
    return "" if demonstrations is None else demonstrations.digest


@cached()
def _held_out_counts(
    key: tuple[str, int],
    digest: str,
    _trees: tuple[PolicyTree, ...],
    _held_out: Demonstrations,
) -> tuple[EpisodeCounts, ...]:
    return count_held_out(_trees, _held_out)


@cached()
def _landscape(
    key: tuple[str, int],
    supports: tuple[float, ...],
    confidences: tuple[float, ...],
    lift: float,
    depth: int | None,
    held_out: str,
    _trees: tuple[PolicyTree, ...],
    _counts: tuple[EpisodeCounts, ...] | None,
) -> Landscape:
    return threshold_landscape(
        _trees, supports, confidences, lift_min=lift, max_depth=depth, held_out=_counts
    )


def landscape(
    grown: tuple[PolicyTree, ...],
    supports: NDArray[np.float64] | Sequence[float],
    confidences: NDArray[np.float64] | Sequence[float],
    *,
    lift: float = 0.0,
    depth: int | None = None,
) -> Landscape:
    """The landscape over a grid, computed once for each combination.

    It has a layer of what the held-out episodes say, where there are some.
    """
    other = held_out()
    counts = None
    if other is not None:
        counts = _held_out_counts(_key(grown), other.digest, grown, other)
    return _landscape(
        _key(grown),
        tuple(map(float, supports)),
        tuple(map(float, confidences)),
        lift,
        depth,
        _digest(other),
        grown,
        counts,
    )


@cached()
def _pareto(
    key: tuple[str, int], lift: float, depth: int | None, _trees: tuple[PolicyTree, ...]
) -> tuple[ParetoPoint, ...]:
    return pareto_front(_trees, lift_min=lift, max_depth=depth)


def pareto(
    grown: tuple[PolicyTree, ...], *, lift: float = 0.0, depth: int | None = None
) -> tuple[ParetoPoint, ...]:
    """The rule sets that no other one beats, found once for each combination."""
    return _pareto(_key(grown), lift, depth, grown)


@cached()
def _top_rules(
    key: tuple[str, int], thresholds: Thresholds, most: int, _trees: tuple[PolicyTree, ...]
) -> TopRules:
    return top_rules(_trees, thresholds, most)


def largest_rules(grown: tuple[PolicyTree, ...], thresholds: Thresholds, most: int) -> TopRules:
    """The rules with the most support, without making the rest of a large set."""
    return _top_rules(_key(grown), thresholds, most, grown)


@st.cache_resource(show_spinner=False)
def settle(page: str) -> None:
    """Take what a page's first visit has loaded out of the garbage collector's sight.

    Streamlit collects all garbage after every run, and once more before a run that a callback asks
    for. Libraries and trees are here to stay; looking through them each time takes longer than
    everything that follows from a moved slider.

    Args:
        page: Its title; once for each.
    """
    gc.collect()
    gc.freeze()


# --- how it looks ------------------------------------------------------------------------------


def is_dark() -> bool:
    """Whether the visitor's theme is dark."""
    return str(st.context.theme.get("type", "light")) == "dark"
