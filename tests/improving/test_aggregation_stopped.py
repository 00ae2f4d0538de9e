"""A run that is stopped gives every part that it has finished, and spoils nothing."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import RuleSet, WorkError, load_demonstrations
from sarl_core.agents.agent import EXPERT_FOLDER
from sarl_core.improving import aggregation, candidate, refinement
from sarl_core.improving.aggregation import aggregate
from sarl_core.improving.aggregation_files import card_path, save_aggregation
from sarl_core.improving.plan import Plan
from sarl_core.mining.budgeted_trees import leaf_rules
from sarl_core.mining.envelope import with_boxes
from sarl_core.progress import CancelledError

PLAN = Plan(max_rules=5, rounds=3, episodes=4, validation=16, report=8, max_steps=200)
REFINED = Plan(
    max_rules=4,
    rounds=1,
    episodes=4,
    validation=4,
    report=3,
    turns=1,
    search_episodes=2,
    seed=3,
    max_steps=100,
)
SEEDS = ("rounds", "validation", "refinement", "report")


@pytest.fixture(scope="module")
def cart():
    path = EXPERT_FOLDER.parent / "demonstrations" / "cartpole.parquet"
    return load_demonstrations(path).select(range(4))


@pytest.fixture(scope="module")
def finished(cart):
    return aggregate(cart, PLAN)


@pytest.fixture
def calls(monkeypatch):
    """Every rollout: (what asked for it, whether its steps are kept, seeds)."""
    found = []

    def spy(module, name, seeds_of):
        plays = getattr(module, name)

        def recorded(*arguments, **named):
            found.append((module, named["keep_steps"], seeds_of(arguments, named)))
            return plays(*arguments, **named)

        monkeypatch.setattr(module, name, recorded)

    for module in (aggregation, refinement):
        spy(
            module,
            "rollout",
            lambda _, named: range(named["seed"], named["seed"] + named["episodes"]),
        )
    spy(candidate, "run_seeds", lambda arguments, _: arguments[3].tolist())
    return found


def stop_in(monkeypatch, part):
    """Ctrl-C in the middle of a part."""

    def interrupted(*arguments, **named):
        raise KeyboardInterrupt

    monkeypatch.setattr(aggregation._Run, part, interrupted)


# --- which episodes are used for what ----------------------------------------------------------


@pytest.mark.parametrize("seed", [0, 3])
def test_no_episode_is_used_for_two_things(cart, small_search, calls, monkeypatch, seed):
    monkeypatch.setattr(aggregation, "_FIRST_VALIDATION", 2)
    plan = replace(REFINED, rounds=2, episodes=3, validation=5, report=5, seed=seed)
    found = aggregate(cart, plan)
    searched = [index for index, (module, *_) in enumerate(calls) if module is not aggregation]
    *others, (_, _, report) = calls
    parts = {
        "rounds": [seeds for module, keeps, seeds in others if keeps and module is aggregation],
        "refinement": [calls[index][2] for index in searched],
        "validation": [s for _, _, s in others[searched[-1] + 1 :]],
        "report": [report],
    }
    used = {name: {one for part in ranges for one in part} for name, ranges in parts.items()}
    assert sum(map(len, used.values())) == len(set.union(*used.values()))
    assert not set.union(*used.values()) & set(range(10_000_000))  # what is typed, experts' own
    # None of the rounds shares an episode with another, nor any part of the search.
    assert len(used["rounds"]) == 2 * 3
    begun, turn = 2 + 2 + (2 + 2) + 2, 2 + 2 + (2 + 2) + 2 + 2 * 1 + 2
    each = 2 * (1 + begun + turn)
    assert len(used["refinement"]) == refinement.SearchEffort(2, 2).seeds(1) == each
    assert len(used["report"]) == 5
    # And the record says where each begins.
    assert found.seeds._asdict() == {name: min(used[name]) for name in SEEDS}


# --- what a stop leaves ------------------------------------------------------------------------


def test_stopped_in_the_rounds(cart):
    rounds = []
    stopped = aggregate(
        cart, PLAN, progress=lambda done, _: done < 6 or len(rounds) < 1, watch=rounds.append
    )
    assert len(stopped.rounds) == len(rounds) >= 1
    assert not stopped.is_finished
    assert stopped.validation_mean is None
    assert len(stopped.rule_set) > 0
    with pytest.raises(CancelledError):
        aggregate(cart, PLAN, progress=lambda done, _: False)


def test_stopped_in_the_choice_the_rounds_decide(cart, tmp_path):
    stopped = aggregate(cart, PLAN, progress=lambda done, _: done < 20)  # the rounds have 12
    means = [one.mean_return for one in stopped.rounds]
    assert len(means) == 3
    assert stopped.chosen == 1 + int(np.argmax(means))
    assert stopped.validation_mean is None
    card = save_aggregation(stopped, tmp_path / "rules.json", command="").card
    assert card["seeds"] == dict.fromkeys(SEEDS, None) | {"rounds": 20_000_000}
    assert card["chosen_by"] == "the episodes of their round only"
    assert card["reported_on"] is card["reported"] is card["validation_mean"] is None


def test_stopped_in_the_report_the_choice_stands(cart, finished, tmp_path):
    total = aggregation._Run(cart, PLAN, "CartPole-v1", None, _expert(), 1).planned_units()
    stopped = aggregate(cart, PLAN, progress=lambda done, _: done < total - 3)
    assert not stopped.is_finished
    assert stopped.rule_set == finished.rule_set
    assert stopped.chosen == finished.chosen
    assert stopped.validation_mean == finished.validation_mean
    card = save_aggregation(stopped, tmp_path / "rules.json", command="").card
    assert card["seeds"] == {**dict.fromkeys(SEEDS), "rounds": 20_000_000, "validation": 30_000_000}
    assert card["chosen_by"] == "the mean of up to 16 episodes of validation"
    assert card["reported_on"] is None


def _expert():
    from sarl_core.rollouts.trial import make_agent

    return make_agent("expert", "CartPole-v1")


def test_ctrl_c_in_the_report_keeps_the_refinement(cart, small_search, monkeypatch, tmp_path):
    whole = aggregate(cart, REFINED)
    stop_in(monkeypatch, "report")
    stopped = aggregate(cart, REFINED)
    assert stopped.rule_set == whole.rule_set
    assert stopped.refined == whole.refined
    assert stopped.validation_mean == whole.validation_mean is not None
    card = save_aggregation(stopped, tmp_path / "rules.json", command="").card
    assert card["seeds"] == {
        "rounds": 23_000_000,
        "validation": 33_000_000,
        "refinement": 43_000_000,
        "report": None,
    }


def the_moved_is_best(monkeypatch):
    """Whatever was moved or changed achieves more."""
    monkeypatch.setattr(refinement.Refinement, "_is_as_good", lambda *_: True)


def stopped_after(monkeypatch, turns):
    """Ctrl-C in a search, after so many turns of it."""
    whole = refinement.Refinement._turn
    done = []

    def interrupted(search):
        if len(done) == turns:
            raise KeyboardInterrupt
        whole(search)
        done.append(search.here)

    monkeypatch.setattr(refinement.Refinement, "_turn", interrupted)
    return done


def test_stopped_in_the_refinement_the_best_point_so_far_is_given(
    cart, small_search, monkeypatch, tmp_path
):
    points = stopped_after(monkeypatch, 2)
    the_moved_is_best(monkeypatch)
    stopped = aggregate(cart, replace(REFINED, turns=8))
    assert stopped.refined
    best = points[-1].trees(stopped.demonstrations, 2)
    assert stopped.rule_set == with_boxes(leaf_rules(best), stopped.demonstrations)
    assert all(rule.box for rule in stopped.rule_set.rules if rule.samples)
    assert stopped.validation_mean is None
    card = save_aggregation(stopped, tmp_path / "rules.json", command="").card
    assert card["refined"]
    assert card["seeds"]["refinement"] == 43_000_000
    assert card["seeds"]["validation"] is card["seeds"]["report"] is None
    assert card["chosen_by"] == "the episodes of a refinement that was not finished"


def test_progress_never_runs_back_where_all_that_was_moved_is_better(
    cart, small_search, monkeypatch
):
    the_moved_is_best(monkeypatch)
    ticks = []
    plan = replace(REFINED, rounds=3)
    aggregate(cart, plan, progress=lambda done, total: ticks.append((done, total)) or True)
    assert ticks == sorted(ticks)
    assert ticks[-1][0] == ticks[-1][1]


def test_what_was_better_is_kept_where_it_is_stopped_while_it_is_moved_on(
    cart, small_search, monkeypatch
):
    the_moved_is_best(monkeypatch)
    told = []
    move = refinement.Refinement._move

    def stop_in_the_end(self, movement, generations, met, **named):
        if generations == refinement._LATE:
            raise KeyboardInterrupt
        return move(self, movement, generations, met, **named)

    monkeypatch.setattr(refinement, "_LATE", 7)
    monkeypatch.setattr(refinement.Refinement, "_move", stop_in_the_end)
    run = refinement.Refinement.run

    def noted(self, *given, better, **named):
        return run(self, *given, better=lambda one: (told.append(one), better(one)), **named)

    monkeypatch.setattr(refinement.Refinement, "run", noted)
    stopped = aggregate(cart, REFINED)
    assert stopped.refined
    assert len(told) == 2
    (kept,) = (candidate.structure_of(tree) for tree in stopped.trees)
    np.testing.assert_array_equal(kept.threshold, told[1].structures[0].threshold)


def test_stopped_before_anything_was_refined_what_the_search_began_with_is_given(
    cart, small_search, monkeypatch
):
    stopped_after(monkeypatch, 0)
    monkeypatch.setattr(
        refinement.Refinement,
        "_ranking",
        lambda self, tried, pairs, times, **first: [1, 0, 2] if len(tried) == 3 else [1, 0],
    )
    stopped = aggregate(cart, replace(REFINED, rounds=3, turns=8))
    assert not stopped.refined
    assert stopped.chosen == 2
    assert stopped.validation_mean is None
    assert stopped.seeds.validation is None
    assert stopped.seeds.refinement == 43_000_000


# --- what it leaves on disk --------------------------------------------------------------------


def test_a_stopped_run_takes_the_place_of_nothing(cart, finished, monkeypatch, tmp_path):
    out = tmp_path / "rules.json"
    save_aggregation(finished, out, command="the good one")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    stop_in(monkeypatch, "select")
    stopped = aggregate(cart, PLAN)
    written, card = save_aggregation(stopped, out, command="stopped")
    assert written == tmp_path / "rules.stopped.json"
    assert RuleSet.load(written) == stopped.rule_set
    assert json.loads((tmp_path / "rules.stopped.card.json").read_text()) == card
    assert {path: path.read_bytes() for path in before} == before
    assert len(list(tmp_path.iterdir())) == 4
    # A finished one does.
    assert save_aggregation(finished, out, command="again").rules == out
    assert json.loads(card_path(out).read_text())["command"] == "again"


def test_rules_and_card_are_written_both_or_neither(finished, monkeypatch, tmp_path):
    out = tmp_path / "rules.json"
    out.write_text("old rules")
    card_path(out).write_text("old card")
    write_text = Path.write_text

    def full_disk(path, text, **named):
        if "card" in path.name:
            raise OSError(28, "No space left on device")
        return write_text(path, text, **named)

    with monkeypatch.context() as patched:
        patched.setattr(Path, "write_text", full_disk)
        with pytest.raises(WorkError, match=r"rules\.card\.json cannot be written \(No space"):
            save_aggregation(finished, out, command="")
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {
        "rules.json": "old rules",
        "rules.card.json": "old card",
    }
    card_path(out).unlink()
    card_path(out).mkdir()
    with pytest.raises(WorkError, match=r"rules\.card\.json is a folder"):
        save_aggregation(finished, out, command="")
    assert out.read_text() == "old rules"
