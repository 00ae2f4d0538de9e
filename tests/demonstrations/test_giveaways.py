from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from sarl_core.demonstrations.dataset import Demonstrations, with_formulas
from sarl_core.demonstrations.formats import load_demonstrations, read_demonstrations
from sarl_core.demonstrations.warnings import find_warnings
from tests.bad_inputs import csv_bytes, npz_bytes, parquet_bytes

ROOT = Path(__file__).resolve().parents[2]
N = 400
RNG = np.random.default_rng(4)
SPEED, GAP = RNG.uniform(0, 30, N), RNG.uniform(0, 90, N)
LABELS = RNG.integers(0, 3, N)
AMOUNTS = RNG.uniform(-1, 1, N)
EPISODES = np.arange(N) // 40


def warnings_of(actions: Any, **features: Any) -> list[str]:
    demonstrations = Demonstrations(
        np.stack(list(features.values()), axis=1),
        np.asarray(actions),
        EPISODES,
        feature_names=tuple(features),
    )
    return [found for found in find_warnings(demonstrations) if "never occurs" not in found]


def but_for_a_few(values: Any, wrong: int = 3) -> Any:
    changed = np.array(values)
    changed[:: N // wrong] = changed[1]
    return changed


@pytest.mark.parametrize(
    ("what", "actions", "feature"),
    [
        ("a copy", LABELS, LABELS),
        ("other numbers for the same labels", LABELS, np.array([7.0, -1.0, 3.0])[LABELS]),
        ("a copy but for a few", LABELS, but_for_a_few(LABELS)),
        ("a lamp", LABELS % 2, LABELS % 2 * 24.0),
        ("a noisy lamp", LABELS % 2, LABELS % 2 * 24.0 + RNG.normal(0, 0.2, N)),
        ("a lamp of a pedal", (LABELS % 2)[:, None] * 0.8, LABELS % 2),
        ("a copied amount", AMOUNTS[:, None], AMOUNTS),
        ("an amount in other units", AMOUNTS[:, None], -180 * AMOUNTS + 3),
        ("a curve of an amount", AMOUNTS[:, None], AMOUNTS**3),
        ("a copy of a percentage", np.round(50 * AMOUNTS + 50).astype(int), 2 * AMOUNTS),
    ],
)
def test_a_feature_that_gives_the_action_is_named(what: str, actions: Any, feature: Any) -> None:
    found = warnings_of(actions, speed=SPEED, witness=feature, gap=GAP)
    assert len(found) == 1, what
    assert "feature 'witness' alone gives action 'action' in " in found[0]


def test_in_which_dimension_is_told() -> None:
    both = np.stack([LABELS, LABELS[::-1]], axis=1)
    (found,) = warnings_of(both, speed=SPEED, witness=LABELS[::-1])
    assert "gives action 'action 1' in every step" in found


@pytest.mark.parametrize(
    ("actions", "features"),
    [
        (SPEED > 12, {"speed": SPEED, "gap": GAP}),  # an expert who looks at one feature
        (np.digitize(SPEED, [5, 12, 20]), {"speed": SPEED}),
        (LABELS, {"speed": SPEED, "contact": LABELS > 0}),  # tells one label of three
        (np.where(RNG.random(N) < 0.9, LABELS % 2, 0), {"contact": LABELS % 2, "gap": GAP}),
        (RNG.random(N) < 0.01, {"lamp": RNG.random(N) < 0.5, "gap": GAP}),  # a rare action
        (np.clip(AMOUNTS + RNG.normal(0, 0.1, N), -1, 1)[:, None], {"wanted": AMOUNTS}),
    ],
)
def test_an_expert_who_decides_by_little_is_not_suspected(
    actions: Any, features: dict[str, Any]
) -> None:
    given = np.asarray(actions)
    assert warnings_of(given.astype(int) if given.dtype.kind == "b" else given, **features) == []


@pytest.mark.parametrize("path", sorted((ROOT / "data" / "demonstrations").glob("*.parquet")))
def test_shipped_demonstrations_are_not_suspected(path: Path) -> None:
    assert find_warnings(load_demonstrations(path)) == ()


@pytest.mark.parametrize(
    "clock", [np.arange(N), np.arange(N) % 40, np.arange(N) * 0.02 + 5, 1000 + np.arange(N) * 0.25]
)
def test_counters_and_clocks_are_named(clock: Any) -> None:
    (found,) = warnings_of(LABELS, speed=SPEED, clock=clock)
    assert "feature 'clock' rises by the same amount at every step" in found


@pytest.mark.parametrize("clock", [N - np.arange(N), 40 - np.arange(N) % 40, -0.5 * np.arange(N)])
def test_what_counts_down_is_named(clock: Any) -> None:
    (found,) = warnings_of(LABELS, speed=SPEED, clock=clock)
    assert "feature 'clock' falls by the same amount at every step" in found


CYCLES = np.concatenate([np.arange(length) for length in (50, 20, 100, 30, 150, 50)])


@pytest.mark.parametrize("clock", [np.arange(N) % 20, CYCLES, 9 + CYCLES, 200 - CYCLES])
def test_a_counter_that_restarts_where_no_episode_is_told_is_named(clock: Any) -> None:
    demonstrations = Demonstrations(np.stack([clock, SPEED], axis=1), LABELS, EPISODES * 0)
    (found,) = [told for told in find_warnings(demonstrations) if "feature 0" in told]
    assert f"counts by one and keeps beginning again at {clock[0]}" in found


@pytest.mark.parametrize(
    "place",
    [
        np.arange(N) % 2,  # a foot that steps
        np.abs(np.arange(N) % 40 - 20),  # there and back
        np.cumsum(RNG.integers(0, 2, N) * 2 - 1),
        np.minimum(np.arange(N) % 40, 30),
        np.arange(N) % 20 * 0.3,
    ],
)
def test_a_position_is_no_counter(place: Any) -> None:
    demonstrations = Demonstrations(np.stack([place, SPEED], axis=1), LABELS, EPISODES * 0)
    assert not any("counts by one" in told for told in find_warnings(demonstrations))


def test_the_next_state_is_named_and_the_one_before_is_not() -> None:
    (found,) = warnings_of(LABELS, speed=SPEED, outcome=np.append(SPEED[1:], 0.0))
    assert "feature 'outcome' holds in each step what feature 'speed' holds in the next" in found
    assert warnings_of(LABELS, speed=SPEED, previous=np.append(0.0, SPEED[:-1])) == []


def test_few_steps_tell_nothing() -> None:
    assert (
        find_warnings(Demonstrations(np.arange(8.0)[:, None], np.arange(8) % 2, np.zeros(8, int)))
        == ()
    )


UNIX = 1.7e9 + np.round(np.cumsum(RNG.uniform(0, 1, N)), 3)


@pytest.mark.parametrize("kind", ["csv", "parquet", "npz", "python", "pair"])
def test_values_that_float32_cannot_tell_apart_are_told(kind: str, tmp_path: Path) -> None:
    rows = [
        f"{u!r},{s!r},{a}" for u, s, a in zip(UNIX.tolist(), SPEED.tolist(), LABELS, strict=True)
    ]
    if kind == "csv":
        found = read_demonstrations(csv_bytes(*rows, header="obs_unix,obs_speed,action"), "d.csv")
    elif kind == "parquet":
        columns = {"obs_unix": UNIX, "obs_speed": SPEED, "action": LABELS}
        found = read_demonstrations(parquet_bytes(columns), "d.parquet")
    elif kind == "npz":
        states = np.stack([UNIX, SPEED], axis=1)
        found = read_demonstrations(npz_bytes(obs=states, acts=LABELS), "d.npz")
    elif kind == "python":
        found = Demonstrations(np.stack([UNIX, SPEED], axis=1), LABELS, EPISODES)
    else:
        (tmp_path / "obs.csv").write_bytes(
            csv_bytes(*[row.rsplit(",", 1)[0] for row in rows], header="obs_unix,obs_speed")
        )
        (tmp_path / "actions.csv").write_bytes(csv_bytes(*map(str, LABELS), header=None))
        found = load_demonstrations(tmp_path)
    told = [note for note in found.notes if "subtract an offset" in note]
    assert len(told) == 1
    assert "400 different values and rules can tell only 3 of them apart" in told[0]
    assert any("subtract an offset" in warning for warning in find_warnings(found))


def test_numbers_that_float32_keeps_are_not_told() -> None:
    columns = {"obs_year": 2000 + LABELS, "obs_id": 2**23 + np.arange(N), "action": LABELS}
    found = read_demonstrations(parquet_bytes(columns), "d.parquet")
    assert not any("offset" in note for note in found.notes)
    shifted = Demonstrations((UNIX - UNIX.min())[:, None], LABELS, EPISODES)
    assert not any("offset" in note for note in shifted.notes)


def test_a_value_that_is_not_whole_among_labels_is_told() -> None:
    values = (LABELS % 2).astype(float)
    values[30] = 0.5
    content = csv_bytes(
        *[f"{s},{a}" for s, a in zip(SPEED, values, strict=True)], header="obs_x,action"
    )
    found = read_demonstrations(content, "d.csv")
    assert not found.is_discrete
    (told,) = [note for note in found.notes if "amount" in note]
    assert "column 'action' was taken as an amount (continuous)" in told
    assert "1 of its 400 values is not whole, the first 0.5 in row 31" in told


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (LABELS.astype(float) - 1, "whole numbers with a decimal point and was taken as an amount"),
        (np.round(50 * AMOUNTS + 50).astype(int), "taken as so many labels; if it is an amount"),
        (np.round(50 * AMOUNTS + 50), "whole numbers with a decimal point and was taken as an"),
    ],
)
def test_what_whole_numbers_were_taken_for_is_told(values: Any, words: str) -> None:
    content = csv_bytes(
        *[f"{s},{a}" for s, a in zip(SPEED, values, strict=True)], header="obs_x,action"
    )
    assert any(words in note for note in read_demonstrations(content, "d.csv").notes)


