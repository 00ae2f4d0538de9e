"""What came of improving rules as files, to be kept; read back, it says the same."""

from __future__ import annotations

import dataclasses
import io
import json
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from msgspec import Struct
from msgspec.structs import asdict

from sarl_core.archives import array_of, arrays_in, opened, promise_of
from sarl_core.demonstrations.formats import read_demonstrations, save_demonstrations
from sarl_core.documents import Count, MisfitError, Number, Share, conformed, parse_json
from sarl_core.errors import InputError
from sarl_core.improving.aggregation import Aggregation, AggregationRound
from sarl_core.improving.gaps import Gaps
from sarl_core.improving.plan import Plan
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from sarl_core.rollouts.episode_files import episodes_from_json, episodes_to_json
from sarl_core.rollouts.seeds import RunSeeds
from sarl_core.rollouts.statistics import Rate

FORMAT, VERSION = "sarl-improvement", 1
_RUN, _RULES, _PAIRS, _REPORT, _STATES = "run", "rules", "demonstrations", "report", "states"
_ARRAYS = ("episode", "step", "observations", "missing")

S = TypeVar("S", bound=Struct)
Contents = dict[str, tuple[bytes, str]]
"""Of each role the content of a file, and the ending of its name."""


class _StoredRate(Struct, forbid_unknown_fields=True):
    count: Count
    of: Count
    rate: Share
    low: Share
    high: Share
    unknown: Count


class _StoredRound(Struct, forbid_unknown_fields=True):
    number: Count
    pairs: Count
    rules: Count
    returns: list[Number]
    coverage: Share
    disagreement: Share
    needed: Share
    cut: Count
    failures: _StoredRate | None


class _StoredAggregation(Struct, forbid_unknown_fields=True):
    format: str
    version: int
    env_id: str
    rounds: list[_StoredRound]
    chosen: Count
    validation_mean: Number | None
    refined: bool
    seeds: tuple[Count, Count | None, Count | None, Count | None]
    fault: str


class _StoredGaps(Struct, forbid_unknown_fields=True):
    format: str
    version: int
    feature_names: tuple[str, ...]
    met: Count
    episodes: Count
    cut: Count
    notes: tuple[str, ...]


def aggregation_contents(aggregation: Aggregation) -> Contents:
    """An aggregation as files; `aggregation_from` reads them.

    Args:
        aggregation: Finished or stopped; of its report the steps are left out, and its trees.
    """
    document = {
        "env_id": aggregation.env_id,
        "rounds": [
            {
                "number": one.number,
                "pairs": one.pairs,
                "rules": one.rules,
                "returns": one.returns.tolist(),
                "coverage": one.coverage,
                "disagreement": one.disagreement,
                "needed": one.needed,
                "cut": one.cut,
                "failures": None if one.failures is None else dataclasses.asdict(one.failures),
            }
            for one in aggregation.rounds
        ],
        "chosen": aggregation.chosen,
        "validation_mean": aggregation.validation_mean,
        "refined": aggregation.refined,
        "seeds": list(aggregation.seeds),
        "fault": aggregation.fault,
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "demonstrations.parquet"
        save_demonstrations(aggregation.demonstrations, path)
        pairs = path.read_bytes()
    contents = {
        _RUN: (_written(document), ".json"),
        _RULES: (rules_to_json(aggregation.rule_set).encode(), ".json"),
        _PAIRS: (pairs, ".parquet"),
    }
    if aggregation.reported is not None:
        contents[_REPORT] = (episodes_to_json(aggregation.reported).encode(), ".json")
    return contents


def aggregation_from(files: Mapping[str, bytes], plan: Plan) -> Aggregation:
    """An aggregation of files.

    Args:
        files: What `aggregation_contents` gave, by role.
        plan: What was to be done.

    Returns:
        The same, without trees, and the rounds without the scores that were needed meanwhile.

    Raises:
        InputError: If they hold anything else.
    """
    stored = _read(files, _StoredAggregation)
    report = files.get(_REPORT)
    return Aggregation(
        env_id=stored.env_id,
        plan=plan,
        rule_set=rules_from_json(_content(files, _RULES), name="the rule file"),
        trees=(),
        rounds=tuple(
            AggregationRound(
                one.number,
                one.pairs,
                one.rules,
                np.array(one.returns, dtype=np.float64),
                one.coverage,
                one.disagreement,
                one.needed,
                one.cut,
                None if one.failures is None else Rate(**asdict(one.failures)),
            )
            for one in stored.rounds
        ),
        chosen=stored.chosen,
        validation_mean=stored.validation_mean,
        refined=stored.refined,
        reported=None if report is None else episodes_from_json(report, name="the report"),
        demonstrations=read_demonstrations(_content(files, _PAIRS), "demonstrations.parquet"),
        seeds=RunSeeds(*stored.seeds),
        fault=stored.fault,
    )


def gaps_contents(gaps: Gaps) -> Contents:
    """States without a rule as files; `gaps_from` reads them."""
    packed = io.BytesIO()
    np.savez_compressed(packed, **{name: getattr(gaps, name) for name in _ARRAYS})
    document = {
        "feature_names": list(gaps.feature_names),
        "met": gaps.met,
        "episodes": gaps.episodes,
        "cut": gaps.cut,
        "notes": list(gaps.notes),
    }
    return {_RUN: (_written(document), ".json"), _STATES: (packed.getvalue(), ".npz")}


def gaps_from(files: Mapping[str, bytes]) -> Gaps:
    """States without a rule, of files.

    Args:
        files: What `gaps_contents` gave, by role.

    Raises:
        InputError: If they hold anything else.
    """
    stored = _read(files, _StoredGaps)
    content = _content(files, _STATES)
    with opened(content) as archive:
        entries = arrays_in(archive)
        if entries.keys() != set(_ARRAYS):
            raise InputError("what is kept of the states lacks a part; find the gaps again")
        arrays: dict[str, Any] = {
            name: array_of(archive, entry, promise_of(archive, entry))
            for name, entry in entries.items()
        }
    return Gaps(
        stored.feature_names,
        **arrays,
        met=stored.met,
        episodes=stored.episodes,
        cut=stored.cut,
        notes=stored.notes,
    )


def _written(document: Mapping[str, object]) -> bytes:
    head = {"format": FORMAT, "version": VERSION}
    return json.dumps({**head, **document}, allow_nan=False).encode()


def _content(files: Mapping[str, bytes], role: str) -> bytes:
    if role not in files:
        raise InputError(f"what is kept of the run lacks its {role}; run it again")
    return files[role]


def _read(files: Mapping[str, bytes], kind: type[S]) -> S:
    content = _content(files, _RUN)
    try:
        document = parse_json(content)
        if not isinstance(document, dict) or (
            (document.get("format"), document.get("version")) != (FORMAT, VERSION)
        ):
            raise InputError("what is kept of the run is of another version; run it again")
        return conformed(document, kind)
    except (MisfitError, ValueError) as error:
        raise InputError(
            f"what is kept of the run cannot be read ({error}); run it again"
        ) from error
