"""Names and formulas that were given to kept demonstrations are those that commands work with."""

from __future__ import annotations

from pathlib import Path

import pytest

from sarl_core import Demonstrations, load_demonstrations, mine_rules
from sarl_core.demonstrations.dataset import formula_feature, with_formulas
from sarl_core.demonstrations.names import Names, names_of, renamed
from sarl_core.errors import InputError
from sarl_core.library import Item, Library
from sarl_core.library.annotations import (
    annotated,
    derived_in,
    formulas_details,
    is_annotated,
    names_details,
    names_in,
)
from sarl_core.library.contents import (
    add_demonstrations,
    annotated_file,
    demonstrations_of,
    sources_of,
)
from sarl_core.mining.combining.choice import with_combinations

DATA = Path(__file__).parents[2] / "data" / "demonstrations"
LEAN = "lean [rad] = 2 * pole angle"


@pytest.fixture(scope="module")
def cart() -> Demonstrations:
    return load_demonstrations(DATA / "cartpole.parquet").select(range(2))


@pytest.fixture(scope="module")
def german(cart: Demonstrations) -> Names:
    own = names_of(cart)
    return own._replace(
        features=("Ort", "Tempo", "Winkel", "Drehung"),
        units=("m", "m/s", "", "rad/s"),
        actions=("Schub",),
        labels=(("nach links", "nach rechts"),),
    )


@pytest.fixture
def item(library: Library, cart: Demonstrations) -> Item:
    return add_demonstrations(library, cart, "the crane", author="Ada")


def test_what_is_given_is_brought_back(cart: Demonstrations, german: Names) -> None:
    feature = formula_feature(LEAN, cart.observed)
    details = {**names_details(german), **formulas_details([feature])}
    assert names_in(details) == german
    assert derived_in(details, cart) == (feature,)
    wanted = renamed(with_formulas(cart, [LEAN]), german)
    assert annotated(cart, details).digest == wanted.digest
    assert annotated(cart, details).features == wanted.features
    for nothing in ({}, {**names_details(None), **formulas_details(None)}):
        assert not is_annotated(nothing)
        assert annotated(cart, nothing) is cart


def test_formulas_of_the_file_may_be_taken_away_and_combinations_stay(
    cart: Demonstrations,
) -> None:
    derives = with_formulas(with_combinations(cart), [LEAN])
    combined = derives.derived[:-1]
    assert combined
    assert is_annotated(formulas_details([]))
    assert annotated(derives, formulas_details([])).derived == combined
    twice = "twice [m] = 2 * cart position"
    feature = formula_feature(twice, cart.observed)
    assert annotated(derives, formulas_details([*combined, feature])).derived == (
        *combined,
        feature,
    )


def test_a_command_is_given_the_names_and_formulas(
    library: Library, item: Item, cart: Demonstrations, german: Names, tmp_path: Path
) -> None:
    assert annotated_file(library, item, tmp_path) == library.path(item)
    details = {**names_details(german), **formulas_details([formula_feature(LEAN, cart.observed)])}
    item = library.annotate(item.id, details, author="Ada")
    path = annotated_file(library, item, tmp_path)
    assert path.parent == tmp_path
    given = load_demonstrations(path)
    wanted = annotated(cart, details)
    assert names_of(given) == german
    assert given.derived == wanted.derived
    assert given.digest == wanted.digest
    assert demonstrations_of(library, item).digest == cart.digest  # which stays what it was


def test_rules_of_renamed_demonstrations_know_where_they_come_from(
    library: Library, item: Item, cart: Demonstrations, german: Names
) -> None:
    plain = mine_rules(cart, supp_min=0.01, conf_min=0.9)
    assert sources_of(library, plain) == [item.id]
    library.annotate(item.id, names_details(german), author="Ada")
    assert sources_of(library, mine_rules(renamed(cart, german), supp_min=0.01, conf_min=0.9)) == [
        item.id
    ]
    other = mine_rules(with_formulas(cart, [LEAN]), supp_min=0.01, conf_min=0.9)
    assert sources_of(library, other) == []


@pytest.mark.parametrize(
    "details",
    [
        {"names": {"features": ["one"], "units": [""], "actions": ["a"], "labels": [["x", "y"]]}},
        {"names": {"features": ["one"]}},
        {"names": 3},
        {"formulas": ["lean = 2 * nothing of the kind"]},
        {"formulas": 3},
        {"formulas": [3]},
    ],
)
def test_what_does_not_fit_is_said(
    library: Library, item: Item, tmp_path: Path, details: dict[str, object]
) -> None:
    item = library.annotate(item.id, details, author="Ada")
    with pytest.raises(InputError, match="given to 'the crane' do not fit it") as caught:
        annotated_file(library, item, tmp_path)
    assert str(library.path(item)) in str(caught.value)
    assert not list(tmp_path.glob("*.parquet"))
