"""Shapes and thresholds are changed to where rules achieve more."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Demonstrations, load_demonstrations
from sarl_core.demonstrations.dataset import with_formulas
from sarl_core.improving import policy_improvement, refinement
from sarl_core.improving.candidate import Candidate, Evaluator
from sarl_core.improving.movement import POPULATION, Movement, ranks
from sarl_core.improving.policy_improvement import PolicyImprovement
from sarl_core.improving.refinement import Refinement, SearchEffort
from sarl_core.improving.shapes import MetStates, neighbours
from sarl_core.mining.budgeted_trees import grow_budgeted_trees, leaf_rules
from sarl_core.mining.combining.candidates import pairs_of_like_kind
from sarl_core.mining.growing.structure import TreeStructure, count_tree
from sarl_core.mining.tree import LEAF, PolicyTree
from sarl_core.progress import CancelledError
from sarl_core.rollouts.choices import mean_score, scores, weighed
from sarl_core.rollouts.episodes import Episodes, rollout
from sarl_core.rollouts.trial import make_agent
from sarl_core.shielding.shield import Shield

CART = "CartPole-v1"
DATA = Path(__file__).parents[2] / "data" / "demonstrations"
CARTPOLE = load_demonstrations(DATA / "cartpole.parquet").select(range(4))
PENDULUM = load_demonstrations(DATA / "pendulum.parquet").select(range(8))
TRIAL = Evaluator(CART, make_agent("novice", CART), "centre", 2, 0.0, None)


def neighbours_of(
    pairs: Demonstrations, rules: int, *, most: int | None = None, divider: int = 2, seed: int = 0
) -> tuple[tuple[PolicyTree, ...], list[Candidate]]:
    trees = grow_budgeted_trees(pairs, max_rules=rules, divider=divider)
    return trees, neighbours(
        trees,
        MetStates(pairs, None),
        max_rules=most or rules,
        count=60,
        generator=np.random.default_rng(seed),
    )


@pytest.mark.parametrize(("pairs", "divider"), [(CARTPOLE, 2), (PENDULUM, 16)])
def test_neighbours_differ_from_each_other_in_one_query_or_label(
    pairs: Demonstrations, divider: int
) -> None:
    (tree,), others = neighbours_of(pairs, 6, divider=divider)
    said = [tree, *(one.trees(pairs, divider)[0] for one in others)]
    answers = {one.label[one.apply(pairs.observations)].tobytes() for one in said}
    assert len(others) > 20
    assert len(answers) > len(others) / 2  # the others differ where nobody was
    asked = [
        [
            (f, None if f == LEAF else t, label if f == LEAF else None)
            for f, t, label in zip(
                one.structures[0].feature.tolist(),
                one.structures[0].threshold.tolist(),
                one.structures[0].label.tolist(),
                strict=True,
            )
        ]
        for one in [Candidate.of_trees([tree]), *others]
    ]
    assert all(one not in asked[:place] for place, one in enumerate(asked))
    sizes = {int((one.feature == LEAF).sum()) for one in said[1:]}
    assert max(sizes) <= 6
    assert min(sizes) < 6
    queries = {(int(f), float(t)) for f, t in zip(tree.feature, tree.threshold, strict=True)}
    for one in said[1:]:
        own = zip(one.feature.tolist(), one.threshold.tolist(), strict=True)
        assert len({query for query in own if query[0] != LEAF and query not in queries}) <= 1


def test_where_there_is_room_a_tree_may_grow() -> None:
    (tree,), others = neighbours_of(CARTPOLE, 6, most=20)
    sizes = [int((one.structures[0].feature == LEAF).sum()) for one in others]
    assert max(sizes) == int((tree.feature == LEAF).sum()) + 1


def test_the_first_new_query_meets_the_wishes_best() -> None:
    """In the place of a single query, the one that scikit-learn finds on the same states."""
    (tree,), others = neighbours_of(CARTPOLE, 2, seed=3)
    right = [
        leaf_rules(one.trees(CARTPOLE, 2)).fidelity
        for one in others
        if len(one.structures[0].feature) == 3
    ]
    # scikit-learn's is the best by Gini.
    assert max(right) >= leaf_rules([tree]).fidelity - 0.005


def test_thresholds_go_to_where_they_bring_more() -> None:
    """Thresholds made wrong on purpose are moved back to where they serve."""
    trees = grow_budgeted_trees(CARTPOLE, max_rules=2)
    before = mean_return(leaf_rules(trees))
    movement = Movement(trees, CARTPOLE, seed=0)
    assert movement.count == 1
    for number in range(2):
        tried = movement.ask()
        assert len(tried) == POPULATION
        achieved = TRIAL.scores(tried, CARTPOLE, seed=number * 8, episodes=8, workers=None)
        movement.tell(np.array([one.mean() for one in achieved]))
    (moved,) = movement.here.trees(CARTPOLE, 2)
    assert moved.feature.tolist() == trees[0].feature.tolist()
    assert moved.threshold[0] != trees[0].threshold[0]
    assert mean_return(leaf_rules([moved])) > before - 5


def test_leaves_of_amounts_move_by_intervals() -> None:
    trees = grow_budgeted_trees(PENDULUM, max_rules=4, divider=16)
    movement = Movement(trees, PENDULUM, seed=0)
    assert movement.count == 3 + 4
    labels = {
        tuple(one.structures[0].label[one.structures[0].feature == LEAF].tolist())
        for one in movement.ask()
    }
    assert len(labels) > 5
    assert all(0 <= label < 16 for one in labels for label in one)


def test_thresholds_of_a_formula_stay_finite_where_it_is_infinite() -> None:
    gap = np.repeat([-1.0, 1.0, 2.0], 20)
    speed = np.repeat([0.0, 0.0, 1.0], 20)  # so that a third of the values is -inf, a third inf
    pairs = with_formulas(
        Demonstrations(
            observations=np.column_stack([gap, speed + 0.01 * np.arange(60) * (speed > 0)]),
            actions=np.repeat([1, 0, 1], 20),
            episodes=np.zeros(60, dtype=np.int64),
            feature_names=("gap", "speed"),
        ),
        ["time = gap / speed"],
    )
    leaf = count_tree(_asking(threshold=None), pairs, 0, divider=2)
    for seed in range(4):
        others = neighbours(
            [leaf],
            MetStates(pairs, None),
            max_rules=2,
            count=60,
            generator=np.random.default_rng(seed),
        )
        assert np.isfinite([one.structures[0].threshold for one in others]).all()
        if any(one.structures[0].feature[0] == 2 for one in others):
            break
    else:
        pytest.fail("nothing asked about the formula")
    movement = Movement([count_tree(_asking(threshold=0.5), pairs, 0, divider=2)], pairs, seed=0)
    moved = {float(one.structures[0].threshold[0]) for one in movement.ask()}
    assert len(moved) == POPULATION
    assert np.isfinite(list(moved)).all()


def _asking(*, threshold: float | None) -> TreeStructure:
    """About feature 2 whether it is at most the threshold; nothing where there is none."""
    if threshold is None:
        end = np.array([LEAF])
        return TreeStructure(end, np.zeros(1), end, end, np.array([0]))
    return TreeStructure(
        np.array([2, LEAF, LEAF]),
        np.array([threshold, 0.0, 0.0]),
        np.array([1, LEAF, LEAF]),
        np.array([2, LEAF, LEAF]),
        np.array([0, 0, 1]),
    )


def test_where_all_do_alike_nothing_is_followed() -> None:
    assert ranks(np.array([3.0, 1.0, 2.0])).tolist() == [0.5, -0.5, 0.0]
    assert np.allclose(ranks(np.full(6, 500.0)), 0.0)
    assert np.allclose(ranks(np.array([1.0, 7.0, 7.0, 0.0])), [-1 / 6, 1 / 3, 1 / 3, -0.5])
    movement = Movement(grow_budgeted_trees(CARTPOLE, max_rules=4), CARTPOLE, seed=0)
    before = movement.here.structures[0].threshold
    movement.ask()
    movement.tell(np.full(POPULATION, 500.0))
    np.testing.assert_array_equal(movement.here.structures[0].threshold, before)


def mean_return(rules) -> float:
    return float(rollout(CART, "novice", shield=Shield(rules), episodes=32, seed=77).returns.mean())


def search(*others, episodes: int = 2, **effort) -> Refinement:
    trees = grow_budgeted_trees(CARTPOLE, max_rules=2)
    return Refinement(
        [trees, *others],
        CARTPOLE,
        TRIAL,
        expert=make_agent("expert", CART),
        combined=pairs_of_like_kind(CARTPOLE),
        max_rules=2,
        effort=SearchEffort(episodes, **effort),
        first=1_000,
    )


def test_two_rules_over_two_features_balance_the_pole(sized_search) -> None:
    """What CART asks about first is another pair; what achieves more is found."""
    sized_search(
        population=8,
        _NEIGHBOURS=24,
        _EARLY=3,
        _LATE=3,
        _MET=1,
        _COMPARED=2,
    )
    ticks: list[tuple[int, int]] = []
    last = search(episodes=6).run(
        1, progress=lambda done, total: ticks.append((done, total)) or True
    )[-1]
    assert ticks[-1] == (SearchEffort(6).cost(1),) * 2
    assert ticks == sorted(ticks)
    (first,) = grow_budgeted_trees(CARTPOLE, max_rules=2)
    assert mean_return(leaf_rules([first])) < 300
    pairs = CARTPOLE.deriving(last.derived)
    assert mean_return(leaf_rules(last.trees(pairs, 2))) > 480


def test_intervals_stay_what_they_are_where_other_amounts_are_met(small_search) -> None:
    """As of an action space without bounds, of which the demonstrated values are divided."""
    pendulum = "Pendulum-v1"
    shown = replace(
        PENDULUM, actions=PENDULUM.actions / 4, action_low=None, action_high=None, bounds_from=None
    )
    search = Refinement(
        [grow_budgeted_trees(shown, max_rules=4, divider=8)],
        shown,
        Evaluator(pendulum, make_agent("novice", pendulum), "centre", 8, 0.0, 20),
        expert=make_agent("expert", pendulum),
        max_rules=4,
        effort=SearchEffort(2),
        first=0,
    )
    met = search._met().pairs
    assert np.abs(met.actions).max() > np.abs(shown.actions).max()
    assert met.action_dimensions == shown.action_dimensions


@pytest.mark.parametrize("moved", [False, True])
def test_it_begins_with_what_achieves_most_when_it_is_moved(
    moved, small_search, monkeypatch
) -> None:
    better = grow_budgeted_trees(CARTPOLE, max_rules=8)
    worse = grow_budgeted_trees(CARTPOLE, max_rules=3)
    compared: list[list[Candidate]] = []
    ranks: list[tuple[int, ...]] = []
    ranked = Refinement._ranking

    def ranking(self, tried, pairs, times, **first):
        compared.append(list(tried))
        if len(compared) == 2:  # of what was moved, the second is gone on with
            return (1, 0)
        if len(compared) == 3:  # the other when it was moved, and the best as it was
            return (0, 1) if moved else (1, 0)
        ranks.append(ranked(self, tried, pairs, times, **first))
        return ranks[-1]

    monkeypatch.setattr(Refinement, "_ranking", ranking)
    begun = search(worse, better)
    ticks: list[tuple[int, int]] = []
    told: list[Candidate] = []
    marks = begun.run(
        2, progress=lambda done, total: ticks.append((done, total)) or True, better=told.append
    )
    assert ticks[-1] == (SearchEffort(2, 3).cost(2),) * 2
    first, halved, end, *_ = compared
    order = ranks[0]
    best = max(first, key=lambda one: mean_return(leaf_rules(one.trees(CARTPOLE, 2))))
    assert best is first[order[0]] is end[1] is told[0]
    assert len(halved) == 2
    assert end[0] is halved[1]
    shape = first[order[1]].structures[0].feature
    np.testing.assert_array_equal(end[0].structures[0].feature, shape)
    assert begun.begun == order[int(moved)]
    assert begun.start is marks[0] is first[begun.begun]
    assert (end[0] in told) == moved


@pytest.mark.parametrize(
    ("early", "late", "taken"), [(-90.0, 10.0, True), (90.0, -10.0, False), (0.0, 0.0, True)]
)
def test_what_is_compared_plays_all_episodes(early, late, taken, small_search, monkeypatch) -> None:
    """Few episodes say the contrary; of two that achieve the same, the moved one is taken."""
    begun = search(episodes=16)
    (tree,) = grow_budgeted_trees(CARTPOLE, max_rules=2)
    there = Candidate.of_trees([tree])
    moved = Candidate.of_trees([count_tree(_asking(threshold=0.5), CARTPOLE, 0, divider=2)])
    met = MetStates(CARTPOLE, None)

    def achieved(tried, pairs, *, seed, episodes):
        first = np.arange(seed, seed + episodes) < 1_000 + 2
        zero = np.zeros(episodes)
        return [np.where(first, early, late) if one is moved else zero for one in tried]

    monkeypatch.setattr(begun, "_scores", achieved)
    assert begun._is_as_good(moved, there, met) == taken


def played(returns: list[float], failed: list[bool]) -> Episodes:
    """Episodes of an environment that signals its failures."""
    zeros = np.zeros(len(returns), dtype=np.int64)
    return Episodes(
        env_id=CART,
        agent="novice",
        seeds=zeros,
        returns=np.array(returns),
        lengths=zeros + 1,
        interventions=zeros,
        covered=zeros,
        terminated=np.array(failed),
        truncated=~np.array(failed),
        last_rewards=np.zeros(len(returns)),
        signalled=np.array(failed, dtype=np.float64),
    )


def test_what_never_ends_is_not_better_than_what_fails_once() -> None:
    landing = played(returns=[250.0] * 15 + [-100.0], failed=[False] * 15 + [True])
    hovering = played(returns=[-20.0] * 16, failed=[False] * 16)
    assert mean_score(scores(hovering, "failures")) > mean_score(scores(landing, "failures"))
    assert weighed(landing, 350.0).mean() > weighed(hovering, 350.0).mean()
    assert weighed(landing, 350.0)[-1] == -450.0
    np.testing.assert_array_equal(weighed(landing, 0.0), landing.returns)


def test_what_takes_much_longer_than_the_expert_is_tried_no_further(
    sized_search, monkeypatch
) -> None:
    lander = "LunarLander-v3"
    demonstrations = load_demonstrations(DATA / "lunar_lander.parquet").select(range(4))
    sized_search(population=2, _NEIGHBOURS=1)
    expert = make_agent("expert", lander)
    search = Refinement(
        [grow_budgeted_trees(demonstrations, max_rules=4)],
        demonstrations,
        Evaluator(lander, make_agent("novice", lander), "centre", 2, 0.0, None),
        expert=expert,
        max_rules=4,
        effort=SearchEffort(10),
        first=50,
    )
    limits: list[int | None] = []
    trial = Evaluator.scores
    monkeypatch.setattr(
        Evaluator,
        "scores",
        lambda self, *given, **named: limits.append(self.max_steps) or trial(self, *given, **named),
    )
    search.run(1)
    lengths = rollout(lander, expert, episodes=10, seed=50).lengths
    assert set(limits) == {int(np.ceil(2 * np.quantile(lengths, 0.9)))}


def test_where_nothing_has_a_value_in_the_met_states_the_shown_ones_serve(
    small_search, monkeypatch
) -> None:
    monkeypatch.setattr(
        "sarl_core.improving.refinement.with_values",
        lambda observations, derived: np.zeros(0, dtype=np.int64),
    )
    begun = search()
    assert begun._met().pairs.digest == CARTPOLE.digest
    assert begun.run(1)[0] is begun.start


def test_it_can_be_stopped_after_any_candidate(small_search) -> None:
    ticks: list[int] = []
    with pytest.raises(CancelledError):
        search().run(1, progress=lambda done, total: ticks.append(done) or done < 2 + 4 + 2)
    # The expert, where the rules lead, and the first of three neighbours.
    assert ticks[-1] == 2 + 4 + 2


@pytest.mark.parametrize("moved", [False, True])
def test_what_achieves_more_is_told_and_gone_on_with(moved, small_search, monkeypatch) -> None:
    """And what does not, is not: each turn begins with the best there is."""
    compared: list[list[Candidate]] = []

    def ranking(self, tried, pairs, times, **first):
        if times == refinement._COMPARED:
            compared.append(list(tried))
            # A neighbour is never better, what was moved is or is not.
            return (0, 1) if moved and len(compared) % 2 == 0 else (1, 0)
        return range(len(tried))

    monkeypatch.setattr(Refinement, "_ranking", ranking)
    told: list[Candidate] = []
    begun = search()
    monkeypatch.setattr(refinement, "_COMPARED", 5)
    marks = begun.run(2, better=told.append)
    first, second, third, fourth = compared
    assert first[1] is begun.start is marks[0]
    assert second[1] is begun.start
    best = second[0] if moved else begun.start
    assert third[1] is best
    assert fourth[1] is best
    assert told == marks == ([begun.start, second[0], fourth[0]] if moved else [begun.start])


@pytest.mark.parametrize("starts", [(), (3, 4, 5)])
def test_in_steps_rules_are_changed_by_what_their_episodes_say(
    starts, sized_search, monkeypatch
) -> None:
    sized_search(population=4, _EARLY=1, _LATE=1, _MET=1, _COMPARED=4, _SHAPES=2)
    for name, times in (("_DEVIATED", 3), ("_FOLLOWED", 2), ("_PROPOSED", (1, 4))):
        monkeypatch.setattr(refinement, name, times)
    for name, batches in (("_FIRST_BATCHES", 100), ("_BATCHES", 100)):
        monkeypatch.setattr(policy_improvement, name, batches)
    asked: list[object] = []
    monkeypatch.setattr(refinement, "neighbours", lambda *_, **__: asked.append(1))
    proposed: list[int] = []
    proposals = PolicyImprovement.proposals

    def counted(self, pairs):
        found = proposals(self, pairs)
        proposed.append(len(found))
        return found

    monkeypatch.setattr(PolicyImprovement, "proposals", counted)
    others = [grow_budgeted_trees(CARTPOLE, max_rules=rules) for rules in starts]
    begun = search(*others, episodes=2, steps=2)
    begun._evaluator = replace(TRIAL, max_steps=150)
    ticks: list[tuple[int, int]] = []
    marks = begun.run(2, progress=lambda done, total: ticks.append((done, total)) or True)
    planned = SearchEffort(2, 1 + len(starts), steps=2).cost(2)
    assert ticks[-1] == (planned, planned)
    assert ticks == sorted(ticks)
    assert not asked  # the expert's wishes lead nowhere then
    # Of four starts two are moved a step each before the first turn; of one alone, none is.
    assert len(proposed) == 2 * 2 + (2 if starts else 0)
    assert sum(proposed) > 0
    last = mean_return(leaf_rules(marks[-1].trees(CARTPOLE, 2)))
    assert last > mean_return(leaf_rules(grow_budgeted_trees(CARTPOLE, max_rules=2)))


def test_thresholds_are_moved_in_as_many_generations_as_is_said(small_search, monkeypatch) -> None:
    told: list[int] = []
    monkeypatch.setattr(Movement, "tell", lambda self, means: told.append(len(means)))

    def generations(late: int | None) -> int:
        told.clear()
        ticks: list[tuple[int, int]] = []
        search(late=late).run(1, progress=lambda *tick: ticks.append(tick) or True)
        assert ticks[-1] == (SearchEffort(2, late=late).cost(1),) * 2
        return len(told)

    assert generations(5) == generations(1) + 4 == generations(None) + 4
    more, few = (SearchEffort(2, late=late).seeds(1) for late in (5, 1))
    assert more - few == 4 * refinement._CAREFUL * 2


def test_of_many_generations_each_leaves_its_worse_half_sooner(small_search, monkeypatch) -> None:
    played: list[tuple[int, int]] = []
    scores = Evaluator.scores

    def playing(self, tried, pairs, **named):
        played.append((len(tried), named["episodes"]))
        return scores(self, tried, pairs, **named)

    monkeypatch.setattr(Evaluator, "scores", playing)
    monkeypatch.setattr(refinement, "_LATE", 1)
    assert refinement.POPULATION == 4
    more, few = (SearchEffort(6, late=late).cost(1) for late in (6, 2))
    # Of twelve episodes all play a third, the better half another, and a quarter the last.
    assert more - few == 4 * (4 * 4 + 4 * 2 + 4 * 1)
    search(episodes=6, late=3).run(1)
    assert [each for each in played if each[1] == 4] == 3 * [(4, 4), (2, 4), (1, 4)]


def test_the_seeds_of_a_turn_are_counted() -> None:
    # Those of the expert and of the choice where to begin are used once.
    once, one, two = (SearchEffort(16).seeds(turns) for turns in range(3))
    assert two - one == one - once > once > 0
    assert SearchEffort(32).seeds(2) == 2 * two


@pytest.mark.parametrize(("moved", "ways"), [(None, 2), (5, 5), (1, 1)])
def test_as_many_starts_are_moved_as_is_said(moved, ways, sized_search, monkeypatch) -> None:
    sized_search(population=4, _SHAPES=2, _EARLY=1, _COMPARED=1, _MET=1)
    halved = Refinement._halved
    counted: list[int] = []

    def counting(self, movements, met):
        counted.append(len(movements))
        return halved(self, movements, met)

    monkeypatch.setattr(Refinement, "_halved", counting)
    others = [grow_budgeted_trees(CARTPOLE, max_rules=rules) for rules in (3, 4, 5, 6)]
    ticks: list[tuple[int, int]] = []
    search(*others, moved=moved).run(0, progress=lambda *tick: ticks.append(tick) or True)
    assert counted == [ways]
    assert ticks[-1] == (SearchEffort(2, 5, moved).cost(0),) * 2
