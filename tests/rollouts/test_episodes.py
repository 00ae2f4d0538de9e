import json
from concurrent.futures import Executor, Future
from typing import Any

import numpy as np
import pytest

from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.progress import CancelledError
from sarl_core.rollouts import episodes as episodes_module
from sarl_core.rollouts.episodes import Episodes, join, rollout, run_seeds
from sarl_core.rollouts.recording import record
from sarl_core.rollouts.steps import StepTable
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield
from sarl_core.shielding.wrappers import ShieldedEnv

COLUMNS = (
    "episode",
    "step",
    "observation",
    "proposed",
    "executed",
    "rules",
    "intervened",
    "margin",
    "reward",
    "outside",
)


@pytest.fixture(scope="module")
def shields() -> dict[str, Shield]:
    return {
        env_id: Shield(
            mine_rules(
                record(env_id, "expert", steps=3_000, stochastic=True), supp_min=0.005, conf_min=0.9
            )
        )
        for env_id in ("LunarLander-v3", "Pendulum-v1", "CartPole-v1")
    }


def same(first: Episodes, second: Episodes) -> bool:
    arrays = (
        "seeds",
        "returns",
        "lengths",
        "interventions",
        "covered",
        "terminated",
        "truncated",
        "last_rewards",
    )
    assert isinstance(first.steps, StepTable)
    assert isinstance(second.steps, StepTable)
    return all(
        getattr(first, name).tobytes() == getattr(second, name).tobytes() for name in arrays
    ) and all(
        getattr(first.steps, name).tobytes() == getattr(second.steps, name).tobytes()
        for name in COLUMNS
    )


@pytest.mark.parametrize(
    ("env_id", "agent", "stochastic"),
    [
        ("LunarLander-v3", "novice", False),
        ("LunarLander-v3", "expert", True),
        ("Pendulum-v1", "untrained", False),
        ("CartPole-v1", "expert", False),
    ],
)
def test_neither_batch_nor_processes_change_the_result(
    env_id: str, agent: str, stochastic: bool, shields: dict[str, Shield]
) -> None:
    actor = make_agent(agent, env_id, stochastic=stochastic)
    arguments: Any = {"shield": shields[env_id], "episodes": 5, "seed": 11, "max_steps": 120}
    whole = rollout(env_id, actor, **arguments)
    assert whole.interventions.sum() > 0 or agent == "expert"
    others: list[dict[str, Any]] = [
        {"batch": 1},
        {"batch": 3},
        {"batch": 100},
        {"jobs": 2},
        {"jobs": 2, "batch": 2},
    ]
    for other in others:
        assert same(whole, rollout(env_id, actor, **arguments, **other)), other


def test_an_episode_depends_on_its_own_seed_only() -> None:
    many = rollout("LunarLander-v3", "novice", episodes=6, seed=20)
    one = rollout("LunarLander-v3", "novice", episodes=1, seed=23)
    assert one.returns[0] == many.returns[3]
    assert many.steps is not None
    assert one.steps is not None
    assert many.steps.of_episode(3).observation.tobytes() == one.steps.observation.tobytes()
    assert len(set(many.returns.tolist())) == 6


@pytest.mark.parametrize("env_id", ["LunarLander-v3", "Pendulum-v1"])
def test_equals_a_plain_loop_through_the_wrapper(env_id: str, shields: dict[str, Shield]) -> None:
    """The same episode, one environment, one state at a time, in `ShieldedEnv`."""
    import gymnasium

    agent = make_agent("novice", env_id)
    found = rollout(env_id, agent, shield=shields[env_id], episodes=2, seed=4)
    assert found.steps is not None
    for index, seed in enumerate((4, 5)):
        env = ShieldedEnv(gymnasium.make(env_id), shields[env_id])
        generator = np.random.default_rng(seed)
        observation, _ = env.reset(seed=seed)
        steps, over, total = found.steps.of_episode(index), False, 0.0
        for row in range(len(steps)):
            assert not over
            assert (steps.observation[row] == observation).all()
            action = agent.act(observation[None], generator.random((1, agent.n_uniforms)))[0]
            native = int(action[0]) if action.dtype.kind == "i" else action
            observation, reward, terminated, truncated, info = env.step(native)
            shown = info["shield"]
            assert np.array_equal(steps.proposed[row], np.atleast_1d(shown.proposed))
            assert np.array_equal(steps.executed[row], np.atleast_1d(shown.executed))
            assert steps.rules[row].tolist() == [-1 if r is None else r for r in shown.rules]
            assert steps.intervened[row] == shown.intervened
            assert steps.margin[row] == shown.margin
            total += float(reward)
            over = terminated or truncated
        assert over
        assert found.returns[index] == total
        assert found.last_rewards[index] == reward
        assert (found.terminated[index], found.truncated[index]) == (terminated, truncated)
        assert found.interventions[index] == steps.intervened.sum() > 0
        assert found.covered[index] == steps.covered.sum()


