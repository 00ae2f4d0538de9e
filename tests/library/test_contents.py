"""Edits that are kept come back as they were, once for each author."""

from __future__ import annotations

import pytest

from sarl_core import InputError
from sarl_core.library import Library
from sarl_core.library.contents import add_edits, edits_of
from sarl_core.mining.editing.edits import Edit, Pin, Switch
from tests.mining.test_editing import FINE

EDITS: tuple[Edit, ...] = (Switch(FINE[0].id, on=False), Pin(FINE[1]))


def test_edits_come_back_and_stand_in_no_list(library: Library) -> None:
    item = add_edits(library, EDITS, "the rules", author="Ada")
    assert edits_of(library, library.item(item.id), FINE) == EDITS
    assert item.details == {"base": "the rules", "edits": 2}
    assert library.items("Ada") == []
    assert library.items("Ada", kind="edits") == [item]


def test_the_same_edits_are_kept_once_for_an_author_and_some_rules(library: Library) -> None:
    first = add_edits(library, EDITS, "the rules", author="Ada")
    assert add_edits(library, EDITS, "the rules", author="Ada").id == first.id
    others = [
        add_edits(library, EDITS, "the rules", author="Ben"),
        add_edits(library, EDITS, "other rules", author="Ada"),
        add_edits(library, EDITS[:1], "the rules", author="Ada"),
    ]
    assert len({first.id, *(other.id for other in others)}) == 4


def test_what_is_no_edit_is_refused(library: Library) -> None:
    item = library.add("note", "a note", {"text": (b"{}", ".json")}, author="Ada")
    with pytest.raises(InputError, match="'a note' is a note and holds no edits"):
        edits_of(library, item, FINE)
