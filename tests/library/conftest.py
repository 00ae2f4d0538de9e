"""Libraries in a folder and in a real PostgreSQL, which is started for the tests."""

from __future__ import annotations

import getpass
import os
import pwd
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from uuid import uuid4

import pytest

from sarl_core.library import Library, Quota
from sarl_core.library.place import LibraryPlace, place_of

PROGRAMS = sorted(Path("/usr/lib/postgresql").glob("*/bin"))


@pytest.fixture(scope="session")
def server() -> Iterator[str]:
    """Address of a PostgreSQL server of this test process, without a database's name."""
    assert PROGRAMS, "PostgreSQL is missing; make test installs it"
    programs = PROGRAMS[-1]
    # It refuses to be root's.
    user = "postgres" if os.geteuid() == 0 else getpass.getuser()
    account = pwd.getpwnam(user)
    folder = Path(tempfile.mkdtemp(prefix="sarl-postgresql-"))
    os.chown(folder, account.pw_uid, account.pw_gid)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]

    def call(program: str, *arguments: str) -> None:
        subprocess.run(
            [programs / program, *arguments],
            user=account.pw_uid if os.geteuid() == 0 else None,
            group=account.pw_gid if os.geteuid() == 0 else None,
            extra_groups=[] if os.geteuid() == 0 else None,
            cwd=folder,
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    data = str(folder / "data")
    call("initdb", "--pgdata", data, "--auth", "trust", "--username", "sarl", "--no-sync")
    options = f"-p {port} -k {folder} -c listen_addresses=127.0.0.1 -c fsync=off"
    call(
        "pg_ctl", "--pgdata", data, "--wait", "--options", options, "--log", data + ".log", "start"
    )
    try:
        yield f"postgresql://sarl@127.0.0.1:{port}"
    finally:
        call("pg_ctl", "--pgdata", data, "--mode", "immediate", "stop")
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(params=["SQLite", "PostgreSQL"])
def place(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> LibraryPlace:
    """Where a library may be that nothing is in yet."""
    if request.param == "SQLite":
        return place_of(tmp_path / "library")
    server = request.getfixturevalue("server")
    name = f"test_{uuid4().hex}"
    from sqlalchemy import create_engine, text

    engine = create_engine(
        server.replace("postgresql:", "postgresql+psycopg:") + "/postgres",
        isolation_level="AUTOCOMMIT",
    )
    with engine.connect() as connection:
        connection.execute(text(f"CREATE DATABASE {name}"))
    engine.dispose()
    monkeypatch.setenv("SARL_LIBRARY_FILES", str(tmp_path / "files"))
    return place_of(f"{server}/{name}")


@pytest.fixture
def opened(place: LibraryPlace) -> Iterator[Callable[..., Library]]:
    """Call it to open the library; what was opened is closed in the end."""
    libraries: list[Library] = []

    def open_(quota: Quota | None = None) -> Library:
        libraries.append(Library(place, quota=quota))
        return libraries[-1]

    yield open_
    for library in libraries:
        library.close()


@pytest.fixture
def library(opened: Callable[..., Library]) -> Library:
    """An empty library."""
    return opened()
