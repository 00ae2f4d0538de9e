"""Finished episodes as JSON, to be kept: every number in full, without the steps."""

from __future__ import annotations

import json
from typing import Annotated, Any

import numpy as np
from msgspec import Meta, Struct

from sarl_core.documents import LARGEST_WHOLE, MisfitError, conformed, parse_json
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import Episodes

FORMAT, VERSION = "sarl-episodes", 1
_WHOLE = ("seeds", "lengths", "interventions", "covered", "outside", "withheld")
_YES_OR_NO = ("terminated", "truncated", "cut")
_NUMBERS = ("returns", "last_rewards", "freedom", "costs")
_PERHAPS_WHOLE, _PERHAPS_NUMBERS = ("flips", "invalid"), ("signalled",)
_KINDS: dict[str, type] = {
    **dict.fromkeys((*_WHOLE, *_PERHAPS_WHOLE), np.int64),
    **dict.fromkeys(_YES_OR_NO, np.bool_),
    **dict.fromkeys((*_NUMBERS, *_PERHAPS_NUMBERS), np.float64),
}


_Whole = Annotated[int, Meta(ge=-LARGEST_WHOLE, le=LARGEST_WHOLE)]


class _EpisodesDocument(Struct, forbid_unknown_fields=True):
    format: str
    version: int
    env_id: str
    agent: str
    notes: list[str]
    seeds: list[_Whole]
    lengths: list[_Whole]
    interventions: list[_Whole]
    covered: list[_Whole]
    outside: list[_Whole]
    withheld: list[_Whole]
    terminated: list[bool]
    truncated: list[bool]
    cut: list[bool]
    returns: list[float | None]
    last_rewards: list[float | None]
    freedom: list[float | None]
    costs: list[float | None]
    flips: list[_Whole] | None = None
    invalid: list[_Whole] | None = None
    signalled: list[float | None] | None = None
    failure: str = ""


def episodes_to_json(episodes: Episodes) -> str:
    """Episodes as text; `episodes_from_json` reads it.

    Args:
        episodes: Of which the steps are left out. NaN is written as null.
    """
    columns: dict[str, Any] = {}
    for name in _KINDS:
        column = getattr(episodes, name)
        if column is not None:
            columns[name] = [None if one != one else one for one in column.tolist()]
    document = {
        "format": FORMAT,
        "version": VERSION,
        "env_id": episodes.env_id,
        "agent": episodes.agent,
        "notes": list(episodes.notes),
        "failure": episodes.failure,
        **columns,
    }
    return json.dumps(document, allow_nan=False)


def episodes_from_json(text: str | bytes, *, name: str) -> Episodes:
    """Episodes that were written.

    Args:
        text: JSON.
        name: What to call it in an error.

    Raises:
        InputError: If it holds anything else.
    """
    try:
        document = conformed(parse_json(text), _EpisodesDocument)
    except (InputError, MisfitError, ValueError) as error:
        raise InputError(f"{name} cannot be read ({error}); run the episodes again") from error
    if (document.format, document.version) != (FORMAT, VERSION):
        raise InputError(f"{name} holds no episodes that this program reads; run them again")
    columns: dict[str, Any] = {}
    for column, kind in _KINDS.items():
        values = getattr(document, column)
        if values is None:
            columns[column] = None
            continue
        if len(values) != len(document.seeds):
            raise InputError(f"{name} has columns of different lengths; run the episodes again")
        columns[column] = np.array([np.nan if one is None else one for one in values], dtype=kind)
    return Episodes(
        document.env_id,
        document.agent,
        notes=tuple(document.notes),
        failure=document.failure,
        **columns,
    )
