"""Which episodes are left out, and which are held out: between the data and every page.

Left-out episodes are not there for anything. Held-out ones are not mined from; rules are tried on
them.
"""

from __future__ import annotations

from typing import NamedTuple

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.validation.holding_out import hold_out
from sarl_dashboard.cache import cached
from sarl_dashboard.state.url import set_url_choice, url_choice, url_text

SHARES = tuple(f"{percent / 100:g}" for percent in range(0, 55, 5))
NOTHING = SHARES[0]
MOST_SEED = 9_999


class Choice(NamedTuple):
    """What was chosen.

    Attributes:
        share: Of the episodes, held out; 0 for none.
        seed: That draws them.
        left_out: Numbers of the episodes that are left out, ascending.
    """

    share: float
    seed: int
    left_out: tuple[int, ...]


class Parts(NamedTuple):
    """Demonstrations in the parts that pages work on.

    Attributes:
        mined: What rules are mined from.
        held_out: What they are tried on; None where nothing is held out.
        problem: Why a choice could not be followed, in one sentence; "" where it was.
        remaining: Both together: all but what is left out.
    """

    mined: Demonstrations
    remaining: Demonstrations
    held_out: Demonstrations | None = None
    problem: str = ""


def chosen() -> Choice:
    """What is in force (URL: holdout, holdout_seed, left_out)."""
    seed = url_text("holdout_seed", "0", _is_seed)
    return Choice(float(url_choice("holdout", SHARES, NOTHING)), int(seed), _left_out())


def _is_seed(text: str) -> bool:
    return text.isdecimal() and text.isascii() and len(text) < 10 and int(text) <= MOST_SEED


def _left_out() -> tuple[int, ...]:
    text = url_text("left_out", "", lambda text: text == "" or bool(_numbers(text)))
    return _numbers(text)


def _numbers(text: str) -> tuple[int, ...]:
    """Numbers as "3,7"; () where it is anything else."""
    parts = text.split(",")
    if not all(part.isdecimal() and part.isascii() and len(part) < 16 for part in parts):
        return ()
    return tuple(sorted({int(part) for part in parts}))


def choose_share(share: str) -> None:
    """Choose the share of the episodes that are held out; for callbacks."""
    set_url_choice("holdout", share, NOTHING)


def choose_seed(seed: int) -> None:
    """Choose the seed that draws them; for callbacks."""
    set_url_choice("holdout_seed", str(seed), "0")


def leave_out(episodes: tuple[int, ...]) -> None:
    """Choose the episodes that are left out; for callbacks."""
    set_url_choice("left_out", ",".join(map(str, sorted(set(episodes)))))


def parted(demonstrations: Demonstrations) -> Parts:
    """The demonstrations in their parts.

    Args:
        demonstrations: All there are.

    Returns:
        The same object where nothing is left out or held out.
    """
    choice = chosen()
    settled = demonstrations.sample_of is not None  # of a mined file, when it was mined
    if settled or not (choice.share or choice.left_out):
        return Parts(demonstrations, demonstrations)
    return _parted(demonstrations, choice)


@cached(show_spinner="Choosing the episodes …")
def _parted(demonstrations: Demonstrations, choice: Choice) -> Parts:
    episodes = demonstrations.episodes[demonstrations.episode_starts].tolist()
    left_out = set(choice.left_out)
    left = [episode for episode in episodes if episode not in left_out]
    problem = ""
    remaining = demonstrations
    if not left:
        problem = "every episode would be left out, so none is; leave out fewer"
    elif len(left) < len(episodes):
        try:
            remaining = demonstrations.select(left)
        except InputError as error:
            problem = f"no episode is left out: {error}"
    if not choice.share:
        return Parts(remaining, remaining, problem=problem)
    try:
        split = hold_out(remaining, choice.share, seed=choice.seed)
    except InputError as error:
        return Parts(remaining, remaining, problem=problem or f"nothing is held out: {error}")
    return Parts(split.mined, remaining, split.held_out, problem)
