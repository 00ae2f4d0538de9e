from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import RuleSet, Shield, load_demonstrations, mine_rules, rollout
from sarl_core.demonstrations.names import names_of, renamed
from sarl_core.environments.description import describe_environment
from sarl_core.explaining.figures.replay import (
    ReturnLine,
    ReturnRow,
    Timeline,
    Track,
    comparison_figure,
    intervention_strip,
    return_figure,
    shortened,
    tracks,
)
from sarl_core.explaining.words.replay import margin_text, named_description, step_texts, step_view
from sarl_core.mining.environment_actions import environment_dimensions
from sarl_core.mining.labels import LabelledDimension
from sarl_core.rollouts.steps import StepTable

DATA = Path(__file__).parents[2] / "data" / "demonstrations"


def played(name: str, *, divider: int = 2) -> tuple[RuleSet, StepTable]:
    demonstrations = load_demonstrations(DATA / f"{name}.parquet")
    rules = mine_rules(demonstrations, supp_min=0.0, conf_min=1.0, divider=divider)
    episode = rollout(demonstrations.env_id, "novice", shield=Shield(rules), episodes=1, seed=3)
    assert episode.steps is not None
    return rules, episode.steps


@pytest.fixture(scope="module", params=["cartpole", "pendulum"])
def replayed(request: pytest.FixtureRequest) -> tuple[RuleSet, StepTable]:
    return played(request.param)


def test_a_changed_step_says_what_was_wanted_and_done_and_why(
    replayed: tuple[RuleSet, StepTable],
) -> None:
    rules, steps = replayed
    row = int(np.flatnonzero(steps.intervened)[0])
    view = step_view(steps, row, rules.actions, rules.source.features, rules)
    (action,) = view.actions
    assert view.intervened
    assert action.changed
    assert action.proposed != action.executed
    assert action.executed_label == rules.rules[int(steps.rules[row, 0])].action
    assert action.proposed_label != action.executed_label
    assert action.rule.startswith("If ")
    assert action.rule_id == rules.rules[int(steps.rules[row, 0])].id
    assert len(view.state) == steps.observation.shape[1]


def test_a_step_that_was_not_changed_says_one_action(
    replayed: tuple[RuleSet, StepTable],
) -> None:
    rules, steps = replayed
    row = int(np.flatnonzero(~steps.intervened)[0])
    view = step_view(steps, row, rules.actions, rules.source.features, None)
    assert not view.intervened
    assert view.actions[0].proposed == view.actions[0].executed
    assert view.actions[0].rule == ""


def test_the_strip_marks_exactly_the_interventions(replayed: tuple[RuleSet, StepTable]) -> None:
    rules, steps = replayed
    rows = tracks(steps, rules.actions, shielded=True)
    beyond = steps.outside.any()
    names = ["wanted", "done", "changed", *(["outside data"] if beyond else [])]
    assert [row.name for row in rows] == names
    assert (~np.isnan(rows[2].labels) == steps.intervened).all()
    if beyond:
        assert (~np.isnan(rows[3].labels) == steps.outside).all()
        assert rows[3].colour != rows[2].colour
    assert ((rows[0].labels != rows[1].labels) == steps.intervened).all()
    timeline = Timeline.of(rows, len(steps))
    figure = intervention_strip(rows, step_texts(steps, rules.actions, rules), timeline)
    points = figure.data[-1]
    assert points.customdata[:, 0].tolist() == list(range(len(steps))) * len(rows)
    assert figure.layout.hoverdistance == -1
    assert len(tracks(steps, rules.actions, shielded=False)) == 1


def test_tooltips_name_the_rule_and_the_change(replayed: tuple[RuleSet, StepTable]) -> None:
    rules, steps = replayed
    for row, text in enumerate(step_texts(steps, rules.actions, rules)):
        assert text.startswith(f"step {row}<br>")
        assert ("wanted" in text) == bool(steps.intervened[row])
        assert ("no rule applies" in text) == (steps.rules[row, 0] < 0)
        assert ("outside the data" in text) == bool(steps.outside[row])


def test_a_step_says_that_its_state_lies_outside_the_data() -> None:
    rules, steps = played("pendulum")
    beyond = np.flatnonzero(steps.outside)
    assert 0 < len(beyond) < steps.intervened.sum()
    for row in (int(beyond[0]), int(np.flatnonzero(~steps.outside)[0])):
        view = step_view(steps, row, rules.actions, rules.source.features, rules)
        rule = rules.rules[int(steps.rules[row, 0])]
        assert rule.box is not None
        state = steps.observation[row].astype(float)
        inside = (state >= rule.box.least) & (state <= rule.box.most)
        assert view.outside == bool(steps.intervened[row] and not inside.all())


def test_labels_come_from_the_environment_where_they_are_discrete() -> None:
    description = describe_environment("CartPole-v1")
    (dimension,) = environment_dimensions(description, None)
    assert dimension.label_names == ("push left", "push right")


