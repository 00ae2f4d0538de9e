"""Statistics of observations are read out of a pickle, of which nothing runs."""

import builtins
import copyreg
import io
import os
import pickle
import struct
import tracemalloc
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import DummyVecEnv, VecNormalize

from sarl_core.agents.plain_pickle import read_pickle
from sarl_core.agents.sb3_statistics import KNOWN, load_statistics
from sarl_core.errors import InputError

CART = "CartPole-v1"


class Calls:
    """Is unpickled by a call."""

    def __init__(self, function: Any, *arguments: Any):
        self.function, self.arguments = function, arguments

    def __reduce__(self) -> Any:
        return self.function, self.arguments


# What makes an array as large as it is told.
TERABYTE = Calls(np.zeros(1).__reduce__()[0], np.ndarray, (10**12,), b"b")


def normalising() -> VecNormalize:
    env = VecNormalize(DummyVecEnv([lambda: gymnasium.make(CART)]), clip_obs=3.5, epsilon=0.25)
    env.reset()
    env.action_space.sample()  # so that its generator is kept
    for _ in range(20):
        env.step([1])
    return env


def written(path: Path, data: bytes) -> Path:
    path.write_bytes(data)
    return path


@pytest.mark.parametrize("protocol", [2, 3, 4, 5])
def test_what_vec_normalize_saved_is_read(protocol: int, tmp_path: Path) -> None:
    env = normalising()
    found = load_statistics(written(tmp_path / "s.pkl", pickle.dumps(env, protocol=protocol)))
    assert found is not None
    assert isinstance(env.obs_rms, RunningMeanStd)
    assert (found.mean == env.obs_rms.mean).all()
    assert (found.variance == env.obs_rms.var).all()
    assert (found.clip, found.epsilon) == (3.5, 0.25)


def test_numbers_of_numpy_and_arrays_by_columns_are_read(tmp_path: Path) -> None:
    env = normalising()
    assert isinstance(env.obs_rms, RunningMeanStd)
    env.clip_obs, env.epsilon = np.float32(2.5), np.float64(0.5)
    env.obs_rms.mean = np.arange(4, dtype=">f4")
    env.obs_rms.var = np.asfortranarray(np.arange(1.0, 5.0).reshape(2, 2))
    found = load_statistics(written(tmp_path / "s.pkl", pickle.dumps(env)))
    assert found is not None
    assert found.mean.tolist() == [0, 1, 2, 3]
    assert found.variance.tolist() == [1, 2, 3, 4]
    assert (found.clip, found.epsilon) == (2.5, 0.5)


def test_observations_that_were_not_normalised_have_no_statistics(tmp_path: Path) -> None:
    env = normalising()
    env.norm_obs = False
    assert load_statistics(written(tmp_path / "s.pkl", pickle.dumps(env))) is None


def payloads() -> dict[str, tuple[Any, str]]:
    """What a file could bring, each with the name that the refusal says."""
    touch = "__import__('pathlib').Path('ran').touch()"
    inside = normalising()
    inside.epsilon = Calls(os.system, "touch ran")  # type: ignore[assignment]
    statistics = normalising()
    assert isinstance(statistics.obs_rms, RunningMeanStd)
    statistics.obs_rms.mean = Calls(builtins.exec, touch)  # type: ignore[assignment]
    return {
        "os.system": (Calls(os.system, "touch ran"), "posix.system"),
        "eval": (
            Calls(builtins.eval, touch),
            "builtins.eval",
        ),
        "exec": (Calls(builtins.exec, touch), "builtins.exec"),
        "getattr": (Calls(getattr, Path("ran"), "touch"), "builtins.getattr"),
        "a field": (inside, "posix.system"),
        "a field of a field": (statistics, "builtins.exec"),
        "numpy's own loader": (Calls(np.load, "ran"), "numpy.load"),
        "another class": (Path("ran"), "pathlib"),
    }


@pytest.mark.parametrize("name", payloads())
def test_a_payload_does_not_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    payload, said = payloads()[name]
    for protocol in (2, 5):
        data = pickle.dumps(payload, protocol=protocol)
        with pytest.raises(InputError, match=f"names '.*{said.split('.')[-1]}.*'") as caught:
            load_statistics(written(tmp_path / "s.pkl", data))
        assert "\n" not in str(caught.value)
        assert not (tmp_path / "ran").exists()


