from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from sarl_core import grow_policy_trees, mine_rules
from sarl_core.paper import landscape_table
from sarl_core.paper.landscape_table import landscapes_of
from sarl_core.paper.landscapes import COUNT, LENGTH
from sarl_core.paper.replicates import demonstrations_of, replicates_of
from sarl_core.paper.study import QUICK
from sarl_core.paper.verdicts import Verdict
from tests.paper.frames import landscapes

# Rows are supports 0, 0.1 and 0.2; columns are confidences 0, 0.5, 0.75 and 1.
AS_THE_PAPER = np.array([[1, 2, 40, 90], [1, 2, 3, 1], [1, 2, 2, 0]])
SMALL = AS_THE_PAPER // 2 + 1


def verdicts(frame: pd.DataFrame, name: str = "2") -> list[Verdict]:
    study = {"2": COUNT, "3": LENGTH}[name]
    return [claim.verdict for claim in study.claims({name: frame})]


def test_the_table_is_what_mining_at_each_cell_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(landscape_table, "environments", lambda: ("CartPole-v1", "Pendulum-v1"))
    told = []
    frame = COUNT.measure(QUICK, lambda done, total: told.append((done, total)))
    assert told == [(done, 4) for done in range(5)]
    assert len(frame) == 231 * 4
    assert tuple(frame.columns) == COUNT.columns
    for replicate in replicates_of("CartPole-v1", 2):
        rows = frame[
            (frame["environment"] == "CartPole-v1") & (frame["recording"] == replicate.recording)
        ]
        assert rows["expert"].unique().tolist() == [replicate.name]
        for row in rows.iloc[[0, 20, 34, 52, 230]].itertuples():
            rules = mine_rules(
                demonstrations_of(replicate), supp_min=row.support, conf_min=row.confidence
            )
            assert row.rule_count == rules.rule_count
            assert row.mean_length == pytest.approx(rules.mean_length)
            assert row.coverage == pytest.approx(rules.coverage)
    pendulum = frame[(frame["environment"] == "Pendulum-v1") & (frame["recording"] == 0)]
    assert pendulum["divider"].unique().tolist() == [2]
    trees = grow_policy_trees(demonstrations_of(replicates_of("Pendulum-v1", 1)[0]))
    corner = mine_rules(trees, supp_min=0, conf_min=1)
    assert pendulum["rule_count"].iloc[20] == corner.rule_count


def test_a_landscape_comes_back_out_of_the_table() -> None:
    frame = landscapes({"CartPole-v1": AS_THE_PAPER, "LunarLander-v3": SMALL})
    found = landscapes_of(frame)["LunarLander-v3"][5]
    assert (found.rule_count == SMALL).all()
    assert found.supports.tolist() == [0, 0.1, 0.2]
    assert np.isnan(found.fidelity).all()
    assert COUNT.parts(frame) == ("Cart Pole", "Lunar Lander")


def test_what_the_paper_shows_agrees_with_the_paper() -> None:
    frame = landscapes({"CartPole-v1": AS_THE_PAPER, "LunarLander-v3": SMALL})
    assert verdicts(frame) == ["agrees", "agrees", "partly", "agrees"]
    claims = COUNT.claims({"2": frame})
    assert "90 rules" in claims[0].ours
    assert "It holds in 12 of 12 recordings, with 6 of 6 experts" in claims[0].ours
    assert "from 90 to 1" in claims[1].ours
    assert "from 90 to 40 rules, between confidence 1 and 0.75" in claims[1].ours
    # Fewer at supports 0.1 and 0.2, more at support 0.
    assert "at 2 of 3 minimum supports, and more at 1. At support 0 it gives more" in claims[2].ours
    assert "from 90 at support 0 to 1 rule at 0.1" in claims[3].ours


@pytest.mark.parametrize(
    ("cell", "value", "number", "expected"),
    [
        ((1, 2), 91, 0, "partly"),  # more rules elsewhere, in one environment of two
        ((0, 2), 1, 1, "partly"),  # the number rises when less confidence is asked
        ((2, 0), 5, 3, "partly"),  # and when more support is asked
    ],
)
def test_one_cell_decides(
    cell: tuple[int, int], value: int, number: int, expected: Verdict
) -> None:
    changed = AS_THE_PAPER.copy()
    changed[cell] = value
    frame = landscapes({"CartPole-v1": changed, "LunarLander-v3": SMALL})
    assert verdicts(frame)[number] == expected
    assert verdicts(landscapes({"CartPole-v1": changed}))[number] == "does not agree"


def test_more_confidence_with_fewer_rules_everywhere_would_agree() -> None:
    fewer = np.array([[9, 9, 5, 4], [9, 9, 3, 1], [9, 9, 2, 0]])
    assert verdicts(landscapes({"CartPole-v1": fewer}))[2] == "agrees"
    assert "At support 0" not in COUNT.claims({"2": landscapes({"CartPole-v1": fewer})})[2].ours
    more = np.array([[1, 2, 5, 9], [1, 2, 3, 4], [1, 2, 2, 3]])
    assert verdicts(landscapes({"CartPole-v1": more}))[2] == "does not agree"


