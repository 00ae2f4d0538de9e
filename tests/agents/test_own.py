"""Agents of the caller's own, named as module:name."""

import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from sarl_core.agents.own import OwnAgent, own_agent
from sarl_core.cli.app import main
from sarl_core.errors import InputError
from sarl_core.rollouts.episodes import rollout

AGENTS = '''
import json
import socket

import numpy as np


def lean(observations):
    return (observations[:, 2] + 0.3 * observations[:, 3] > 0).astype(int)


class Remembers:
    """Pushes left and right in turns, from the left in every episode."""

    def __init__(self):
        self.count = 7

    def reset(self):
        self.count = 0

    def __call__(self, observations):
        self.count += 1
        return np.array([self.count % 2])


class Recurrent:
    """Asked as a RecurrentPPO is; its state is how often it was asked in this episode."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        assert len(observation) == 1
        assert (state is None) == bool(episode_start[0])
        state = np.zeros(1) if state is None else state + 1
        return (state % 2).astype(int), state


def recurrent(seed=3):
    return Recurrent()


class Breaks(Remembers):
    episodes = 0

    def reset(self):
        super().reset()
        self.episodes += 1

    def __call__(self, observations):
        if (self.episodes, self.count) == (3, 4):
            raise ValueError("no such\\ngear")
        return super().__call__(observations)


def shape(observations):
    return np.zeros((len(observations), 3))


def words(observations):
    return ["left"] * len(observations)


def unknown(observations):
    return np.full(len(observations), 2)


def needs(one, other):
    raise AssertionError


class Needs:
    def __init__(self, path):
        self.path = path


number = 3


class Remote:
    def __init__(self):
        port = int(open("port").read())
        self.connection = socket.create_connection(("127.0.0.1", port)).makefile("rw")

    def __call__(self, observations):
        self.connection.write(json.dumps(observations.tolist()) + "\\n")
        self.connection.flush()
        return json.loads(self.connection.readline())
'''


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    (tmp_path / "scripted_agents.py").write_text(AGENTS)
    (tmp_path / "broken_agents.py").write_text("raise RuntimeError('no licence')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


def test_memory_ends_with_its_episode_whatever_is_asked_for_at_once() -> None:
    for name in ("Remembers", "recurrent", "Recurrent"):
        agent = own_agent(f"scripted_agents:{name}", "CartPole-v1")
        assert isinstance(agent, OwnAgent)
        assert agent.remembers
        together = rollout("CartPole-v1", agent, episodes=4, seed=5, batch=4, jobs=2)
        alone = [rollout("CartPole-v1", agent, episodes=1, seed=5 + one) for one in range(4)]
        assert together.returns.tolist() == [one.returns[0] for one in alone], name
        assert together.steps is not None
        first = together.steps.executed[together.steps.step < 4, 0]
        assert np.unique(first.reshape(4, 4), axis=0).shape == (1, 4)
        assert set(first[:2]) == {0, 1}


def test_a_recurrent_ppo_acts_as_it_does_under_its_own_library(folder: Path) -> None:
    import gymnasium
    from sb3_contrib import RecurrentPPO

    model = RecurrentPPO("MlpLstmPolicy", "CartPole-v1", seed=1, device="cpu")
    model.save(folder / "recurrent.zip")
    (folder / "trained.py").write_text(
        "from sb3_contrib import RecurrentPPO\n"
        "def model():\n    return RecurrentPPO.load('recurrent.zip', device='cpu')\n"
    )
    played = rollout("CartPole-v1", own_agent("trained:model", "CartPole-v1"), episodes=2, seed=9)
    env = gymnasium.make("CartPole-v1")
    for seed, length in zip(played.seeds, played.lengths, strict=True):
        observation, state, steps, over = env.reset(seed=int(seed))[0], None, 0, False
        while not over:
            action, state = model.predict(
                observation, state, np.array([steps == 0]), deterministic=True
            )
            observation, _, terminated, truncated, _ = env.step(int(action))
            steps, over = steps + 1, terminated or truncated
        assert steps == length


@pytest.fixture
def server(folder: Path) -> Iterator[None]:
    listening = socket.create_server(("127.0.0.1", 0))
    (folder / "port").write_text(str(listening.getsockname()[1]))

    def serve() -> None:
        connection, _ = listening.accept()
        with connection, connection.makefile("rw") as lines:
            for line in lines:
                states = np.array(json.loads(line))
                lines.write(json.dumps((states[:, 2] > 0).astype(int).tolist()) + "\n")
                lines.flush()

    thread = threading.Thread(target=serve, daemon=True)
    thread.start()
    yield
    listening.close()


def test_a_model_behind_a_socket_is_recorded(
    server: None, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = "record --env CartPole-v1 --agent scripted_agents:Remote --steps 60 --out r.csv --json"
    assert main(asked.split()) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["steps"], document["agent"]) == (60, "scripted_agents:Remote")


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("scripted_agents:gone", "scripted_agents has no gone"),
        ("broken_agents:any", "cannot be imported (RuntimeError: no licence)"),
        ("no_such_module:any", "cannot be imported (ModuleNotFoundError"),
        ("scripted_agents:number", "is of type int, which chooses no actions"),
        ("scripted_agents:Needs", "cannot be made (TypeError"),
        ("scripted_agents:shape", "gives actions of shape (1, 3)"),
        ("scripted_agents:words", "and no numbers"),
        ("scripted_agents:unknown", "action 2, and CartPole-v1 takes whole numbers from 0 to 1"),
        ("scripted_agents:needs", "in step 0 of the episode with seed 4, the agent"),
    ],
)
def test_what_is_no_agent_is_refused_in_one_sentence(
    name: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(f"evaluate --env CartPole-v1 --agent {name} --seed 4".split()) == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert said in error


def test_what_came_before_a_fault_is_kept(capsys: pytest.CaptureFixture[str]) -> None:
    command = "--env CartPole-v1 --agent scripted_agents:Breaks --seed 4"
    assert main(f"evaluate {command} --episodes 5 --json".split()) == 2
    out, error = capsys.readouterr()
    assert [one["seed"] for one in json.loads(out)["episodes"]] == [4, 5]
    assert "in step 4 of the episode with seed 6, the agent scripted_agents:Breaks raised" in error
    assert main(f"record {command} --steps 500 --out kept.csv".split()) == 2
    assert "steps before it are in kept.csv" in capsys.readouterr().err
    lengths = rollout("CartPole-v1", own_agent("scripted_agents:Remembers", "CartPole-v1"), seed=4)
    rows = len(Path("kept.csv").read_text().splitlines()) - 1
    assert rows == lengths.lengths[:2].sum() + 4


def test_an_expert_of_ones_own_answers(capsys: pytest.CaptureFixture[str]) -> None:
    record = "record --env CartPole-v1 --agent scripted_agents:lean --steps 300 --out start.csv"
    assert main(record.split()) == 0
    asked = (
        "aggregate start.csv --env CartPole-v1 --expert scripted_agents:lean --max-rules 4 "
        "--rounds 2 --episodes 4 --validation 16 --out compact.json --json --max-steps 60"
    )
    capsys.readouterr()
    assert main(asked.split()) == 0
    assert json.loads(capsys.readouterr().out)["reported"]["mean"] > 40


def test_only_the_caller_names_a_module(folder: Path) -> None:
    """What a file or a link says goes to `make_agent`, which imports nothing."""
    from sarl_core.rollouts.trial import make_agent

    with pytest.raises(InputError, match="there is no agent 'broken_agents:any'"):
        make_agent("broken_agents:any", "CartPole-v1")
