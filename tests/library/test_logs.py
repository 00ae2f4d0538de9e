"""A log is kept as it was, with what was said of its columns."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from sarl_core import load_demonstrations
from sarl_core.demonstrations.formats import ColumnRole
from sarl_core.errors import InputError
from sarl_core.library import Library
from sarl_core.library.bundles import export_bundle, import_bundle
from sarl_core.library.contents import annotated_file
from sarl_core.library.logs import add_log, log_content, log_file_name, log_roles
from sarl_core.library.results import add_note

TABLE = b"run,a,b,what,t\n1,0.5,2,left,0\n1,0.25,3,right,40\n2,1,1,left,80\n"
ROLES = {
    "run": ColumnRole("episode"),
    "a": ColumnRole("feature", unit="m/s"),
    "b": ColumnRole("feature"),
    "what": ColumnRole("action", kind="labels"),
    "t": ColumnRole("time", unit="ms"),
}


@pytest.fixture
def library(tmp_path: Path) -> Iterator[Library]:
    with Library(tmp_path / "here") as library:
        yield library


def test_a_log_is_kept_once_for_each_way_of_reading_it(library: Library, tmp_path: Path) -> None:
    plain = add_log(library, TABLE, "lab.csv", author="Ada", roles=ROLES)
    assert add_log(library, TABLE, "lab.csv", author="Ada", roles=ROLES) == plain
    other = ROLES | {"b": ColumnRole("ignore")}
    assert add_log(library, TABLE, "lab.csv", author="Ada", roles=other).id != plain.id
    assert add_log(library, TABLE, "lab.csv", author="Eve", roles=ROLES).id != plain.id
    assert log_content(library, plain) == TABLE
    assert log_roles(plain) == ROLES
    assert log_file_name(plain) == "lab.csv"
    assert (plain.details["steps"], plain.details["episodes"]) == (3, 2)


def test_a_command_has_it_read_as_was_said(library: Library, tmp_path: Path) -> None:
    item = add_log(library, TABLE, "lab.csv", author="Ada", roles=ROLES)
    log = load_demonstrations(annotated_file(library, item, tmp_path))
    assert [one.unit for one in log.features] == ["m/s", ""]
    assert np.array_equal(log.observations, np.float32([[0.5, 2], [0.25, 3], [1, 1]]))
    assert log.times is not None


def test_what_cannot_be_read_is_not_kept(library: Library) -> None:
    with pytest.raises(InputError):
        add_log(library, b"nothing", "log.csv", author="Ada")
    with pytest.raises(InputError, match=r"no column 'x'|x"):
        add_log(library, TABLE, "lab.csv", author="Ada", roles={"x": ColumnRole("feature")})
    assert library.items() == []


def test_other_things_are_no_logs(library: Library) -> None:
    note = add_note(library, "a,b", author="Ada")
    with pytest.raises(InputError, match="is no log"):
        log_content(library, note)


def test_a_log_travels(library: Library, tmp_path: Path) -> None:
    item = add_log(library, TABLE, "lab.csv", author="Ada", roles=ROLES)
    export_bundle(library, [item.id], tmp_path / "log.sarl")
    with Library(tmp_path / "there") as there:
        (brought,) = import_bundle(there, tmp_path / "log.sarl", author="Bob")
        assert log_content(there, brought) == TABLE
        assert log_roles(brought) == ROLES