LENGTHS = np.array([[0, 1, 8, 9.0], [0, 3, 3, 1], [0, 2, 1, 0]])


def test_lengths_as_the_paper_has_them() -> None:
    frame = landscapes({"CartPole-v1": LENGTHS * 10}, {"CartPole-v1": LENGTHS})
    assert verdicts(frame, "3") == ["agrees", "agrees", "agrees"]
    ours = [claim.ours for claim in LENGTH.claims({"3": frame})]
    assert "9.0 conditions there" in ours[0]
    # At support 0.1, confidences 0.5 and 0.75 tie.
    assert "from 0.62 at support 0.1 to 0.50 at 0.2" in ours[1]
    assert "correlation of 1.00 on Cart Pole" in ours[2]


def test_lengths_that_disagree() -> None:
    lengths = LENGTHS.copy()
    lengths[0, 2] = 10  # within a tenth of the greatest
    assert verdicts(landscapes({"CartPole-v1": lengths}), "3")[0] == "partly"
    lengths[0, 2] = 10.1
    assert verdicts(landscapes({"CartPole-v1": lengths}), "3")[0] == "does not agree"
    lengths[1, 3] = 7  # at support 0.1 the longest rules stay at confidence 1
    assert verdicts(landscapes({"CartPole-v1": lengths}), "3")[1] == "partly"
    lengths[2, 3] = 7
    assert verdicts(landscapes({"CartPole-v1": lengths}), "3")[1] == "does not agree"
    other_way = landscapes({"CartPole-v1": 100 - LENGTHS}, {"CartPole-v1": LENGTHS})
    assert verdicts(other_way, "3")[2] == "does not agree"


def test_numbers_name_the_greatest_value_and_its_place() -> None:
    frame = landscapes({"CartPole-v1": AS_THE_PAPER, "LunarLander-v3": SMALL}, None)
    assert COUNT.numbers(frame)["CartPole-v1"] == {
        "greatest": 90.0,
        "at_support": 0.0,
        "at_confidence": 1.0,
        "at_support_0_confidence_1": 90.0,
        "at_support_0_confidence_1_over_recordings": [90.0, 90.0],
        "mean_range_over_recordings": 0.0,
        "widest_range_over_recordings": 0.0,
    }


# --- several recordings --------------------------------------------------------------------------


def recorded(*counts: np.ndarray) -> pd.DataFrame:
    """A table of Cart Pole with one landscape a recording."""
    parts = [
        landscapes({"CartPole-v1": one}, recordings=(number,)) for number, one in enumerate(counts)
    ]
    return pd.concat(parts, ignore_index=True)


def test_numbers_tell_how_far_recordings_lead_apart() -> None:
    other = AS_THE_PAPER.copy()
    other[0, 3], other[1, 2] = 96, 1
    found = COUNT.numbers(recorded(AS_THE_PAPER, other))["CartPole-v1"]
    assert found["at_support_0_confidence_1"] == 90  # of the first
    assert found["at_support_0_confidence_1_over_recordings"] == [90, 96]
    assert found["widest_range_over_recordings"] == 6
    assert found["mean_range_over_recordings"] == pytest.approx((6 + 2) / 12)


@pytest.mark.parametrize(
    ("others", "expected"),
    [(0, "agrees"), (1, "agrees"), (2, "partly"), (5, "does not agree"), (6, "does not agree")],
)
def test_a_verdict_is_that_of_most_recordings(others: int, expected: Verdict) -> None:
    more = AS_THE_PAPER.copy()
    more[1, 2] = 91  # more rules there than at support 0 and confidence 1
    most = COUNT.claims({"2": recorded(*[more] * others, *[AS_THE_PAPER] * (6 - others))})[0]
    assert most.verdict == expected
    assert f"It holds in {6 - others} of 6 recordings" in most.ours
    assert most.numbers["held_in"] == 6 - others


def test_one_recording_decides_nothing() -> None:
    frame = recorded(AS_THE_PAPER)
    assert set(verdicts(frame)) == {"cannot be judged"}
    assert set(verdicts(recorded(*[AS_THE_PAPER] * 4))) == {"cannot be judged"}


@pytest.mark.parametrize("dark", [False, True])
def test_figures_show_the_chosen_environment(dark: bool) -> None:
    frame = landscapes({"CartPole-v1": AS_THE_PAPER, "LunarLander-v3": SMALL})
    flat, raised = COUNT.draw(frame, "Lunar Lander", dark)
    assert "Lunar Lander" in flat.title
    assert np.asarray(raised.figure.data[0].z).tolist() == SMALL.T.tolist()
    assert flat.figure.layout.title.text is None
