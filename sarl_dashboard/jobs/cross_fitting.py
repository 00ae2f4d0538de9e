"""What the rules in force are worth in episodes that they were not mined from.

Trees are grown without each fold of the episodes, in processes beside the page, once for the data:
after that it is known at all thresholds. Nobody waits for it: pages are drawn without it, and have
it as soon as it is there.
"""

from __future__ import annotations

import time
from concurrent.futures import Executor
from contextlib import nullcontext

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import WorkError
from sarl_core.mining.distributed.mined_data import MinedData
from sarl_core.mining.never.never_rules import mine_at
from sarl_core.mining.rules import Thresholds
from sarl_core.mining.tree import PolicyTree
from sarl_core.mining.validation.cross_fitting import CrossFit, Judged, cross_fit
from sarl_core.mining.validation.recommendation import Recommendation, recommended
from sarl_core.progress import Progress, report
from sarl_dashboard.cache import RESULTS, cached, keep, owner
from sarl_dashboard.jobs.job import Job, Place
from sarl_dashboard.jobs.mining import mining
from sarl_dashboard.jobs.processes import own_process
from sarl_dashboard.memory_cache import size_of
from sarl_dashboard.state import combining, rule_base
from sarl_dashboard.state.data import chosen_demonstrations, mined_data
from sarl_dashboard.state.mined import learner_of
from sarl_dashboard.state.thresholds import MIN_DIVIDER, chosen_divider

UNASKED = 250_000  # steps up to which it is made without being asked for
LEAST_SUPPORT = 0.0001
"""Of a rule, where there are more: what is known of smaller ones takes most of the room."""
_MOST_SHARE = 0.75  # of the room for all results: the rest is for what it is about
PLACE = Place[CrossFit]("elsewhere")
DRAWING = 2.0  # seconds in which a browser draws a page; processes that start would hinder it
_LOOK_SECONDS = 0.05  # between two looks at whether it is still wanted


def key_of(demonstrations: Demonstrations, divider: int) -> tuple[object, ...]:
    """What the trees without each fold depend on."""
    if demonstrations.is_discrete:
        divider = MIN_DIVIDER
    learner, combined = learner_of(demonstrations), combining.pairs(demonstrations)
    return ("elsewhere", demonstrations.pairs_digest, divider, learner, combined)


def judged(thresholds: Thresholds) -> Judged | None:
    """The rules at some thresholds in other episodes; None while that is not known.

    Args:
        thresholds: Of the chosen demonstrations.

    Returns:
        Of mined rules alone: a compact set was built from other states. Of a mined file what the
        episodes say that were held out when it was mined, where it holds the counts for that.
    """
    mined = mined_data()
    if mined is not None:
        return _judged_in_file(mined, thresholds) if rule_base.at_thresholds() else None
    fit = known()
    if fit is None or thresholds.support < fit.least_support:
        return None
    return _judged(fit, thresholds)


def known() -> CrossFit | None:
    """The trees without each fold of the chosen demonstrations; None while they are not there."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None or demonstrations.sample_of is not None:
        return None
    if not rule_base.at_thresholds():
        return None
    fit = RESULTS.get(key_of(demonstrations, chosen_divider()))
    return fit if isinstance(fit, CrossFit) else None


def least_support(demonstrations: Demonstrations) -> float:
    """Of rules of which it is found out what they are worth elsewhere."""
    return LEAST_SUPPORT if len(demonstrations) > UNASKED else 0.0


def _trees_of(fit: CrossFit) -> tuple[str, ...]:
    """What tells one from others: the trees know the episodes that they were grown from."""
    return tuple(tree.digest for fold in fit.folds for tree in fold.trees)


@cached()
def _judged_in_file(mined: MinedData, thresholds: Thresholds) -> Judged | None:
    return mined.judged(thresholds)


@cached(hash_funcs={CrossFit: _trees_of})
def _judged(fit: CrossFit, thresholds: Thresholds) -> Judged:
    if thresholds.never is None:
        return fit.at(thresholds)
    return fit.of(lambda trees: mine_at(trees, thresholds))


@cached(hash_funcs={CrossFit: _trees_of})
def recommendation(
    trees: tuple[PolicyTree, ...],
    fit: CrossFit,
    *,
    dimension: int | None,
    lift: float,
    depth: int | None,
) -> Recommendation | None:
    """Few rules that are right in other episodes, too; None where nothing can be recommended."""
    return recommended(trees, fit, dimension=dimension, lift_min=lift, max_depth=depth)


def job_of(key: tuple[object, ...]) -> Job[CrossFit] | None:
    """The work of this session, if it is about these data."""
    job = PLACE.job
    return job if job is not None and job.key == key else None


def begin(demonstrations: Demonstrations, divider: int, *, after: float = 0.0) -> None:
    """Grow the trees without each fold, in the place of what is on its way; for a callback too.

    Args:
        demonstrations: To be parted.
        divider: Number of intervals of continuous actions.
        after: Seconds to wait first.
    """
    key, session = key_of(demonstrations, divider), owner()
    combined, learner = combining.pairs(demonstrations), learner_of(demonstrations)
    least = least_support(demonstrations)

    def work(executor: Executor, progress: Progress) -> CrossFit:
        _wait(after, progress)
        # One fold after the other where there are many steps, and here, where they are.
        is_large = len(demonstrations) > UNASKED
        with own_process(gives_way=True) if is_large else nullcontext(executor) as workers:
            return cross_fit(
                demonstrations,
                divider=divider,
                combined=combined,
                learner=learner,
                min_support=least,
                executor=workers,
                progress=progress,
            )

    def keep_fit(fit: CrossFit) -> None:
        if (size := size_of(fit.folds)) > _MOST_SHARE * RESULTS.most_bytes:
            raise WorkError(
                f"it takes {size / 1e6:,.0f} MB, and the dashboard keeps "
                f"{RESULTS.most_bytes / 1e6:,.0f} MB in all (SARL_CACHE_MB, for whoever runs it)"
            )
        keep(key, fit, session)

    PLACE.begin(lambda: mining(key, work, keep_fit))


def _wait(seconds: float, progress: Progress) -> None:
    """Let time pass, unless the work is called off meanwhile."""
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        report(progress, 0, 1)
        time.sleep(min(left, _LOOK_SECONDS))


def make_ready() -> None:
    """Begin to make it, where it is not there and not on its way: once the page is drawn."""
    demonstrations = chosen_demonstrations()
    if demonstrations is None or not rule_base.at_thresholds():
        return
    if len(demonstrations) > UNASKED or demonstrations.sample_of is not None:
        return
    divider = chosen_divider()
    key = key_of(demonstrations, divider)
    job = job_of(key)
    # What was made may have been let go of since, for want of room.
    if key not in RESULTS and (job is None or not (job.running or job.error)):
        begin(demonstrations, divider, after=DRAWING)
