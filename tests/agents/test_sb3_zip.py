import base64
import io
import json
import pickle
import zipfile
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from stable_baselines3 import DQN, PPO

from sarl_core.errors import InputError
from sarl_core.rollouts.trial import make_agent


class Boom:
    """Makes a file when it is unpickled."""

    def __init__(self, name: str):
        self.name = name

    def __reduce__(self) -> Any:
        return (Path.touch, (Path(self.name),))


@pytest.fixture
def model_zip(tmp_path: Path) -> Path:
    PPO("MlpPolicy", "CartPole-v1", seed=0, device="cpu").save(tmp_path / "model.zip")
    return tmp_path / "model.zip"


def rewrite(source: Path, target: Path, **entries: bytes) -> Path:
    """Copy a zip with some entries replaced; `policy_pth` stands for policy.pth."""
    replaced = {name.replace("_pth", ".pth"): value for name, value in entries.items()}
    with zipfile.ZipFile(source) as old, zipfile.ZipFile(target, "w") as new:
        for entry in old.infolist():
            new.writestr(entry.filename, replaced.get(entry.filename, old.read(entry)))
    return target


def saved(value: Any) -> bytes:
    buffer = io.BytesIO()
    torch.save(value, buffer)
    return buffer.getvalue()


def test_nothing_in_a_malicious_zip_runs(
    model_zip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with zipfile.ZipFile(model_zip) as archive:
        data = json.loads(archive.read("data"))
    pickled = base64.b64encode(pickle.dumps(Boom("from_data"))).decode()
    for key in ("policy_class", "policy_kwargs", "observation_space", "lr_schedule"):
        data[key] = {**data[key], ":serialized:": pickled}
    in_data = rewrite(
        model_zip,
        tmp_path / "in_data.zip",
        data=json.dumps(data).encode(),
        pytorch_variables_pth=pickle.dumps(Boom("from_variables")),
    )
    # Its weights are good, and its pickles stay closed: it can be used.
    observations = np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32)
    actions = make_agent(in_data, "CartPole-v1").act(observations, None)
    assert (actions == make_agent(model_zip, "CartPole-v1").act(observations, None)).all()
    for number, bad in enumerate(
        (
            saved(Boom("from_torch_zip")),
            saved({"action_net.weight": Boom("from_state")}),
            pickle.dumps(Boom("from_pickle")),
        )
    ):
        path = rewrite(model_zip, tmp_path / f"{number}.zip", policy_pth=bad)
        with pytest.raises(InputError, match="holds something else than weights"):
            make_agent(path, "CartPole-v1")
    assert not list(tmp_path.glob("from_*"))


def test_the_malicious_zip_would_run_if_it_were_unpickled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    pickle.loads(pickle.dumps(Boom("from_data")))
    torch.load(io.BytesIO(saved(Boom("from_torch_zip"))), weights_only=False)
    assert {path.name for path in tmp_path.glob("from_*")} == {"from_data", "from_torch_zip"}


