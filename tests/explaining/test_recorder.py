from __future__ import annotations

import io
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest

from sarl_core import RuleSet, Shield, load_demonstrations, mine_rules, rollout
from sarl_core.environments.description import describe_environment
from sarl_core.explaining.exports.steps import (
    RecordedSteps,
    steps_to_csv,
    steps_to_parquet,
)
from sarl_core.explaining.html.lit_path import lit_path_table, lit_paths_html
from sarl_core.explaining.state_path import PathFinder
from sarl_core.explaining.tables.recorder import (
    PAGE,
    filter_text,
    page_count,
    place_of,
    recorder_columns,
)
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.rollouts.episodes import Episodes
from sarl_core.rollouts.step_filters import StepFilter

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


@pytest.fixture(scope="module")
def rules() -> RuleSet:
    return mine_rules(load_demonstrations(DATA / "cartpole.parquet"), supp_min=0.005, conf_min=0.95)


@pytest.fixture(scope="module")
def played(rules: RuleSet) -> Episodes:
    return rollout("CartPole-v1", "novice", shield=Shield(rules), episodes=3, seed=70)


@pytest.fixture
def record(rules: RuleSet, played: Episodes) -> RecordedSteps:
    assert played.steps is not None
    features = rules.source.features
    return RecordedSteps(
        played.steps, "CartPole-v1", "novice", [70, 71, 72], features, rules, "all"
    )


def test_the_table_says_what_was_recorded(rules: RuleSet, played: Episodes) -> None:
    steps = played.steps
    assert steps is not None
    rows = StepFilter(intervened=True, episode=1).rows(steps)[:PAGE]
    dimensions = environment_dimensions(describe_environment("CartPole-v1"), rules)
    found = recorder_columns(
        steps, rows, dimensions, rules.source.features, rules, seeds=[70, 71, 72]
    )
    assert (
        list(found)[:8]
        == [
            "Seed",
            "Step",
            "Wanted",
            "Done",
            "Rule",
            "Changed",
            *(["Outside"] if steps.outside.any() else []),
            "Distance",
            "Reward",
        ][:8]
    )
    names = ("push left", "push right")
    for place, row in enumerate(rows.tolist()):
        assert found["Seed"][place] == 71
        assert found["Step"][place] == steps.step[row]
        assert found["Wanted"][place] == names[int(steps.proposed[row, 0])]
        assert found["Done"][place] == names[int(steps.executed[row, 0])]
        assert found["Rule"][place] == f"R{steps.rules[row, 0] + 1}"
        assert found["Changed"][place] is True
        assert found["pole angle (rad)"][place] == steps.observation[row, 2]
    alone = recorder_columns(steps, rows, dimensions, rules.source.features, None)
    assert list(alone)[:3] == ["Step", "Done", "Reward"]


def test_names_that_collide_stay_apart_and_dimensions_are_named() -> None:
    demonstrations = load_demonstrations(DATA / "bipedal_walker.parquet")
    rules = mine_rules(demonstrations, supp_min=0.05, conf_min=0.8)
    played = rollout("BipedalWalker-v3", "novice", shield=Shield(rules), episodes=1, seed=1)
    steps = played.steps
    assert steps is not None
    dimensions = environment_dimensions(describe_environment("BipedalWalker-v3"), rules)
    features = tuple(replace(one, name="Reward", unit="") for one in rules.source.features)
    found = recorder_columns(steps, np.arange(3), dimensions, features, rules)
    assert len(found) == 1 + 4 * 3 + 2 + bool(steps.outside.any()) + 1 + len(features)
    wanted = [name for name in found if name.endswith(": wanted")]
    assert len(wanted) == 4
    assert all(name[:1].isupper() for name in wanted)


def test_pages_and_places() -> None:
    rows = np.array([2, 5, 9])
    assert [place_of(rows, row) for row in (2, 5, 9)] == [0, 1, 2]
    assert [place_of(rows, row) for row in (0, 3, 10)] == [None] * 3
    assert [page_count(n) for n in (0, 1, PAGE, PAGE + 1)] == [1, 1, 1, 2]
    assert filter_text(StepFilter(), 300, 300) == "300 steps"
    assert (
        filter_text(StepFilter(intervened=True, rule=3), 12, 300, "R14")
        == "12 of 300 steps: changed by the rules, under R14"
    )


