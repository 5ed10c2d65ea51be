"""Reading a journal of injections, be it written meanwhile or left behind by a killed daemon."""

import contextlib
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from observer_rt.foundation.errors import UserError
from observer_rt.service.keeping.journal import PATIENCE, make_tables, require_journal
from observer_rt.service.keeping.journal_columns import WEAR, Value

Row = Mapping[str, Value]
"""A row of the journal by its columns; those of a version that knew fewer are missing."""

_NEWEST = """SELECT * FROM injection ORDER BY run DESC, number DESC LIMIT ?"""
_SPANS = f"""
WITH part AS (SELECT *, ntile(?) OVER (ORDER BY run, number) AS span FROM injection)
SELECT max(judged_utc), count(*), sum(valid), min(rail_pressure_MPa), max(rail_pressure_MPa),
    {", ".join(f"avg({name}) FILTER (WHERE valid)" for each in WEAR for name in (each.value, each.low, each.high))}
FROM part GROUP BY span ORDER BY span"""


@dataclass(frozen=True)
class Mean:
    """An indicator over the valid injections of a span: means of its value and of its 95 % interval's ends."""

    value: float | None
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Span:
    """A number of injections one after another, ended at a time; wear: in the order of `WEAR`."""

    until_utc: str
    injections: int
    valid: int
    lowest_rail_MPa: float  # noqa: N815 - units as in the file
    highest_rail_MPa: float  # noqa: N815
    wear: tuple[Mean, ...]


class JournalFile:
    """A journal that is read; what is written meanwhile is not seen half."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def count(self) -> int:
        """How many injections it has."""
        (count,) = self._connection.execute("SELECT count(*) FROM injection").fetchone()
        return int(count)

    def runs(self) -> list[Row]:
        """The runs of the daemon, in order."""
        return list(self._rows("SELECT * FROM run ORDER BY started_unix_us"))

    def injections(self, last: int | None = None) -> Iterator[Row]:
        """The injections in order, or the last ones."""
        return self._rows(f"SELECT * FROM ({_NEWEST}) ORDER BY run, number", (-1 if last is None else last,))

    def spans(self, number: int) -> list[Span]:
        """The wear over time: as many spans of as many injections each, fewer where there are fewer injections."""
        return [
            Span(
                until,
                count,
                valid,
                lowest,
                highest,
                tuple(Mean(*wear[k : k + 3]) for k in range(0, len(wear), 3)),
            )
            for until, count, valid, lowest, highest, *wear in self._connection.execute(_SPANS, (number,))
        ]

    def _rows(self, query: str, values: tuple[int, ...] = ()) -> Iterator[Row]:
        cursor = self._connection.execute(query, values)
        names = [column[0] for column in cursor.description]
        return (dict(zip(names, row, strict=True)) for row in cursor)


@contextlib.contextmanager
def reading_journal(path: Path) -> Iterator[JournalFile]:
    """A journal as it is now.

    Raises:
        UserError: there is none, it is no journal, or it is damaged.
    """
    if not path.exists():
        raise UserError(str(path), "no such file", "name the file given to `observer-rt run --journal`")
    require_journal(path)
    place = path.absolute().as_uri() + "?mode=ro"
    try:
        with contextlib.closing(sqlite3.connect(place, uri=True, timeout=PATIENCE)) as connection:
            connection.execute("BEGIN")  # one state of the file for all that is asked
            yield JournalFile(connection if _is_begun(connection) else _empty())
    except sqlite3.OperationalError as error:
        raise UserError(
            str(path),
            f"cannot be read: {error}",
            "copy it with the files beside it to where you may write, and read it there",
        ) from None
    except sqlite3.DatabaseError as error:
        raise UserError(
            str(path),
            f"is damaged: {error}",
            f"save what is left: sqlite3 {path} .recover | sqlite3 saved.sqlite",
        ) from None


def _is_begun(connection: sqlite3.Connection) -> bool:
    """Whether there is anything in it: a daemon may have been killed, or be, on the way to its first row."""
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    return bool(tables)


def _empty() -> sqlite3.Connection:
    connection = sqlite3.connect(":memory:")
    make_tables(connection)
    return connection