def test_zip_bombs_are_refused(model_zip: Path, tmp_path: Path) -> None:
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("policy.pth", b"\0" * (257 * 2**20))
        archive.writestr("data", b"{}")
    inner = io.BytesIO()
    with zipfile.ZipFile(inner, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("archive/data.pkl", b"\0" * (257 * 2**20))
    nested = rewrite(model_zip, tmp_path / "nested.zip", policy_pth=inner.getvalue())
    for path in (bomb, nested):
        with pytest.raises(InputError, match="unpacks to 257 MB") as caught:
            make_agent(path, "CartPole-v1")
        assert str(caught.value).count(str(path)) == 1
    swollen = {"action_net.weight": torch.zeros(1).expand(100_000, 100_000)}
    claimed = rewrite(model_zip, tmp_path / "claimed.zip", policy_pth=saved(swollen))
    with pytest.raises(InputError, match="claim more memory"):
        make_agent(claimed, "CartPole-v1")


@pytest.mark.parametrize(
    ("entries", "sentence"),
    [
        ({"data": b"not json"}, "'data' is no JSON"),
        ({"data": b"[" * 100_000}, "'data' is no JSON"),
        (
            {"data": b'{"policy_kwargs": {"activation_fn": "<class \'torch.nn.PReLU\'>"}}'},
            "uses the activation 'torch.nn.PReLU'",
        ),
        ({"policy_pth": saved([1, 2])}, "holds no weights by name"),
        ({"policy_pth": saved({"x": torch.zeros(2)})}, "not those of an MlpPolicy"),
        (
            {
                "policy_pth": saved(
                    {
                        "features_extractor.cnn.0.weight": torch.zeros(2),
                        "action_net.weight": torch.zeros(2, 2),
                    }
                )
            },
            "features_extractor.cnn",
        ),
        ({"policy_pth": saved({"action_net.weight": torch.zeros(2, 2)})}, "lack 'action_net.bias'"),
    ],
)
def test_other_zips_are_one_sentence(
    model_zip: Path, tmp_path: Path, entries: dict[str, bytes], sentence: str
) -> None:
    path = rewrite(model_zip, tmp_path / "other.zip", **entries)
    with pytest.raises(InputError, match=sentence) as caught:
        make_agent(path, "CartPole-v1")
    assert "other.zip" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (b"Q", b"0"),  # a tensor without its storage
        (b"}q", b"Kq"),  # no dictionary where one should be
    ],
)
def test_damage_inside_the_weights_is_one_sentence(
    old: bytes, new: bytes, model_zip: Path, tmp_path: Path
) -> None:
    with zipfile.ZipFile(model_zip) as archive:
        weights = io.BytesIO(archive.read("policy.pth"))
    inner, target = zipfile.ZipFile(weights), io.BytesIO()
    with zipfile.ZipFile(target, "w", zipfile.ZIP_STORED) as damaged:
        for entry in inner.infolist():
            content = inner.read(entry)
            if entry.filename.endswith("data.pkl"):
                content = content.replace(old, new)
            damaged.writestr(entry.filename, content)
    path = rewrite(model_zip, tmp_path / "damaged.zip", policy_pth=target.getvalue())
    with pytest.raises(InputError, match="holds something else than weights"):
        make_agent(path, "CartPole-v1")


def test_what_is_no_model_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "text.zip"
    text.write_text("hello")
    empty = tmp_path / "empty.zip"
    with zipfile.ZipFile(empty, "w"):
        pass
    for path, sentence in ((text, "cannot be read as a zip"), (empty, "lacks policy.pth")):
        with pytest.raises(InputError, match=sentence):
            make_agent(path, "CartPole-v1")


def test_a_model_of_another_environment_is_refused(model_zip: Path) -> None:
    with pytest.raises(InputError, match="takes 4 features and Acrobot-v1 gives 6"):
        make_agent(model_zip, "Acrobot-v1")
    with pytest.raises(
        InputError, match="a policy for discrete actions and the environment takes continuous ones"
    ):
        make_agent(model_zip, "Pendulum-v1")
    with pytest.raises(InputError, match="2 outputs where the environment's actions need 5"):
        make_agent(model_zip, "toy/MultiDiscrete-v0")


def test_the_values_of_a_dqn_are_no_distribution(tmp_path: Path) -> None:
    DQN("MlpPolicy", "CartPole-v1", buffer_size=10, device="cpu").save(tmp_path / "dqn.zip")
    assert make_agent(tmp_path / "dqn.zip", "CartPole-v1", stochastic=True).n_uniforms == 0


def test_the_environment_is_closed(model_zip: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[Any] = []
    original = gymnasium.make

    def spy(*args: Any, **kwargs: Any) -> Any:
        env = original(*args, **kwargs)
        closed = env.close
        made.append(False)
        number = len(made) - 1

        def close() -> None:
            made[number] = True
            closed()

        env.close = close  # type: ignore[method-assign]
        return env

    monkeypatch.setattr(gymnasium, "make", spy)
    make_agent(model_zip, "CartPole-v1")
    assert made
    assert all(made)
