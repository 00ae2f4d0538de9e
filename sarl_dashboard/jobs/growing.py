"""Trees of many pairs, grown in a process of their own, so that one can call it off."""

from __future__ import annotations

import time
from functools import partial

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.memory import release
from sarl_core.mining.growing.growth import EXACT_UP_TO, counted_trees, grow_structures
from sarl_core.mining.tree import Learner
from sarl_core.processes import run_each
from sarl_dashboard.jobs.job import Job, Place
from sarl_dashboard.jobs.processes import own_process
from sarl_dashboard.state.mined import Trees, growing_of, learner_of, trees_under_any_name

PLACE = Place[Trees]("growing")
_SECONDS: dict[Learner, float] = {"exact": 4e-6, "histogram": 6e-7}
"""For each value of a state and action dimension, on two cores."""
_START = 4.0  # seconds until a process is there and has the states
_MOST = 0.95  # of a bar that only knows how long such work usually takes


def is_long(demonstrations: Demonstrations) -> bool:
    """Whether growing the trees of demonstrations takes more than a moment."""
    return demonstrations.sample_of is None and are_many(demonstrations)


def are_many(demonstrations: Demonstrations) -> bool:
    """Whether there are so many steps, here or elsewhere, that unfiltered rules are too many."""
    return demonstrations.whole.steps > EXACT_UP_TO


def key_of(demonstrations: Demonstrations, divider: int) -> tuple[object, ...]:
    """What the trees depend on."""
    _, *others = growing_of(demonstrations, divider)
    return (demonstrations.pairs_digest, *others)


def is_done(demonstrations: Demonstrations, divider: int) -> bool:
    """Whether the trees are there."""
    return trees_under_any_name.holds(*growing_of(demonstrations, divider))


def job_of(demonstrations: Demonstrations, divider: int) -> Job[Trees]:
    """Begin to grow them."""
    arguments = growing_of(demonstrations, divider)
    states, divider, learner = arguments
    # Nothing of the dashboard, which a process would have to load for it.
    grow = partial(grow_structures, divider=divider, learner=learner)
    keep = trees_under_any_name.keeping(*arguments)
    steps = len(demonstrations)
    values = demonstrations.observations.size * demonstrations.action_columns.shape[1]
    expected = _START + _SECONDS[learner_of(demonstrations)] * values

    def work(job: Job[Trees]) -> None:
        begun = time.monotonic()

        def progress(done: int, total: int) -> bool:
            seconds = time.monotonic() - begun
            usual = f"of about {expected:.0f} s"
            if seconds > expected:  # where the expert is often undecided, the tree is large
                usual = f"so far, usually it takes {expected:.0f} s"
            job.text = f"Growing the decision tree of {steps:,} states: {seconds:.0f} s {usual}"
            job.done = min(seconds / expected, _MOST)
            return job.wanted()

        with own_process() as executor:
            (grown,) = run_each(grow, [(states,)], executor=executor, progress=progress)
        release()  # they came in one piece, which is as large as they are
        # Here, where the states are: trees with their counts are several times as large.
        keep(counted_trees(grown, states, divider=divider, learner=learner))

    return Job(key_of(demonstrations, divider), work, 1)
