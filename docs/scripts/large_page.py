"""The tables of docs/results/large_data.md and its picture, from what was measured."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import plotly.graph_objects as go
from plotly.subplots import make_subplots

from benchmarks.large import FEATURES, LABELS
from benchmarks.measure import duration
from docs.scripts.large_methods import METHODS
from sarl_core.explaining.colours import LABEL_COLOURS
from sarl_core.explaining.figures.png import figure_to_png, sheet
from sarl_core.explaining.layouts import figure_layout
from sarl_core.files import whole_file
from sarl_core.mining.distributed.growth import COUNTS
from sarl_core.mining.distributed.mining import SAMPLE_ROWS
from sarl_core.mining.distributed.pieces import ROWS as PIECE_ROWS
from sarl_core.mining.growing.histogram import BINS

ROOT = Path(__file__).resolve().parents[2]
RESULTS = ROOT / "docs" / "results"
JSON, PAGE = RESULTS / "large_data.json", RESULTS / "large_data.md"
PICTURE = ROOT / "docs" / "pictures" / "scaling.png"
BEGIN = "<!-- {}, made by: python -m docs.scripts.large_data -->"
END = "<!-- end of {} -->"
LINES = {
    "histogram": ("histogram learner, in memory", LABEL_COLOURS[0]),
    "exact": ("exact learner, in memory", LABEL_COLOURS[1]),
    "tree": ("scikit-learn, in memory", LABEL_COLOURS[2]),
    "cluster_1": ("files, one worker of 4 GB", LABEL_COLOURS[3]),
    "cluster_2": ("files, two workers of 4 GB", LABEL_COLOURS[4]),
}
MANY_ROWS, MANY_WORKERS = 1_000_000_000, 100
NETWORK = 1.25e9
"""Bytes a second that a machine sends: 10 Gbit/s."""
TASK = 0.001
"""Seconds of the scheduler for a task, as the guide of Dask has it."""

Outcome = Mapping[str, Any]
Outcomes = Mapping[str, Mapping[str, Outcome]]
"""By method, and by rows as text."""


def write_page(parts: Mapping[str, Outcomes]) -> None:
    """Write the tables into the page."""
    text = with_tables(PAGE.read_text(encoding="utf-8"), parts)
    with whole_file(PAGE) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


def with_tables(page: str, parts: Mapping[str, Outcomes]) -> str:
    """A page with what was measured between its marks."""
    scaling, peers = parts.get("scaling", {}), parts.get("peers", {})
    for name, text in (
        ("scaling", scaling_table(scaling)),
        ("peers", peers_table(peers)),
        ("plan", plan_table(scaling)),
    ):
        begin, end = BEGIN.format(name), END.format(name)
        before, rest = page.split(begin)
        page = f"{before}{begin}\n\n{text}\n\n{end}{rest.split(end)[1]}"
    return page


def scaling_table(scaling: Outcomes) -> str:
    """Time and memory by rows."""
    sizes = ("10000", "100000", "1000000", "10000000")
    rows = [
        [title, *(_answer(scaling.get(method, {}).get(size)) for size in sizes)]
        for method, (title, _) in LINES.items()
    ]
    return f"{_table(['', *map(_rows, sizes)], rows)}\n\n{_circumstances(scaling)}"


def peers_table(peers: Outcomes) -> str:
    """Time and memory by rows; rules and accuracy of the most rows that were answered."""
    sizes = ("10000", "100000", "1000000")
    rows = []
    for name, method in METHODS.items():
        outcomes = peers.get(name)
        if outcomes is None:
            continue
        answered = [outcomes[size] for size in sizes if "seconds" in outcomes.get(size, {})]
        last = answered[-1] if answered else {}
        version = outcomes[min(outcomes, key=int)].get("version")
        rows.append(
            [
                f"{method.title} ({version})" if version else method.title,
                *(_answer(outcomes.get(size)) for size in sizes),
                f"{last['rules']:,}" if last else "–",
                _share(last.get("accuracy")),
                _share(last.get("of_label_0")),
            ]
        )
    head = ["", *map(_rows, sizes), "rules", "accuracy", "label 0 or not"]
    return f"{_table(head, rows)}\n\n{_circumstances(peers)}"


def plan_table(scaling: Outcomes) -> str:
    """What a billion rows would take on a hundred workers, by what a worker's share took."""
    measured = scaling.get("cluster_1", {})
    times = _times(measured)
    if not times:
        return "Nothing is measured yet."
    rows = max(times)
    one = measured[str(rows)]
    pieces = MANY_ROWS // PIECE_ROWS
    a_node = FEATURES * BINS * LABELS * 8
    nodes = sum(one["splits"])
    at_once = COUNTS // (FEATURES * BINS * LABELS)
    batches = sum(math.ceil(level / at_once) for level in one["splits"])
    levels = len(one["splits"])
    adding = sum(math.ceil(pieces / 8**power) for power in range(1, 5))
    tasks = pieces * (6 + levels + batches) + adding * (batches + 3) + batches
    file_bytes = MANY_ROWS * one["file_bytes"] / rows
    share = MANY_ROWS // MANY_WORKERS
    passes = sum(
        one["work"].get(name, {}).get("seconds", 0.0)
        for name in ("survey_piece", "bin_piece", "count_piece")
    )
    moved = nodes * a_node * (pieces + adding) / MANY_WORKERS
    counting = _counting(one, rows) * levels * share
    together = passes * share / rows + counting + moved / NETWORK + tasks * TASK
    lines = [
        ("bytes a row in Parquet", f"{one['file_bytes'] / rows:.0f}", _bytes(file_bytes)),
        ("read by a worker, three passes", "", _bytes(3 * file_bytes / MANY_WORKERS)),
        (
            "seconds of a core for reading and counting",
            f"{passes * 1e6 / rows:.2f} a million rows",
            f"{duration(passes * share / rows)} on each worker",
        ),
        ("a worker's memory, at most", _bytes(one["memory"]), "the bins and what is below"),
        ("bins and labels that stay in it", "", _bytes(share * 2 * (FEATURES + 1))),
        ("histograms of a batch of nodes in it", "", _bytes(at_once * a_node * pieces / 100)),
        ("nodes that are split, on levels", f"{nodes:,} on {levels}", "as many: the rule's share"),
        ("batches of nodes that are counted at once", "", f"{batches:,}"),
        (
            "histograms that a worker sends or adds up",
            "",
            f"{_bytes(moved)}: {duration(moved / NETWORK)} at 10 Gbit/s",
        ),
        (
            "seconds of a core for these histograms",
            f"{_counting(one, rows) * 1e6:.2f} a million rows and level" if counting else "–",
            f"{duration(counting)} on each worker" if counting else "not measured",
        ),
        ("sample that the client has", "", _bytes(SAMPLE_ROWS * 4 * (FEATURES + 1))),
        (
            "tasks of the scheduler",
            f"{sum(int(each['calls']) for each in one['work'].values()):,}",
            f"{tasks:,}: {duration(tasks * TASK)} at 1 ms each",
        ),
        (
            "time, where nothing is done beside anything else",
            duration(one["seconds"]),
            f"{together / 60:.0f} minutes",
        ),
    ]
    title = f"measured: {rows:,} rows, one worker"
    return _table(["", title, "a billion rows, a hundred workers"], lines)


