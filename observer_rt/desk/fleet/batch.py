"""`observer-rt batch`: thousands of recordings in parallel, into a `Dataset`: a folder of Parquet.

injections/SHA256.parquet   rows of a recording with this content, `job.SCHEMA`: one for each injection
batch.json                  by which model and how: another one needs another folder
"""

import json
import logging
import threading
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.daemon.state_file import model_hash
from observer_rt.desk.fleet.job import SCHEMA, FailedFile, Task, evaluate_file
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import InterruptionError, RunError, UserError, file_errors
from observer_rt.foundation.files import file_hash, replacing, write_text
from observer_rt.foundation.version import __version__

_INJECTIONS, _BATCH = "injections", "batch.json"  # in the folder
CONNECT_TIMEOUT = 10.0  # s
_SETTINGS = {
    # how often Dask looks at its own processes: as often as it would, that takes some percent of each
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.preload": ["observer_rt.desk.fleet.job"],
    # workers keep some memory, else each chunk is taken from the kernel anew, for a twelfth of their time
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 1 << 24,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 1 << 24,
}
_WAITING = 4  # files at a worker, so that it need not wait for the next
_RETRIES = 2  # of a job whose worker is gone
_WAIT = 0.5  # s to a look at Ctrl-C


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
        return self._file(sha256).exists()

    def take(self, sha256: str, rows: pa.Table) -> None:
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


@contextmanager
def dask_client(address: str | None, workers: int | None) -> Iterator[Any]:
    """A `distributed.Client` of a scheduler, else of workers here. Raises `RunError` if that is not reached."""
    import dask
    from distributed import Client, LocalCluster

    logging.getLogger("distributed").setLevel(logging.ERROR)  # a file of ours says what failed
    if address is not None:
        try:
            client = Client(address, timeout=CONNECT_TIMEOUT)
        except (OSError, ValueError) as error:
            raise RunError(
                f"--scheduler {address}: cannot be reached ({error})\n"
                "  remedy: start one with `dask scheduler`, and workers with `dask worker ADDRESS`"
            ) from error
        with client:
            yield client
        return
    with (
        dask.config.set(_SETTINGS),
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # None is not none, but port 8787
            memory_limit=0,  # a file takes what it takes, whatever its length
            silence_logs=logging.ERROR,
        ) as processes,
        Client(processes) as client,
    ):
        yield client


@dataclass
class EvaluatedFiles:
    """Numbers of files by outcome, and those that failed; skipped: done before, or copies."""

    done: int = 0
    skipped: int = 0
    failed: list[FailedFile] = field(default_factory=list)

    @property
    def count(self) -> int:
        return self.done + self.skipped + len(self.failed)


def evaluate_all(
    client: Any, stop: threading.Event, task: Task, paths: Sequence[Path], dataset: Dataset, console: Console
) -> EvaluatedFiles:
    """Rows of all files into the dataset; stop: set to end. Raises `InterruptionError` when it is interrupted."""
    remaining, jobs = iter(paths), _Jobs(client, task, dataset)
    counts = jobs.counts
    with progress_bar(console, "evaluating", len(paths)) as progress:
        while not stop.is_set():
            if jobs.has_room and (path := next(remaining, None)) is not None:
                jobs.submit(path)
            elif jobs.running:
                jobs.collect(progress)
            else:
                return counts
    client.cancel(list(jobs.running))
    raise InterruptionError(
        f"interrupted; {counts.done + counts.skipped} of {len(paths)} files are done\n"
        "  remedy: give the same command again to go on"
    )


class _Jobs:
    def __init__(self, client: Any, task: Task, dataset: Dataset) -> None:
        self._client, self._task, self._dataset = client, task, dataset
        self._begun: set[str] = set()
        self.counts = EvaluatedFiles()
        self.running: dict[Any, tuple[Path, str]] = {}
        """Path and SHA-256 by job."""

    @property
    def has_room(self) -> bool:
        """Whether another file may go to the workers."""
        return bool(len(self.running) < _WAITING * max(1, sum(self._client.ncores().values())))

    def submit(self, path: Path) -> None:
        """A file to the workers, unless its content is done or at work already."""
        try:
            sha256 = file_hash(self._task.folder / path)
        except OSError as error:
            self.counts.failed.append(FailedFile(path, f"{path}: {error.strerror}"))
            return
        if self._dataset.is_done(sha256) or sha256 in self._begun:
            self.counts.skipped += 1
            return
        job = self._client.submit(evaluate_file, self._task, path, sha256, pure=False, retries=_RETRIES)
        self.running[job] = path, sha256
        self._begun.add(sha256)

    def collect(self, progress: Callable[[float], None]) -> None:
        """Results of the jobs that are over, after a moment's wait. progress: takes the number of files done."""
        from distributed import wait

        over: Collection[Any] = ()
        with suppress(TimeoutError):
            over = wait(list(self.running), timeout=_WAIT, return_when="FIRST_COMPLETED").done
        for job in over:
            path, sha256 = self.running.pop(job)
            rows = _result(job, path)
            if isinstance(rows, FailedFile):
                self.counts.failed.append(rows)
            else:
                self._dataset.take(sha256, rows)
                self.counts.done += 1
            progress(self.counts.count)


def _result(job: Any, path: Path) -> Any:
    """Value of a job's function, or a `FailedFile` after an error that nobody foresaw."""
    error = job.exception()
    if error is None:
        return job.result()
    problem = f"{type(error).__name__}: {error}\n  remedy: please report it, with the file"
    if type(error).__name__ == "KilledWorker":
        problem = f"its worker died {_RETRIES + 1} times\n  remedy: fewer --workers, if memory is short"
    return FailedFile(path, f"{path}: {problem}")


def settings_of(bench: Bench, state: Path | None, learning: bool, pattern: str | None) -> dict[str, Any]:
    """Settings that rows depend on beside the files."""
    return {
        "software": __version__,
        "models": [model_hash(injector.parameters) for injector in bench.injectors],
        "bench": file_hash(bench.path),
        "state": file_hash(state) if state is not None else None,
        "learning": learning,
        "injector_from": pattern,
    }


def print_counts(dataset: Dataset, counts: EvaluatedFiles, as_json: bool, console: Console) -> None:
    """Print the numbers of files by outcome, in words or JSON, and which files failed."""
    for failed in counts.failed:
        say(console, f"left out: {failed.problem}")
    if as_json:
        document = {
            "done": counts.done,
            "skipped": counts.skipped,
            "failed": [{"file": str(failed.file), "problem": failed.problem} for failed in counts.failed],
            "injections": dataset.injections,
            "out": str(dataset.folder),
        }
        print(json.dumps(document, indent=2))
        return
    text = f"{counts.done} files, {dataset.injections} injections"
    if counts.skipped:
        text += f"; {counts.skipped} were done before, or are copies"
    if counts.failed:
        text += f"; {len(counts.failed)} could not be evaluated"
    say(results(), f"{text}; {dataset.folder}")
