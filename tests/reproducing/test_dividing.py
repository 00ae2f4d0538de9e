from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sarl_core import rollout
from sarl_core.mining.quantisation import quantise
from sarl_core.reproducing import dividing
from sarl_core.reproducing.dividing import DIVIDING, episodes_of, quantisations_of
from sarl_core.reproducing.shipped import demonstrations_of
from sarl_core.reproducing.study import FIRST_SEED, Effort, Verdict
from sarl_core.reproducing.tables import read_table, write_table
from tests.reproducing.frames import divided

WALKER, PENDULUM = "BipedalWalker-v3", "Pendulum-v1"
WHOLE = np.linspace(280, 290, 20)


def table(walker: Mapping[int, float], pendulum: Mapping[int, float] | None = None) -> pd.DataFrame:
    """Returns around a value for each divider, snapped to the centre; 0 is the expert as it is."""
    found = {WALKER: walker} | ({PENDULUM: pendulum} if pendulum else {})
    return divided(
        {
            env_id: {
                (divider, "centre" if divider else "clip"): WHOLE - 285 + value
                for divider, value in values.items()
            }
            for env_id, values in found.items()
        }
    )


def verdicts(frame: pd.DataFrame) -> list[Verdict]:
    return [claim.verdict for claim in DIVIDING.claims({"divider": frame})]


def test_two_intervals_that_cost_everything() -> None:
    frame = table({0: 285, 2: -35, 3: 180, 5: 250})
    assert verdicts(frame) == ["agrees", "does not agree"]
    finer, complexity = DIVIDING.claims({"divider": frame})
    assert "Bipedal Walker −35 (" in finer.ours
    assert "with 2 intervals, 250 (" in finer.ours
    assert "with 5, 285 as it is" in finer.ours
    assert "from 285 (" in complexity.ours
    assert " to −35 (" in complexity.ours
    assert "nobody walks" in complexity.ours


@pytest.mark.parametrize(
    ("walker", "pendulum", "expected"),
    [
        ({0: 285, 2: 284, 3: 284}, None, ["does not agree", "agrees"]),
        ({0: 285, 2: 100, 3: 284}, None, ["agrees", "partly"]),
        ({0: 285, 2: -30, 3: 284}, {0: -150, 2: -400, 3: -150}, ["agrees", "does not agree"]),
        ({0: 285, 2: -30, 3: 284}, {0: -150, 2: -150, 3: -150}, ["partly", "does not agree"]),
        ({0: -20, 2: -30, 3: -30}, None, ["does not agree", "does not agree"]),
    ],
)
def test_other_dividers(
    walker: dict[int, float], pendulum: dict[int, float] | None, expected: list[Verdict]
) -> None:
    assert verdicts(table(walker, pendulum)) == expected


def test_without_the_walker_one_claim_is_left() -> None:
    frame = table({0: 1, 2: 1, 3: 9}).assign(environment=PENDULUM)
    assert len(verdicts(frame)) == 1


def test_the_table_holds_what_the_expert_brings(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dividing, "continuous", lambda: (PENDULUM,))
    effort = Effort(quick=True, learners=1, phases=1, test_steps=1, episodes=1, snapped_episodes=2)
    told = []
    measured = DIVIDING.measure(effort, lambda done, total: told.append((done, total)))
    assert tuple(measured.columns) == DIVIDING.columns
    assert told[-1] == (18, 18)
    write_table(measured, tmp_path / "divider.csv")
    frame = read_table(DIVIDING, tmp_path / "divider.csv")
    found = episodes_of(frame, PENDULUM)
    assert set(found) == {(0, "clip")} | {
        (k, s) for k in (2, 3, 5, 9) for s in ("centre", "expert")
    }
    own = rollout(PENDULUM, "expert", episodes=2, seed=FIRST_SEED)
    assert found[0, "clip"].returns.tolist() == own.returns.tolist()
    assert found[0, "clip"].seeds.tolist() == own.seeds.tolist()
    (torque,) = quantisations_of(frame, PENDULUM)
    (expected,) = quantise(demonstrations_of(PENDULUM))
    for one, other in zip(torque, expected, strict=True):
        assert one.divider == other.divider
        assert one.counts.tolist() == other.counts.tolist()
        assert one.medians.tolist() == other.medians.tolist()
        assert one.errors == other.errors
        assert one.dimension.edges == other.dimension.edges
    numbers = DIVIDING.numbers(frame)[PENDULUM]
    assert numbers["returns"]["as it is"]["mean"] == pytest.approx(own.returns.mean())
    assert set(numbers["actions"]["torque"]["divider 9"]) == {
        "never_seen",
        "error_centre",
        "error_clip",
        "error_expert",
    }


@pytest.mark.parametrize("dark", [False, True])
def test_figures_show_returns_and_errors(dark: bool) -> None:
    frame = table({0: 285, 2: -35, 3: 180}, {0: -150, 2: -400, 3: -150})
    assert DIVIDING.parts(frame) == ("Bipedal Walker", "Pendulum")
    returns, errors = DIVIDING.draw(frame, "Pendulum", dark)
    centre, clip, _ = np.asarray(returns.figure.data[0].z, dtype=float)
    assert centre == pytest.approx([-400, -150], abs=1)
    assert clip == pytest.approx([-150, -150], abs=1)
    assert np.asarray(errors.figure.data[0].z)[0] == pytest.approx([0.125, 0.5 / 6])
