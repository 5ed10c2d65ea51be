"""The work on one file of a batch: its recording through the observer, and a row for each injection."""

import gc
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import timedelta
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
from rich.console import Console

import observer_rt.desk.fleet.job  # noqa: F401 - imported for what it imports
from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.curves import RESULT_FIELDS
from observer_rt.desk.evaluation.evaluate import evaluate
from observer_rt.desk.evaluation.logged import open_source
from observer_rt.desk.fleet.recordings import PathPattern, injector_of, zero_of
from observer_rt.engine.learning.knowledge import Knowledge
from observer_rt.engine.reports.injection_report import Output, columns_of, row_of
from observer_rt.files.formats import is_log
from observer_rt.files.signals.doubts import refuse_dead
from observer_rt.foundation.errors import ObserverError, file_errors

_KINDS = {int: pa.int64(), float: pa.float64(), bool: pa.bool_(), str: pa.string()}
SCHEMA = pa.schema(
    [
        ("file", pa.string()),
        ("sha256", pa.string()),
        ("injector", pa.string()),
        ("time", pa.timestamp("us", tz="UTC")),
        ("time_from", pa.string()),
        *((name, _KINDS[kind]) for name, kind in columns_of(RESULT_FIELDS, Output.PARQUET).items()),
    ]
)
"""time: of the injection's begin; time_from: its source (`TimeFrom`)."""
_ROWS = 1024


@dataclass(frozen=True)
class Task:
    bench: Bench
    folder: Path  # where relative paths begin
    knowledge: Knowledge | None = None  # learned before, to start each file with
    learning: bool = True
    names: PathPattern | None = None  # of injectors, in the paths


class FailedFile(NamedTuple):
    """A file that gave no rows, and why."""

    file: Path
    problem: str


def evaluate_file(task: Task, path: Path, sha256: str) -> pa.Table | FailedFile:
    """The file's injections as rows of `SCHEMA`, of every injector of the bench."""
    try:
        return _table(row for alone in task.bench.per_injector for row in _rows(task, path, sha256, alone))
    except ObserverError as error:
        return FailedFile(path, str(error))
    except MemoryError:
        return FailedFile(path, f"{path}: not enough memory\n  remedy: fewer --workers")
    finally:
        gc.collect()  # observer and listener hold each other: without it the next files find their memory taken


def _table(rows: Iterator[dict[str, Any]]) -> pa.Table:
    """Some rows at a time: in a table they take a tenth of the memory."""
    batches = []
    while some := list(islice(rows, _ROWS)):
        batches.append(pa.RecordBatch.from_pylist(some, SCHEMA))
    return pa.Table.from_batches(batches, SCHEMA)


def _rows(task: Task, path: Path, sha256: str, alone: Bench) -> Iterator[dict[str, Any]]:
    name = injector_of(path, task.names, alone)
    file, c = task.folder / path, alone.injector.coefficients
    source = open_source(file, alone, (), Console(quiet=True))
    learning = task.learning and alone.injector.config.learning.enabled
    with file_errors(file):
        (evaluation,) = evaluate(alone, [source], task.knowledge, learning, traces=()).evaluations
    if not is_log(file):
        refuse_dead(file, source.survey, source.names)
    zero, by = zero_of(file, evaluation.source)
    for result in evaluation.injections:
        yield {
            **row_of(RESULT_FIELDS, Output.PARQUET, result, c),
            "file": str(path),
            "sha256": sha256,
            "injector": name,
            "time": zero + timedelta(seconds=result.start),
            "time_from": by,
        }


def dask_setup(_worker: object) -> None:
    """Called by Dask as a worker starts: imported modules are left out of every later search for garbage."""
    gc.collect()
    gc.freeze()
