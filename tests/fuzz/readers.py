"""Each reader: files to begin with, how to change them, and what must hold of any file."""

from __future__ import annotations

import io
import re
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from random import Random
from typing import Any

import gymnasium as gym
import numpy as np

from sarl_core.agents.mlp_policy import MlpPolicy
from sarl_core.agents.sb3_zip import load_sb3_zip
from sarl_core.demonstrations.dataset import Demonstrations
from sarl_core.demonstrations.formats import read_demonstrations, save_demonstrations, table_columns
from sarl_core.demonstrations.warnings import find_warnings
from sarl_core.errors import InputError
from sarl_core.mining.algorithm_1 import mine_rules
from sarl_core.mining.language import sentence
from sarl_core.mining.rule_set import rules_from_json, rules_to_json
from sarl_core.shielding.shield import Shield
from tests.bad_inputs import BAD_INPUTS, ROWS, csv_bytes, good_arrays, npz_bytes, parquet_bytes
from tests.fuzz import formats
from tests.fuzz.mutations import (
    Bytes,
    of_archive,
    of_gzip,
    of_json,
    of_numbers,
    of_parquet,
    of_table,
)


@dataclass(frozen=True)
class Reader:
    """A reader to be fuzzed.

    Attributes:
        seeds: Files to begin with.
        mutate: Changes a file.
        read: Reads it, and does with it what comes next.
    """

    seeds: Callable[[], list[bytes]]
    mutate: Callable[[bytes, Random, Bytes], bytes]
    read: Callable[[bytes], None]

    def check(self, data: bytes) -> None:
        """Read a file; anything but its being good or one sentence is a fault."""
        try:
            self.read(data)
        except InputError as error:
            told = str(error)
            assert 0 < len(told) < 500, told
            assert not re.search("[\x00-\x1f\x7f-\x9f]", told), repr(told)


def use(demonstrations: Demonstrations) -> None:
    """What follows on reading: looking at it, mining, saving."""
    assert len(demonstrations) > 1
    find_warnings(demonstrations)
    demonstrations.summary()
    assert demonstrations.digest
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "again.npz"
        save_demonstrations(demonstrations, path)
        assert read_demonstrations(path.read_bytes(), path.name).digest == demonstrations.digest
    if len(demonstrations) < 2000:
        rules = mine_rules(demonstrations, supp_min=0.0, conf_min=0.5)
        text = rules_to_json(rules)
        assert rules_to_json(rules_from_json(text)) == text


def read_as(name: str) -> Callable[[bytes], None]:
    def read(data: bytes) -> None:
        table_columns(data, name)
        use(read_demonstrations(data, name))

    return read


def read_pair(data: bytes) -> None:
    first, _, second = data.partition(b"\n\n")
    use(read_demonstrations(first, "obs.csv", companion=(second, "actions.csv")))


def read_rules(data: bytes) -> None:
    rules = rules_from_json(data)
    text = rules_to_json(rules)
    assert rules_to_json(rules_from_json(text)) == text
    state = np.zeros((2, len(rules.source.features)), np.float32)
    for rule in rules.rules:
        rule.applies(state)
        assert sentence(rule, rules)
    action = [0] * len(rules.actions)
    Shield(rules).decide(state[0], action if len(action) > 1 else action[0])


def read_policy(data: bytes) -> None:
    with tempfile.NamedTemporaryFile(suffix=".npz") as file:
        Path(file.name).write_bytes(data)
        policy = MlpPolicy.load(file.name)
    with np.errstate(over="ignore", invalid="ignore"):  # of huge weights, which are numbers yet
        policy.act(np.zeros((2, policy.n_features), np.float32), None)


@cache
def environment() -> Any:
    return gym.make("CartPole-v1")


def read_model(data: bytes) -> None:
    with tempfile.NamedTemporaryFile(suffix=".zip") as file:
        Path(file.name).write_bytes(data)
        policy, _, _ = load_sb3_zip(file.name, environment(), "CartPole-v1")
    with np.errstate(over="ignore", invalid="ignore"):
        policy.act(np.zeros((2, policy.n_features), np.float32), None)


def bad(extension: str) -> list[bytes]:
    return [
        content
        for name, content, _ in BAD_INPUTS.values()
        if name.endswith(extension) and len(content) < 20_000
    ]


def rule_seeds() -> list[bytes]:
    seeds = []
    for continuous in (False, True):
        rng = np.random.default_rng(0)
        found = Demonstrations(
            rng.normal(size=(30, 2)),
            rng.normal(size=(30, 1)) if continuous else rng.integers(0, 3, 30),
            np.arange(30) // 10,
        )
        seeds.append(rules_to_json(mine_rules(found, supp_min=0.0, conf_min=0.6)).encode())
    return seeds


def policy_seeds() -> list[bytes]:
    rng = np.random.default_rng(0)
    seeds = []
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "policy.npz"
        for head in ("categorical", "gaussian"):
            discrete = head == "categorical"
            MlpPolicy(
                weights=(rng.normal(size=(3, 4)).astype(np.float32), np.ones((4, 2), np.float32)),
                biases=(np.zeros(4, np.float32), np.zeros(2, np.float32)),
                activation="tanh",
                head=head,
                label_counts=(2,) if discrete else (),
                log_std=None if discrete else np.zeros(2, np.float32),
                action_low=None if discrete else -np.ones(2, np.float32),
                action_high=None if discrete else np.ones(2, np.float32),
            ).save(path)
            seeds.append(path.read_bytes())
    return seeds


def model_seeds() -> list[bytes]:
    from stable_baselines3 import DQN, PPO

    seeds = []
    for algorithm in (PPO, DQN):
        out = io.BytesIO()
        small = {"net_arch": [4]}
        algorithm("MlpPolicy", environment(), policy_kwargs=small, device="cpu").save(out)
        seeds.append(out.getvalue())
    return seeds


READERS = {
    "csv": Reader(lambda: [csv_bytes(*ROWS), *bad(".csv")], of_table, read_as("demo.csv")),
    "parquet": Reader(
        lambda: [parquet_bytes(), *bad(".parquet")], of_parquet, read_as("demo.parquet")
    ),
    "npz": Reader(
        lambda: [npz_bytes(**good_arrays()), *bad(".npz")], of_archive, read_as("demo.npz")
    ),
    "jsonl": Reader(formats.json_lines, of_table, read_as("demo.jsonl")),
    "json": Reader(formats.json_files, of_json, read_as("demo.json")),
    "gzip": Reader(formats.gzip_files, of_gzip, read_as("demo.csv.gz")),
    "arrow": Reader(formats.arrow_files, of_numbers, read_as("demo.arrow")),
    "hdf5": Reader(formats.hdf5_files, of_numbers, read_as("demo.hdf5")),
    "xlsx": Reader(formats.excel_files, of_archive, read_as("demo.xlsx")),
    "zip": Reader(formats.archives, of_archive, read_as("demo.zip")),
    "pair": Reader(lambda: [b"0.5;1.5\n0.25;1.0\n0.1;0.2\n\n\n0\n1\n0\n"], of_table, read_pair),
    "rules": Reader(rule_seeds, of_json, read_rules),
    "policy": Reader(policy_seeds, of_archive, read_policy),
    "model": Reader(model_seeds, of_archive, read_model),
}
