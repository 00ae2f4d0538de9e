"""Where states without a rule lie: their features beside those of the demonstrated states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.explaining.colours import MARKER_COLOUR, MUTED_COLOUR, faded
from sarl_core.explaining.layouts import figure_layout
from sarl_core.explaining.markup import plain
from sarl_core.explaining.ticks import share_ticks
from sarl_core.improving.gaps import Gaps
from sarl_core.mining.language import number_text, share_text

_TAIL = 0.002  # of the states at either end, kept from flattening the rest of a histogram
_HEIGHT = 180


@dataclass(frozen=True, eq=False)
class GapHistogram:
    """One feature over the demonstrated states and over those that need a demonstration.

    Attributes:
        feature: Its index.
        edges: Of B bins, (B + 1,); values outside count to the outermost.
        demonstrated: Share of the demonstrated states in each bin, (B,).
        missing: Share of the states without a rule in each bin, (B,).
    """

    feature: int
    edges: NDArray[np.float64]
    demonstrated: NDArray[np.float64]
    missing: NDArray[np.float64]

    @property
    def difference(self) -> float:
        """How far the two are apart, 0 (alike) to 1 (nowhere the same)."""
        return float(np.abs(self.demonstrated - self.missing).sum() / 2)


def gap_histograms(
    demonstrations: Demonstrations, gaps: Gaps, *, bins: int = 40
) -> tuple[GapHistogram, ...]:
    """Compare states without a rule with the demonstrated ones, feature by feature.

    Args:
        demonstrations: N pairs, with the features of the gaps.
        gaps: K states, K at least 1.
        bins: Of the histograms.

    Returns:
        One entry a feature, the one in which they differ most first.
    """
    histograms = []
    for index in range(gaps.observations.shape[1]):
        demonstrated, missing = demonstrations.observations[:, index], gaps.observations[:, index]
        ends = [np.quantile(values, [_TAIL, 1 - _TAIL]) for values in (demonstrated, missing)]
        low, high = float(min(end[0] for end in ends)), float(max(end[1] for end in ends))
        if not low < high:
            low, high = low - 0.5, high + 0.5
        edges = np.linspace(low, high, bins + 1)
        histograms.append(
            GapHistogram(
                index,
                edges,
                *(_shares(values, low, high, bins) for values in (demonstrated, missing)),
            )
        )
    return tuple(sorted(histograms, key=lambda one: -one.difference))


def _shares(values: NDArray[np.float32], low: float, high: float, bins: int) -> NDArray[np.float64]:
    scaled = (values.astype(np.float64) - low) * (bins / (high - low))
    index = np.clip(scaled, 0, bins - 1).astype(np.int64)
    return np.bincount(index, minlength=bins) / len(values)


def gap_figure(histogram: GapHistogram, feature: Feature) -> go.Figure:
    """One feature over the demonstrated states and over those that need a demonstration.

    Args:
        histogram: Of the feature.
        feature: Name and unit.

    Returns:
        Two histograms over each other, each of its own states.
    """
    edges = histogram.edges
    unit = f" {plain(feature.unit)}" if feature.unit else ""
    ranges = [
        f"{number_text(low, apart_from=high)} to {number_text(high, apart_from=low)}{unit}"
        for low, high in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
    ]
    figure = go.Figure()
    for name, shares, fill in (
        ("demonstrated states", histogram.demonstrated, faded(MUTED_COLOUR, 0.6)),
        ("states without a rule", histogram.missing, faded(MARKER_COLOUR, 0.65)),
    ):
        figure.add_bar(
            x=(edges[:-1] + edges[1:]) / 2,
            y=np.round(shares, 6),
            width=np.diff(edges),
            name=name,
            customdata=ranges,
            hovertext=[share_text(share) for share in shares.tolist()],
            marker={"color": fill, "line": {"width": 0}},
            hovertemplate=f"%{{customdata}}<br>%{{hovertext}} of the {name}<extra></extra>",
        )
    figure.update_layout(
        **figure_layout(
            _HEIGHT,
            margin={"l": 44, "r": 10, "t": 6, "b": 40},
            barmode="overlay",
            bargap=0,
            showlegend=False,
        )
    )
    figure.update_xaxes(
        range=[float(edges[0]), float(edges[-1])],
        fixedrange=True,
        showgrid=False,
        zeroline=False,
        nticks=6,
        title={"text": plain(feature.unit), "standoff": 4},
    )
    most = float(max(histogram.demonstrated.max(), histogram.missing.max()))
    figure.update_yaxes(**share_ticks(0.0, 1.05 * most, 4), fixedrange=True, zeroline=False)
    return figure