def _counting(one: Outcome, rows: int) -> float:
    """Seconds for the histograms of a row on a level; 0 where no level was large enough."""
    work = one["work"]
    if "histogram" not in work:
        return 0.0
    levels = work["sent_on"]["calls"] / one["pieces"]
    return float(work["histogram"]["seconds"] / (rows * levels))


def draw(parts: Mapping[str, Outcomes]) -> None:
    """Write the picture."""
    with whole_file(PICTURE) as unfinished:
        unfinished.write_bytes(sheet([[figure_to_png(scaling_figure(parts.get("scaling", {})))]]))


def scaling_figure(scaling: Outcomes) -> go.Figure:
    """Seconds against rows, a line a method, and against workers, a line a number of rows."""
    figure = make_subplots(
        rows=1,
        cols=2,
        shared_yaxes=True,
        column_widths=[0.64, 0.36],
        horizontal_spacing=0.05,
        subplot_titles=["against rows", "against workers"],
    )
    for method, (title, colour) in LINES.items():
        times = _times(scaling.get(method, {}))
        look = _look(colour) | {"line": {"color": colour, "width": 2.2}}
        if not method.startswith("cluster"):
            look["line"]["dash"] = "dot"
        figure.add_scatter(x=list(times), y=list(times.values()), name=title, row=1, col=1, **look)
    one, two = (_times(scaling.get(f"cluster_{workers}", {})) for workers in (1, 2))
    for rows in sorted({*one} & {*two}):
        figure.add_scatter(
            x=[1, 2],
            y=[one[rows], two[rows]],
            mode="lines+markers+text",
            text=["", f"  {_rows(str(rows))}"],
            textposition="middle right",
            showlegend=False,
            row=1,
            col=2,
            line={"color": LABEL_COLOURS[4], "width": 2.2},
            marker={"color": [LABEL_COLOURS[3], LABEL_COLOURS[4]], "size": 7},
            cliponaxis=False,
        )
    figure.update_layout(
        **figure_layout(400, margin={"r": 24, "b": 84, "t": 32}),
        width=820,
        template="plotly_white",
        legend={"orientation": "h", "x": 0, "y": -0.2, "yanchor": "top"},
    )
    figure.update_layout(paper_bgcolor="white", plot_bgcolor="white")
    figure.update_annotations(font={"size": 13})
    powers = range(4, 8)
    figure.update_xaxes(
        type="log",
        tickvals=[10**power for power in powers],
        ticktext=[f"{10**power:,}" for power in powers],
        range=[3.9, 7.1],
        title={"text": "rows", "standoff": 4},
        row=1,
        col=1,
    )
    figure.update_xaxes(
        tickvals=[1, 2],
        range=[0.8, 3.6],
        title={"text": "workers of one core and 4 GB", "standoff": 4},
        row=1,
        col=2,
    )
    ticks = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200]
    figure.update_yaxes(type="log", tickvals=ticks, ticktext=[f"{one:g}" for one in ticks])
    figure.update_yaxes(title={"text": "seconds", "standoff": 4}, row=1, col=1)
    return figure


