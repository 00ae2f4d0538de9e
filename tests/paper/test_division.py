from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from sarl_core import rollout
from sarl_core.mining.quantisation import quantise
from sarl_core.paper import division
from sarl_core.paper.divider_table import episodes_of, quantisations_of
from sarl_core.paper.division import DIVIDING
from sarl_core.paper.replicates import demonstrations_of, replicates_of
from sarl_core.paper.study import Effort
from sarl_core.paper.tables import read_table, write_table
from sarl_core.paper.verdicts import Verdict
from tests.paper.frames import divided

WALKER, PENDULUM = "BipedalWalker-v3", "Pendulum-v1"
WHOLE = np.linspace(280, 290, 20)


def table(
    walker: Mapping[int, float],
    pendulum: Mapping[int, float] | None = None,
    *,
    typical: float | None = None,
) -> pd.DataFrame:
    """Returns around a value for each divider; 0 is the expert as it is.

    Those of the two ways to snap are the same, but with two intervals what the expert typically
    did brings the walker `typical`, where that is given.
    """
    found = {WALKER: walker} | ({PENDULUM: pendulum} if pendulum else {})
    returns: dict[str, dict[tuple[int, str], np.ndarray]] = {}
    for env_id, values in found.items():
        returns[env_id] = {(0, "clip"): WHOLE - 285 + values[0]}
        for divider, value in values.items():
            for snapping in ("centre", "expert") if divider else ():
                returns[env_id][divider, snapping] = WHOLE - 285 + value
    if typical is not None:
        returns[WALKER][2, "expert"] = WHOLE - 285 + typical
    return divided(returns)


def verdicts(frame: pd.DataFrame) -> list[Verdict]:
    return [claim.verdict for claim in DIVIDING.claims({"divider": frame})]


def test_two_intervals_that_cost_everything() -> None:
    frame = table({0: 285, 2: -35, 3: 180, 5: 250})
    assert verdicts(frame) == ["agrees", "does not agree"]
    finer, complexity = DIVIDING.claims({"divider": frame})
    assert "Bipedal Walker −35 (" in finer.ours
    assert "with 2 intervals, 180 (" in finer.ours
    assert "with 5, 285 (" in finer.ours
    assert "; 0 % fail) as it is" in finer.ours
    assert "; 100 % fail) with 2 intervals" in finer.ours
    assert "from 285 (" in complexity.ours
    assert " to −35 (" in complexity.ours


