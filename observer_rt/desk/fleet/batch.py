"""`observer-rt batch`: thousands of recordings in parallel, into a folder or a database, an injection a row."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa
from rich.console import Console

from observer_rt import __version__
from observer_rt.config.bench import Bench
from observer_rt.daemon.persistence.state_file import model_hash
from observer_rt.desk.fleet.cluster import Broken, Jobs, Work
from observer_rt.desk.fleet.dataset import Results
from observer_rt.desk.fleet.job import FailedFile, Task, evaluated, hashed
from observer_rt.desk.fleet.moment import WRITTEN
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.files import file_hash

if TYPE_CHECKING:
    from observer_rt.desk.fleet.discovering import FoundAnswers

_WAITING = 4  # files at a worker, so that it need not wait for the next
_Outcome = tuple[Path, str, pa.Table | FailedFile | None]
"""A file, its hash, and its rows; None: they were there before."""


@dataclass
class Evaluated:
    """Numbers of files by outcome; paths: of those that did not fail, by SHA-256.

    without_time: files evaluated now that do not state when they were recorded.
    """

    done: int = 0
    skipped: int = 0
    failed: int = 0
    without_time: int = 0
    paths: dict[str, Path] = field(default_factory=dict)

    @property
    def well(self) -> int:
        """Files whose rows are there."""
        return self.done + self.skipped


def evaluate_all(work: Work, task: Task, paths: Sequence[Path], dataset: Results) -> Evaluated:
    """Rows of all files into the dataset. Raises `InterruptionError` when it is interrupted."""
    counts = Evaluated()
    with progress_bar(work.console, "evaluating", len(paths)) as progress:
        for path, sha256, rows in _outcomes(work, task, paths, dataset):
            _take(dataset, counts, path, sha256, rows)
            progress(counts.well + counts.failed)
    work.refuse_interrupted(counts.well, len(paths), "files")
    return counts


def _outcomes(work: Work, task: Task, paths: Sequence[Path], dataset: Results) -> Iterator[_Outcome]:
    """Outcome of each file, as it becomes known; only as many are at work as keep the workers busy."""
    jobs: Jobs[tuple[Path, str]] = Jobs(work.cluster.client)
    remaining = iter(paths)
    begun: set[str] = set()

    def begin_more() -> None:
        for path in islice(remaining, max(0, _WAITING * jobs.places - len(jobs))):
            jobs.begin((path, ""), hashed, task.folder / path)

    for (path, sha256), result in jobs.outcomes(work.stop, begin_more):
        if isinstance(result, str) and (dataset.is_done(result) or result in begun):
            yield path, result, None
        elif isinstance(result, str):
            begun.add(result)
            jobs.begin((path, result), evaluated, task, path, result)
        elif isinstance(result, Broken):
            yield path, sha256, FailedFile(path, sha256, f"{path}: {result}")
        else:
            yield path, sha256, result


def _take(
    dataset: Results, counts: Evaluated, path: Path, sha256: str, rows: pa.Table | FailedFile | None
) -> None:
    if isinstance(rows, FailedFile):
        dataset.take_failures([rows])
        counts.failed += 1
        return
    if rows is None:
        counts.skipped += 1
    else:
        dataset.take(path, sha256, rows)
        counts.done += 1
        counts.without_time += rows.num_rows > 0 and rows["time_from"][0].as_py() == WRITTEN
    counts.paths.setdefault(sha256, path)


def settings_of(bench: Bench, state: Path | None, learning: bool, pattern: str | None) -> dict[str, Any]:
    """Settings that rows depend on beside the files."""
    return {
        "software": __version__,
        "models": [model_hash(each.parameters) for each in bench.injectors],
        "bench": file_hash(bench.path),
        "state": file_hash(state) if state is not None else None,
        "learning": learning,
        "injector_from": pattern,
    }


def tell(
    dataset: Results, counts: Evaluated, found: "FoundAnswers | None", as_json: bool, console: Console
) -> None:
    """Print the outcome: files, and answers if asked for, in words or JSON; those that failed."""
    for failed in dataset.failed:
        say(console, f"left out: {failed.problem}")
    if counts.without_time:
        say(
            console,
            f"{counts.without_time} recordings do not state when they were made: their time is when the files were "
            "last written, which `trend` does not take",
        )
    if as_json:
        said: dict[str, Any] = {
            "done": counts.done,
            "skipped": counts.skipped,
            "failed": counts.failed,
            "injections": dataset.injections,
            "out": str(dataset.folder),
        }
        if found is not None:
            said["discovered"] = found.as_json()
        print(json.dumps(said, indent=2))
        return
    text = f"{counts.done} files, {dataset.injections} injections"
    if counts.skipped:
        text += f"; {counts.skipped} were done before, or are copies"
    if counts.failed:
        text += f"; {counts.failed} could not be evaluated, see {dataset.errors}"
    say(results(), f"{text}; {dataset.folder}")
    if found is not None:
        found.show(dataset.folder)
