from __future__ import annotations

import pickle
from pathlib import Path

import pytest

from sarl_core import Environment, InputError
from sarl_core.environments.description import describe_environment, make_environment
from sarl_core.environments.environment import with_time_limit

FLAT = "gymnasium.wrappers:FlattenObservation"


def test_an_environment_is_its_id_in_text_and_one_value_however_its_json_was_written() -> None:
    one = Environment("Pendulum-v1", '{"g": 3.0, "max_episode_steps":7}', (FLAT,))
    other = Environment("Pendulum-v1", '{ "max_episode_steps": 7,\n"g": 3.0 }', (FLAT,))
    assert (str(one), one, hash(one)) == ("Pendulum-v1", other, hash(other))
    assert pickle.loads(pickle.dumps(one)) == one


def test_arguments_and_wrappers_reach_the_environment_innermost_first() -> None:
    env = make_environment(
        Environment(
            "CartPole-v1",
            '{"max_episode_steps": 7}',
            (FLAT, "gymnasium.wrappers:RecordEpisodeStatistics"),
        )
    )
    assert env.spec.max_episode_steps == 7
    assert str(env).startswith("<RecordEpisodeStatistics<FlattenObservation<TimeLimit")
    moon = make_environment(Environment("Pendulum-v1", '{"g": 1.6}'))
    assert moon.unwrapped.g == 1.6
    assert (
        describe_environment(Environment("CartPole-v1", '{"max_episode_steps": 7}')).max_steps == 7
    )
    assert describe_environment("CartPole-v1").max_steps == 500


def test_a_time_limit_is_an_argument_and_nothing_else_changes() -> None:
    moon = Environment("Pendulum-v1", '{"g": 1.6}', (FLAT,), failure="fell")
    longer = with_time_limit(moon, 900)
    assert longer == Environment(
        "Pendulum-v1", '{"g": 1.6, "max_episode_steps": 900}', (FLAT,), failure="fell"
    )
    assert describe_environment(with_time_limit("CartPole-v1", 900)).max_steps == 900
    assert with_time_limit(longer, 5).keywords["max_episode_steps"] == 5


@pytest.mark.parametrize(
    ("arguments", "wrappers", "said"),
    [
        ('{"g"', (), "are no JSON"),
        ("[1]", (), "are JSON but no object"),
        ('{"g": NaN}', (), "are no JSON"),
        ('{"gravity": 3}', (), "takes no argument 'gravity'"),
        ('{"max_episode_steps": "x"}', (), "cannot be made with these arguments"),
        ("{}", ("crane",), "must be module:name"),
        ("{}", ("crane.py:Crane; 1",), "must be module:name"),
        ("{}", ("no_such_module:Crane",), "cannot be imported"),
        ("{}", ("math:Crane",), "math has no Crane"),
        ("{}", ("math:pi",), "cannot be called"),
        ("{}", ("math:sqrt",), "cannot be put around the environment"),
        ("{}", ("builtins:str",), "gives no environment but str"),
    ],
)
def test_what_cannot_be_made_is_said_in_a_sentence(
    arguments: str, wrappers: tuple[str, ...], said: str
) -> None:
    with pytest.raises(InputError, match=said):
        make_environment(Environment("Pendulum-v1", arguments, wrappers))


def test_a_module_that_fails_is_said_in_a_sentence(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_crane.py").write_text("raise RuntimeError('no licence')\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(InputError, match=r"cannot be imported \(RuntimeError: no licence\)"):
        make_environment(Environment("Pendulum-v1", wrappers=("broken_crane:Crane",)))
