"""The journal: a row an injection in an SQLite file, readable while it is written and after any kill."""

import contextlib
import os
import sqlite3
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from observer_rt.config.bench import Bench
from observer_rt.daemon.state_file import model_hash
from observer_rt.engine.reports.injection_report import FIELDS, InjectionReport, Output, Value, columns_of, row_of
from observer_rt.engine.reports.news import MeasuredMass, News
from observer_rt.foundation.errors import RunError, UserError
from observer_rt.foundation.files import is_at
from observer_rt.foundation.units import MILLIGRAM, NANOSECONDS, NANOSECONDS_PER_MS
from observer_rt.foundation.version import __version__

APPLICATION_ID = 0x4F425254  # "OBRT", in the file's header
SCHEMA = 1
PATIENCE = 2.0  # s for another program that has the file locked
BATCH = 500  # entries in one transaction
MOST_WAITING = 10_000  # entries, some minutes of a full disk; those beyond are lost

_REPORTED = columns_of(FIELDS, Output.JOURNAL)
COLUMNS = {"judged_utc": str, **_REPORTED, "measured_mass_mg": float}
"""Columns of an injection beside its run, with their types; a measured mass is added later."""
_KINDS = {int: "INTEGER", bool: "INTEGER", float: "REAL", str: "TEXT"}
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
    {", ".join(f"{name} {_KINDS[kind]}" for name, kind in COLUMNS.items())},
    PRIMARY KEY (run, number)
)"""
# a batch may come again when it is not known whether its transaction reached the disk
_ADD_RUN = "INSERT OR IGNORE INTO run VALUES (?, ?, NULL, ?, ?, ?, ?, ?)"
_ADD_INJECTION = (
    f"INSERT OR IGNORE INTO injection (run, judged_utc, {', '.join(_REPORTED)}) "
    f"VALUES (:run, :judged_utc, {', '.join(f':{name}' for name in _REPORTED)})"
)
_ADD_MASS = "UPDATE injection SET measured_mass_mg = ? WHERE run = ? AND number = ?"
Row = Mapping[str, Value]
"""A row of the journal by its columns."""


class JournalWriter:
    """Listener that only collects; another thread writes the rows of a run. A file taken away is begun anew."""

    def __init__(self, path: Path, bench: Bench, tell: Callable[[str], None]) -> None:
        """Raises `UserError` for a file that is no journal; the first `write` makes the file."""
        require_journal(path)
        self.name = f"journal {path}"
        self.lost = 0
        """Injections and measured masses for which there was no room."""
        self.written = 0
        """Injections in the file that is there now."""
        self.removed = 0
        """Injections of this run in files that were removed or moved away meanwhile."""
        self._path = path
        self._tell = tell
        self._reported_lost = 0
        injector, now = bench.injector, time.time_ns()
        self._c = injector.coefficients
        self._run = now // 1000
        self._about_run = (
            self._run,
            utc(now),
            __version__,
            model_hash(injector.parameters),
            injector.name,
            str(bench.path.absolute()),
            injector.config.model_dump_json(),
        )
        self._is_begun = False
        self._waiting: deque[tuple[int, InjectionReport | MeasuredMass]] = deque()  # with Unix time, ns
        self._connection: sqlite3.Connection | None = None
        self._identity: os.stat_result | None = None

    def __call__(self, news: News) -> None:
        """Keep news that belong into the journal, without their arrays."""
        match news:
            case InjectionReport():
                entry: InjectionReport | MeasuredMass = news.without_courses()
            case MeasuredMass():
                entry = replace(news, report=news.report.without_courses())
            case _:
                return
        if len(self._waiting) < MOST_WAITING:
            self._waiting.append((time.time_ns(), entry))
        else:
            self.lost += 1

    def write(self) -> None:
        """Write waiting entries, at first the run itself. Raises `RunError`; entries not written wait on."""
        if self.lost != self._reported_lost:
            self._reported_lost = self.lost
            self._tell(f"warning: {self.name}: {self.lost} injections lost so far, for want of room to keep them")
        with contextlib.suppress(PermissionError):  # which the next transaction reports
            if self._identity is not None and not is_at(self._path, self._identity):
                self._begin_anew()
        while self._waiting or not self._is_begun:
            batch = [self._waiting[i] for i in range(min(len(self._waiting), BATCH))]  # the loop may add more
            with self._writing() as connection:
                connection.execute("BEGIN IMMEDIATE")
                connection.execute(_ADD_RUN, self._about_run)
                for at, entry in batch:  # one by one, so that the loop gets its turn between two of them
                    if isinstance(entry, MeasuredMass):
                        connection.execute(_ADD_MASS, (entry.mass / MILLIGRAM, self._run, entry.report.number))
                    else:
                        row = row_of(FIELDS, Output.JOURNAL, entry, self._c)
                        connection.execute(_ADD_INJECTION, {"run": self._run, "judged_utc": utc(at), **row})
            self._is_begun = True
            for _ in batch:
                _, entry = self._waiting.popleft()
                self.written += isinstance(entry, InjectionReport)

    def finish(self) -> str:
        """Write what waits and the clean stop; returns a text about the journal. Raises `RunError`."""
        self.write()
        with self._writing() as connection:
            connection.execute(
                "UPDATE run SET stopped_utc = ? WHERE started_unix_us = ?", (utc(time.time_ns()), self._run)
            )
            (total,) = connection.execute("SELECT count(*) FROM injection").fetchone()
            with contextlib.suppress(sqlite3.OperationalError):  # while somebody reads
                # then whoever may read the file can, even where nothing can be made beside it
                connection.execute("PRAGMA journal_mode = DELETE")
        self._disconnect()
        removed = f"; {self.removed} more were in a journal that was removed" if self.removed else ""
        return f"{total} injections in the journal {self._path}, {self.written} of this run{removed}"

    def _begin_anew(self) -> None:
        """Say that the file was taken away, and have the next one begun with this run."""
        self._tell(
            f"warning: {self.name}: the journal was removed, with {self.written} injections of this run\n"
            "  remedy: none is needed if that was meant: a new one is begun"
        )
        self.removed, self.written = self.removed + self.written, 0
        self._disconnect()
        self._is_begun = False

    @contextlib.contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        """A connection to the file there now: all of a transaction reaches the disk, or `RunError`."""
        try:
            if self._connection is None:
                self._connection = _connected(self._path)
                self._identity = self._path.stat()
            with self._connection as connection:
                yield connection
        except (sqlite3.Error, OSError) as error:
            self._disconnect()
            is_damaged = isinstance(error, sqlite3.DatabaseError) and not isinstance(error, sqlite3.OperationalError)
            advice = "; move the file away, and a new one is begun" if is_damaged else ""
            raise RunError(f"{self._path}: the journal cannot be written: {error}{advice}") from error

    def _disconnect(self) -> None:
        if self._connection is not None:
            with contextlib.suppress(sqlite3.Error):
                self._connection.close()
        self._connection = self._identity = None


def utc(unix_ns: int) -> str:
    """Writes a Unix time [ns] as SQLite and people read it, to the millisecond."""
    seconds, fraction = divmod(unix_ns, NANOSECONDS)
    return f"{datetime.fromtimestamp(seconds, UTC):%Y-%m-%d %H:%M:%S}.{fraction // NANOSECONDS_PER_MS:03d}"


def require_journal(path: Path) -> None:
    """Raise `UserError` unless the file is a journal this version knows, empty, or not there."""
    if not path.exists() or path.stat().st_size == 0:
        return
    try:
        with contextlib.closing(sqlite3.connect(path.absolute().as_uri() + "?mode=ro", uri=True)) as connection:
            (application,) = connection.execute("PRAGMA application_id").fetchone()
            (schema,) = connection.execute("PRAGMA user_version").fetchone()
            (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except sqlite3.OperationalError:
        return  # locked, or no right to read: reported by whoever needs it
    except sqlite3.DatabaseError as error:
        problem = f"is no journal of injections: {error}"
        raise UserError(str(path), problem, "name another file, or move this one away") from None
    if application != APPLICATION_ID and tables:
        problem = "is a database of another program"
        raise UserError(str(path), problem, "name another file for the journal of injections")
    if schema > SCHEMA:
        problem = f"was written by a newer version: schema {schema}, this one knows {SCHEMA}"
        raise UserError(str(path), problem, "use that version, or name another file")


def _connected(path: Path) -> sqlite3.Connection:
    """A connection to a journal, begun if need be, that survives power cuts."""
    connection = sqlite3.connect(path, timeout=PATIENCE, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
        # after every batch the file is whole without its -wal: whoever copies or moves it away loses nothing
        connection.execute("PRAGMA wal_autocheckpoint = 1")
        with connection:
            connection.execute("BEGIN IMMEDIATE")
            for text in (_RUN, _INJECTION):
                connection.execute(text)
            present = {name for _, name, *_ in connection.execute("PRAGMA table_info(injection)")}
            for name in [name for name in COLUMNS if name not in present]:  # of a journal that an older version began
                connection.execute(f"ALTER TABLE injection ADD COLUMN {name} {_KINDS[COLUMNS[name]]}")
            connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            connection.execute(f"PRAGMA user_version = {SCHEMA}")
    except BaseException:
        connection.close()
        raise
    return connection


class JournalContent(NamedTuple):
    """Rows of a journal, in order."""

    runs: list[Row]
    injections: list[Row]


def read_journal(path: Path) -> JournalContent:
    """A journal as it is now, entries whole. Raises `UserError`: missing, no journal, or damaged."""
    if not path.exists():
        raise UserError(str(path), "no such file", "name the file given to `observer-rt run --journal`")
    require_journal(path)
    try:
        with contextlib.closing(
            sqlite3.connect(path.absolute().as_uri() + "?mode=ro", uri=True, timeout=PATIENCE)
        ) as connection:
            connection.row_factory = sqlite3.Row
            connection.execute("BEGIN")  # one state of the file for all that is asked
            if not connection.execute("SELECT * FROM sqlite_master").fetchall():
                return JournalContent([], [])  # a daemon may be on the way to its first row, or was killed there
            runs, injections = "run ORDER BY started_unix_us", "injection ORDER BY run, number"
            return JournalContent(_rows(connection, runs), _rows(connection, injections))
    except sqlite3.OperationalError as error:
        remedy = "copy it with the files beside it to where you may write, and read it there"
        raise UserError(str(path), f"cannot be read: {error}", remedy) from None
    except sqlite3.DatabaseError as error:
        remedy = f"save what is left: sqlite3 {path} .recover | sqlite3 saved.sqlite"
        raise UserError(str(path), f"is damaged: {error}", remedy) from None


def _rows(connection: sqlite3.Connection, table: str) -> list[Row]:
    return [dict(row) for row in connection.execute(f"SELECT * FROM {table}")]
