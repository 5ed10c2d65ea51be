"""The folder of a batch: partitioned Parquet, an injection a row.

injections/injector=NAME/SHA256.parquet   rows of one file, `job.SCHEMA` without the injector
done.jsonl                                a line for every file whose rows are written
errors.jsonl                              while a batch runs: a line for every file without rows, and why
errors.parquet                            the same, once it is over
batch.json                                by which model and how: another one needs another folder
"""

import json
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self
from urllib.parse import quote

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from observer_rt.desk.fleet.job import OLD_NAMES, SCHEMA, FailedFile
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing, write_text

INJECTIONS = "injections"
FAILED = pa.schema([(name, pa.string()) for name in ("file", "sha256", "injector", "problem")])
"""Columns of failures."""
_DONE, _ERRORS, _SETTINGS = "done.jsonl", "errors.parquet", "batch.json"
_ERRORS_SO_FAR = "errors.jsonl"
_PARTITION = "injector"


class Results(ABC):
    """Where a batch puts its rows. errors: where its failures are, for people.

    A context in which files are evaluated: what failed in an earlier one is forgotten, as it is tried again.
    """

    def __init__(self, folder: Path, errors: str) -> None:
        """folder: or the file."""
        self.folder, self.errors = folder, errors
        self._done: set[str] = set()
        self._failed: list[FailedFile] = []
        self.injections = 0
        """Rows written since it was opened."""

    def is_done(self, sha256: str) -> bool:
        """Whether the rows of a file with this content are there."""
        return sha256 in self._done

    @property
    def failed(self) -> tuple[FailedFile, ...]:
        """Files without rows."""
        return tuple(self._failed)

    def take(self, path: Path, sha256: str, rows: pa.Table) -> None:
        """Rows of one file, and that it is done."""
        self._write(path, sha256, rows)
        self._done.add(sha256)
        self.injections += rows.num_rows

    def take_failures(self, failed: Sequence[FailedFile]) -> None:
        """Files without rows, or that discovery could not take."""
        if failed:
            self._failed += failed
            self._write_failures(failed)

    @abstractmethod
    def __enter__(self) -> Self: ...

    @abstractmethod
    def __exit__(self, *_: object) -> None: ...

    @abstractmethod
    def _write(self, path: Path, sha256: str, rows: pa.Table) -> None: ...

    @abstractmethod
    def _write_failures(self, failed: Sequence[FailedFile]) -> None: ...


class Dataset(Results):
    """Takes results in whatever order; what is there when the power fails is whole, and is not done again."""

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        """settings: what the rows depend on beside the files. Raises `UserError` for a folder with others."""
        super().__init__(folder, str(folder / _ERRORS))
        with file_errors(folder):
            folder.mkdir(parents=True, exist_ok=True)
            self._refuse_other({**settings, "columns": SCHEMA.names})
            (folder / INJECTIONS).mkdir(exist_ok=True)
            self._done = self._read_done()

    def _write(self, path: Path, sha256: str, rows: pa.Table) -> None:
        """First the rows are written, then it is noted as done."""
        with file_errors(self.folder):
            for name in pc.unique(rows[_PARTITION]).to_pylist():
                place = self.folder / INJECTIONS / f"{_PARTITION}={quote(name, safe='')}"
                place.mkdir(exist_ok=True)
                its = rows.filter(pc.equal(rows[_PARTITION], name)).drop_columns([_PARTITION])
                write_table(place / f"{sha256}.parquet", its)
            with (self.folder / _DONE).open("a", encoding="utf-8") as done:
                line = {"sha256": sha256, "file": str(path), "injections": rows.num_rows}
                done.write(json.dumps(line) + "\n")

    def _write_failures(self, failed: Sequence[FailedFile]) -> None:
        with file_errors(self.folder), (self.folder / _ERRORS_SO_FAR).open("a", encoding="utf-8") as errors:
            errors.writelines(json.dumps(failure_row(each)) + "\n" for each in failed)

    def __enter__(self) -> Self:
        with file_errors(self.folder):
            for name in (_ERRORS, _ERRORS_SO_FAR):
                (self.folder / name).unlink(missing_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        if self._failed:
            table = pa.Table.from_pylist([failure_row(each) for each in self._failed], FAILED)
            write_table(self.folder / _ERRORS, table)
            (self.folder / _ERRORS_SO_FAR).unlink()

    def _read_done(self) -> set[str]:
        path = self.folder / _DONE
        if not path.exists():
            return set()
        text = path.read_text(encoding="utf-8")
        if not text.endswith("\n"):  # the power failed within the last line: that file is done again
            text = text[: text.rfind("\n") + 1]
            write_text(path, text)
        return {str(json.loads(line)["sha256"]) for line in text.splitlines()}

    def _refuse_other(self, settings: dict[str, Any]) -> None:
        path = self.folder / _SETTINGS
        if not path.exists():
            for name in (_DONE, _ERRORS, _ERRORS_SO_FAR, INJECTIONS):
                if (self.folder / name).exists():
                    raise UserError(
                        f"--out {self.folder}", f"holds {name}, of no batch", "name another folder"
                    )
            write_text(path, json.dumps(settings, indent=2))
            return
        with suppress(ValueError):
            if isinstance(before := json.loads(path.read_text(encoding="utf-8")), dict):
                refuse_other(self.folder, before, settings)
                return
        raise UserError(f"--out {self.folder}", f"holds {_SETTINGS}, of no batch", "name another folder")


def refuse_other(out: Path, before: dict[str, Any], settings: dict[str, Any]) -> None:
    """Raise `UserError` for results that depend on other settings than those of now."""
    if other := [key for key in settings if before.get(key) != settings[key]]:
        raise UserError(
            f"--out {out}",
            f"holds the results of another batch: {', '.join(other)} differ",
            "name another folder or file",
        )


def write_table(path: Path, table: pa.Table) -> None:
    """A table as Parquet, whole whenever somebody looks."""
    with file_errors(path), replacing(path) as part:
        pq.write_table(table, part)


def failure_row(failed: FailedFile) -> dict[str, str | None]:
    """A failure under `FAILED`."""
    said = {**vars(failed), "file": failed.file and str(failed.file), "injector": failed.injector or None}
    return {name: said[name] for name in FAILED.names}


def read_injections(folder: Path, columns: Iterable[str] = SCHEMA.names) -> pa.Table:
    """All rows of a batch's folder. Raises `UserError` for a folder that is none."""
    place = folder / INJECTIONS
    if not place.is_dir():
        raise UserError(
            str(folder), "is no folder of a batch", "make one: observer-rt batch RECORDING... --out DIR"
        )
    with file_errors(place):
        partitioning = ds.partitioning(pa.schema([(_PARTITION, pa.string())]), flavor="hive")
        schema = pa.schema([*SCHEMA, *(SCHEMA.field(new).with_name(old) for new, old in OLD_NAMES.items())])
        found = ds.dataset(place, schema=schema, format="parquet", partitioning=partitioning)
        values = {name: ds.field(name) for name in columns}
        older = {
            name: pc.coalesce(values[name], ds.field(OLD_NAMES[name])) for name in values if name in OLD_NAMES
        }
        table: pa.Table = found.to_table(columns={**values, **older})
    return table