def _look(colour: str) -> dict[str, Any]:
    return {
        "mode": "lines+markers",
        "marker": {"color": colour, "size": 7},
        "cliponaxis": False,
    }


def _times(outcomes: Mapping[str, Outcome]) -> dict[int, float]:
    return {
        int(size): outcomes[size]["seconds"]
        for size in sorted(outcomes, key=int)
        if "seconds" in outcomes[size]
    }


def _answer(outcome: Outcome | None) -> str:
    if outcome is None:
        return "not measured"
    if "note" in outcome:
        return str(outcome["note"])
    return f"{duration(outcome['seconds'])}, {_bytes(outcome['memory'])}"


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.1f} %"


def _bytes(value: float) -> str:
    for unit, size in (("TB", 1e12), ("GB", 1e9), ("MB", 1e6)):
        if value >= size:
            return f"{value / size:.3g} {unit}"
    return f"{value / 1e3:.3g} kB"


def _rows(size: str) -> str:
    return f"{int(size):,} rows"


def _circumstances(outcomes: Outcomes) -> str:
    """The machine, and what else it did."""
    every = [one for several in outcomes.values() for one in several.values()]
    if not every:
        return "Nothing is measured yet."
    last, load = every[-1], max(one["load_before"] for one in every)
    machine = (
        f"{last['cores']} cores, {last['machine_memory'] / 1e9:.0f} GB, Python {last['python']}."
    )
    if load < 1:
        return machine
    return (
        f"{machine} The machine did other work meanwhile (a load of {load:.1f} before this began), "
        "so that these times are longer than they need be, and differ by chance."
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return "\n".join(f"| {' | '.join(row)} |" for row in [head, ["---"] * len(head), *rows])
