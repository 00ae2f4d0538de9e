"""What a file knows beside its arrays, as JSON under the key `sarl`."""

from __future__ import annotations

import json
import math
from collections import Counter
from dataclasses import dataclass, replace
from typing import Any, Literal, cast

from sarl_core.demonstrations.dataset import Demonstrations, Feature
from sarl_core.documents import parse_json
from sarl_core.environments.feature_order import Order
from sarl_core.errors import InputError, quoted

KEY = "sarl"
VERSION = 1


@dataclass(frozen=True)
class Metadata:
    """What a file says about its demonstrations; None, () or "" where it says nothing.

    Attributes:
        env_id: Environment.
        agent: Who demonstrated.
        seed: Seed it was recorded with.
        features: Names and units, d of them.
        action_names: m names.
        label_names: For each action dimension the names of its labels, () if continuous.
        label_first: The action that label 0 stands for.
        action_low: Lower bounds of continuous actions, m numbers.
        action_high: Upper bounds.
        bounds_from: Where those come from.
        notes: Sentences on how the data was read.
    """

    env_id: str = ""
    agent: str = ""
    seed: int | None = None
    features: tuple[Feature, ...] = ()
    action_names: tuple[str, ...] = ()
    label_names: tuple[tuple[str, ...], ...] = ()
    label_first: tuple[int, ...] = ()
    action_low: tuple[float, ...] = ()
    action_high: tuple[float, ...] = ()
    bounds_from: Literal["action space", "demonstrated values"] | None = None
    notes: tuple[str, ...] = ()

    @property
    def is_discrete(self) -> bool | None:
        """Whether the actions are labels, None if the file does not say."""
        if any(self.label_names):
            return True
        return False if self.action_low else None

    def with_actions_in(self, order: Order) -> Metadata:
        """The same with its action dimensions in another order.

        Args:
            order: Of its action dimensions.

        Returns:
            What was not said stays so.
        """
        return replace(
            self,
            action_names=order.put(self.action_names),
            label_names=order.put(self.label_names),
            label_first=order.put(self.label_first),
            action_low=order.put(self.action_low),
            action_high=order.put(self.action_high),
        )


def encode_metadata(demonstrations: Demonstrations) -> str:
    """The JSON that `decode_metadata` reads."""
    return json.dumps({"version": VERSION} | demonstrations.metadata(), ensure_ascii=False)


def decode_metadata(text: str | bytes) -> Metadata:
    """Read and check metadata.

    Args:
        text: JSON, in UTF-8 if bytes.

    Returns:
        What it says.

    Raises:
        InputError: If it is not JSON, says a thing twice, or says it in another form.
    """
    try:
        raw = parse_json(text, object_pairs_hook=_unique)
    except InputError as error:
        raise InputError(f"its metadata {KEY!r} is too large: {error}") from error
    except ValueError as error:
        raise InputError(
            f"its metadata {KEY!r} is not JSON ({error}); save the file again, or without metadata"
        ) from error
    if not isinstance(raw, dict):
        raise _malformed("is no JSON object")
    version = raw.get("version", VERSION)
    if version != VERSION:
        raise _malformed(f"has version {quoted(version)}, and this program reads version {VERSION}")
    metadata = Metadata(
        env_id=_text(raw, "env_id"),
        agent=_text(raw, "agent"),
        seed=_seed(raw),
        features=tuple(_feature(entry) for entry in _list(raw, "features")),
        action_names=_strings(_list(raw, "action_names"), "action_names"),
        label_names=tuple(_strings(entry, "label_names") for entry in _list(raw, "label_names")),
        label_first=tuple(_label(entry) for entry in _list(raw, "label_first")),
        action_low=tuple(_number(entry, "action_low") for entry in _list(raw, "action_low")),
        action_high=tuple(_number(entry, "action_high") for entry in _list(raw, "action_high")),
        bounds_from=_bounds_from(raw),
        notes=_strings(_list(raw, "notes"), "notes"),
    )
    if len(metadata.action_low) != len(metadata.action_high):
        raise _malformed("has more bounds 'action_low' than 'action_high', or fewer")
    return metadata


def _malformed(what: str) -> InputError:
    return InputError(f"its metadata {KEY!r} {what}; save the file again, or without metadata")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    keys = [key for key, _ in pairs]
    if len(set(keys)) < len(keys):
        doubled = next(key for key, count in Counter(keys).items() if count > 1)
        raise _malformed(f"gives {quoted(doubled)} twice")
    return dict(pairs)


def _list(raw: dict[str, Any], key: str) -> list[Any]:
    value = raw.get(key)
    if value is None:
        return []
    if not isinstance(value, list):
        raise _malformed(f"has no list under {key!r}")
    return value


def _text(raw: dict[str, Any], key: str) -> str:
    value = raw.get(key)
    if value is None:
        return ""
    if not isinstance(value, str):
        raise _malformed(f"has no text under {key!r}")
    return value


def _strings(value: Any, key: str) -> tuple[str, ...]:
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        raise _malformed(f"has something other than names under {key!r}")
    return tuple(value)


def _integer(value: Any, key: str) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise _malformed(f"has something other than a whole number under {key!r}")
    return value


def _label(value: Any) -> int:
    label = _integer(value, "label_first")
    if abs(label) > 2**31:
        raise _malformed("has a number too large for a label under 'label_first'")
    return label


def _number(value: Any, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _malformed(f"has something other than a number under {key!r}")
    if not math.isfinite(number := float(value) if abs(value) < 1e308 else math.inf):
        raise _malformed(f"has an infinite number under {key!r}")
    return number


def _seed(raw: dict[str, Any]) -> int | None:
    value = raw.get("seed")
    return None if value is None else _integer(value, "seed")


def _feature(entry: Any) -> Feature:
    if not isinstance(entry, dict):
        raise _malformed("has something other than objects under 'features'")
    if not isinstance(entry.get("name"), str):
        raise _malformed("has a feature without a 'name'")
    return Feature(entry["name"], _text(entry, "unit"))


def _bounds_from(raw: dict[str, Any]) -> Literal["action space", "demonstrated values"] | None:
    value = raw.get("bounds_from")
    if value not in (None, "action space", "demonstrated values"):
        raise _malformed("has an unknown origin of bounds under 'bounds_from'")
    return cast(Literal["action space", "demonstrated values"] | None, value)
