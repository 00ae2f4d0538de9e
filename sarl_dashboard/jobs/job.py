"""Long work that goes on beside the pages: they look in, show how far it is, and may call it off.

The work belongs to the visitor's session. Other pages can be opened meanwhile; when the visitor has
gone for good, it ends by itself.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from threading import Thread
from typing import Generic, TypeVar, cast

import streamlit as st
from streamlit import runtime
from streamlit.runtime.scriptrunner import get_script_run_ctx

from sarl_core.errors import SarlError, WorkError
from sarl_core.progress import CancelledError
from sarl_dashboard.cache import BACK_WITHIN

Result = TypeVar("Result")


class Job(Generic[Result]):
    """One piece of work in a thread of its own.

    Attributes:
        key: Of everything that its result depends on.
        result: What came of it so far, for the page; None where there is nothing yet.
        total: Units of work in all.
        done: Units finished.
        text: What is being done.
        error: Why it ended early; None if it did not, or was called off.
    """

    def __init__(
        self,
        key: object,
        work: Callable[[Job[Result]], None],
        total: int,
        result: Result | None = None,
    ) -> None:
        """Start at once.

        Args:
            key: Of everything that its result depends on.
            work: Does it, tells how far it is, and stops when no longer `wanted`. No Streamlit in
                there: it has no page to write to, and no session for caches.
            total: Units of work in all.
            result: What there is of it before it begins.
        """
        self.key, self.result = key, result
        self.total, self.text = total, "Starting …"
        self.done: float = 0
        self.error: SarlError | None = None
        self._work = work
        self._cancelled = self._finished = False
        self.take_over()
        Thread(target=self._run, daemon=True, name="job").start()

    @property
    def running(self) -> bool:
        """Whether more can be expected of it."""
        return not (self._finished or self._cancelled)

    @property
    def cancelled(self) -> bool:
        """Whether it was called off."""
        return self._cancelled

    @property
    def stopping(self) -> bool:
        """Whether it was called off, and still gathers what it has finished."""
        return self._cancelled and not self._finished

    @property
    def share(self) -> float:
        """How far it is, 0 to 1."""
        return min(self.done / self.total, 1.0) if self.total else 1.0

    def cancel(self) -> None:
        """Call it off; what is being done this moment is let go of."""
        if not self._finished:
            self._cancelled = True

    @property
    def is_left(self) -> bool:
        """Whether the page that began it is gone: closed, or loaded anew."""
        try:
            return not runtime.get_instance().is_active_session(self._session)
        except RuntimeError:  # there is no server whose visitor could leave
            return False

    def take_over(self) -> None:
        """Let it belong to the visitor whose page this is."""
        context = get_script_run_ctx()
        self._session = context.session_id if context is not None else ""
        self._seen = time.monotonic()

    def wanted(self) -> bool:
        """Whether to go on; for the work itself."""
        now = time.monotonic()
        if not self.is_left:
            self._seen = now
        return not self._cancelled and now - self._seen < BACK_WITHIN

    def progress(self, done: int, total: int) -> bool:
        """Tell how far it is, and ask whether to go on; for the work itself."""
        self.done, self.total = done, total
        return self.wanted()

    def _run(self) -> None:
        try:
            self._work(self)
        except CancelledError:
            pass
        except SarlError as error:
            self.error = error
        except Exception:  # a mistake of ours: the page has a sentence, the log the rest
            logging.getLogger(__name__).exception("work beside the pages failed")
            self.error = WorkError("the work failed unexpectedly; the server's log says more")
        finally:
            self._finished = True


@dataclass(frozen=True)
class Place(Generic[Result]):
    """Where on screen a visitor begins work of one kind, and looks at the latest of it.

    Attributes:
        name: Tells it from others.
        gathering: What is said while work that was called off gathers what it has finished; ""
            where nobody waits for that.
    """

    name: str
    gathering: str = ""

    @property
    def job(self) -> Job[Result] | None:
        """What this visitor began last; None if nothing was."""
        return cast("Job[Result] | None", st.session_state.get(f"_job_{self.name}"))

    @property
    def at_work(self) -> bool:
        """Whether more is to come of it."""
        job = self.job
        return job is not None and (job.running or bool(self.gathering and job.stopping))

    def begin(self, start: Callable[[], Job[Result]]) -> None:
        """Begin work in the place of the one before, which is called off; for a callback too."""
        if self.job is not None:
            self.job.cancel()
        st.session_state[f"_job_{self.name}"] = start()

    def take_up(self, job: Job[Result]) -> None:
        """Look at work that another page began and left."""
        job.take_over()
        self.begin(lambda: job)
