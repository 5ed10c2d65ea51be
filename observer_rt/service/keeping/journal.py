"""The journal: a row an injection in an SQLite file, which is readable while it is written and after any kill."""

import contextlib
import os
import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

from observer_rt.foundation.errors import RunError, UserError
from observer_rt.service.keeping.journal_columns import COLUMNS, Value

APPLICATION_ID = 0x4F425254  # "OBRT", in the file's header
SCHEMA = 1
PATIENCE = 2.0  # s for another program that has the file locked

_RUN = """CREATE TABLE IF NOT EXISTS run (
    started_unix_us INTEGER PRIMARY KEY,
    started_utc TEXT NOT NULL,
    stopped_utc TEXT,
    software_version TEXT NOT NULL,
    model_sha256 TEXT NOT NULL,
    injector TEXT NOT NULL,
    bench_file TEXT NOT NULL,
    configuration_json TEXT NOT NULL
)"""
_INJECTION = f"""CREATE TABLE IF NOT EXISTS injection (
    run INTEGER NOT NULL REFERENCES run (started_unix_us),
    {", ".join(f"{column.name} {column.kind}" for column in COLUMNS)},
    PRIMARY KEY (run, number)
)"""
# a batch may come again when it is not known whether its transaction reached the disk
_ADD_RUN = "INSERT OR IGNORE INTO run VALUES (?, ?, NULL, ?, ?, ?, ?, ?)"
_ADD_INJECTION = (
    f"INSERT OR IGNORE INTO injection (run, {', '.join(column.name for column in COLUMNS)}) "
    f"VALUES (:run, {', '.join(f':{column.name}' for column in COLUMNS)})"
)
_ADD_MASS = "UPDATE injection SET measured_mass_mg = ? WHERE run = ? AND number = ?"


@dataclass(frozen=True)
class Run:
    """One run of the daemon; its injections refer to it by the time it began."""

    started_unix_us: int
    started_utc: str
    software_version: str
    model_sha256: str
    injector: str  # its name in the bench file, empty where that has one
    bench_file: str
    configuration_json: str


@dataclass(frozen=True)
class MassRow:
    """What was measured of an injection that has a row."""

    number: int
    mass_mg: float


class Journal:
    """Writes the rows of one run; a file that is taken away meanwhile is begun anew."""

    def __init__(self, path: Path, run: Run) -> None:
        """Raises `UserError` for a file that is no journal; the file is made by the first `write`."""
        self._path = path
        self._run = run
        self._connection: sqlite3.Connection | None = None
        self._identity: os.stat_result | None = None
        require_journal(path)

    def write(self, rows: Iterable[dict[str, Value]], masses: Sequence[MassRow] = ()) -> None:
        """Add rows of `row_of`, and what was measured of injections: all of it reaches the disk, or nothing.

        Raises:
            RunError: nothing was written.
        """
        run = self._run.started_unix_us
        try:
            with self._opened() as connection:
                connection.execute("BEGIN IMMEDIATE")
                connection.execute(_ADD_RUN, astuple(self._run))
                connection.executemany(_ADD_INJECTION, ({**row, "run": run} for row in rows))
                connection.executemany(_ADD_MASS, [(mass.mass_mg, run, mass.number) for mass in masses])
        except (sqlite3.Error, OSError) as error:
            self._give_up()
            raise self._failed(error) from error

    def close(self, stopped_utc: str) -> None:
        """Note the clean stop. Raises `RunError` when it cannot be written."""
        try:
            with self._opened() as connection:
                connection.execute(
                    "UPDATE run SET stopped_utc = ? WHERE started_unix_us = ?",
                    (stopped_utc, self._run.started_unix_us),
                )
            with contextlib.suppress(sqlite3.OperationalError):  # while somebody reads
                # then whoever may read the file can, even where nothing can be made beside it
                connection.execute("PRAGMA journal_mode = DELETE")
        except (sqlite3.Error, OSError) as error:
            raise self._failed(error) from error
        finally:
            self._give_up()

    def _opened(self) -> sqlite3.Connection:
        """The connection to the file that is there now."""
        if self._connection is not None and not self._is_there():
            self._give_up()
        if self._connection is None:
            self._connection = _connected(self._path)
            self._identity = self._path.stat()
        return self._connection

    def _is_there(self) -> bool:
        try:
            return self._identity is not None and os.path.samestat(self._path.stat(), self._identity)
        except FileNotFoundError:
            return False

    def _failed(self, error: sqlite3.Error | OSError) -> RunError:
        is_damaged = isinstance(error, sqlite3.DatabaseError) and not isinstance(
            error, sqlite3.OperationalError
        )
        advice = "; move the file away, and a new one is begun" if is_damaged else ""
        return RunError(f"{self._path}: the journal cannot be written: {error}{advice}")

    def _give_up(self) -> None:
        """Close what is open: the next write begins with a connection of its own."""
        if self._connection is not None:
            with contextlib.suppress(sqlite3.Error):
                self._connection.close()
        self._connection = None


def require_journal(path: Path) -> None:
    """Raise `UserError` unless the file is a journal this version knows, empty, or not there."""
    if not path.exists() or path.stat().st_size == 0:
        return
    try:
        with contextlib.closing(
            sqlite3.connect(path.absolute().as_uri() + "?mode=ro", uri=True)
        ) as connection:
            (application,) = connection.execute("PRAGMA application_id").fetchone()
            (schema,) = connection.execute("PRAGMA user_version").fetchone()
            (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:
        return  # locked, or no right to read: told by whoever needs it
    except sqlite3.DatabaseError as error:
        raise UserError(
            str(path), f"is no journal of injections: {error}", "name another file, or move this one away"
        ) from None
    if application != APPLICATION_ID and tables:
        raise UserError(
            str(path), "is a database of another program", "name another file for the journal of injections"
        )
    if schema > SCHEMA:
        raise UserError(
            str(path),
            f"was written by a newer version: schema {schema}, this one knows {SCHEMA}",
            "use that version, or name another file",
        )


def _connected(path: Path) -> sqlite3.Connection:
    """A connection that survives power cuts, to a journal with all columns."""
    connection = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        # after every batch the file is whole without its -wal: whoever copies or moves it away loses nothing
        connection.execute("PRAGMA wal_autocheckpoint = 1")
        with connection:
            connection.execute("BEGIN IMMEDIATE")
            make_tables(connection)
    except BaseException:
        connection.close()
        raise
    return connection


def make_tables(connection: sqlite3.Connection) -> None:
    """Make what a journal consists of, as far as it is not there."""
    connection.execute(_RUN)
    connection.execute(_INJECTION)
    there = {name for _, name, *_ in connection.execute("PRAGMA table_info (injection)")}
    for column in COLUMNS:  # of a journal begun by a version that learned less
        if column.name not in there:
            connection.execute(f"ALTER TABLE injection ADD COLUMN {column.name} {column.kind}")
    connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
    connection.execute(f"PRAGMA user_version = {SCHEMA}")
