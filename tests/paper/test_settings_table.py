from __future__ import annotations

import pandas as pd
import pytest

from sarl_core import grow_policy_trees, mine_rules
from sarl_core.paper import settings_table
from sarl_core.paper.replicates import demonstrations_of, replicates_of
from sarl_core.paper.settings_table import SETTINGS
from sarl_core.paper.study import QUICK
from sarl_core.paper.verdicts import Verdict
from tests.paper.frames import expert

# Recording by recording: filtered rules, unfiltered rules, and the coverage of these.
CART = ((5, 100, 1.0), (7, 110, 1.0)) * 3
LANDER = ((1234, 20_000, 0.998), (1234, 19_000, 0.9985)) * 3
LARGE = ((90, 100, 1.0),) * 6
HOLES = ((5, 100, 0.9),) * 6


def table(**found: tuple[tuple[int, int, float], ...]) -> pd.DataFrame:
    rows = []
    for env_id, recordings in found.items():
        for number, (filtered, unfiltered, coverage) in enumerate(recordings):
            for setting, count, covered, length in (
                ("filtered", filtered, 0.5, 4.0),
                ("unfiltered", unfiltered, coverage, 12.0 + number % 2),
            ):
                rows.append(
                    {
                        "environment": f"{env_id}-v1",
                        "expert": expert(number, env_id),
                        "recording": number,
                        "setting": setting,
                        "support": 0.0,
                        "confidence": 1.0,
                        "divider": 0,
                        "rule_count": count,
                        "mean_length": length,
                        "coverage": covered,
                        "fidelity": 1.0,
                    }
                )
    return pd.DataFrame(rows)


def verdicts(frame: pd.DataFrame) -> list[Verdict]:
    return [claim.verdict for claim in SETTINGS.claims({"table-1": frame})]


def test_the_range_over_recordings_is_told() -> None:
    frame = table(CartPole=CART, LunarLander=LANDER)
    compact, covered = SETTINGS.claims({"table-1": frame})
    assert (compact.verdict, covered.verdict) == ("agrees", "agrees")
    assert "It holds in 12 of 12 recordings, with 6 of 6 experts" in compact.ours
    assert "Cart Pole 5 to 7 of 100 to 110 (4.0 and 12.0 to 13.0)" in compact.ours
    assert "Lunar Lander 1,234 of 19,000 to 20,000" in compact.ours
    assert "99.8 %" in covered.ours  # the least of both
    one = SETTINGS.numbers(frame)["CartPole-v1"]["filtered"]
    assert one["rule_count"] == 5  # that of the rules used everywhere
    assert one["over_recordings"]["rule_count"] == [5, 7]
    assert one["over_recordings"]["mean_length"] == [4, 4]


@pytest.mark.parametrize(
    ("cart", "lander", "expected"),
    [
        (CART, LANDER, ["agrees", "agrees"]),
        (((5, 100, 1.0), (20, 100, 1.0)) * 3, LANDER, ["partly", "agrees"]),  # they differ
        (LARGE, LANDER, ["partly", "agrees"]),
        (LARGE, LARGE, ["does not agree", "agrees"]),
        (CART, HOLES, ["agrees", "partly"]),
        (HOLES, HOLES, ["agrees", "does not agree"]),
        (CART[:4], LANDER[:4], ["cannot be judged", "cannot be judged"]),
    ],
)
def test_every_recording_counts(
    cart: tuple[tuple[int, int, float], ...],
    lander: tuple[tuple[int, int, float], ...],
    expected: list[Verdict],
) -> None:
    assert verdicts(table(CartPole=cart, LunarLander=lander)) == expected


def test_figures_show_the_rules_that_are_used_everywhere() -> None:
    frame = table(CartPole=CART, LunarLander=LANDER)
    counts, covered = SETTINGS.draw(frame, SETTINGS.parts(frame)[0], False)
    points = {trace.name: list(trace.x) for trace in counts.figure.data if trace.name}
    assert points == {"filtered": [5, 1234], "unfiltered": [100, 20_000]}
    points = {trace.name: list(trace.x) for trace in covered.figure.data if trace.name}
    assert points["unfiltered"] == [1.0, 0.998]


def test_the_table_is_what_mining_gives(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(settings_table, "environments", lambda: ("CartPole-v1",))
    told = []
    frame = SETTINGS.measure(QUICK, lambda done, total: told.append((done, total)))
    assert told == [(done, 2) for done in range(3)]
    assert tuple(frame.columns) == SETTINGS.columns
    assert frame["recording"].tolist() == [0, 0, 1, 1]
    other = replicates_of("CartPole-v1", 2)[1]
    assert frame["expert"].tolist() == ["cartpole"] * 2 + [other.name] * 2
    rules = mine_rules(grow_policy_trees(demonstrations_of(other)), supp_min=0, conf_min=1)
    row = frame[(frame["recording"] == 1) & (frame["setting"] == "unfiltered")].iloc[0]
    assert row["rule_count"] == len(rules)
    assert row["mean_length"] == pytest.approx(
        sum(rule.length for rule in rules.rules) / len(rules)
    )
