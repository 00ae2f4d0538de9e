"""The command that compares two rule files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from sarl_core.cli import terminal
from sarl_core.cli.inputs import read_demonstrations
from sarl_core.cli.options import Columns, Json, MissingName, with_columns
from sarl_core.cli.stand_ins import called


@with_columns
def diff(
    first: Annotated[Path, typer.Argument(metavar="A.json", show_default=False, help="Rules.")],
    second: Annotated[
        Path, typer.Argument(metavar="B.json", show_default=False, help="Other rules.")
    ],
    columns: Columns,
    missing: MissingName = "refuse",
    demonstrations: Annotated[
        Path | None,
        typer.Option(
            "--demonstrations",
            metavar="FILE",
            show_default=False,
            help="Compare what they decide on these states. Without it, on 10,000 random ones over "
            "the range of the thresholds.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Compare two rule files: rules added, removed and changed, and what the two decide.

    Example: `python -m sarl_core diff mined.json edited.json --demonstrations
    data/demonstrations/cartpole.parquet`
    """
    with terminal.working("Comparing"):
        from sarl_core.demonstrations.recoding import recoded
        from sarl_core.mining.editing.difference import comparable
        from sarl_core.mining.editing.shared_words import in_shared_words
        from sarl_core.mining.rule_order import rules_for
        from sarl_core.mining.rule_set import RuleSet
        from sarl_core.shielding.disagreement import SAMPLED_STATES, disagreement, sampled_states

        one, other = RuleSet.load(first), RuleSet.load(second)
        one, other, words = in_shared_words(one, other)
        other, notes = comparable(one, other)
        if demonstrations is None:
            states = sampled_states([one, other])
            states_from = (
                f"The states are {SAMPLED_STATES:,} random ones over the range of the thresholds, "
                "the same every time; --demonstrations takes those of a file."
            )
        else:
            recorded = read_demonstrations(demonstrations, None, columns, missing)
            recorded = recoded(recorded, one.source.features, called=called(demonstrations))
            one, more = rules_for(one, recorded, called="the states")
            other, notes = comparable(one, other)[0], (*recorded.notes, *notes, *more)
            states = recorded.observations
            states_from = f"The states are those of {called(demonstrations)}."
        difference = disagreement(one, other, states)
    from sarl_core.explaining.words.difference import difference_document, difference_lines

    names = (called(first), called(second))
    if as_json:
        document = difference_document(
            difference,
            names=names,
            states_from=called(demonstrations)
            if demonstrations
            else "random over the range of the thresholds",
        )
        terminal.print_json({**document, "notes": [*words, *notes]})
    else:
        lines = difference_lines(difference, names=names, states_from=states_from)
        terminal.print_lines([*lines, *(f"note: {note}" for note in (*words, *notes))])
