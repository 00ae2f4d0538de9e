"""Where a library is: a folder, or a PostgreSQL database with a folder for its files."""

from __future__ import annotations

import getpass
import os
from dataclasses import dataclass
from pathlib import Path

from sarl_core.errors import InputError, quoted

LIBRARY = "SARL_LIBRARY"  # environment variable: a folder, or the address of a database
LIBRARY_FILES = "SARL_LIBRARY_FILES"  # the folder of the files, where that is a database
AUTHOR = "SARL_AUTHOR"  # environment variable: who works here
_DATABASE = "library.sqlite3"
_POSTGRESQL = ("postgresql://", "postgres://")


@dataclass(frozen=True)
class LibraryPlace:
    """Where a library is.

    Attributes:
        address: Of the database, as SQLAlchemy takes it.
        folder: In which large things lie as files.
        said: How a sentence calls it, without a password.
    """

    address: str
    folder: Path
    said: str

    @property
    def is_folder(self) -> bool:
        """Whether the database is a file in that folder."""
        return self.address.startswith("sqlite")

    @property
    def is_new(self) -> bool:
        """Whether it is a folder in which nothing was ever kept; nothing is made by looking.

        Raises:
            OSError: If it cannot be looked into.
        """
        return self.is_folder and not self.database_file.is_file()

    @property
    def database_file(self) -> Path:
        """The file of the database, where it is one."""
        return self.folder.absolute() / _DATABASE


def place_of(text: str | Path | None = None) -> LibraryPlace:
    """Where a library is.

    Args:
        text: A folder, or the address of a PostgreSQL database; the environment variable
            `LIBRARY` where not given, and the user's data directory where that is not set.

    Returns:
        The place; nothing is made there.

    Raises:
        InputError: If it is an address of something else.
    """
    given = str(os.environ.get(LIBRARY, "") if text is None else text).strip()
    if given.startswith(_POSTGRESQL):
        address = "postgresql+psycopg://" + given.partition("://")[2]
        from sqlalchemy.engine import make_url
        from sqlalchemy.exc import ArgumentError

        try:
            said = make_url(address).render_as_string(hide_password=True)
        except (ArgumentError, ValueError) as error:
            raise InputError(
                f"the address of the library's database cannot be read; set {LIBRARY} to one like "
                "postgresql://user:password@host/database"
            ) from error
        folder = os.environ.get(LIBRARY_FILES, "").strip()
        return LibraryPlace(
            address, Path(folder) if folder else _own(), said.replace("+psycopg", "")
        )
    if "://" in given:
        raise InputError(
            f"the library is said to be at {quoted(given.partition('://')[0] + '://...')}, which "
            f"is neither a folder nor PostgreSQL; set {LIBRARY} to one of these"
        )
    path = Path(given).expanduser() if given else _own()
    return LibraryPlace(f"sqlite:///{path.absolute() / _DATABASE}", path, str(path))


def usual_author() -> str:
    """Who works here, where nobody says so: the environment variable `AUTHOR`, or the account."""
    given = os.environ.get(AUTHOR, "").strip()
    if given:
        return given
    try:
        return getpass.getuser()
    except (OSError, KeyError, ImportError):  # of an account without a name
        return "somebody"


def _own() -> Path:
    """The user's data directory."""
    from platformdirs import user_data_path

    return user_data_path("sarl-explorer", appauthor=False) / "library"
