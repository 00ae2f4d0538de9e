"""Results that are kept for whoever asks again."""

from __future__ import annotations

from collections import OrderedDict
from threading import Lock


class Kept:
    """The latest few results, shared between sessions, so that memory has a bound."""

    def __init__(self, most: int) -> None:
        self.most, self.lock = most, Lock()
        self.results: OrderedDict[object, object] = OrderedDict()

    def get(self, key: object) -> object | None:
        """A result, if it is still kept."""
        with self.lock:
            if key in self.results:
                self.results.move_to_end(key)
            return self.results.get(key)

    def put(self, key: object, result: object) -> None:
        """Keep a result, and let go of the one that was not used for longest."""
        with self.lock:
            self.results[key] = result
            self.results.move_to_end(key)
            while len(self.results) > self.most:
                self.results.popitem(last=False)
