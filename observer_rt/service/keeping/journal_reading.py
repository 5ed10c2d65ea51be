"""Reads a journal, written meanwhile or left behind by a killed daemon, and shows it as tables, CSV and JSON."""

import contextlib
import csv
import json
import sqlite3
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from rich.table import Table

from observer_rt.foundation.errors import UserError
from observer_rt.service.keeping.journal import COLUMNS, PATIENCE, SCHEMA, make_tables, require_journal
from observer_rt.service.reports.injection_report import NAMED, WEAR, Value
from observer_rt.terminal.console import results

Row = Mapping[str, Value]
"""A row of the journal by its columns; those of a version that knew fewer are missing."""
SPANS = 12  # of the table of wear

_NEWEST = """SELECT * FROM injection ORDER BY run DESC, number DESC LIMIT ?"""
_SPANS = f"""
WITH part AS (SELECT *, ntile(?) OVER (ORDER BY run, number) AS span FROM injection)
SELECT max(judged_utc) AS until_utc, count(*) AS injections, sum(valid) AS valid_injections,
    min(rail_pressure_MPa) AS lowest_rail_MPa, max(rail_pressure_MPa) AS highest_rail_MPa,
    {", ".join(f"avg({name}) FILTER (WHERE valid) AS {name}" for each in WEAR for name in each.columns)}
FROM part GROUP BY span ORDER BY span"""


class JournalReader:
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

    def spans(self, number: int) -> list[Mapping[str, Any]]:
        """The wear over time: as many spans of as many injections each, fewer where there are fewer injections.

        until_utc, injections, valid_injections, lowest_rail_MPa, highest_rail_MPa; under the columns of `WEAR` means
        of the valid ones.
        """
        return list(self._rows(_SPANS, (number,)))

    def _rows(self, query: str, values: tuple[int, ...] = ()) -> Iterator[Row]:
        cursor = self._connection.execute(query, values)
        names = [column[0] for column in cursor.description]
        return (dict(zip(names, row, strict=True)) for row in cursor)


def print_csv(journal: JournalReader, last: int | None) -> None:
    """All injections, or the last ones, on stdout."""
    writer = csv.DictWriter(sys.stdout, ["run", *COLUMNS], extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(journal.injections(last))


def print_json(journal: JournalReader, last: int | None) -> None:
    """One document on stdout: the runs, and all injections or the last ones."""
    runs = [dict(run) for run in journal.runs()]
    for run in runs:
        run["configuration"] = json.loads(str(run.pop("configuration_json")))
    injections = [
        {
            **row,
            "valid": bool(row["valid"]),
            "reasons": str(row["reasons"]).split(",") if row["reasons"] else [],
        }
        for row in journal.injections(last)
    ]
    print(json.dumps({"schema": SCHEMA, "runs": runs, "injections": injections}, indent=2))


def print_tables(journal: JournalReader, last: int) -> None:
    """The wear over time, and the last injections."""
    console, runs = results(), journal.runs()
    killed = sum(run["stopped_utc"] is None for run in runs)
    since = f" since {runs[0]['started_utc']} UTC" if runs else ""
    console.print(
        f"injections: {journal.count()}{since}; runs: {len(runs)}, {killed} of them killed or still running",
        highlight=False,
    )
    names = [each.value.heading.replace("\n", " ") for each in WEAR]
    title = "Wear over time: means of the valid injections, with their 95 % intervals"
    wear = Table("until (UTC)", "injections", "valid", "rail MPa", *names, title=title)
    for span in journal.spans(SPANS):
        means = ([span[name] for name in each.columns] for each in WEAR)
        wear.add_row(
            str(span["until_utc"]),
            str(span["injections"]),
            f"{100 * span['valid_injections'] / span['injections']:.0f} %",
            f"{span['lowest_rail_MPa']:.0f} to {span['highest_rail_MPa']:.0f}",
            *(_mean(*mean) for mean in means),
        )
    newest = Table("judged (UTC)", "no.", "rail MPa", "mass mg", *names, "valid", title="Last injections")
    shown = [NAMED[name] for name in ("number", "rail_pressure_MPa", "mass_mg")] + [
        each.value for each in WEAR
    ]
    for row in journal.injections(last):
        cells = (field.text(row.get(field.name)) for field in shown)
        newest.add_row(str(row["judged_utc"]), *cells, "yes" if row["valid"] else str(row["reasons"]))
    console.print(wear, newest)


def _mean(value: float | None, low: float | None, high: float | None) -> str:
    if value is None:
        return "-"
    return f"{value:+.1%}" + ("" if low is None else f" [{low:+.1%}, {high:+.1%}]")


@contextlib.contextmanager
def reading_journal(path: Path) -> Iterator[JournalReader]:
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
            (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
            if not tables:  # a daemon may have been killed, or be, on the way to its first row
                connection = sqlite3.connect(":memory:")
                make_tables(connection)
            yield JournalReader(connection)
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
