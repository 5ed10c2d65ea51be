"""Results of a batch in a folder of Parquet, a row for each injection.

injections/SHA256.parquet   rows of a recording with this content, `job.SCHEMA`
batch.json                  by which model and how: another one needs another folder
"""

import json
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from observer_rt.desk.fleet.job import SCHEMA
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import replacing, write_text

_INJECTIONS, _BATCH = "injections", "batch.json"  # in the folder


class Dataset:
    """Takes results in any order. A file of rows appears when it is complete, and stands for a finished recording."""

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        """settings: what the rows depend on beside the files. Raises `UserError` for a folder with others."""
        self.folder, self._rows = folder, folder / _INJECTIONS
        self.injections = 0
        """Rows written since it was opened."""
        settings, before = {**settings, "columns": SCHEMA.names}, None
        with file_errors(folder):
            with suppress(FileNotFoundError, ValueError):
                before = json.loads((folder / _BATCH).read_text(encoding="utf-8"))
            if not isinstance(before, dict):
                for name in (_BATCH, _INJECTIONS):
                    if (folder / name).exists():
                        raise UserError(f"--out {folder}", f"holds {name}, of no batch", "name another folder")
                write_text(folder / _BATCH, json.dumps(settings, indent=2))
            elif other := [key for key in settings if before.get(key) != settings[key]]:
                problem = f"holds the results of another batch: {', '.join(other)} differ"
                raise UserError(f"--out {folder}", problem, "name another folder")
            self._rows.mkdir(exist_ok=True)

    def is_done(self, sha256: str) -> bool:
        """Whether the rows of a file with this content are there."""
        return self._file(sha256).exists()

    def take(self, sha256: str, rows: pa.Table) -> None:
        """Write the rows of one file."""
        with file_errors(self.folder), replacing(self._file(sha256)) as part:
            pq.write_table(rows, part)
        self.injections += rows.num_rows

    def _file(self, sha256: str) -> Path:
        return self._rows / f"{sha256}.parquet"


def read_injections(folder: Path, columns: Iterable[str] = SCHEMA.names) -> pa.Table:
    """All rows of a batch's folder. Raises `UserError` for another folder."""
    dataset = folder / _INJECTIONS
    if not dataset.is_dir():
        raise UserError(str(folder), "is no folder of a batch", "make one: observer-rt batch RECORDING... --out DIR")
    with file_errors(dataset):
        table: pa.Table = ds.dataset(dataset, schema=SCHEMA, format="parquet").to_table(columns=list(columns))
    return table
