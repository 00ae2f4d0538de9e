"""Logs that are audited on a cluster: the document of one memory, value for value."""

from __future__ import annotations

import json
import os
import signal
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from sarl_core import (
    InputError,
    RuleSet,
    Shield,
    audit,
    audit_files,
    grow_policy_trees,
    load_demonstrations,
    load_rules,
    mine_never_rules,
    mine_rules,
    save_demonstrations,
)
from sarl_core.auditing import near
from sarl_core.auditing.comparison import LogComparison
from sarl_core.auditing.distributed import audit_on_cluster
from sarl_core.auditing.guards import MEASURES
from sarl_core.auditing.numbers import AuditNumbers
from sarl_core.auditing.reference import reference_of
from sarl_core.clusters import cluster
from sarl_core.mining.distributed import pieces
from sarl_core.mining.distributed.pieces import Reading, parquet_paths
from sarl_core.mining.never.never_rules import with_never_rules
from sarl_core.progress import CancelledError
from tests.auditing.conftest import in_files

DATA = Path(__file__).resolve().parents[2] / "data"


@pytest.fixture(autouse=True)
def small_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that all that happens to many rows happens to few."""
    monkeypatch.setattr(pieces, "ROWS", 500)


def document(held: AuditNumbers) -> str:
    return json.dumps(held.to_dict())


def held_far(client: Any, rules: RuleSet, folder: Path, **more: Any) -> AuditNumbers:
    reading = Reading(missing="drop")
    return audit_on_cluster(client, Shield(rules), parquet_paths([folder]), reading, **more)


@pytest.mark.parametrize("cuts", [[], [1_234], [300, 301, 2_000, 3_900]])
@pytest.mark.parametrize("compared", [False, True])
def test_the_document_is_that_of_one_memory(
    fleet: pd.DataFrame,
    fleet_rules: RuleSet,
    client: Any,
    tmp_path: Path,
    cuts: list[int],
    compared: bool,
) -> None:
    folder = in_files(fleet, tmp_path / "logs", cuts)
    whole = load_demonstrations(folder, missing="drop")
    before = whole.select(range(0, 40, 3)) if compared else None
    reference = None if before is None else reference_of(Shield(fleet_rules), before)
    near_by = audit(fleet_rules, whole, demonstrations=before)
    far = held_far(client, fleet_rules, folder, reference=reference)
    assert document(far) == document(near_by)
    assert far.broken > 100
    assert {name: measure(far) for name, measure in MEASURES.items()} == {
        name: measure(near_by) for name, measure in MEASURES.items()
    }
    assert LogComparison(far, far).to_dict() == LogComparison(near_by, near_by).to_dict()


def test_the_number_of_workers_does_not_matter(
    fleet: pd.DataFrame, fleet_rules: RuleSet, client: Any, tmp_path: Path
) -> None:
    folder = in_files(fleet, tmp_path / "logs", [700, 2_100])
    alone = audit_files(fleet_rules, folder, "local:1", missing="drop")
    assert document(alone) == document(held_far(client, fleet_rules, folder))


def test_a_sample_of_the_steps_says_how_far_features_spread(
    fleet: pd.DataFrame,
    fleet_rules: RuleSet,
    client: Any,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # Nearly all steps lack a value, so that what is drawn at first is too little.
    gap = fleet["obs_gap [m]"].where((fleet.index % 50 < 2) | (fleet.index > 3_700))
    folder = in_files(fleet.assign(**{"obs_gap [m]": gap}), tmp_path / "logs", [2_000])
    whole = load_demonstrations(folder, missing="drop")
    every = audit(fleet_rules, whole)
    monkeypatch.setattr(near, "SAMPLE", 60)
    assert near.in_sample(near.sample_keys(whole)).sum() == 60
    few = audit(fleet_rules, whole)
    assert few.near_count != every.near_count
    assert document(held_far(client, fleet_rules, folder)) == document(few)


def test_words_and_labels_that_some_files_lack(
    fleet: pd.DataFrame, fleet_rules: RuleSet, client: Any, tmp_path: Path
) -> None:
    dry = fleet[fleet.obs_road == "dry"].assign(episode=lambda table: table.episode + 50)
    dry = dry[dry.action != "roll"]
    both = pd.concat([dry, fleet])
    folder = in_files(both, tmp_path / "logs", [len(dry)])
    far = held_far(client, fleet_rules, folder)
    assert document(far) == document(
        audit(fleet_rules, load_demonstrations(folder, missing="drop"))
    )


@pytest.mark.parametrize(
    ("rules", "log"),
    [("bipedal_walker_compact", "bipedal_walker"), ("driving_compact", "driving")],
)
def test_shipped_logs(rules: str, log: str, client: Any, tmp_path: Path) -> None:
    rule_set = load_rules(DATA / "rules" / f"{rules}.json")
    whole = load_demonstrations(DATA / "demonstrations" / f"{log}.parquet")
    (tmp_path / "logs").mkdir()
    for number, episodes in enumerate(np.array_split(whole.episodes[whole.episode_starts], 3)):
        path = tmp_path / "logs" / f"log-{number}.parquet"
        save_demonstrations(whole.select(episodes), path)
    shield = Shield(rule_set, projection="clip")
    files = parquet_paths([tmp_path / "logs"])
    far = audit_on_cluster(client, shield, files, Reading())
    again = load_demonstrations(tmp_path / "logs")
    assert document(far) == document(audit(rule_set, again, projection="clip"))


def test_a_worker_that_dies_in_the_middle_is_survived(
    fleet: pd.DataFrame, fleet_rules: RuleSet, client: Any, tmp_path: Path
) -> None:
    folder = in_files(fleet, tmp_path / "logs", [1_000, 3_000])
    killed: list[int] = []
    with cluster("local:2") as other:

        def kill(done: int, total: int) -> None:
            if not killed and done > 0.7 * total:
                killed.append(next(iter(other.run(os.getpid).values())))
                with suppress(ProcessLookupError):
                    os.kill(killed[0], signal.SIGKILL)

        survived = held_far(other, fleet_rules, folder, progress=kill)
    assert killed
    assert document(survived) == document(held_far(client, fleet_rules, folder))


def test_work_can_be_called_off(
    fleet: pd.DataFrame, fleet_rules: RuleSet, client: Any, tmp_path: Path
) -> None:
    folder = in_files(fleet, tmp_path / "logs", [1_000])
    with pytest.raises(CancelledError, match="nothing was kept"):
        held_far(client, fleet_rules, folder, progress=lambda done, total: done < 300)


FAULTS = {
    "other columns": (
        lambda table: table.rename(columns={"obs_gap [m]": "obs_distance [m]"}),
        r"log-1.parquet: it has no column 'obs_gap \[m\]', and log-0.parquet has; give",
    ),
    "no steps": (
        lambda table: table.assign(**{"obs_speed [m/s]": np.nan}),
        None,
    ),
    "a label that the rules do not know": (
        lambda table: table.assign(action=table.action.replace("go", "swerve")),
        r"log-1.parquet.*: the log holds the 'action' 'swerve' in row",
    ),
    "a word that the rules do not know": (
        lambda table: table.assign(obs_road=table.obs_road.replace("wet", "flooded")),
        "the log holds the road 'flooded' in row",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_file_unlike_the_others(
    fault: str, fleet: pd.DataFrame, fleet_rules: RuleSet, client: Any, tmp_path: Path
) -> None:
    change, sentence = FAULTS[fault]
    folder = in_files(fleet, tmp_path / "logs", [2_000])
    change(fleet[2_000:]).to_parquet(folder / "log-1.parquet", index=False)
    if sentence is None:  # they are left out, as anywhere
        whole = load_demonstrations(folder, missing="drop")
        assert document(held_far(client, fleet_rules, folder)) == document(
            audit(fleet_rules, whole)
        )
        return
    with pytest.raises(InputError, match=sentence):
        held_far(client, fleet_rules, folder)


def test_logs_without_a_step(
    fleet: pd.DataFrame, fleet_rules: RuleSet, client: Any, tmp_path: Path
) -> None:
    empty = fleet.assign(**{"obs_speed [m/s]": np.nan})
    with pytest.raises(InputError, match="so no step would be left; leave out the columns"):
        held_far(client, fleet_rules, in_files(empty, tmp_path / "logs", [2_000]))
    loose = fleet.drop(columns="episode")
    with pytest.raises(InputError, match="no column says to which episode a row belongs"):
        held_far(client, fleet_rules, in_files(loose, tmp_path / "loose", [2_000]))


@pytest.mark.parametrize("compared", [False, True])
@pytest.mark.parametrize("behind", [False, True])
def test_rules_that_forbid(
    fleet: pd.DataFrame, client: Any, tmp_path: Path, behind: bool, compared: bool
) -> None:
    folder = in_files(fleet, tmp_path / "logs", [300, 301, 2_000])
    whole = load_demonstrations(folder, missing="drop")
    trees = grow_policy_trees(whole.select(range(12)))
    rules = mine_never_rules(trees, epsilon=0.3, supp_min=0.02)
    if behind:
        demanding = mine_rules(trees, supp_min=0.2, conf_min=0.8)
        rules = with_never_rules(demanding, trees, 0.3)
        assert demanding.rules
    assert rules.forbids
    before = whole.select(range(0, 40, 3)) if compared else None
    reference = None if before is None else reference_of(Shield(rules), before)
    near_by = audit(rules, whole, demonstrations=before)
    assert near_by.broken > 100
    assert near_by.near_count > 20
    far = held_far(client, rules, folder, reference=reference)
    assert document(far) == document(near_by)
    assert LogComparison(far, far).to_dict() == LogComparison(near_by, near_by).to_dict()
