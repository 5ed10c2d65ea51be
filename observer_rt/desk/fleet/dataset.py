"""The folder of a batch: partitioned Parquet, an injection a row.

injections/injector=NAME/SHA256.parquet   rows of one file, `job.SCHEMA` without the injector
done.jsonl                                a line for every file whose rows are written
errors.jsonl                              a line for every file without rows, and why; of the latest run
batch.json                                by which model and how: another one needs another folder
"""

import json
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from observer_rt.desk.fleet.job import SCHEMA, FailedFile
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors
from observer_rt.foundation.outputs import replacing, write_text

INJECTIONS = "injections"
_DONE, _ERRORS, _SETTINGS = "done.jsonl", "errors.jsonl", "batch.json"
_PARTITION = "injector"


class Dataset:
    """Takes results in any order; results written before a power failure are complete, and are not computed again."""

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        """settings: what the rows depend on beside the files. Raises `UserError` for a folder with others.

        What failed in an earlier run is forgotten, as it is tried again.
        """
        self.folder, self.errors = folder, folder / _ERRORS
        self.injections = 0
        """Rows written since it was opened."""
        with file_errors(folder):
            self._refuse_other({**settings, "columns": SCHEMA.names})
            (folder / INJECTIONS).mkdir(exist_ok=True)
            self.errors.unlink(missing_ok=True)
            self._done = self._read_done()

    def is_done(self, sha256: str) -> bool:
        """Whether the rows of a file with this content are there."""
        return sha256 in self._done

    def take(self, path: Path, sha256: str, rows: pa.Table) -> None:
        """First the rows of one file are written, then it is noted as done."""
        with file_errors(self.folder):
            for name in pc.unique(rows[_PARTITION]).to_pylist():
                partition = self.folder / INJECTIONS / f"{_PARTITION}={quote(name, safe='')}"
                partition.mkdir(exist_ok=True)
                its = rows.filter(pc.equal(rows[_PARTITION], name)).drop_columns([_PARTITION])
                with replacing(partition / f"{sha256}.parquet") as part:
                    pq.write_table(its, part)
            _append(self.folder / _DONE, {"sha256": sha256, "file": str(path), "injections": rows.num_rows})
        self._done.add(sha256)
        self.injections += rows.num_rows

    def take_failure(self, failed: FailedFile) -> None:
        """A file without rows."""
        with file_errors(self.folder):
            _append(self.errors, {**asdict(failed), "file": str(failed.file)})

    def _read_done(self) -> set[str]:
        path = self.folder / _DONE
        text = path.read_text(encoding="utf-8") if path.exists() else ""
        if text and not text.endswith("\n"):  # the power failed within the last line: that file is done again
            text = text[: text.rfind("\n") + 1]
            write_text(path, text)
        return {str(json.loads(line)["sha256"]) for line in text.splitlines()}

    def _refuse_other(self, settings: dict[str, Any]) -> None:
        path, location = self.folder / _SETTINGS, f"--out {self.folder}"
        before = None
        with suppress(FileNotFoundError, ValueError):
            before = json.loads(path.read_text(encoding="utf-8"))
        if not isinstance(before, dict):
            for name in (_SETTINGS, _DONE, _ERRORS, INJECTIONS):
                if (self.folder / name).exists():
                    raise UserError(location, f"holds {name}, of no batch", "name another folder")
            write_text(path, json.dumps(settings, indent=2))
        elif other := [key for key in settings if before.get(key) != settings[key]]:
            problem = f"holds the results of another batch: {', '.join(other)} differ"
            raise UserError(location, problem, "name another folder")


def _append(path: Path, said: dict[str, Any]) -> None:
    with path.open("a", encoding="utf-8") as lines:
        lines.write(json.dumps(said) + "\n")


def read_injections(folder: Path, columns: Iterable[str] = SCHEMA.names) -> pa.Table:
    """All rows of a batch's folder. Raises `UserError` for another folder."""
    dataset = folder / INJECTIONS
    if not dataset.is_dir():
        raise UserError(
            str(folder), "is no folder of a batch", "make one: observer-rt batch RECORDING... --out DIR"
        )
    with file_errors(dataset):
        partitioning = ds.partitioning(pa.schema([(_PARTITION, pa.string())]), flavor="hive")
        rows = ds.dataset(dataset, schema=SCHEMA, format="parquet", partitioning=partitioning)
        table: pa.Table = rows.to_table(columns=list(columns))
    return table
