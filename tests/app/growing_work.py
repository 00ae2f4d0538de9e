"""What a process does in the place of growing trees; it loads as little as that does."""

from __future__ import annotations

import time

from sarl_core.errors import WorkError

LONG = 60.0


def slow(*_: object, **__: object) -> None:
    time.sleep(LONG)


def failing(*_: object, **__: object) -> None:
    raise WorkError("the memory is full; close something")
