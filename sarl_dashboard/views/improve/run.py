"""The button that improves rules, how far that is, and what came of it so far."""

from __future__ import annotations

from sarl_core.mining.language import counted
from sarl_dashboard.components.run_bar import Offer, run_bar, watched
from sarl_dashboard.jobs.improving import ImprovementOrder, Outcome, improving, known_outcome
from sarl_dashboard.jobs.job import Place
from sarl_dashboard.views.improve.outcome import show_outcome
from sarl_dashboard.views.improve.shipped import show_shipped

PLACE = Place[Outcome](
    "improve",
    gathering="Stopping: the episodes that are being played are played to their end.",
)


def run_of(order: ImprovementOrder | None) -> None:
    """The button or the progress, and what is known so far.

    Args:
        order: What is asked for; None where that cannot be had.
    """

    def outcome(at_work: bool) -> None:
        stored = known_outcome(order) if order is not None and not at_work else None
        finished = stored if stored is not None and stored.is_finished else None
        latest = PLACE.job.result if PLACE.job is not None else None
        run_bar(PLACE, offer_of(order, latest, finished) if order is not None else None)
        known = finished or latest
        if stored is not None and (latest is None or latest.is_empty or changed(latest, order)):
            known = stored
        if known is None or known.is_empty:
            if not at_work:
                show_shipped(gaps=order is not None and order.rules is not None)
            return
        show_outcome(
            known,
            at_work=at_work,
            changed=not at_work and changed(known, order),
        )

    watched(PLACE, outcome)


def changed(known: Outcome, order: ImprovementOrder | None) -> bool:
    """Whether what is known is of another order."""
    return order is None or known.order.key != order.key


def offer_of(
    order: ImprovementOrder, latest: Outcome | None, finished: Outcome | None
) -> Offer[Outcome]:
    """What the button begins.

    Args:
        order: What is asked for.
        latest: Of the run before, as far as it came.
        finished: What came of this very order, if it is known.
    """
    return Offer(
        key=order.key,
        start=lambda: improving(order),
        about=what_it_does(order) + (" All done already." if finished is not None else ""),
        complete=finished is not None,
        cancelled="Cancelled before there was anything to keep."
        if latest is None or latest.is_empty
        else "Cancelled. What had been finished is kept below.",
        label="Run" if order.rules is None else "Find the gaps",
    )


def what_it_does(order: ImprovementOrder) -> str:
    """Beside the button."""
    plan = order.plan
    if order.rules is not None:
        return (
            f"{counted(len(order.rules), 'rule')} at the thresholds in the sidebar, "
            f"{counted(plan.episodes, 'episode')}."
        )
    return (
        f"{counted(plan.rounds, 'round')} of {counted(plan.episodes, 'episode')}; then the best is "
        f"chosen, and reported on {plan.report} fresh episodes."
    )
