"""What the owner of a dashboard offers its visitors."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from sarl_core import Environment, InputError
from sarl_core.agents.offers import Offers
from sarl_core.serving.settings import read_settings

SETTINGS = """
[[environments]]
id = "crane_task:Crane-v0"
failure = "crashed"
wrappers = ["crane_task:named"]
arguments = { load = 3.5, wind = [1, 2] }

[[environments]]
id = "CartPole-v1"

[agents]
operator = "crane_task:operator"
"""


def test_a_settings_file_says_what_is_offered_in_either_language(tmp_path: Path) -> None:
    first, second = tmp_path / "offers.toml", tmp_path / "offers.json"
    first.write_text(SETTINGS)
    crane = {
        "id": "crane_task:Crane-v0",
        "failure": "crashed",
        "wrappers": ["crane_task:named"],
        "arguments": {"wind": [1, 2], "load": 3.5},
    }
    second.write_text(
        json.dumps(
            {
                "environments": [crane, {"id": "CartPole-v1"}],
                "agents": {"operator": "crane_task:operator"},
            }
        )
    )
    offers = read_settings(first).offers
    assert offers == read_settings(second).offers == Offers.from_text(offers.to_text())
    assert offers.environments[0] == Environment(
        "crane_task:Crane-v0",
        '{"load": 3.5, "wind": [1, 2]}',
        ("crane_task:named",),
        failure="crashed",
    )
    assert offers.agents == (("operator", "crane_task:operator"),)


def test_an_offered_environment_goes_by_its_id_with_and_without_its_module() -> None:
    crane = Environment("crane_task:Crane-v0", '{"load": 3}')
    offers = Offers((crane, Environment("CartPole-v1")))
    assert offers.environment("crane_task:Crane-v0") == offers.environment("Crane-v0") == crane
    assert offers.environment("other_task:Crane-v0") is None
    assert Offers.from_text("") == Offers()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("environments = 3", "environments"),
        ("[[environments]]\nname = 'Crane-v0'", "'name' is not known"),
        ("[[environments]]\nfailure = 'crashed'", "'id' is missing"),
        ("[agents]\nnovice = 'crane:agent'", "already"),
        ("[[environments]]\nid = 'A-v0'\n[[environments]]\nid = 'A-v0'", "offered twice"),
        ("[", "cannot be read"),
    ],
)
def test_settings_that_say_something_else_are_refused(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "offers.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_settings(path)
