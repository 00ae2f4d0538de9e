"""The names that people read: of features, units, actions and labels; and other ones for them.

Names change nothing that is mined: trees, thresholds and the rules' ids stay what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from sarl_core.demonstrations.dataset import Demonstrations, derived_over
from sarl_core.environments.description import EnvironmentDescription
from sarl_core.environments.feature_order import NamedFeatures, line_up
from sarl_core.errors import InputError, quoted


class Names(NamedTuple):
    """All names of demonstrations.

    Attributes:
        features: d names, of what was observed; derived features follow them.
        units: d units, "" where there is none.
        actions: m names, one an action dimension.
        labels: For each action dimension the names of its labels, () if continuous.
    """

    features: tuple[str, ...]
    units: tuple[str, ...]
    actions: tuple[str, ...]
    labels: tuple[tuple[str, ...], ...]


def names_of(demonstrations: Demonstrations) -> Names:
    """The names that demonstrations have.

    Args:
        demonstrations: Any.

    Returns:
        As they stand in sentences, axes and exports.
    """
    dimensions = demonstrations.action_dimensions
    return Names(
        tuple(feature.name for feature in demonstrations.observed),
        tuple(feature.unit for feature in demonstrations.observed),
        tuple(dimension.name for dimension in dimensions),
        tuple(dimension.labels for dimension in dimensions),
    )


def tidy(names: Names) -> Names:
    """Names as a person meant them: in one line, without spaces around them.

    Args:
        names: As they were typed.

    Returns:
        The names.
    """

    def lines(texts: Sequence[str]) -> tuple[str, ...]:
        return tuple(" ".join(text.split()) for text in texts)

    return Names(
        lines(names.features),
        lines(names.units),
        lines(names.actions),
        tuple(map(lines, names.labels)),
    )


def renamed(demonstrations: Demonstrations, names: Names) -> Demonstrations:
    """Demonstrations under other names.

    Args:
        demonstrations: N pairs.
        names: As many as they have.

    Returns:
        The same pairs.

    Raises:
        InputError: If a name is empty, stands twice, is one that formulas cannot name, or their
            number is another.
    """
    _check("feature", names.features)
    _check("action", names.actions)
    for action, labels in zip(names.actions, names.labels, strict=True):
        _check(f"label of action {action!r}", labels)
    own = names_of(demonstrations)
    counts = [
        (len(one.features), len(one.units), len(one.actions), tuple(map(len, one.labels)))
        for one in (own, names)
    ]
    if counts[0] != counts[1]:
        raise InputError(
            "the names are for other demonstrations: the number of features, actions or labels "
            "differs; name these"
        )
    return replace(
        demonstrations,
        feature_names=names.features,
        feature_units=names.units,
        derived=derived_over(demonstrations.derived, range(len(names.features)), names.features),
        action_names=names.actions,
        label_names=names.labels if demonstrations.is_discrete else demonstrations.label_names,
    )


class InOrder(NamedTuple):
    """Demonstrations in the order of an environment.

    Attributes:
        demonstrations: The same pairs.
        notes: What is to be said of that order, as clauses; none where it was the same.
    """

    demonstrations: Demonstrations
    notes: tuple[str, ...]


def in_order_of(demonstrations: Demonstrations, description: EnvironmentDescription) -> InOrder:
    """Put features and action dimensions into an environment's order, by their names.

    Args:
        demonstrations: N pairs.
        description: Of the environment.

    Returns:
        The same object where the order is the same.

    Raises:
        InputError: If there are more or fewer, or their names are of other things.
    """
    own = names_of(demonstrations)
    there, wanted = len(own.features), len(description.feature_names)
    if there != wanted:
        raise InputError(
            f"the demonstrations have {there} feature{'' if there == 1 else 's'} and "
            f"{description.env_id} has {wanted}; choose the environment that they are from"
        )
    first = NamedFeatures("the demonstrations", own.features, demonstrations.env_id)
    second = NamedFeatures(description.env_id, description.feature_names, description.env_id)
    features = line_up(first, second)
    orders = [features]
    if features.how == "permuted":
        demonstrations = replace(
            demonstrations,
            observations=demonstrations.observations[:, features.places],
            derived=derived_over(
                demonstrations.derived, features.inverse, features.put(own.features)
            ),
            feature_names=features.put(own.features),
            feature_units=features.put(own.units),
            indicators=features.put(demonstrations.indicators or ()) or None,
        )
    if len(own.actions) > 1 or len(description.action_names) > 1:
        actions = line_up(
            first._replace(names=own.actions),
            second._replace(names=description.action_names),
            what="action dimensions",
        )
        orders.append(actions)
        if actions.how == "permuted":
            demonstrations = replace(
                demonstrations,
                actions=demonstrations.action_columns[:, actions.places],
                action_names=actions.put(own.actions),
                label_names=actions.put(demonstrations.label_names or ()) or None,
                label_first=actions.put(demonstrations.label_first or ()) or None,
                label_codes=actions.put(demonstrations.label_codes or ()) or None,
                action_low=actions.put(demonstrations.action_low or ()) or None,
                action_high=actions.put(demonstrations.action_high or ()) or None,
            )
    return InOrder(demonstrations, tuple(order.note for order in orders if order.note))


def renamed_description(
    description: EnvironmentDescription, names: Names
) -> EnvironmentDescription | None:
    """An environment under the names of demonstrations or rules.

    Args:
        description: Of the environment.
        names: Perhaps of another one.

    Returns:
        None where the number of features, actions or labels differs.
    """
    counts = tuple(map(len, names.labels)) if description.is_discrete else ()
    own = tuple(map(len, description.label_names)) if description.is_discrete else ()
    widths = (len(description.feature_names), len(description.action_names), own)
    if (len(names.features), len(names.actions), counts) != widths:
        return None
    return replace(
        description,
        feature_names=names.features,
        feature_units=names.units,
        action_names=names.actions,
        label_names=names.labels if description.is_discrete else description.label_names,
    )


def _check(what: str, names: tuple[str, ...]) -> None:
    places: dict[str, int] = {}
    for place, name in enumerate(names):
        if not name.strip():
            raise InputError(f"{what} {place} has an empty name; give it one")
        if name in places:
            raise InputError(
                f"the name {quoted(name)} stands twice, for {what} {places[name]} and {place}; "
                "give each its own"
            )
        places[name] = place
