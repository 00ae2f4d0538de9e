"""A button that begins long work, how far it is, and what came of it."""

from __future__ import annotations

from collections.abc import Callable

from sarl_dashboard.cache import key_of
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.job import Place, Result
from sarl_dashboard.jobs.mining import Work, mining, mining_results


def worked_out(
    name: str,
    depends_on: tuple[object, ...],
    work: Work[Result],
    hint: str,
    show: Callable[[Result], None],
) -> None:
    """A button that begins work, how far it is, and what came of it.

    Args:
        name: Of the place on screen; the buttons' keys are "run_<name>" and "cancel_<name>".
        depends_on: Everything that the result depends on.
        work: Gives the result.
        hint: Beside the button.
        show: Draws the result.
    """
    place: Place[Result] = Place(name)
    results, key = mining_results(), key_of((name, *depends_on))

    def progress_and_result(at_work: bool) -> None:
        result = results.get(key)
        if at_work or result is None:
            run_bar(
                place,
                Offer(
                    key=key,
                    start=lambda: mining(
                        key, work, lambda result: results.put(key, result), lasts=True
                    ),
                    about=hint,
                    complete=result is not None,
                    cancelled="Cancelled; nothing was kept.",
                ),
            )
        if result is not None:
            show(result)

    watched(place, progress_and_result)
