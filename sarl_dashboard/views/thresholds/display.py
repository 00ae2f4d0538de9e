"""What the page shows of the thresholds, and how: the choices above the figures."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import streamlit as st

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.explaining.figures.thresholds import Layer
from sarl_core.explaining.words.growth import LEARNERS
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.growing.growth import EXACT_UP_TO
from sarl_core.mining.growing.histogram import BINS
from sarl_core.mining.never.landscape import NeverLandscape
from sarl_core.mining.never.steps import FINE_EPSILONS
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.thresholds.landscape import PAPER_CONFIDENCES, PAPER_SUPPORTS, Landscape
from sarl_core.mining.thresholds.steps import FINE_CONFIDENCES, FINE_SUPPORTS
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.components.journey.words import with_words, word_help
from sarl_dashboard.components.settings import switch
from sarl_dashboard.state import rule_base
from sarl_dashboard.state.compact_set import Compact
from sarl_dashboard.state.data import chosen_demonstrations, data_parts
from sarl_dashboard.state.mined import (
    mined_landscape,
    mined_leeway,
    mined_never_landscape,
    mined_rules,
)
from sarl_dashboard.state.thresholds import (
    FORBID,
    MAX_DEPTH,
    MAX_LIFT,
    choose_learner,
    chosen_learner,
    chosen_mode,
    from_least,
    settled,
)

MAPS, SURFACES = "Maps", "3-D"
FINE, PAPER = "Fine grid", "Paper's grid"
LARGEST, TRADE_OFFS, DIVIDER = "Largest rules", "Best trade-offs", "Divider"
WHOLE = "All actions"
SIZE, QUALITY, HELD_OUT = "Rules and length", "Coverage and fidelity", "Held out"
LEFT = "Rules and freedom"
LAYERS: dict[str, tuple[Layer, Layer]] = {
    SIZE: ("rule_count", "mean_length"),
    QUALITY: ("coverage", "fidelity"),
    HELD_OUT: ("fidelity", "held_out_fidelity"),
}


NEVER_LAYERS: dict[str, tuple[Layer, Layer]] = {
    LEFT: ("rule_count", "freedom"),
    QUALITY: ("coverage", "fidelity"),
}


@dataclass(frozen=True, eq=False)
class Display:
    """What is looked at, and how.

    Attributes:
        trees: One an action dimension.
        compact: The compact rules where they are in force; None for thresholds.
        held_out: The episodes held out, or the file that counted them; None where there are none.
        dimension: Which action dimension is looked at; None for all.
        layers: What the two figures show.
        surfaces: Whether as the paper's surfaces, and not as maps.
        paper_grid: Whether on the paper's grid.
        forbids: Whether rules at the thresholds forbid, and none of them demands.
    """

    trees: tuple[PolicyTree, ...]
    compact: Compact | None
    held_out: Demonstrations | MinedData | None
    dimension: int | None
    layers: tuple[Layer, Layer]
    surfaces: bool
    paper_grid: bool
    forbids: bool

    @property
    def is_divided(self) -> bool:
        """Whether the actions are continuous, and the divider says what labels there are."""
        return self.trees[0].dimension.is_interval

    def landscape(self, thresholds: Thresholds) -> Landscape | NeverLandscape:
        """The landscape over the grid.

        Args:
            thresholds: Those in force; only lift and depth count.
        """
        if self.forbids:
            return self._never(from_least(FINE_SUPPORTS), FINE_EPSILONS, thresholds)
        supports, confidences = FINE_SUPPORTS, FINE_CONFIDENCES
        if self.paper_grid:
            supports, confidences = tuple(PAPER_SUPPORTS), tuple(PAPER_CONFIDENCES)
        return self._part(from_least(supports), confidences, thresholds)

    def point(self, thresholds: Thresholds) -> Landscape | NeverLandscape:
        """The numbers in force, in the shape of a landscape of one point.

        Args:
            thresholds: Those in force; set aside where the compact rules are.
        """
        if self.compact is not None:
            return _compact_point(self.compact.counted, self.dimension)
        if thresholds.never is not None and thresholds.demands:
            return self._both(thresholds)
        if thresholds.never is not None:
            return self._never((thresholds.support,), (thresholds.never,), thresholds)
        return self._part((thresholds.support,), (thresholds.confidence,), thresholds)

    def _never(
        self, supports: tuple[float, ...], epsilons: tuple[float, ...], limits: Thresholds
    ) -> NeverLandscape:
        whole = mined_never_landscape(self.trees, supports, epsilons, depth=limits.max_depth)
        return whole if self.dimension is None else whole.dimensions[self.dimension]

    def _both(self, thresholds: Thresholds) -> NeverLandscape:
        """Of rules that demand with others behind them, which no landscape counts."""
        demonstrations = chosen_demonstrations()
        assert demonstrations is not None
        rules = mined_rules(self.trees, thresholds, data_parts())
        count = 1 if self.dimension is None else len(rules.actions)
        if self.dimension is not None:
            rules = replace(rules, rules=rules.of_dimension(self.dimension))
        leeway, nowhere = mined_leeway(rules, demonstrations), np.zeros(1)
        return NeverLandscape(
            nowhere,
            nowhere,
            np.array([[len(rules)]]),
            np.array([[rules.mean_length]]),
            # Of one dimension alone: in all others no rule applies.
            np.array([[count * leeway.coverage]]),
            np.array([[leeway.fidelity]]),
            np.array([[1.0 - count * (1.0 - leeway.freedom)]]),
        )

    def _part(
        self, supports: tuple[float, ...], confidences: tuple[float, ...], limits: Thresholds
    ) -> Landscape:
        whole = mined_landscape(
            self.trees,
            supports,
            confidences,
            lift=limits.lift,
            depth=limits.max_depth,
            held_out=self.held_out,
        )
        return whole if self.dimension is None else whole.dimensions[self.dimension]


def _compact_point(rules: RuleSet, dimension: int | None) -> Landscape:
    if dimension is not None:
        own = rules.of_dimension(dimension)
        rules = replace(rules, rules=own, actions=(rules.actions[dimension],))
    nowhere = np.zeros(1)
    return Landscape(
        nowhere,
        nowhere,
        np.array([[len(rules)]]),
        np.array([[rules.mean_length]]),
        np.array([[rules.coverage]]),
        np.array([[rules.fidelity]]),
    )


def chosen_display(
    trees: tuple[PolicyTree, ...],
    compact: Compact | None,
    held_out: Demonstrations | MinedData | None,
) -> Display:
    """The choices above the figures.

    Args:
        trees: One an action dimension.
        compact: The compact rules where they are in force.
        held_out: The episodes held out, or the file that counted them; None where there are none.
    """
    forbids = chosen_mode() == FORBID
    with st.container(horizontal=True, gap="medium", vertical_alignment="center", key="ways"):
        if forbids:
            layers, grid = NEVER_LAYERS, FINE  # the paper knows no such rules
            pair = switch("Show", "left", list(layers), "What the two figures show")
        else:
            layers = LAYERS
            pairs = [SIZE, QUALITY] if held_out is None else list(layers)
            pair = switch("Show", "layer", pairs, "What the two figures show")
        view = switch("View", "view", [MAPS, SURFACES], "Maps, or the paper's surfaces")
        if not forbids:
            grid = switch(
                "Grid",
                "grid",
                [FINE, PAPER],
                "Fine: dense where most happens. The paper's: 0 to 0.5 and 0 to 1 by 0.05.",
            )
        more()
        dimension = chosen_dimension([tree.dimension.name for tree in trees])
    return Display(
        trees, compact, held_out, dimension, layers[pair], view == SURFACES, grid == PAPER, forbids
    )


def more() -> None:
    """What changes the whole plane, and is rarely needed."""
    with st.popover("More", icon=":material/tune:"):
        if chosen_mode() != FORBID:
            st.slider(
                "Minimum lift",
                0.0,
                MAX_LIFT,
                value=0.0,
                step=0.1,
                key="lift",
                bind="query-params",
                on_change=rule_base.choose,
                help=word_help(
                    "lift", "Here: how much of it a rule must have at least; 0: no limit."
                ),
            )
        st.slider(
            "Maximum depth",
            0,
            MAX_DEPTH,
            value=0,
            key="depth",
            bind="query-params",
            on_change=rule_base.choose,
            help=with_words("Most conditions of a rule. 0: no limit."),
        )
        if settled() is not None:
            st.caption("What grew the trees was settled when these steps were mined.")
            return
        st.session_state["_learner_choice"] = chosen_learner()
        st.selectbox(
            "Learner",
            list(LEARNERS),
            key="_learner_choice",
            format_func=LEARNERS.__getitem__,
            on_change=_choose_learner,
            help=with_words(
                "What grows the decision tree. Exact tries every border between two values; "
                f"histogram those between {BINS:,} bins of a feature, for many states. Automatic: "
                f"exact up to {EXACT_UP_TO:,} states, then histogram. "
                "Counts are of all states with either."
            ),
        )


def _choose_learner() -> None:
    rule_base.choose()
    choose_learner(st.session_state["_learner_choice"])


def chosen_dimension(names: list[str]) -> int | None:
    """Which of the action dimensions is looked at; None for all together."""
    if len(names) == 1:
        return None
    # Not a switch, which takes its options for Markdown.
    name = st.selectbox(
        "Action",
        [WHOLE, *names],
        key="dimension",
        bind="query-params",
        width=200,
        label_visibility="collapsed",
    )
    return names.index(name) if name in names else None
