from __future__ import annotations

import json

import pytest

from sarl_core import InputError
from sarl_core.mining.editing.edit_files import edits_from_json, edits_to_json
from sarl_core.mining.editing.edits import (
    Add,
    Change,
    Move,
    Pin,
    Regrow,
    Remove,
    Switch,
    Unpin,
    apply,
)
from sarl_core.mining.validation.holding_out import with_held_out
from tests.mining.test_editing import ABOVE, DATA, FINE, manual

TRIED = with_held_out(FINE, DATA)
EDITS = (
    Switch(TRIED[0].id, on=False),
    Pin(TRIED[1]),
    Pin(TRIED[2]),
    Move(TRIED[2].id, up=True),
    Unpin(TRIED[1].id),
    Add(manual(TRIED, ABOVE)),
    Change(manual(TRIED, ABOVE, action=2)),
    Add(manual(TRIED, ABOVE, rule_id="manual.2")),
    Remove("manual.2"),
    Regrow(0, 4, 1, 0.1),
)


def test_edits_come_back_as_they_were_and_make_the_same_rules() -> None:
    read = edits_from_json(edits_to_json(EDITS), TRIED, name="the edits")
    assert read == EDITS
    assert apply(TRIED, read).digest == apply(TRIED, EDITS).digest != TRIED.digest


def test_the_same_edits_are_written_alike() -> None:
    read = edits_from_json(edits_to_json(EDITS), TRIED, name="the edits")
    assert edits_to_json(read) == edits_to_json(EDITS)


def written(**changed: object) -> str:
    return json.dumps({"format": "sarl-edits", "version": 1, "edits": [], **changed})


RULE = json.loads(edits_to_json([Pin(TRIED[0])]))["edits"][0]["rule"]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "the edits cannot be read"),
        ("[]", "the edits holds no edits"),
        (written(format="sarl-rules"), "the edits holds no edits"),
        (written(version=2), "a newer version"),
        (written(more=1), "more"),
        (written(edits=[{"do": "switch", "rule_id": "0.1"}]), "'on' is missing in edits 1"),
        (written(edits=[{"do": "format the disk"}]), "edits 1"),
        (written(edits=[{"do": "switch", "rule_id": 1, "on": True}]), "edits 1"),
        (written(edits=[{"do": "regrow", "part": "__import__('os')"}]), "no part to regrow"),
        (written(edits=[{"do": "add", "rule": {**RULE, "action": 9}}]), "action 9 is none"),
        (written(edits=[{"do": "pin", "rule": {**RULE, "dimension": 3}}]), "dimension 3"),
        (written(edits=[{"do": "pin", "rule": {**RULE, "samples": 10**6}}]), "'samples'"),
    ],
)
def test_what_is_no_edit_is_refused_in_a_sentence(text: str, said: str) -> None:
    with pytest.raises(InputError, match="the edits") as error:
        edits_from_json(text, TRIED, name="the edits")
    assert said in str(error.value)
    assert "\n" not in str(error.value)
