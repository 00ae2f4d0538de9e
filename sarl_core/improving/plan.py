"""What an aggregation is to do, and what cannot be done."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

from sarl_core.errors import InputError, quoted
from sarl_core.improving.refinement import SearchEffort
from sarl_core.mining.budgeted_trees import MIN_RULES
from sarl_core.mining.combining.candidates import Pair
from sarl_core.mining.rules import Thresholds
from sarl_core.rollouts.choices import Choice
from sarl_core.rollouts.seeds import (
    LARGEST_RUN,
    MOST_EPISODES_A_ROUND,
    MOST_ROUNDS,
    MOST_VALIDATION,
    SEEDS_A_RUN,
)
from sarl_core.shielding.projection import Projection

_MOST_SEARCH_EPISODES = 1_000
_MOST_WORTH = 1e9


@dataclass(frozen=True)
class Plan:
    """What an aggregation is to do.

    Attributes:
        max_rules: Most rules of each action dimension.
        rounds: How often the rules act and the expert answers.
        episodes: Episodes a round.
        thresholds: Cut the trees there; None makes every leaf a rule.
        divider: Number of intervals of continuous dimensions.
        projection: How the shield replaces a continuous action.
        turns: Of the refinement that follows; 0 for none.
        search_episodes: For each neighbour that it tries.
        search_limit: Time limit of its episodes, in steps: a longer one than the environment's, so
            that what fails later is told apart, too, or a shorter one, so that there is time for
            more of them; None for the environment's own.
        search_starts: Of how many rounds the rules are moved before the best of them is gone on
            with; as `Refinement` does it where None.
        search_steps: In each turn, in which the rules are changed by what their own episodes say
            in place of what the expert says; 0 for none.
        search_generations: Of a turn, in which the thresholds of the best rules are moved; as
            `Refinement` does it where None. Of more than 16 each leaves its worse half after a
            third of the episodes, and half of the rest after two thirds.
        search_worth: What a failure counts in it, in units of the return; where None, as much as
            the returns of the rounds differ, and nothing where `choose` is the return.
        validation: Episodes by which the best of all is chosen in the end.
        report: Episodes of the final report.
        seed: Another one gives other episodes.
        max_steps: An episode that has not ended by then is cut off; `episodes.MAX_STEPS` where
            None.
        choose: What comes first where the best is chosen.
        combined: Pairs of features of which combinations may be asked about, by their indices in
            the environment's order; () for none. Of many, every other round offers none.
    """

    max_rules: int
    rounds: int = 20
    episodes: int = 40
    thresholds: Thresholds | None = None
    divider: int = 2
    projection: Projection = "centre"
    turns: int = 0
    search_episodes: int = 16
    search_limit: int | None = None
    search_starts: int | None = None
    search_steps: int = 0
    search_generations: int | None = None
    search_worth: float | None = None
    validation: int = 256
    report: int = 100
    seed: int = 0
    max_steps: int | None = None
    choose: Choice = "return"
    combined: tuple[Pair, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what cannot be done.

        Raises:
            InputError: If a number is out of range, or something else is to be chosen by.
        """
        if self.choose not in get_args(Choice):
            raise InputError(
                f"the best is to be chosen by {quoted(self.choose)}; give return or failures"
            )
        if self.thresholds is not None and self.turns:
            # The search tries every leaf as a rule: what is cut away would be judged with it.
            raise InputError(
                "rules that thresholds cut are not refined; give --refine without --support and "
                "--confidence, or these without it"
            )
        for name, value, least, most in (
            ("budget of rules", self.max_rules, MIN_RULES, None),
            ("number of rounds", self.rounds, 1, MOST_ROUNDS),
            ("number of episodes a round", self.episodes, 1, MOST_EPISODES_A_ROUND),
            ("number of search episodes", self.search_episodes, 1, _MOST_SEARCH_EPISODES),
            ("number of validation episodes", self.validation, 1, MOST_VALIDATION),
            ("number of report episodes", self.report, 1, MOST_VALIDATION),
            ("seed", self.seed, 0, LARGEST_RUN),
            ("limit of a search episode", _or_one(self.search_limit), 1, None),
            ("number of search starts", _or_one(self.search_starts), 1, self.rounds),
            ("number of search steps", self.search_steps, 0, None),
            ("number of search generations", _or_one(self.search_generations), 1, None),
            ("max_steps", _or_one(self.max_steps), 1, None),
        ):
            _check_number(name, value, least, most)
        if self.search_worth is not None and not 0 <= self.search_worth <= _MOST_WORTH:
            raise InputError(
                f"the worth of a failure is {self.search_worth:g}; give a number from 0 to "
                f"{_MOST_WORTH:g}"
            )
        self.check_turns(self.search())

    def search(self, *, pruned: int = 0) -> SearchEffort:
        """How much the refinement tries, which may begin with each round.

        Args:
            pruned: Rules that it begins with beyond the budget.
        """
        return SearchEffort(
            self.search_episodes,
            self.rounds,
            self.search_starts,
            self.search_steps,
            self.search_generations,
            pruned,
        )

    def check_turns(self, search: SearchEffort) -> None:
        """Refuse more turns than the seeds of one run are enough for.

        Args:
            search: As `search` gives it.

        Raises:
            InputError: If they are not.
        """
        _check_number("number of turns", self.turns, 0, self._most_turns(search))

    def _most_turns(self, search: SearchEffort) -> int:
        none, one = (search.seeds(turns) for turns in range(2))
        left = SEEDS_A_RUN - none
        if self.turns and left < one - none:
            raise InputError(
                f"the first turn and what comes before it take {one:,} episodes of their own, and "
                f"one run has {SEEDS_A_RUN:,}; give "
                + (
                    "a larger --max-rules, or fewer --search-episodes"
                    if search.pruned
                    else "fewer rounds, --search-steps, --search-generations or --search-episodes"
                )
            )
        return max(left, 0) // (one - none)


def _or_one(number: int | None) -> int:
    return 1 if number is None else number


def _check_number(name: str, value: int, least: int, most: int | None) -> None:
    if value < least:
        raise InputError(f"the {name} is {value}; give {least} or more")
    if most is not None and value > most:
        # Beyond, what is chosen by would be what it is reported on.
        raise InputError(f"the {name} is {value:,}; give {most:,} or fewer")
