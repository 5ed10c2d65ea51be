"""The results of a batch in one file, a database of DuckDB, and the rows of either kind of results.

Tables `injections` (`job.SCHEMA`), `done`, `errors` (`dataset.FAILED`) and `settings`, as the files of a folder.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import pyarrow as pa

from observer_rt.desk.fleet import dataset
from observer_rt.desk.fleet.dataset import FAILED, INJECTIONS, Dataset, Results, failure_row, refuse_other
from observer_rt.desk.fleet.job import SCHEMA, FailedFile
from observer_rt.foundation.errors import UserError

SUFFIX = ".duckdb"
_TABLES = f"""
    CREATE TABLE {INJECTIONS} AS FROM empty_rows;
    CREATE TABLE done (sha256 VARCHAR PRIMARY KEY, file VARCHAR, injections BIGINT);
    CREATE TABLE errors AS FROM empty_errors;
    CREATE TABLE settings (said VARCHAR);
"""


class Database(Results):
    """Takes results as `Dataset` does; the rows of a file and the note that it is done are one transaction."""

    def __init__(self, path: Path, settings: dict[str, Any]) -> None:
        """settings: what the rows depend on beside the files. Raises `UserError` for a file with others."""
        super().__init__(path, f"table errors of {path}")
        with _told(path):
            self._database = _opened(path, read_only=False)
            said = {**settings, "columns": SCHEMA.names}
            if not self._database.execute("SHOW TABLES").fetchall():
                self._database.register("empty_rows", SCHEMA.empty_table())
                self._database.register("empty_errors", FAILED.empty_table())
                self._database.execute(f"BEGIN; {_TABLES}")
                self._database.execute("INSERT INTO settings VALUES (?)", [json.dumps(said)])
                self._database.execute("COMMIT")
            (before,) = self._database.execute("SELECT said FROM settings").fetchone()
            self._done = {
                sha256 for (sha256,) in self._database.execute("SELECT sha256 FROM done").fetchall()
            }
        refuse_other(path, json.loads(before), said)

    def _write(self, path: Path, sha256: str, rows: pa.Table) -> None:
        with _told(self.folder):
            self._database.execute("BEGIN")
            self._insert(INJECTIONS, rows)
            self._database.execute("INSERT INTO done VALUES (?, ?, ?)", [sha256, str(path), rows.num_rows])
            self._database.execute("COMMIT")

    def _write_failures(self, failed: Sequence[FailedFile]) -> None:
        with _told(self.folder):
            self._insert("errors", pa.Table.from_pylist([failure_row(each) for each in failed], FAILED))

    def __enter__(self) -> Self:
        with _told(self.folder):
            self._database.execute("DELETE FROM errors")
        return self

    def __exit__(self, *_: object) -> None:
        self._database.close()

    def _insert(self, table: str, rows: pa.Table) -> None:
        self._database.register("rows_to_take", rows)
        self._database.execute(f"INSERT INTO {table} BY NAME FROM rows_to_take")
        self._database.unregister("rows_to_take")


def results_at(out: Path, settings: dict[str, Any]) -> Results:
    """The results that `batch --out` names: a database by its suffix, else a folder."""
    return Database(out, settings) if out.suffix == SUFFIX else Dataset(out, settings)


def read_injections(results: Path, columns: Iterable[str] = SCHEMA.names) -> pa.Table:
    """All rows of a batch, of a folder or of a database. Raises `UserError` for what is neither."""
    if results.suffix != SUFFIX or results.is_dir():
        return dataset.read_injections(results, columns)
    if not results.exists():
        raise UserError(str(results), "no such file or folder", "check the path")
    names = list(columns)
    with _told(results):
        database = _opened(results, read_only=True)
        try:
            said = ", ".join(f'"{name}"' for name in names)
            found: pa.Table = database.sql(f"SELECT {said} FROM {INJECTIONS}").to_arrow_table()
        finally:
            database.close()
    return found.cast(pa.schema([SCHEMA.field(name) for name in names]))


def _opened(path: Path, read_only: bool) -> Any:
    import duckdb  # an extra

    return duckdb.connect(str(path), read_only=read_only)


@contextmanager
def _told(path: Path) -> Iterator[None]:
    """Turn DuckDB's errors into `UserError`, and that it is not installed."""
    try:
        import duckdb
    except ImportError:
        raise UserError(str(path), "needs DuckDB", "pip install 'observer-rt[duckdb]'") from None
    try:
        yield
    except duckdb.Error as error:
        raise UserError(
            str(path),
            f"is no database that can be used: {error}",
            "end who else has it open, or name another file or folder",
        ) from None
