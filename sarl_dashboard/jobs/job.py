"""Long work that goes on beside the pages: they look in, show how far it is, and may call it off.

Other pages can be opened meanwhile. What a page needs for itself belongs to the visitor's session
and ends by itself when the visitor has gone for good. What a visitor has asked for takes its turn
among that of others, goes on when the page is closed, and is found again on the page Library.
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
from sarl_dashboard import session
from sarl_dashboard.cache import BACK_WITHIN
from sarl_dashboard.jobs.queue import JobKind, queue
from sarl_dashboard.state import library
from sarl_dashboard.state.url import page_address, page_title

Result = TypeVar("Result")
_LOOKED_EVERY = 0.3  # seconds, for one's turn


class Job(Generic[Result]):
    """One piece of work in a thread of its own.

    Attributes:
        key: Of everything that its result depends on.
        result: What came of it so far, for the page; None where there is nothing yet.
        total: Units of work in all.
        done: Units finished.
        text: What is being done.
        error: Why it ended early; None if it did not, or was called off.
        lasts: Whether it takes its turn, and goes on without a page.
        kind: What one visitor does one of at a time; None for anything else.
        visitor: Who began it, for what each may have.
        author: Whose the things are that it keeps.
        page: Title of the page where it was begun.
        address: Of that page, as it was then.
        place: Name of the place on screen.
        began: When it began, in seconds of `time.monotonic`.
    """

    def __init__(
        self,
        key: object,
        work: Callable[[Job[Result]], None],
        total: int,
        result: Result | None = None,
        *,
        lasts: bool = False,
        kind: JobKind | None = None,
    ) -> None:
        """Start: at once, or what lasts when it is its turn.

        Args:
            key: Of everything that its result depends on.
            work: Does it, tells how far it is, and stops when no longer `wanted`. No Streamlit in
                there: it has no page to write to, and no session for caches.
            total: Units of work in all.
            result: What there is of it before it begins.
            lasts: Whether it goes on when its page is closed.
            kind: What one visitor does one of at a time; None for anything else.
        """
        self.key, self.result = key, result
        self.total, self.text = total, "Starting …"
        self.done: float = 0
        self.error: SarlError | None = None
        self._work = work
        self._cancelled = self._finished = False
        self.lasts, self.kind = lasts, kind
        self.visitor, self.author = session.visitor(), library.author()
        self.page, self.address, self.place = page_title(), page_address(), ""
        self.began = time.monotonic()
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

    @property
    def is_own(self) -> bool:
        """Whether this visitor began it, and so may call it off, from another page too."""
        return self.visitor == session.visitor()

    @property
    def is_here(self) -> bool:
        """Whether it belongs to this very page: begun here, or left elsewhere and taken up here."""
        return self._session == _this_session()

    def take_over(self) -> None:
        """Let it belong to the page that asks."""
        self._session = _this_session()
        self._seen = time.monotonic()

    def wanted(self) -> bool:
        """Whether to go on; for the work itself."""
        if self.lasts:
            return not self._cancelled
        now = time.monotonic()
        if not self.is_left:
            self._seen = now
        return not self._cancelled and now - self._seen < BACK_WITHIN

    def progress(self, done: int, total: int) -> bool:
        """Tell how far it is, and ask whether to go on; for the work itself."""
        self.done, self.total = done, total
        return self.wanted()

    def _wait(self) -> None:
        """Wait for its turn, where it is one of those that take turns."""
        if self.lasts:
            queue().enter(self)
            while obstacle := queue().obstacle(self):
                self.text = obstacle
                if not self.wanted():
                    raise CancelledError
                time.sleep(_LOOKED_EVERY)
            self.text = "Starting …"

    def _run(self) -> None:
        try:
            with library.working_for(self.author):
                self._wait()
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
            if self.lasts:
                queue().leave(self)


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
        """Begin work in the place of the one before, which is called off; for a callback too.

        What another page is still about was only looked at here, and goes on.
        """
        self._call_off()
        job = start()
        job.place = self.name
        self._look_at(job)

    def clear(self) -> None:
        """Call off what was begun here, and look at nothing."""
        self._call_off()
        st.session_state.pop(f"_job_{self.name}", None)

    def find_again(self, key: object) -> bool:
        """Look at work that this visitor began here in another page, where none was begun since.

        Args:
            key: Of what is looked at; None where that alone does not tell which work is about it.

        Returns:
            Whether there is any.
        """
        if self.job is not None or key is None:
            return False
        for job in (*queue().running, *queue().waiting):
            here = (job.place, job.key) == (self.name, key)
            if here and job.running and job.is_own:
                self.take_up(job)
                return True
        return False

    def take_up(self, job: Job[Result]) -> None:
        """Look at work of this visitor that another page began, and may have left."""
        if job.is_left:
            job.take_over()
        self._look_at(job)

    def _call_off(self) -> None:
        if self.job is not None and self.job.is_here:
            self.job.cancel()

    def _look_at(self, job: Job[Result]) -> None:
        st.session_state[f"_job_{self.name}"] = job


def _this_session() -> str:
    context = get_script_run_ctx()
    return context.session_id if context is not None else ""
