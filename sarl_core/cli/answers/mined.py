"""What commands answer about mined files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from sarl_core.cli import terminal

if TYPE_CHECKING:
    from sarl_core.mining.distributed.mined_data import MinedData


def describe_mined(mined: MinedData, path: Path) -> dict[str, Any]:
    """What a mined file holds.

    Args:
        mined: Its content.
        path: The file.

    Returns:
        A document for JSON.
    """
    source = mined.trees[0].source
    return {
        "file": str(path),
        "env_id": source.env_id,
        "steps": source.steps,
        "episodes": source.episodes,
        "sample": len(mined.sample),
        "features": [
            {
                "name": feature.name,
                "unit": feature.unit,
                "bins": len(one.counts),
                "median": median,
            }
            for feature, one, median in zip(
                source.features, mined.histograms, mined.medians, strict=True
            )
        ],
        "trees": [
            {
                "action": tree.dimension.name,
                "nodes": tree.n_nodes,
                "depth": int(tree.depth.max()),
                "labels": dict(
                    zip(tree.dimension.label_names, tree.counts[0].tolist(), strict=True)
                ),
            }
            for tree in mined.trees
        ],
        "divider": mined.divider,
        "learner": mined.trees[0].learner,
        "min_support": mined.min_support,
        "held_out_episodes": mined.held_out_episodes,
        "notes": list(mined.sample.notes),
        "digest": source.digest,
    }


def print_mined(document: dict[str, Any]) -> None:
    """Print what `describe_mined` gave.

    Args:
        document: What it gave.
    """
    from sarl_core.mining.language import counted

    terminal.print_lines([f"note: {note}" for note in document["notes"]])
    terminal.print_lines([f"{document['file']}: what is left of {document['steps']:,} steps"])
    held = document["held_out_episodes"]
    facts = [
        ("mined from", counted(document["episodes"], "episode")),
        ("held out", counted(held, "episode") if held else "none"),
        *(
            (
                f"tree of {tree['action']}",
                f"{tree['nodes']:,} nodes, at most {counted(tree['depth'], 'condition')}",
            )
            for tree in document["trees"]
        ),
        ("smallest support", f"{document['min_support']:g}"),
        ("steps in it", f"a sample of {document['sample']:,}"),
        ("digest", document["digest"]),
    ]
    terminal.print_facts(facts)