@pytest.mark.parametrize(
    ("env_id", "least"),
    [("CartPole-v1", 500.0), ("LunarLander-v3", 240.0), ("Pendulum-v1", -250.0)],
)
def test_the_shipped_experts_are_as_good_as_their_cards(env_id: str, least: float) -> None:
    from sarl_core.agents.agent import shipped_experts

    card = json.loads(shipped_experts()[env_id].with_suffix(".json").read_text())
    reported = card["returns_deterministic"]
    assert reported["episodes"] == 100
    assert reported["mean"] >= least
    # Some of the very episodes that the card reports.
    few = rollout(env_id, "expert", episodes=8, seed=9_000_000)
    assert few.returns.min() >= reported["min"] - 0.01
    assert few.returns.max() <= reported["max"] + 0.01
    assert few.returns.mean() >= least


def test_summary_and_json(shields: dict[str, Shield]) -> None:
    found = rollout("CartPole-v1", "novice", shield=shields["CartPole-v1"], episodes=5, seed=1)
    document = found.to_dict()
    assert json.loads(json.dumps(document)) == document
    assert [row["seed"] for row in document["episodes"]] == [1, 2, 3, 4, 5]
    assert set(document["episodes"][0]) == {
        "seed",
        "return",
        "length",
        "interventions",
        "covered",
        "failed",
        "cost",
    }
    summary = document["summary"]
    assert list(summary) == [
        "mean",
        "std",
        "iqm",
        "iqm_low",
        "iqm_high",
        "intervention_rate",
        "coverage",
        "outside_rate",
        "worst_tenth",
        "freedom",
        "cost",
        "cost_low",
        "cost_high",
        "cost_worst_tenth",
        "failures",
        "failure_rate",
        "failure_low",
        "failure_high",
    ]
    assert summary["mean"] == found.returns.mean()
    assert found.steps is not None
    assert summary["intervention_rate"] == found.steps.intervened.mean()
    assert summary["coverage"] == found.steps.covered.mean()
    assert 0 < summary["intervention_rate"] < summary["coverage"] <= 1


def test_frames(shields: dict[str, Shield]) -> None:
    found = rollout("Pendulum-v1", "novice", shield=shields["Pendulum-v1"], episodes=3)
    frame = found.to_frame()
    assert frame["return"].tolist() == found.returns.tolist()
    assert frame["truncated"].all()
    assert found.steps is not None
    steps = found.steps.to_frame(("cos", "sin", "speed"))
    assert list(steps.columns) == [
        "episode",
        "step",
        "obs_cos",
        "obs_sin",
        "obs_speed",
        "proposed",
        "executed",
        "rule",
        "intervened",
        "outside",
        "margin",
        "reward",
    ]
    assert len(steps) == 600
    assert "StepTable(episode=int64[600]" in repr(found.steps)
    assert "env_id='Pendulum-v1'" in repr(found)


def test_parts_are_what_a_shorter_rollout_gives_and_join_again() -> None:
    whole = rollout("CartPole-v1", "novice", episodes=7, seed=2)
    parts = [whole.part(0, 3), whole.part(3, 5), whole.part(5, 99)]
    assert [len(part) for part in parts] == [3, 2, 2]
    assert same(parts[0], rollout("CartPole-v1", "novice", episodes=3, seed=2))
    assert same(parts[1], rollout("CartPole-v1", "novice", episodes=2, seed=5))
    assert same(join(parts), whole)
    assert join([parts[0], rollout("CartPole-v1", "novice", keep_steps=False)]).steps is None


