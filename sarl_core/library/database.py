"""A library's database: opened, brought up to date, read, and written whole or not at all."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, Engine, create_engine, event, inspect, select, text
from sqlalchemy.exc import DBAPIError, SQLAlchemyError

from sarl_core.errors import InputError, WorkError
from sarl_core.library.place import LibraryPlace
from sarl_core.library.tables import NEWEST, metadata, versions

_PATIENCE = 30  # seconds that a writer waits for another
_REACHED_IN = 10  # seconds, or a server counts as out of reach
_WRITERS = 7_205_759_403  # the lock that writers of one PostgreSQL library take, one at a time


class Database:
    """The tables of one library."""

    def __init__(self, place: LibraryPlace) -> None:
        """Open it, and bring it up to date.

        Args:
            place: Where it is.

        Raises:
            InputError: If it was made by a newer version, or is no library.
            WorkError: If it cannot be reached, read or written.
        """
        self._said = place.said
        self._engine = _engine(place)
        try:
            with _in_words(self._said):
                self._bring_up_to_date()
        except BaseException:
            self.close()
            raise

    @contextmanager
    def reading(self) -> Iterator[Connection]:
        """What does not change while it is read.

        Raises:
            WorkError: If it cannot be read.
        """
        with _in_words(self._said), self._engine.begin() as connection:
            yield connection

    @contextmanager
    def writing(self) -> Iterator[Connection]:
        """One writer at a time; all that is written inside counts, or nothing.

        Raises:
            WorkError: If it cannot be written.
        """
        options = {"sarl_writes": True}
        with (
            _in_words(self._said),
            self._engine.connect().execution_options(**options) as connection,
            connection.begin(),
        ):
            if connection.dialect.name == "postgresql":
                connection.execute(text(f"SELECT pg_advisory_xact_lock({_WRITERS})"))
            yield connection

    def close(self) -> None:
        """Let go of its connections."""
        self._engine.dispose()

    def _bring_up_to_date(self) -> None:
        with self.reading() as connection:
            version = _version(connection)
        if version == NEWEST or (version is None and self._made()):
            return
        from alembic import command
        from alembic.config import Config
        from alembic.script import ScriptDirectory

        config = Config()
        config.set_main_option("script_location", str(Path(__file__).parent / "migrations"))
        config.set_main_option("path_separator", "os")
        known = {one.revision for one in ScriptDirectory.from_config(config).walk_revisions()}
        if version is not None and version not in known:
            raise InputError(
                f"the library in {self._said} was made by a newer version of this program; install "
                "that version, or choose another place with SARL_LIBRARY"
            )
        # Another process may do the same: then there is nothing left to do, which Alembic sees.
        with self.writing() as connection:
            config.attributes["connection"] = connection
            command.upgrade(config, "head")

    def _made(self) -> bool:
        """Make the tables where there are none, as all migrations together would, but sooner."""
        with self.writing() as connection:
            if inspect(connection).get_table_names():  # another process was first
                return _version(connection) == NEWEST
            metadata.create_all(connection)
            versions.create(connection)
            connection.execute(versions.insert().values(version_num=NEWEST))
        return True


def is_there(place: LibraryPlace) -> bool:
    """Whether there is a library; nothing is made by looking.

    Args:
        place: Where it would be.

    Raises:
        WorkError: If the database cannot be reached.
    """
    if place.is_folder:
        return not place.is_new
    engine = _engine(place)
    try:
        with _in_words(place.said), engine.connect() as connection:
            return _version(connection) is not None
    finally:
        engine.dispose()


@contextmanager
def _in_words(place: str) -> Iterator[None]:
    """Say in a sentence what a database says in its own words."""
    try:
        yield
    except DBAPIError as error:
        reason = " ".join(str(error.orig).split())
        if "not a database" in reason:
            raise InputError(
                f"in {place} lies a file that is no library; choose another place with SARL_LIBRARY"
            ) from error
        raise WorkError(
            f"the library in {place} cannot be used ({reason}); look after its disk, or choose "
            "another place with SARL_LIBRARY"
        ) from error
    except SQLAlchemyError as error:
        raise WorkError(
            f"the library in {place} cannot be used ({' '.join(str(error).split())}); choose "
            "another place with SARL_LIBRARY"
        ) from error


def _engine(place: LibraryPlace) -> Engine:
    if not place.is_folder:
        try:
            return create_engine(
                place.address,
                pool_pre_ping=True,
                connect_args={"connect_timeout": _REACHED_IN},
            )
        except ModuleNotFoundError as error:
            raise WorkError(
                "a library in PostgreSQL needs psycopg, which is not installed; run pip install "
                "'sarl-explorer[server]'"
            ) from error
    try:
        place.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise WorkError(
            f"the library in {place.said} cannot be made ({error.strerror or error}); choose "
            "another place with SARL_LIBRARY"
        ) from error
    engine = create_engine(place.address, connect_args={"timeout": _PATIENCE})

    @event.listens_for(engine, "connect")
    def _connected(connection: Any, _: object) -> None:
        connection.isolation_level = None  # else Python begins transactions where it thinks fit
        connection.execute("PRAGMA foreign_keys=ON")

    @event.listens_for(engine, "begin")
    def _begun(connection: Connection) -> None:
        # Who reads first and writes then may find that another has written: writers wait at once.
        writes = connection.get_execution_options().get("sarl_writes")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if writes else "BEGIN")

    return engine


def _version(connection: Connection) -> str | None:
    """The last step that its tables have taken; None where there are none yet."""
    if not inspect(connection).has_table(versions.name):
        return None
    return connection.execute(select(versions.c.version_num)).scalar()