def test_the_payloads_would_run_if_they_were_unpickled(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("os.system", "eval", "exec", "a field"):
        pickle.loads(pickle.dumps(payloads()[name][0]))
        (tmp_path / "ran").unlink()


class Persistent(pickle.Pickler):
    def persistent_id(self, obj: Any) -> Any:
        return "an id" if isinstance(obj, bytes) else None


def persistent() -> bytes:
    buffer = io.BytesIO()
    Persistent(buffer).dump(b"x")
    return buffer.getvalue()


def extension() -> bytes:
    copyreg.add_extension("posix", "system", 250)
    try:
        return pickle.dumps(os.system, protocol=2)
    finally:
        copyreg.remove_extension("posix", "system", 250)


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (extension(), "the instruction EXT1"),
        (persistent(), "the instruction BINPERSID"),
        (b"Pan id\n.", "the instruction PERSID"),
        (b"(cos\nsystem\nX\x02\x00\x00\x00lsoR.", "'os.system'"),
        (b"(S'ls'\nios\nsystem\n.", "the instruction INST"),
        (b"\x80\x02ccopyreg\n_reconstructor\n.", "'copyreg._reconstructor'"),
        # the state of a class, and not of one of its objects, would change the class
        (b"\x80\x02cnumpy\ndtype\n}X\x01\x00\x00\x00aK\x01sb.", "no whole pickle"),
        (b"\x80\x04\x8c\x05numpy\x8c\x09dtype.sum\x93.", "'numpy.dtype.sum'"),
        (b"\x80\x04K\x01\x85R.", "no whole pickle"),
        (b"\x80\x04.", "no whole pickle"),
        (b"\x80\x04h\x07.", "no whole pickle"),
        (b"", "no whole pickle"),
        (b"hello", "no whole pickle"),
        (b"\x80\x04N.", "no statistics"),
        (pickle.dumps({"mean": 0}), "no statistics"),
        (pickle.dumps(RunningMeanStd(shape=(3,))), "no statistics"),
    ],
)
def test_other_pickles_are_one_sentence(data: bytes, said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said) as caught:
        load_statistics(written(tmp_path / "s.pkl", data))
    assert len(str(caught.value)) < 400


def nested(depth: int) -> bytes:
    """Tuples of one tuple twice, in one another, as the key of a dictionary."""
    twice = b"h\x00h\x00\x86q\x00"
    return b"\x80\x04})q\x00" + twice * depth + b"h\x00K\x01s."


@pytest.mark.parametrize(
    "data",
    [
        nested(60),
        b"\x80\x04N" + b"r" + struct.pack("<I", 2**32 - 1) + b".",  # a memory of 32 GB
        b"\x80\x05\x96" + struct.pack("<Q", 2**40) + b"x.",  # bytes that are not there
        b"\x80\x04\x8d" + struct.pack("<Q", 2**62) + b"x.",
        b"\x80\x04]" + b"h\x00" * 10,
        b"\x80\x04" + b"(" * 99_000 + b".",
        b"\x80\x04" + b"]" * 200_000 + b".",
        b"L" + b"9" * 1_000_000 + b"L\n.",
        b"\0" * (17 * 2**20),
    ],
)
def test_bombs_take_neither_time_nor_memory(data: bytes, tmp_path: Path) -> None:
    path = written(tmp_path / "s.pkl", data)
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            load_statistics(path)
        assert tracemalloc.get_traced_memory()[1] < 2 * 16 * 2**20 + 2**20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda env: delattr(env, "obs_rms"), "lacks the statistics 'obs_rms'"),
        (lambda env: setattr(env, "obs_rms", {"a": env.obs_rms}), "in several parts"),
        (lambda env: delattr(env.obs_rms, "var"), "lacks one of its arrays"),
        (lambda env: setattr(env.obs_rms, "var", np.ones(3)), "one number a feature"),
        (lambda env: setattr(env.obs_rms, "var", -np.ones(4)), "one number a feature"),
        (lambda env: setattr(env.obs_rms, "mean", np.full(4, np.nan)), "one number a feature"),
        (lambda env: setattr(env.obs_rms, "mean", np.array([None] * 4)), "array"),
        (lambda env: setattr(env.obs_rms, "mean", np.array(["a"] * 4)), "array"),
        (lambda env: setattr(env.obs_rms, "mean", TERABYTE), "array"),
        (lambda env: setattr(env, "clip_obs", -1.0), "one number a feature"),
        (lambda env: setattr(env, "clip_obs", "ten"), "lacks a number"),
        (lambda env: setattr(env, "epsilon", 10**400), "damaged"),
    ],
)
def test_damaged_statistics_are_one_sentence(change: Any, said: str, tmp_path: Path) -> None:
    env = normalising()
    change(env)
    with pytest.raises(InputError, match=said):
        load_statistics(written(tmp_path / "s.pkl", pickle.dumps(env)))


def test_a_file_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "missing.pkl"):
        with pytest.raises(InputError, match="cannot be read"):
            load_statistics(path)


GOOD = pickle.dumps(normalising())


@given(
    st.lists(st.tuples(st.integers(0, len(GOOD) - 1), st.integers(0, 255)), min_size=1, max_size=8),
    st.integers(1, len(GOOD)),
)
def test_damage_is_an_error_of_input_and_nothing_else(
    changes: list[tuple[int, int]], length: int
) -> None:
    data = bytearray(GOOD)
    for place, value in changes:
        data[place] = value
    said = []
    for one in (bytes(data), bytes(data[:length])):
        try:
            read_pickle(one, KNOWN)
        except InputError as error:
            said.append(str(error))
    assert all(len(sentence) < 400 for sentence in said)
