from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from imageio_ffmpeg import count_frames_and_secs
from PIL import Image

from sarl_core import Environment, InputError, Shield, load_demonstrations, mine_rules, rollout
from sarl_core.environments.environment import EnvironmentOrId
from sarl_core.progress import CancelledError
from sarl_core.rendering.fork import Fork, Rest, endings, fork
from sarl_core.rendering.overlay import GAP
from sarl_core.rollouts.steps import StepTable

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
# An episode of which few pictures are drawn.
SHORT = Environment("CartPole-v1", '{"max_episode_steps": 120}')
COLUMNS = ("observation", "proposed", "executed", "rules", "intervened", "margin", "reward")


def shield_of(name: str) -> Shield:
    supports = {"cartpole": (0.005, 0.95), "pendulum": (0.02, 0.8)}
    support, confidence = supports[name]
    demonstrations = load_demonstrations(DATA / f"{name}.parquet")
    return Shield(mine_rules(demonstrations, supp_min=support, conf_min=confidence))


@pytest.fixture(scope="module")
def cart() -> Shield:
    return shield_of("cartpole")


def original(env_id: EnvironmentOrId, shield: Shield, seed: int) -> StepTable:
    steps = rollout(env_id, "novice", shield=shield, episodes=1, seed=seed).steps
    assert steps is not None
    return steps


def same(first: StepTable, second: StepTable, count: int) -> bool:
    """Bit for bit, and that is what is compared."""
    return all(
        getattr(first, name)[:count].tobytes() == getattr(second, name)[:count].tobytes()
        for name in COLUMNS
    )


@pytest.mark.parametrize("name", ["cartpole", "pendulum"])
@pytest.mark.parametrize("rest", ["shielded", "alone"])
def test_a_fork_is_the_original_and_the_same_until_it_parts(name: str, rest: Rest) -> None:
    env_id = {"cartpole": "CartPole-v1", "pendulum": "Pendulum-v1"}[name]
    shield = shield_of(name)
    before = original(env_id, shield, 100_003)
    step = int(np.flatnonzero(before.intervened)[5])
    found = fork(env_id, "novice", shield, step=step, rest=rest, seed=100_003)
    kept, withheld = found.unchanged.steps, found.withheld.steps
    assert kept is not None
    assert withheld is not None
    assert same(kept, before, len(before))
    assert len(kept) == len(before)
    assert same(withheld, kept, step)
    # At the fork itself: the same state, the same rule, the agent's own action.
    assert (withheld.observation[step] == kept.observation[step]).all()
    assert (withheld.proposed[step] == kept.proposed[step]).all()
    assert (withheld.rules[step] == kept.rules[step]).all()
    assert (withheld.executed[step] == withheld.proposed[step]).all()
    assert not withheld.intervened[step]
    assert kept.intervened[step]
    # What the agent draws is the same in both, whatever it sees: the novice looks at nothing.
    shared = min(len(kept), len(withheld))
    assert (withheld.proposed[:shared] == kept.proposed[:shared]).all()
    after = slice(step + 1, None)
    if rest == "alone":
        assert not withheld.intervened[after].any()
        assert (withheld.executed[after] == withheld.proposed[after]).all()
    else:
        decided = shield.decide_batch(withheld.observation[after], withheld.proposed[after])
        assert (decided.executed.reshape(-1) == withheld.executed[after].reshape(-1)).all()
        assert (decided.rules == withheld.rules[after]).all()
    assert found.difference == found.withheld.returns[0] - found.unchanged.returns[0]


def test_the_branch_without_is_what_the_environment_does_with_those_actions(cart: Shield) -> None:
    """An oracle of its own: the plain environment, fed with the recorded actions."""
    import gymnasium

    step = int(np.flatnonzero(original("CartPole-v1", cart, 7).intervened)[0])
    found = fork("CartPole-v1", "novice", cart, step=step, rest="alone", seed=7)
    env = gymnasium.make("CartPole-v1")
    state, _ = env.reset(seed=7)
    gained = 0.0
    assert found.withheld.steps is not None
    for seen, action in zip(
        found.withheld.steps.observation, found.withheld.steps.executed[:, 0], strict=True
    ):
        assert (np.float32(state) == seen).all()
        state, reward, terminated, _, _ = env.step(int(action))
        gained += float(reward)
    env.close()
    with_it, without = found.branches
    assert without.gained == gained
    assert (without.ending == "failure") == terminated
    assert without.steps < with_it.steps
    assert without.interventions < with_it.interventions
    assert endings(found.withheld) == (without.ending,)


def test_the_same_fork_gives_the_same_picture(cart: Shield, tmp_path: Path) -> None:
    step = int(np.flatnonzero(original(SHORT, cart, 7).intervened)[20])
    found, again = (fork(SHORT, "novice", cart, step=step, rest="alone", seed=7) for _ in range(2))
    assert found.replay.gif() == again.replay.gif()
    assert found.replay.gif() is found.replay.gif()
    picture = Image.open(io.BytesIO(found.replay.gif()))
    one = found.replay.panels[0].size[1]
    assert picture.width > 2 * one  # two panels and the gap
    first = max(step - 50, 0)  # a second before they part
    film = found.replay
    assert (film.first, film.pictures) == (first, len(film) - first)
    assert (next(film.animation()) == film.frame(first)).all()
    assert film.places == ((0, one), (one + GAP, one))
    found.replay.save(tmp_path / "fork.mp4")
    shown, _ = count_frames_and_secs(tmp_path / "fork.mp4")
    assert shown == film.pictures
    marks = [found.replay.panels[1].caption(at).mark for at in (step - 1, step, step + 1)]
    assert marks[1:] == ["WITHHELD", "NO SHIELD"]
    assert found.replay.panels[0].caption(step).mark == "CHANGED"
    # In the common part the two panels show the same scene.
    left, right = (panel.film.indexes(step) for panel in found.replay.panels)
    assert (left == right).all()


@pytest.fixture(scope="module")
def calm(cart: Shield) -> int:
    return int(np.flatnonzero(~original(SHORT, cart, 7).intervened)[0])


def test_where_nothing_was_changed_there_is_nothing_to_withhold(cart: Shield, calm: int) -> None:
    for step in (calm, 10_000, -1):
        with pytest.raises(InputError, match=f"change nothing at step {step} of seed 7"):
            fork(SHORT, "novice", cart, step=step, seed=7)
    with pytest.raises(InputError, match="neither shielded nor alone"):
        fork(SHORT, "novice", cart, step=calm, rest="off", seed=7)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="seed is -1"):
        fork(SHORT, "novice", cart, step=calm, seed=-1)


def test_a_caller_who_wants_no_more_is_heard(cart: Shield) -> None:
    with pytest.raises(CancelledError):
        fork("CartPole-v1", "novice", cart, step=3, seed=7, progress=lambda done, _: done < 3)


def test_a_fork_says_what_it_is(cart: Shield) -> None:
    step = int(np.flatnonzero(original(SHORT, cart, 7).intervened)[0])
    found = fork(SHORT, "novice", cart, step=step, seed=7)
    assert isinstance(found, Fork)
    assert found.step == step
    assert [panel.title for panel in found.replay.panels] == [
        "novice, change kept",
        "novice, change withheld",
    ]
