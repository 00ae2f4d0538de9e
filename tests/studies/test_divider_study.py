from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.errors import InputError
from sarl_core.mining.quantisation import quantise
from sarl_core.progress import CancelledError
from sarl_core.rollouts.episodes import rollout
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.trial import make_agent
from sarl_core.studies.divider import DividerStudy, snapped_agents, study_divider

PENDULUM = "Pendulum-v1"


@pytest.fixture(scope="module")
def demonstrations() -> Demonstrations:
    return record(PENDULUM, "expert", steps=800)


@pytest.fixture(scope="module")
def study(demonstrations: Demonstrations) -> DividerStudy:
    return study_divider(
        PENDULUM, "expert", demonstrations, dividers=(2, 9), episodes=6, seed=100_000
    )


def test_every_divider_and_way_to_snap_is_there(study: DividerStudy) -> None:
    assert [(each.divider, each.snapping) for each in study.snapped] == [
        (2, "centre"),
        (2, "clip"),
        (2, "expert"),
        (9, "centre"),
        (9, "clip"),
        (9, "expert"),
    ]
    assert all(len(each.episodes) == 6 for each in study.snapped)
    assert all(each.episodes.seeds[0] == 100_000 for each in study.snapped)
    assert study.of(3, "centre") is None


def test_clip_leaves_the_expert_as_it_is(study: DividerStudy) -> None:
    alone = rollout(PENDULUM, "expert", episodes=6, seed=100_000)
    assert study.unchanged.returns.tolist() == alone.returns.tolist()
    for divider in (2, 9):
        assert study.of(divider, "clip") is study.unchanged


def test_two_intervals_cost_the_expert_more_than_nine(study: DividerStudy) -> None:
    for snapping in ("centre", "expert"):
        coarse, fine = (study.of(divider, snapping) for divider in (2, 9))
        assert coarse is not None
        assert fine is not None
        assert coarse.returns.mean() < fine.returns.mean() - 20


def test_only_what_stands_for_an_interval_is_executed(demonstrations: Demonstrations) -> None:
    expert = make_agent("expert", PENDULUM)
    (divided,) = quantise(demonstrations, (3,))
    agents = snapped_agents(PENDULUM, expert, [divided])
    assert [agent.snapping for agent in agents] == ["centre", "expert"]
    states = demonstrations.observations[:200]
    proposed = expert.act(states, None)[:, 0]
    labels = divided[0].dimension.labels_of(proposed)
    centres = agents[0].act(states, None)
    assert centres.shape == (200, 1)
    wanted = np.array([-4 / 3, 0.0, 4 / 3], dtype=np.float32)[labels]
    assert centres[:, 0].tolist() == wanted.tolist()
    medians = agents[1].act(states, None)[:, 0]
    assert medians.tolist() == divided[0].medians.astype(np.float32)[labels].tolist()


def test_a_sampled_expert_stays_sampled(demonstrations: Demonstrations) -> None:
    expert = make_agent("expert", PENDULUM, stochastic=True)
    (agent, _) = snapped_agents(PENDULUM, expert, quantise(demonstrations, (3,)))
    assert agent.n_uniforms == 1
    assert agent.name == "expert, 3 intervals, centre"


def test_progress_counts_over_all_and_stops(demonstrations: Demonstrations) -> None:
    calls: list[tuple[int, int]] = []
    study_divider(
        PENDULUM,
        "novice",
        demonstrations,
        dividers=(2,),
        episodes=2,
        progress=lambda *call: calls.append(call),
    )
    # Clipping changes nothing and is not run again: the expert, two ways to snap.
    assert calls == [(done, 6) for done in range(1, 7)]
    with pytest.raises(CancelledError):
        study_divider(
            PENDULUM, "novice", demonstrations, dividers=(2,), episodes=2, progress=lambda *_: False
        )


@pytest.mark.parametrize(
    ("env_id", "fragment"),
    [
        ("CartPole-v1", "takes discrete actions"),
        ("BipedalWalker-v3", "1 action dimensions"),
        ("MountainCarContinuous-v0", "from -2 to 2"),
    ],
)
def test_demonstrations_of_another_environment_are_refused(
    env_id: str, fragment: str, demonstrations: Demonstrations
) -> None:
    with pytest.raises(InputError, match=fragment) as error:
        study_divider(env_id, "novice", demonstrations, episodes=1)
    assert "\n" not in str(error.value)


def test_bounds_taken_from_the_values_fit_any_environment(demonstrations: Demonstrations) -> None:
    unbounded = replace(
        demonstrations, action_low=None, action_high=None, bounds_from=None, env_id=""
    )
    found = study_divider(PENDULUM, "expert", unbounded, dividers=(2,), episodes=1)
    assert found.quantisations[0][0].dimension.bounds_from == "demonstrated values"