@pytest.mark.parametrize(
    ("centre", "typical", "expected"),
    [
        (-58, -58, "does not agree"),
        (-58, 70, "does not agree"),  # of 285, a quarter is 71.25 and a half 142.5
        (-58, 73, "partly"),
        (-58, 135, "partly"),
        (-58, 144, "agrees"),
        (135, -58, "partly"),
        (144, -58, "agrees"),
        (144, 135, "agrees"),
    ],
)
def test_the_better_way_to_snap_decides_whether_two_intervals_are_enough(
    centre: float, typical: float, expected: Verdict
) -> None:
    frame = table({0: 285, 2: centre, 3: 284}, typical=typical)
    complexity = DIVIDING.claims({"divider": frame})[1]
    assert complexity.verdict == expected
    expected_numbers = {"as_it_is": 285, "centre": centre, "expert": typical}
    assert {name: complexity.numbers[name] for name in expected_numbers} == pytest.approx(
        expected_numbers, abs=1
    )
    # Both are told, whichever decides.
    for value in (centre, typical):
        assert f"{value} (".replace("-", "−") in complexity.ours


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
    monkeypatch.setattr(division, "continuous", lambda: (PENDULUM,))
    effort = Effort(
        quick=True, recordings=2, phases=1, test_steps=1, episodes=1, snapped_episodes=2
    )
    told = []
    measured = DIVIDING.measure(effort, lambda done, total: told.append((done, total)))
    assert tuple(measured.columns) == DIVIDING.columns
    assert told[-1] == (36, 36)
    write_table(measured, tmp_path / "divider.csv")
    frame = read_table(DIVIDING, tmp_path / "divider.csv")
    found = episodes_of(frame, PENDULUM)
    assert set(found) == {(0, "clip")} | {
        (k, s) for k in (2, 3, 5, 9) for s in ("centre", "expert")
    }
    replicates = replicates_of(PENDULUM, 2)
    own = [rollout(PENDULUM, one.expert, episodes=2, seed=one.first_seed) for one in replicates]
    returns = [value for one in own for value in one.returns.tolist()]
    assert found[0, "clip"].returns.tolist() == returns
    assert found[0, "clip"].seeds.tolist() == [seed for one in own for seed in one.seeds.tolist()]
    (torque,) = quantisations_of(frame, PENDULUM)
    (expected,) = quantise(demonstrations_of(replicates[0]))
    for one, other in zip(torque, expected, strict=True):
        assert one.divider == other.divider
        assert one.counts.tolist() == other.counts.tolist()
        assert one.medians.tolist() == other.medians.tolist()
        assert one.errors == other.errors
        assert one.dimension.edges == other.dimension.edges
    numbers = DIVIDING.numbers(frame)[PENDULUM]
    assert numbers["returns"]["as it is"]["mean"] == pytest.approx(np.mean(returns))
    assert set(numbers["actions"]["torque"]["divider 9"]) == {
        "occupancy",
        "never_seen",
        "error_centre",
        "error_clip",
        "error_expert",
    }


@pytest.mark.parametrize("dark", [False, True])
def test_figures_show_returns_and_errors(dark: bool) -> None:
    frame = table({0: 285, 2: -35, 3: 180}, {0: -150, 2: -400, 3: -150})
    assert DIVIDING.parts(frame) == ("Bipedal Walker", "Pendulum")
    returns, errors, _ = DIVIDING.draw(frame, "Pendulum", dark)
    centre, clip, _ = np.asarray(returns.figure.data[0].z, dtype=float)
    assert centre == pytest.approx([-400, -150], abs=1)
    assert clip == pytest.approx([-150, -150], abs=1)
    assert np.asarray(errors.figure.data[0].z)[0] == pytest.approx([0.125, 0.5 / 6])


@pytest.mark.parametrize("dark", [False, True])
def test_figures_show_how_often_each_interval_was_demonstrated(dark: bool) -> None:
    frame = table({0: 285, 2: -35, 3: 180})
    # The first interval of each divider was never demonstrated.
    *_, lies = DIVIDING.draw(frame, "Bipedal Walker", dark)
    assert "torque" in lies.title
    assert "never shown" in lies.alt
    bars = {bar.y[0]: bar for bar in lies.figure.data}
    assert list(bars) == ["2 intervals", "3 intervals"]
    halves, thirds = bars.values()
    assert list(halves.marker.color) == [0, 1]
    assert list(thirds.marker.color) == [0, 0.5, 0.5]
    assert [bool(shape) for shape in thirds.marker.pattern.shape] == [True, False, False]
    assert list(thirds.base) == pytest.approx([-1, -1 / 3, 1 / 3])
    numbers = DIVIDING.numbers(frame)[WALKER]["actions"]["torque"]
    assert numbers["divider 3"]["occupancy"] == [0, 0.5, 0.5]
    assert numbers["divider 3"]["never_seen"] == [0]


def test_every_action_has_its_own_figure_of_where_it_lies() -> None:
    frame = table({0: 285, 2: -35, 3: 180})
    other = frame[frame["what"] != "return"].assign(action="knee")
    drawn = DIVIDING.draw(pd.concat([frame, other]), "Bipedal Walker", False)
    assert [one.title for one in drawn[2:]] == [
        "Share of the steps in each interval of torque, Bipedal Walker",
        "Share of the steps in each interval of knee, Bipedal Walker",
    ]