def test_labels_come_from_the_rules_where_actions_are_continuous() -> None:
    rules, _ = played("pendulum", divider=3)
    description = describe_environment("Pendulum-v1")
    assert environment_dimensions(description, rules)[0].n_labels == 3
    (alone,) = environment_dimensions(description, None, divider=2)
    assert alone.edges == (-2.0, 0.0, 2.0)


def test_an_environment_has_the_names_of_its_rules_and_else_of_its_demonstrations() -> None:
    cart = load_demonstrations(DATA / "cartpole.parquet")
    own = names_of(cart)
    shown = renamed(cart, own._replace(features=("a", "b", "c", "d"), labels=(("w", "e"),)))
    ruled = renamed(cart, own._replace(features=("k", "l", "m", "n"), actions=("shove",)))
    rules = mine_rules(ruled, supp_min=0.0, conf_min=1.0)
    plain = describe_environment("CartPole-v1")
    alone = named_description(plain, None, shown)
    assert (alone.feature_names, alone.label_names) == (("a", "b", "c", "d"), (("w", "e"),))
    both = named_description(plain, rules, shown)
    assert (both.feature_names, both.action_names) == (("k", "l", "m", "n"), ("shove",))
    assert environment_dimensions(both, rules)[0].label_names == ("push left", "push right")
    # Names of something else are of no use.
    lander = describe_environment("LunarLander-v3")
    assert named_description(lander, rules, shown) is lander
    unnamed = replace(rules, source=replace(rules.source, env_id=""))
    assert named_description(lander, unnamed, None) is lander
    other = replace(rules, source=replace(rules.source, env_id="Other-v0"))
    assert named_description(plain, other, None) is plain
    three = replace(rules.actions[0], label_names=("w", "e", "n"))
    assert named_description(plain, replace(rules, actions=(three,)), None) is plain
    pendulum = load_demonstrations(DATA / "pendulum.parquet")
    torque = renamed(pendulum, names_of(pendulum)._replace(actions=("twist",)))
    described = named_description(describe_environment("Pendulum-v1"), None, torque)
    assert environment_dimensions(described, None)[0].name == "twist"


def test_a_margin_is_told_in_words() -> None:
    assert margin_text(float("inf")) == "No threshold was looked at"
    assert margin_text(0.0125) == (
        "Smallest distance to a threshold on the way: 0.0125 (in that feature's unit)"
    )


def test_returns_are_drawn_for_each_run() -> None:
    lines = [
        ReturnLine("with", np.array([1.0, 2.0, 3.0]), "#000000"),
        ReturnLine("without", np.array([1.0]), "#111111"),
    ]
    figure = return_figure(lines, Timeline(3, 64))
    assert figure.data[0].y.tolist() == [1.0, 2.0, 3.0]
    assert figure.layout.showlegend
    assert not return_figure(lines[:1], Timeline(3, 64)).layout.showlegend


def test_a_mark_over_the_figures_of_a_replay_stands_at_its_step(
    replayed: tuple[RuleSet, StepTable],
) -> None:
    rules, steps = replayed
    rows = tracks(steps, rules.actions, shielded=True)
    timeline = Timeline.of(rows, len(steps) + 7)  # the other run was longer
    strip = intervention_strip(rows, step_texts(steps, rules.actions, rules), timeline)
    line = return_figure([ReturnLine("with", np.zeros(len(steps)), "#000000")], timeline)
    for figure in (strip, line):
        axis, margin = figure.layout.xaxis, figure.layout.margin
        assert (margin.l, margin.r, margin.autoexpand) == (timeline.left, timeline.right, False)
        assert figure.layout.yaxis.automargin is False
        low, high = axis.range
        for step in (0, 3, len(steps) + 6):
            assert low + timeline.place(step) * (high - low) == pytest.approx(step)
    assert line.layout.margin.b == timeline.bottom
    assert 0 < timeline.place(0) < timeline.place(len(steps) + 6) < 1
    assert 0 < Timeline.of(rows, 1).place(0) < 1


def test_episodes_are_drawn_with_their_interval() -> None:
    row = ReturnRow("with", np.array([1.0, 2.0, 6.0]), 2.5, 1.0, 5.0, "#000000")
    points, mean = comparison_figure([row]).data
    assert points.x.tolist() == [1.0, 2.0, 6.0]
    assert mean.error_x.array[0] == 2.5
    assert mean.error_x.arrayminus[0] == 1.5


def test_a_long_name_of_a_track_leaves_room_for_the_steps() -> None:
    dimension = LabelledDimension("d", ("0", "1"))
    rows = [Track(f"{'left knee torque ' * 4}: wanted", np.zeros(3), dimension)]
    timeline = Timeline.of(rows, 3)
    assert timeline.left <= 180
    (name,) = intervention_strip(rows, ["", "", ""], timeline).layout.yaxis.ticktext
    assert name.startswith("left knee")
    assert name.endswith("…: wanted")
    assert len(name) == 22
    assert shortened("done") == "done"