def test_files_hold_every_number_in_full(record: RecordedSteps) -> None:
    steps = record.steps
    csv = pd.read_csv(io.BytesIO(steps_to_csv(record)), dtype={"rule_id": "str"})
    parquet = pq.read_table(io.BytesIO(steps_to_parquet(record)))
    frame = parquet.to_pandas()
    for read in (csv, frame):
        assert len(read) == len(steps)
        assert read["seed"].tolist() == (steps.episode + 70).tolist()
        assert read["executed"].tolist() == steps.executed[:, 0].tolist()
        assert read["intervened"].tolist() == steps.intervened.tolist()
        angles = read["obs_pole angle"].to_numpy(dtype=np.float32)
        assert (angles == steps.observation[:, 2]).all()
        assert record.rule_set is not None
        ids = [one.id for one in record.rule_set.rules]
        for rule, name in zip(steps.rules[:, 0].tolist(), read["rule_id"].tolist(), strict=True):
            assert name == ids[rule] if rule >= 0 else pd.isna(name)
    described = json.loads(parquet.schema.metadata[b"sarl"])
    assert described["format"] == "sarl-steps"
    assert described["seeds"] == [70, 71, 72]
    assert described["features"][2] == {"name": "pole angle", "unit": "rad"}
    assert described["rules"] == len(ids)


def test_no_id_is_taken_for_a_formula(record: RecordedSteps) -> None:
    assert record.rule_set is not None
    first = replace(record.rule_set.rules[0], id="=HYPERLINK(1)")
    sly = replace(record.rule_set, rules=(first, *record.rule_set.rules[1:]))
    steps = record.steps.take(np.flatnonzero(record.steps.rules[:, 0] == 0)[:1])
    assert len(steps)
    text = steps_to_csv(replace(record, steps=steps, rule_set=sly)).decode()
    assert "'=HYPERLINK" in text
    assert ",=" not in text


def test_without_rules_there_is_no_column_of_them(record: RecordedSteps) -> None:
    bare = replace(record, rule_set=None)
    assert "rule_id" not in bare.to_frame().columns


@pytest.mark.parametrize("placed", [False, True])
def test_the_path_of_a_state_ends_where_the_shield_ends(
    rules: RuleSet, played: Episodes, placed: bool
) -> None:
    if placed:
        rules = replace(
            rules,
            rules=tuple(replace(rule, pinned=index == 1) for index, rule in enumerate(rules.rules)),
        )
    steps = played.steps
    assert steps is not None
    finder, shield = PathFinder(rules), Shield(rules)
    decided = shield.decide_batch(steps.observation, steps.proposed)
    seen = set()
    for state, (rule,), margin in zip(
        steps.observation, decided.rules.tolist(), decided.margin.tolist(), strict=True
    ):
        path = finder.path(0, state, rule)
        assert path.rule == (rule if rule >= 0 else None)
        seen.add(path.rule)
        for query in path.queries:
            value, (feature, op, threshold) = np.float64(query.value), query.condition
            assert query.value == state[feature]
            assert (value <= threshold) == (op == "<=")
            assert query.distance == abs(value - threshold)
        if rule >= 0:
            assert tuple(query.condition for query in path.queries) == rules.rules[rule].conditions
        if not placed:
            nearest = min((query.distance for query in path.queries), default=math.inf)
            assert nearest == pytest.approx(margin)
    assert None in seen
    assert len(seen) > 2


def test_the_path_of_rules_of_no_tree_is_their_own(rules: RuleSet) -> None:
    odd = replace(rules.rules[0], conditions=rules.rules[0].conditions[::-1])
    other = replace(rules.rules[1], conditions=rules.rules[1].conditions[:1])
    mixed = replace(rules, rules=(odd, other, *rules.rules[2:]))
    finder = PathFinder(mixed)
    state = np.zeros(4, dtype=np.float32)
    assert finder.path(0, state, 0).rule == 0
    nothing = finder.path(0, state, -1)
    assert nothing.queries == ()
    assert nothing.rule is None


def test_names_in_a_path_are_escaped(rules: RuleSet, played: Episodes) -> None:
    steps = played.steps
    assert steps is not None
    features = tuple(replace(one, name="<b>angle") for one in rules.source.features)
    sly = replace(rules, source=replace(rules.source, features=features))
    row = int(np.flatnonzero(steps.rules[:, 0] >= 0)[0])
    (text,) = lit_paths_html(PathFinder(sly), steps.observation[row], steps.rules[row])
    assert "<b>" not in text
    assert "&lt;b&gt;angle" in text
    path = PathFinder(sly).path(0, steps.observation[row], int(steps.rules[row, 0]))
    assert text.count("<tr") == len(path.queries) + 1
    assert 'class="near"' in text
    assert "No rule ends here" in lit_path_table(path._replace(rule=None), sly, 0)
