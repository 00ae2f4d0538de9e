"""Certificates: what is tested, in which order it is counted, and what a file of one says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sarl_core import Environment, InputError, Shield, load_rules, make_agent, rollout
from sarl_core.rollouts.seeds import CERTIFIED, ROUNDS
from sarl_core.studies.certificate import Certificate, certify
from sarl_core.studies.certificate_files import (
    certificate_document,
    certificate_from,
    certificate_to_json,
    load_certificate,
    save_certificate,
)
from sarl_core.studies.sequential_test import sequential_test

DATA = Path(__file__).parents[2] / "data"
CART = "CartPole-v1"
SHORT = Environment(CART, '{"max_episode_steps": 60}')  # whole episodes, over soon


@pytest.fixture(scope="module")
def shield() -> Shield:
    return Shield(load_rules(DATA / "rules" / "cartpole_compact.json"))


@pytest.fixture(scope="module")
def certified(shield) -> Certificate:
    return certify(CART, "novice", shield, at_most=0.1)


def test_rules_that_hold_a_pole_are_certified(certified, shield):
    verdict = certified.verdict
    assert (verdict.certified, verdict.failures) == (True, 0)
    assert verdict.episodes == sequential_test(0.1).certified[0]
    assert (certified.seed, certified.last_seed) == (CERTIFIED, CERTIFIED + verdict.episodes - 1)
    assert certified.last_seed < ROUNDS
    subject = certified.subject
    assert (subject.env_id, subject.agent, subject.sampled) == (CART, "novice", True)
    assert subject.rules == len(shield.rule_set)
    assert subject.failure == "an end that is no time limit"
    assert subject.package.startswith("gymnasium ")


def test_failures_are_counted_in_the_order_of_the_seeds(shield):
    # Steps beyond 10 cm are common, so it takes a while and both kinds of episodes.
    environment = replace(SHORT, failure="abs(cart_position) > 0.1")
    found = certify(environment, "novice", shield, at_most=0.4, certainty=0.9, seed=700)
    played = rollout(
        environment, "novice", shield=shield, episodes=found.verdict.episodes, seed=700
    )
    wanted = sequential_test(0.4, 0.9).decided(played.failed, played.undecided)
    assert found.verdict == wanted
    assert wanted.failures > 0
    assert found.subject.failure == "a step at which abs(cart_position) > 0.1 is true"
    there = certify(environment, "novice", shield, at_most=0.4, certainty=0.9, seed=700, jobs=2)
    assert there.verdict == found.verdict
    assert there.subject == found.subject


def test_an_agent_that_fails_is_refused_and_one_cut_off_is_not_certified(shield):
    cut = certify(CART, "novice", shield, at_most=0.1, episodes=60, max_steps=20)
    assert (cut.verdict.certified, cut.verdict.undecided) == (None, 60)
    assert "cut off" in " ".join(cut.notes)
    falls = replace(SHORT, failure="abs(pole_angle) >= 0")
    refused = certify(falls, "novice", shield, at_most=0.1)
    assert refused.verdict.certified is False
    assert refused.verdict.failures == refused.verdict.episodes


def test_the_digest_of_an_agent_is_that_of_its_weights(shield):
    expert = make_agent("expert", CART)

    def subject_of(agent):  # episodes that are cut off at once say as much of it
        return certify(CART, agent, shield, at_most=0.3, max_steps=5).subject

    one = subject_of(expert)
    assert len(one.agent_digest) == 32
    assert subject_of("expert") == one
    other = make_agent("untrained", CART, seed=1)
    assert subject_of(other).agent_digest != one.agent_digest


@pytest.mark.parametrize("env_id", ["MountainCar-v0", "FrozenLake-v1"])
def test_where_nothing_is_a_failure_nothing_is_certified(env_id, shield):
    with pytest.raises(InputError, match=f"nothing to certify in {env_id}"):
        certify(env_id, "novice", shield, at_most=0.1)


def test_a_file_says_the_same_again(certified, tmp_path):
    path = tmp_path / "certificate.json"
    save_certificate(certified, path)
    assert load_certificate(path) == certified
    document = json.loads(path.read_text())
    assert document == certificate_document(certified)
    assert document["certified"] is True
    assert document["interval"]["low"] == 0.0
    with pytest.raises(InputError, match=r"does not end in \.json"):
        save_certificate(certified, tmp_path / "certificate.txt")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"format": "sarl-rules"}, "is no certificate"),
        ({"version": 2}, "a version that this program does not read"),
        ({"more": 1}, "'more' is not known to this version"),
        ({"episodes": 20}, "does not hold together"),
        ({"failures": 1}, "does not hold together"),
        ({"certified": False}, "does not hold together"),
        ({"certified": None}, "does not hold together"),
        ({"at_most": 0.01}, "cannot be read"),
        ({"at_most": 0.09}, "does not hold together"),
        ({"at_most": 0.0}, "a rate of 0 cannot be certified"),
        ({"seeds": {"first": 1, "last": 2}}, "does not hold together"),
        ({"looks": {"certified": [5], "refused": []}}, "does not hold together"),
        ({"failures": -1}, "cannot be read"),
    ],
)
def test_what_does_not_hold_together_is_refused(change, sentence, certified):
    document = json.loads(certificate_to_json(certified)) | change
    with pytest.raises(InputError, match=sentence):
        certificate_from(document, name="it")


def test_looks_that_another_processor_rounds_otherwise_are_read_as_they_are():
    path = Path(__file__).parents[2] / "data" / "rules" / "lunar_lander_combined.card.json"
    document = json.loads(path.read_text())["certificate"]
    read = certificate_from(document, name="it")
    late = 140
    for place, by, sentence in ((late, -2, ""), (late, -40, "does not hold"), (3, 5, "does not")):
        looks = list(read.test.refused)
        looks[place] = max(looks[place] + by, looks[place - 1])
        moved = document | {"looks": {"certified": list(read.test.certified), "refused": looks}}
        if sentence:
            with pytest.raises(InputError, match=sentence):
                certificate_from(moved, name="it")
            continue
        assert certificate_from(moved, name="it").test.refused == tuple(looks)
    early = [max(1, look - 3) for look in read.test.certified]  # which more failures would pass
    moved = document | {"looks": {"certified": early, "refused": list(read.test.refused)}}
    with pytest.raises(InputError, match="does not hold together"):
        certificate_from(moved, name="it")


def test_what_is_no_file_of_a_certificate_is_refused(tmp_path):
    path = tmp_path / "certificate.json"
    for content in (b"", b"{", b"[]", b"\xff\xfe\x00", b'{"format": NaN}'):
        path.write_bytes(content)
        with pytest.raises(InputError, match=r"certificate\.json"):
            load_certificate(path)
    with pytest.raises(InputError, match="cannot be read"):
        load_certificate(tmp_path / "nowhere.json")


def test_the_rate_is_that_of_its_episodes(certified):
    assert (certified.rate.count, certified.rate.of) == (0, certified.verdict.episodes)
    assert np.isclose(certified.rate.at_most, 1 - 0.05 ** (1 / certified.verdict.episodes))


def test_how_many_episodes_were_cut_off_is_one_number(shield):
    cut = certify(CART, "novice", shield, at_most=0.5, episodes=20, max_steps=5)
    assert cut.verdict.episodes == 20
    said = [note for note in cut.notes if "cut off" in note]
    assert len(said) == 1
    assert said[0].startswith("all 20 episodes were cut off after 5 steps")
