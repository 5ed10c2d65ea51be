"""`observer-rt batch`: thousands of recordings, an injection a row."""

import json
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
from rich.console import Console

from observer_rt import __version__
from observer_rt.config.bench import Bench
from observer_rt.fleet.cluster import connected
from observer_rt.fleet.dataset import Dataset
from observer_rt.fleet.job import Failed, Task, evaluated, hashed
from observer_rt.fleet.names import InjectorNames, recordings_in
from observer_rt.foundation.compilation import is_compiled
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.file_hash import file_hash
from observer_rt.observer.learning.knowledge import Knowledge
from observer_rt.service.restoring import restored_knowledge
from observer_rt.service.state_file import model_hash
from observer_rt.terminal.console import progress_bar, results, say, say_if_compiling
from observer_rt.terminal.destinations import check_folder
from observer_rt.terminal.stop import stop_on_signals

_RETRIES = 2  # of a file whose worker is gone
_WAITING = 4  # files at a worker, so that it need not wait for the next
_WAIT = 0.5  # s to a look at Ctrl-C


@dataclass(frozen=True)
class BatchOptions:
    """What the command line says; pattern: as of `InjectorNames`."""

    out: Path
    scheduler: str | None = None
    workers: int | None = None
    state: Path | None = None
    learning: bool = True
    pattern: str | None = None
    effects: tuple[Path, ...] = ()
    json: bool = False


@dataclass
class Counts:
    """How many files there were, of what kind."""

    done: int = 0
    skipped: int = 0
    failed: int = 0


def batch(bench: Bench, sources: Sequence[str], options: BatchOptions, console: Console) -> None:
    """Evaluate every recording that is not done yet; print what came of them.

    Raises `UserError` for options that will not do, before the work begins; `RunError` when it is interrupted.
    """
    InjectorNames(options.pattern)
    paths = recordings_in(sources)
    options.out.mkdir(parents=True, exist_ok=True)
    check_folder("--out", options.out)
    dataset = Dataset(options.out, _settings(bench, options))
    dataset.forget_failures()
    task = Task(
        bench, _knowledge(bench, options, console), options.learning, options.pattern, options.effects
    )
    counts = Counts()
    say_if_compiling(console)
    with (
        stop_on_signals() as stop,
        connected(options.scheduler, options.workers) as client,
        progress_bar(console, "evaluating", len(paths)) as progress,
    ):
        for outcome in _outcomes(client, task, paths, dataset, stop):
            _take(dataset, counts, *outcome)
            progress(counts.done + counts.skipped + counts.failed)
        if stop.is_set():
            raise RunError(
                f"interrupted; {counts.done + counts.skipped} of {len(paths)} files are done\n"
                "  remedy: give the same command again to go on"
            )
    _tell(dataset, counts, options, console)


_Outcome = tuple[Path, str, pa.Table | Failed | None]
"""A file, its hash, and its rows; None: they were there before."""


def _outcomes(
    client: Any, task: Task, paths: Sequence[Path], dataset: Dataset, stop: threading.Event
) -> Iterator[_Outcome]:
    """What becomes of each file, as it becomes known; only as many are at work as keep the workers busy."""
    from distributed import wait

    submit = partial(client.submit, pure=False, retries=_RETRIES)
    remaining = iter(paths)
    running: dict[Any, tuple[Path, str]] = {}
    begun: set[str] = set()
    while not stop.is_set():
        # what is not compiled yet is compiled once, not by every worker
        room = (_WAITING * max(1, len(client.ncores())) if is_compiled() else 1) - len(running)
        for path in islice(remaining, max(0, room)):
            running[submit(hashed, path)] = path, ""
        if not running:
            return
        try:
            ready = wait(list(running), timeout=_WAIT, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            continue
        for future in ready:
            path, sha256 = running.pop(future)
            result = _result(future, path, sha256)
            if isinstance(result, str) and (dataset.is_done(result) or result in begun):
                yield path, result, None
            elif isinstance(result, str):
                begun.add(result)
                running[submit(evaluated, task, path, result)] = path, result
            else:
                yield path, sha256, result
    client.cancel(list(running))


def _result(future: Any, path: Path, sha256: str) -> str | pa.Table | Failed:
    """What a worker gave; what nobody foresaw is no end of the batch either."""
    error = future.exception()
    if error is None:
        return future.result()
    if type(error).__name__ == "KilledWorker":
        problem, remedy = f"its worker died {_RETRIES + 1} times", "fewer --workers, if memory is short"
    else:
        problem, remedy = f"{type(error).__name__}: {error}", "please report it, with the file"
    return Failed(path, sha256, f"{path}: {problem}\n  remedy: {remedy}")


def _take(dataset: Dataset, counts: Counts, path: Path, sha256: str, rows: pa.Table | Failed | None) -> None:
    if rows is None:
        counts.skipped += 1
    elif isinstance(rows, Failed):
        dataset.take_failure(rows)
        counts.failed += 1
    else:
        dataset.take(path, sha256, rows)
        counts.done += 1


def _settings(bench: Bench, options: BatchOptions) -> dict[str, Any]:
    """What rows depend on beside the files."""
    return {
        "software": __version__,
        "models": [model_hash(each.parameters) for each in bench.injectors],
        "bench": file_hash(bench.path),
        "state": file_hash(options.state) if options.state is not None else None,
        "learning": options.learning,
        "injector_from": options.pattern,
    }


def _knowledge(bench: Bench, options: BatchOptions, console: Console) -> Knowledge | None:
    if options.state is None:
        return None
    parameters = bench.injector.parameters
    return restored_knowledge(
        options.state,
        model_hash(parameters),
        parameters.scaling.pressure,
        partial(say, console),
        set_aside=False,
    )


def _tell(dataset: Dataset, counts: Counts, options: BatchOptions, console: Console) -> None:
    """What came of it: files in words or JSON, and those that failed."""
    for failed in dataset.failed:
        say(console, f"left out: {failed.problem}")
    if options.json:
        said = {**vars(counts), "injections": dataset.injections, "out": str(options.out)}
        print(json.dumps(said, indent=2))
        return
    text = f"{counts.done} files, {dataset.injections} injections"
    if counts.skipped:
        text += f"; {counts.skipped} were done before, or are copies"
    if counts.failed:
        text += f"; {counts.failed} could not be evaluated, see {options.out / 'errors.parquet'}"
    say(results(), f"{text}; {options.out}")