def test_amounts_of_which_many_are_whole_are_amounts() -> None:
    clipped = np.clip(2 * AMOUNTS, -1, 1)
    content = csv_bytes(
        *[f"{s},{a}" for s, a in zip(SPEED, clipped, strict=True)], header="obs_x,action"
    )
    assert not any("amount" in note for note in read_demonstrations(content, "d.csv").notes)


def test_labels_with_large_codes_are_labels_by_those_names() -> None:
    codes = np.array([100, 205, 90000])[LABELS]
    content = csv_bytes(
        *[f"{s},{a}" for s, a in zip(SPEED, codes, strict=True)], header="obs_x,action"
    )
    assert read_demonstrations(content, "d.csv").label_names == (("100", "205", "90000"),)


def test_nothing_is_said_of_what_is_derived() -> None:
    plain = Demonstrations(
        np.stack([LABELS + RNG.uniform(-0.4, 0.4, N), SPEED], axis=1),
        LABELS,
        EPISODES,
        feature_names=("lever", "speed"),
    )
    far = with_formulas(plain, ["copy = lever * 2", "far = 1 / max(speed - 15, 0)"])
    before = [one for one in find_warnings(plain) if "lever" in one]
    assert before
    assert [one for one in find_warnings(far) if "alone gives" in one] == before
