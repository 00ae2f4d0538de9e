"""What pages keep of their work: bounded in bytes, and a visitor's part goes with the visitor."""

from __future__ import annotations

import functools
import gc
import inspect
import os
import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import fields, is_dataclass
from operator import attrgetter
from pathlib import Path
from threading import Lock, Thread
from typing import Any, Generic, ParamSpec, TypeVar, cast

import numpy as np
import streamlit as st
from streamlit.runtime.scriptrunner import get_script_run_ctx

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.environments.formulas import Formula
from sarl_core.memory import release
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.evidence import DataBox
from sarl_core.mining.rule_set import RuleSet
from sarl_core.mining.tree import PolicyTree
from sarl_dashboard.memory_cache import BoundedCache
from sarl_dashboard.text import digest_of

P = ParamSpec("P")
R = TypeVar("R")

_MOST_MEGABYTES = 512  # over all pages and visitors; SARL_CACHE_MB says otherwise

RESULTS: BoundedCache[object] = BoundedCache(
    None, int(float(os.environ.get("SARL_CACHE_MB") or _MOST_MEGABYTES) * 2**20)
)
_making: defaultdict[object, Lock] = defaultdict(Lock)


# --- by what results are found again -----------------------------------------------------------

HashFuncs = Mapping[type, Callable[[Any], object]]
HASH_FUNCS: HashFuncs = {
    Demonstrations: attrgetter("digest"),
    MinedData: attrgetter("digest"),
    PolicyTree: attrgetter("digest"),
    DataBox: tuple,
    RuleSet: attrgetter("digest"),
    bytes: digest_of,
    # What a text is read as may be nested deeper than Python likes to look.
    Formula: attrgetter("text", "feature_names"),
}
"""What stands in a key for a thing that is large or has no hash."""
_PLAIN = (type(None), bool, int, str, Path)


def key_of(value: object, hash_funcs: HashFuncs = HASH_FUNCS) -> object:
    """What tells a value from all others of other content.

    Args:
        value: Of a type in `hash_funcs`; a number, a text, a path; or a tuple or frozen dataclass
            of such.
        hash_funcs: By type, what stands for a value of it.

    Returns:
        Small and hashable.

    Raises:
        TypeError: If something in it is of another type: a key that leaves it out, or that samples
            it, would bring back what was made from something else.
    """
    if isinstance(value, np.generic):
        value = value.item()
    kind = type(value)
    if kind in hash_funcs:
        return kind, hash_funcs[kind](value)
    if isinstance(value, float):
        return kind, repr(value)  # so that NaN is found again
    if isinstance(value, _PLAIN):
        return kind, value
    if isinstance(value, tuple):
        return kind, *(key_of(part, hash_funcs) for part in value)
    if is_dataclass(kind) and cast(Any, kind).__dataclass_params__.frozen:
        return kind, *(key_of(getattr(value, part.name), hash_funcs) for part in fields(kind))
    raise TypeError(
        f"{kind.__module__}.{kind.__qualname__} cannot be part of a key; pass what it was made "
        "from, or give HASH_FUNCS a function for it"
    )


class Cached(Generic[P, R]):
    """A function of which results are kept."""

    def __init__(self, function: Callable[P, R], spinner: str, hash_funcs: HashFuncs) -> None:
        functools.update_wrapper(self, function)
        self._function, self._spinner, self._hash_funcs = function, spinner, hash_funcs
        self._signature = inspect.signature(function)

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> R:
        """What the function gives."""
        key = self._key(*args, **kwargs)
        entry = RESULTS.get(key)
        if entry is None:
            with _making[key]:  # one visitor makes it, the others wait
                entry = RESULTS.get(key)
                if entry is None:
                    with _spinner(self._spinner):
                        entry = (self._function(*args, **kwargs),)
                    keep(key, entry, owner())
            _making.pop(key, None)
        return cast(tuple[R], entry)[0]

    def holds(self, *args: P.args, **kwargs: P.kwargs) -> bool:
        """Whether there is a result for these arguments already."""
        return self._key(*args, **kwargs) in RESULTS

    def keeping(self, *args: P.args, **kwargs: P.kwargs) -> Callable[[R], None]:
        """What keeps a result that is made elsewhere, from a thread without a session, too."""
        key, session = self._key(*args, **kwargs), owner()
        return lambda result: keep(key, (result,), session)

    def _key(self, *args: P.args, **kwargs: P.kwargs) -> object:
        bound = self._signature.bind(*args, **kwargs)
        bound.apply_defaults()
        code = cast(Any, self._function).__code__  # another one once the file was edited
        return code.co_filename, code, key_of(tuple(bound.arguments.values()), self._hash_funcs)


