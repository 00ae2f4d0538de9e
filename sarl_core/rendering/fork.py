"""The same episode twice, once with one of the shield's changes and once without it.

Both begin from the same seed and draw the same random numbers, so they are the same, bit for bit,
up to the step at which the change is withheld; whatever differs afterwards follows from it.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from sarl_core.agents.agent import Agent
from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.mining.rule_tree import NO_RULE
from sarl_core.progress import Progress, report
from sarl_core.rendering.camera import film_episode, picture_speed
from sarl_core.rendering.canvas import OVERLAY_COLOURS
from sarl_core.rendering.film import Film, Palette
from sarl_core.rendering.overlay import Caption, Panel
from sarl_core.rendering.replay import DescribeRule, Replay, sentences
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.player import shield_for
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import BatchDecision, Shield

Rest = Literal["shielded", "alone"]
"""After the change that is withheld: the shield goes on, or the agent acts alone to the end."""
Ending = Literal["failure", "end", "limit"]
"""How an episode ended: by a failure, by the environment for another reason, by a time limit."""

_LEAD_SECONDS = 1.0  # of the common part that a film of the fork begins with


class Branch(NamedTuple):
    """How one branch went.

    Attributes:
        gained: The return of the whole episode.
        steps: Its length.
        ending: How it ended.
        interventions: Steps at which the shield changed the action.
    """

    gained: float
    steps: int
    ending: Ending
    interventions: int


@dataclass(frozen=True, eq=False)
class Fork:
    """An episode with all changes of a shield, and one without one of them.

    Attributes:
        replay: Both, the one with the change on the left; a film of them begins a second before
            they part.
        step: Where they part.
        rest: What the shield does after it, in the one without the change.
    """

    replay: Replay
    step: int
    rest: Rest

    @property
    def unchanged(self) -> Episodes:
        """The episode with the change, the same as `rollout` plays it."""
        return self.replay.episodes[0]

    @property
    def withheld(self) -> Episodes:
        """The episode without it."""
        return self.replay.episodes[1]

    @property
    def branches(self) -> tuple[Branch, Branch]:
        """How the two went, with the change and without it."""
        with_it, without = (_branch(episodes) for episodes in self.replay.episodes)
        return with_it, without

    @property
    def difference(self) -> float:
        """What the return gains, or loses where it is negative, when the change is withheld."""
        return float(self.withheld.returns[0] - self.unchanged.returns[0])


def fork(
    env_id: EnvironmentOrId,
    agent: str | Path | Agent,
    shield: Shield,
    *,
    step: int,
    rest: Rest = "shielded",
    seed: int = 0,
    stochastic: bool = False,
    describe_rule: DescribeRule | None = None,
    progress: Progress | None = None,
) -> Fork:
    """Replay a seed with the shield, and again without what the shield changed at one step.

    At that step the agent's whole action is executed as it was proposed, in every dimension.

    Args:
        env_id: What ``gymnasium.make`` takes.
        agent: An agent, or what `make_agent` takes.
        shield: Checks every action.
        step: At which the change is withheld; one of those at which there is one.
        rest: Whether the shield goes on after that step or is off to the end.
        seed: Of both episodes.
        stochastic: Whether a trained policy is sampled.
        describe_rule: A sentence for the index of a rule; that of `language` where not given.
        progress: Called with (steps done, most steps); returning False stops.

    Returns:
        Both episodes. The same arguments give the same ones, bit for bit.

    Raises:
        InputError: If something does not fit, the environment draws no pictures, or the shield
            changes nothing at that step.
        WorkError: If drawing fails.
        CancelledError: If `progress` returned False.
    """
    if rest not in get_args(Rest):
        raise InputError(f"the rest {rest!r} is neither shielded nor alone; choose one")
    actor = make_agent(agent, env_id, stochastic=stochastic, seed=seed)
    fps, limit = picture_speed(env_id)
    palette = Palette(OVERLAY_COLOURS)
    shield = shield_for(env_id, shield)
    describe = describe_rule or sentences(shield.rule_set)
    dimensions = environment_dimensions(describe_environment(env_id), shield.rule_set)
    episodes: list[Episodes] = []
    panels: list[Panel] = []
    titles = (f"{actor.name}, change kept", f"{actor.name}, change withheld")
    for part, title in enumerate(titles):

        def advance(done: int, total: int, part: int = part) -> None:
            report(progress, done + part * total, 2 * total)

        film = Film(palette)
        guard = shield if not part else _Withholding(shield, step, rest)
        episode = film_episode(env_id, actor, guard, seed, film, limit, advance)
        if not part:
            _check_step(episode, step, seed)
        assert episode.steps is not None
        episodes.append(episode)
        panels.append(
            _ForkedPanel(
                title=title,
                subtitle=f"{str(env_id).rsplit(':', 1)[-1]} · seed {seed}",
                film=film,
                steps=episode.steps,
                shielded=True,
                describe_rule=describe,
                dimensions=dimensions,
                fps=fps,
                withheld_at=step if part else None,
                rest=rest,
            )
        )
    first = max(step - round(_LEAD_SECONDS * fps), 0)
    return Fork(Replay(tuple(episodes), tuple(panels), fps, first), step, rest)


def _check_step(episode: Episodes, step: int, seed: int) -> None:
    assert episode.steps is not None
    changed = np.flatnonzero(episode.steps.intervened)
    if step in changed:
        return
    if not len(changed):
        raise InputError(
            f"the rules change nothing in the episode of seed {seed}; choose another seed, agent "
            "or rules"
        )
    nearest = int(changed[np.abs(changed - step).argmin()])
    raise InputError(
        f"the rules change nothing at step {step} of seed {seed}; choose a step at which they do, "
        f"such as {nearest}"
    )


def _branch(episodes: Episodes) -> Branch:
    return Branch(
        float(episodes.returns[0]),
        int(episodes.lengths[0]),
        endings(episodes)[0],
        int(episodes.interventions[0]),
    )


def endings(episodes: Episodes) -> tuple[Ending, ...]:
    """How each episode ended.

    Args:
        episodes: E finished ones.

    Returns:
        One entry an episode. Where it is not known which ends are failures, none is one.
    """
    return tuple(
        "failure" if failure else "end" if end else "limit"
        for failure, end in zip(episodes.failed.tolist(), episodes.terminated.tolist(), strict=True)
    )


class _Withholding(Shield):
    """A shield for one episode that lets one action pass, or all from there on."""

    def __init__(self, shield: Shield, step: int, rest: Rest) -> None:
        # All a shield knows is worked out already, and none of it changes.
        self.__dict__.update(shield.__dict__)
        self._withheld_at, self._rest, self._decided = step, rest, 0

    def decide_batch(self, observations: ArrayLike, actions: ArrayLike) -> BatchDecision:
        """As the shield decides, one state a time; the change that is withheld is none."""
        decision = super().decide_batch(observations, actions)
        now, self._decided = self._decided, self._decided + 1
        if now < self._withheld_at or (now > self._withheld_at and self._rest == "shielded"):
            return decision
        passed = decision._replace(
            executed=decision.proposed, intervened=np.zeros_like(decision.intervened)
        )
        if now == self._withheld_at:
            return passed
        return passed._replace(
            rules=np.full_like(decision.rules, NO_RULE),
            margin=np.full_like(decision.margin, np.inf),
            outside=np.zeros_like(decision.outside),
            invalid=np.full_like(decision.invalid, None),
        )


@dataclass(frozen=True, eq=False)
class _ForkedPanel(Panel):
    """A branch as a picture; it says where the shield was held back.

    Attributes:
        withheld_at: The step at which the change is withheld, None in the branch that keeps it.
        rest: What the shield does after it.
    """

    withheld_at: int | None
    rest: Rest

    def caption(self, step: int) -> Caption:
        """See `Panel.caption`."""
        executed = self.executed_text(step)
        if step == self.withheld_at:
            rules = [rule for rule in self.steps.rules[step].tolist() if rule >= 0]
            reasons = [self.describe_rule(rule) for rule in rules]
            return Caption("WITHHELD", executed, "; ".join(reasons), True)
        if self.withheld_at is not None and step > self.withheld_at and self.rest == "alone":
            return Caption("NO SHIELD", executed, "The shield is off from here on.", False)
        return super().caption(step)