def test_without_a_shield_nothing_intervenes() -> None:
    found = rollout("CartPole-v1", "novice", episodes=2)
    assert found.interventions.sum() == found.covered.sum() == 0
    assert found.steps is not None
    assert (found.steps.rules == -1).all()
    assert np.isinf(found.steps.margin).all()
    assert found.steps.proposed.tobytes() == found.steps.executed.tobytes()


def test_steps_need_not_be_kept() -> None:
    found = rollout("CartPole-v1", "novice", episodes=3, keep_steps=False)
    assert found.steps is None
    assert (found.returns == rollout("CartPole-v1", "novice", episodes=3).returns).all()


def test_arrays_are_read_only() -> None:
    found = rollout("CartPole-v1", "novice", episodes=1)
    assert found.steps is not None
    for array in (found.returns, found.lengths, found.steps.reward, found.steps.observation):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize("jobs", [1, 2])
def test_progress_counts_episodes_and_can_stop(jobs: int) -> None:
    calls: list[tuple[int, int]] = []
    rollout(
        "CartPole-v1",
        "novice",
        episodes=9,
        jobs=jobs,
        progress=lambda done, total: calls.append((done, total)),
    )
    assert calls[-1] == (9, 9)
    assert [done for done, _ in calls] == sorted(done for done, _ in calls)

    with pytest.raises(CancelledError, match="of 9"):
        rollout("CartPole-v1", "novice", episodes=9, jobs=jobs, progress=lambda *_: False)

    def fail(done: int, total: int) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        rollout("CartPole-v1", "novice", episodes=9, jobs=jobs, progress=fail)


def test_who_wants_no_more_waits_for_no_episode() -> None:
    class Never(Executor):
        workers = 1

        def submit(self, call: Any, /, *arguments: Any, **named: Any) -> Future[Any]:
            return Future()

    with pytest.raises(CancelledError, match="stopped after 0 of 3"):
        rollout(
            "CartPole-v1", "novice", episodes=3, executor=Never(), progress=lambda done, _: done > 0
        )


def test_an_endless_environment_is_truncated(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(episodes_module, "MAX_STEPS", 50)
    found = rollout("toy/Endless-v0", "novice", episodes=3, batch=2)
    assert found.lengths.tolist() == [50, 50, 50]
    assert found.truncated.all()
    assert found.cut.all()
    assert not found.terminated.any()


@pytest.mark.parametrize("arguments", [{"episodes": 0}, {"seed": -1}, {"batch": 0}, {"jobs": 0}])
def test_numbers_out_of_range_are_named(arguments: dict[str, int]) -> None:
    with pytest.raises(InputError, match=next(iter(arguments))):
        rollout("CartPole-v1", "novice", **arguments)  # type: ignore[arg-type]


def test_a_shield_of_another_environment_is_refused(shields: dict[str, Shield]) -> None:
    with pytest.raises(InputError, match="the rules"):
        rollout("LunarLander-v3", "novice", shield=shields["CartPole-v1"])


def test_an_unknown_environment_is_one_sentence() -> None:
    with pytest.raises(InputError, match="'NoSuch-v0' cannot be made"):
        rollout("NoSuch-v0", "novice")


def test_an_observer_sees_every_state_and_changes_nothing() -> None:
    agent, seeds = make_agent("novice", "CartPole-v1"), np.array([4, 5, 6])
    views: dict[int, list[Any]] = {}
    watched = run_seeds(
        "CartPole-v1",
        agent,
        None,
        seeds,
        batch=2,
        observer=lambda view: views.setdefault(view.episode, []).append(view),
    )
    alone = run_seeds("CartPole-v1", agent, None, seeds)
    assert watched.returns.tolist() == alone.returns.tolist()
    assert alone.steps is not None
    for episode, seen in views.items():
        steps = alone.steps.of_episode(episode)
        assert [view.step for view in seen] == list(range(len(steps) + 1))
        assert np.array_equal([view.state for view in seen[:-1]], steps.observation)
        assert np.array_equal(seen[-1].state, np.float32(seen[-1].env.unwrapped.state))
    assert len(views) == 3