def cached(
    *, show_spinner: str = "", hash_funcs: HashFuncs | None = None
) -> Callable[[Callable[P, R]], Cached[P, R]]:
    """Keep what a function gives, for all visitors, as long as there is room.

    Results are found again by the content of all arguments (`key_of`). Streamlit's own cache of
    resources counts entries, and its cache of data samples large ones; here bytes are counted, and
    what was made from an upload goes when nobody holds it any more.

    Args:
        show_spinner: What is said while it works.
        hash_funcs: By type, what stands for an argument in the place of `HASH_FUNCS`.

    Returns:
        A decorator.
    """
    by_type = {**HASH_FUNCS, **(hash_funcs or {})}
    return lambda function: Cached(function, show_spinner, by_type)


def keep(key: object, result: object, owner: str) -> None:
    """Keep a result, if whoever brought what it was made from is still there.

    Args:
        key: What it is found by.
        result: Anything.
        owner: Digest of the upload that it was made from, "" where there is none.
    """
    RESULTS.put(key, result, owner=owner)
    _give_back(owner)


def _spinner(text: str) -> AbstractContextManager[object]:
    """Say what is going on, where there is a page to say it on."""
    return st.spinner(text) if text and get_script_run_ctx() is not None else nullcontext()


# --- what a visitor brought --------------------------------------------------------------------


class Visit:
    """A visitor's session, and the demonstrations it holds.

    Attributes:
        upload: Digest of those uploaded last, or of others while there are none; "" before.
    """

    def __init__(self) -> None:
        self.upload = ""

    def bring(self, digest: str) -> None:
        """Take demonstrations in the place of those before, which are given back."""
        before, self.upload = self.upload, digest
        if before != digest:
            _give_back(before)


_VISITS: set[Visit] = set()
BACK_WITHIN = 20.0
"""Seconds in which whoever has gone may come back: longer than a reload, or a tunnel."""


def _give_back(digest: str) -> None:
    """Let go of what was made from an upload that no visitor holds any more."""
    if digest and all(other.upload != digest for other in list(_VISITS)):
        RESULTS.drop(digest)


def _end(visit: Visit) -> None:
    """Let a visit end, unless the same demonstrations are opened again at once.

    A page that is loaded anew, and a connection that was lost, are the end of a session, too; what
    was made from a large upload took long.
    """
    Thread(target=_leave, args=(visit, BACK_WITHIN), daemon=True).start()


def _leave(visit: Visit, seconds: float = 0.0) -> None:
    time.sleep(seconds)
    _VISITS.discard(visit)
    _give_back(visit.upload)
    _collect()


def _collect() -> None:
    """Find what holds itself together in circles, as a session that has ended does.

    Pages take what they load out of the collector's sight (`settle`), and with it the sessions of
    that moment: so it looks at everything, once.
    """
    gc.unfreeze()
    gc.collect()
    gc.freeze()
    release()


@st.cache_resource(scope="session", on_release=_end, show_spinner=False)
def visit() -> Visit:
    """The visit that this script runs for; it ends with the session."""
    begun = Visit()
    _VISITS.add(begun)
    return begun


def owner() -> str:
    """Digest of the upload that the page works on, "" where it works on none."""
    upload = st.session_state.get("_upload")
    chosen = st.session_state.get("_data")
    names = ("upload", st.session_state.get("_upload_id"))
    return str(upload.digest) if upload is not None and chosen in names else ""
