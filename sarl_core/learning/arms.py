"""Ways to learn under a shield: what each does with the rules while it learns.

They differ in two things: whether a rule decides what is executed, and what the learner is told
about it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

from sarl_core.environments.description import describe_environment
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.errors import InputError

if TYPE_CHECKING:
    from sarl_core.mining.rule_set import RuleSet

SEEDS_APART = 100_000  # between learners, so that no two share an episode
LAST_SEED = 89  # of a learner: the next one would see the episodes that all are tried on

Memory = Literal["proposed", "executed", "masked"]
"""What a policy-gradient learner believes it did: what it proposed; what was executed, with its own
log-probability; or that it chose from what the rules left, which where one demands is nothing."""


@dataclass(frozen=True)
class LearningArm:
    """One way to learn.

    Attributes:
        name: In commands and file names.
        title: On screen.
        what: What it does, in one sentence.
        shielded: Whether rules are in force while it learns.
        replay: Whether it is an off-policy learner (DQN, for continuous actions SAC), and not PPO.
        memory: What PPO believes it did.
        penalty: Taken off the reward at every intervention.
        imitation: Weight of the loss that teaches the network what the rules said; 0 for none.
        sharpness: How many times as decidedly as it was taught it acts; discrete actions only.
        handover: Whether whole episodes are left to the learner as it proves itself.
        discrete_only: Whether it needs discrete actions.
    """

    name: str
    title: str
    what: str
    shielded: bool = True
    replay: bool = False
    memory: Memory = "proposed"
    penalty: float = 0.0
    imitation: float = 0.0
    sharpness: float = 1.0
    handover: bool = False
    discrete_only: bool = False

    @property
    def alone(self) -> str:
        """Name of the arm that learns by the same algorithm without a shield."""
        return "none-replay" if self.replay else "none"


_ALL = (
    LearningArm(
        "none",
        "No shield",
        "PPO learns alone, by trial and error.",
        shielded=False,
    ),
    LearningArm(
        "override",
        "Override",
        "The rules replace what breaks them; PPO believes that its own action was executed.",
    ),
    LearningArm(
        "penalty",
        "Override with penalty",
        "As override, and every replaced action costs reward, one point if nothing else is said.",
        penalty=1.0,
    ),
    LearningArm(
        "executed",
        "Override, executed action",
        "As override, and PPO learns from the executed action, with its own probability of it.",
        memory="executed",
    ),
    LearningArm(
        "mask",
        "Mask",
        "PPO samples only what the rules leave: where one demands an action it has nothing to "
        "learn from, where some forbid it learns to choose from the rest.",
        memory="masked",
        discrete_only=True,
    ),
    LearningArm(
        "imitate",
        "Mask and imitate",
        "As mask, and the network is also taught what the rules said wherever they spoke.",
        memory="masked",
        imitation=1.0,
    ),
    LearningArm(
        "handover",
        "Imitate, then hand over",
        "As mask and imitate, and more and more episodes are left to the learner alone, as long "
        "as it fails in them no more often than under the rules.",
        memory="masked",
        imitation=1.0,
        sharpness=6.0,
        handover=True,
    ),
    LearningArm(
        "none-replay",
        "No shield, replay",
        "DQN (SAC where actions are continuous) learns alone, by trial and error.",
        shielded=False,
        replay=True,
    ),
    LearningArm(
        "replay",
        "Override, replay",
        "The rules replace what breaks them; DQN (SAC where actions are continuous) remembers "
        "the action that was executed.",
        replay=True,
    ),
)
ARMS: dict[str, LearningArm] = {arm.name: arm for arm in _ALL}
"""Every arm by its name, in the order in which they are shown."""


def arms_named(names: Sequence[str], *, discrete: bool = True) -> tuple[LearningArm, ...]:
    """Arms by their names.

    Args:
        names: Of `ARMS`, or "all".
        discrete: Whether the actions are; "all" leaves out what needs it.

    Returns:
        In the order of `ARMS`, each once.

    Raises:
        InputError: If there is no such arm, or no name.
    """
    for name in names:
        if name not in ARMS and name != "all":
            raise InputError(f"there is no arm {name!r}; choose all, or {', '.join(ARMS)}")
    if not names:
        raise InputError("no way to learn is chosen; choose at least one")
    everything = "all" in names
    return tuple(
        arm
        for arm in _ALL
        if arm.name in names or (everything and (discrete or not arm.discrete_only))
    )


def check_learning(
    env_id: EnvironmentOrId, rules: RuleSet | None, arm: LearningArm, *, steps: int, seed: int
) -> None:
    """Refuse what cannot be learned, before any work is done for it.

    Args:
        env_id: What ``gymnasium.make`` takes.
        rules: Of the shield, or None.
        arm: The way to learn.
        steps: Environment steps.
        seed: Of the learner.

    Raises:
        InputError: If a number is out of range, the environment cannot be used, the rules are
            missing or not for it, or the arm is not for its actions.
    """
    if steps < 1:
        raise InputError(f"steps is {steps} and must be at least 1; give a larger number")
    if not 0 <= seed <= LAST_SEED:
        raise InputError(f"seed is {seed} and must be from 0 to {LAST_SEED}; give another one")
    description = describe_environment(env_id)
    if len(description.action_shape) and description.is_discrete:
        raise InputError(
            f"{env_id} takes several discrete actions at once, which no learner here does; "
            "choose an environment with one discrete action, or with continuous ones"
        )
    if description.is_discrete and any(description.label_first):
        raise InputError(
            f"the actions of {env_id} count from {description.label_first[0]} and no learner here "
            "takes them; wrap the environment so that they count from 0"
        )
    if arm.discrete_only and not description.is_discrete:
        raise InputError(
            f"the arm {arm.name!r} masks discrete actions and {env_id} takes continuous ones; "
            "choose another arm, such as imitate or replay"
        )
    if arm.shielded and rules is None:
        raise InputError(
            f"the arm {arm.name!r} learns under a shield and there are no rules for it; give "
            "a rule file, or choose an arm without a shield (none, none-replay)"
        )
    if rules is not None:
        from sarl_core.rollouts.player import check_environment
        from sarl_core.shielding.shield import Shield

        check_environment(env_id, Shield(rules))


class Handover:
    """How many episodes the learner is trusted with.

    It starts with one in ten. Each time an episode of its own ends and its recent ones failed no
    more often than the recent ones under the rules, it gets one in ten more; else half as many,
    never less than where it started, because without trials it could never prove itself. The
    state follows from the episodes alone, so a resumed run finds it by telling them again.
    """

    START = 0.1
    MORE = 0.1
    OWN, LED = 10, 60  # recent episodes that count: its own, and those under the rules
    TRIALS = 5  # before them nothing is known

    def __init__(self) -> None:
        self.share = self.START
        self._own: deque[bool] = deque(maxlen=self.OWN)
        self._led: deque[bool] = deque(maxlen=self.LED)

    def ended(self, *, shielded: bool, crashed: bool) -> None:
        """Take note of an episode.

        Args:
            shielded: Whether the rules were in force.
            crashed: Whether it ended by failure.
        """
        if shielded:
            self._led.append(crashed)
            return
        self._own.append(crashed)
        if len(self._own) < self.TRIALS:
            return
        if _rate(self._own) <= _rate(self._led):
            self.share = min(1.0, self.share + self.MORE)
        else:
            self.share = max(self.START, self.share / 2)


def _rate(crashes: deque[bool]) -> float:
    return sum(crashes) / max(len(crashes), 1)
