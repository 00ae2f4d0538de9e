"""A threshold landscape as a file: JSON, CSV, an interactive page, or a picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sarl_core.errors import InputError
from sarl_core.files import whole_file
from sarl_core.mining.never.landscape import NEVER_LAYERS, NeverLandscape
from sarl_core.mining.thresholds.landscape import LAYERS, Landscape

MAX_VALUES = 10_001  # an axis in steps of 0.0001
MAX_CELLS = 4_000_000  # as a file, half a gigabyte


def parse_grid(text: str, name: str) -> NDArray[np.float64]:
    """Read the thresholds of a grid, written ``a:b:step``.

    Args:
        text: As "0:0.5:0.05"; b is included if the steps reach it.
        name: Of the option, for errors.

    Returns:
        The thresholds, ascending. Each is the float nearest to the decimal number, so that
        three steps of 0.05 are 0.15 and nothing beside it.

    Raises:
        InputError: If it is not of this form, leaves [0, 1] or has too many values.
    """
    try:
        first, last, step = (Decimal(part) for part in text.split(":"))
    except (ValueError, InvalidOperation) as error:
        raise InputError(
            f"{name} is {text!r}; give the first value, the last and the step, as 0:0.5:0.05"
        ) from error
    if not all(value.is_finite() for value in (first, last, step)) or step <= 0 or last < first:
        raise InputError(
            f"{name} is {text!r}; the step must be above 0 and the last value not below the first"
        )
    if first < 0 or last > 1:
        raise InputError(f"{name} is {text!r}; thresholds are shares from 0 to 1")
    if (last - first) / step >= MAX_VALUES:
        raise InputError(f"{name} is {text!r}, more than {MAX_VALUES:,} values; give a larger step")
    count = int((last - first) / step) + 1
    return np.array([float(first + index * step) for index in range(count)])


def save_landscape(
    landscape: Landscape | NeverLandscape, names: Sequence[str], path: Path, *, title: str = ""
) -> None:
    """Write a landscape; the file appears whole or not at all.

    Args:
        landscape: To write.
        names: Of the action dimensions.
        path: A `.json`, `.csv`, `.html` (opens without a network) or `.png` file.
        title: Above the figure.

    Raises:
        InputError: If the path has another ending, or the grid too many cells for a file.
        WorkError: If the file cannot be written, or no browser is there to draw a PNG.
    """
    if landscape.rule_count.size > MAX_CELLS:
        raise InputError(
            f"the grid has {landscape.rule_count.size:,} cells, more than {MAX_CELLS:,}; "
            "give larger steps"
        )
    suffix = path.suffix.lower()
    if suffix == ".json":
        document = landscape_document(landscape, names)
        content = json.dumps(document, ensure_ascii=False, allow_nan=False).encode() + b"\n"
    elif suffix == ".csv":
        content = _csv(landscape, names).encode()
    elif suffix in (".html", ".png"):
        from markupsafe import Markup

        from sarl_core.explaining.figures.png import figure_to_png
        from sarl_core.explaining.figures.thresholds import landscape_figure
        from sarl_core.explaining.templates import render

        figure = landscape_figure(landscape, title=title)
        content = (
            figure_to_png(figure)
            if suffix == ".png"
            else render(
                "documents/figure",
                title=title or "Rules at every pair of thresholds",
                figure=Markup(figure.to_html(full_html=False, include_plotlyjs=True)),
            ).encode()
        )
    else:
        raise InputError(f"{path} ends in none of .json, .csv, .html, .png; choose one")
    with whole_file(path) as unfinished:
        unfinished.write_bytes(content)


def landscape_document(
    landscape: Landscape | NeverLandscape, names: Sequence[str]
) -> dict[str, Any]:
    """A landscape for JSON.

    Args:
        landscape: To write.
        names: Of the action dimensions.

    Returns:
        `supports`, `confidences` (of never-rules `epsilons`), the layers as one list a support
        with one entry a confidence (fidelity null where nothing is covered), and under
        `dimensions` the layers of each action dimension with its `name`.
    """
    across = (
        {"epsilons": landscape.epsilons.tolist()}
        if isinstance(landscape, NeverLandscape)
        else {"confidences": landscape.confidences.tolist()}
    )
    parts: Sequence[Landscape | NeverLandscape] = landscape.dimensions
    return {
        "supports": landscape.supports.tolist(),
        **across,
        **_layers(landscape),
        "dimensions": [
            {"name": name, **_layers(part)} for name, part in zip(names, parts, strict=True)
        ],
    }


def _layers(landscape: Landscape | NeverLandscape) -> dict[str, Any]:
    names = NEVER_LAYERS if isinstance(landscape, NeverLandscape) else LAYERS
    layers = {layer: getattr(landscape, layer).tolist() for layer in names}
    # NaN, the only number that is not itself, is where nothing is covered.
    layers["fidelity"] = [
        [None if value != value else value for value in row] for row in layers["fidelity"]
    ]
    return layers


def _csv(landscape: Landscape | NeverLandscape, names: Sequence[str]) -> str:
    """One row a cell; with several action dimensions, of the whole and of each."""
    import pandas as pd

    parts: list[tuple[str, Landscape | NeverLandscape]] = [("all", landscape)]
    if len(names) > 1:
        parts += zip(names, landscape.dimensions, strict=True)
    never = isinstance(landscape, NeverLandscape)
    layers = ("epsilon", *NEVER_LAYERS) if never else ("confidence", *LAYERS)
    columns = ["dimension", "support", *layers]
    table = pd.concat(part.to_frame().assign(dimension=name)[columns] for name, part in parts)
    return table.to_csv(index=False, lineterminator="\n")
