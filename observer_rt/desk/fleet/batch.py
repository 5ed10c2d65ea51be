"""`observer-rt batch`: thousands of recordings, an injection a row, in a folder of partitioned Parquet.

injections/injector=NAME/SHA256.parquet   rows of one file, `job.SCHEMA` without the injector
done.jsonl                                a line for every file whose rows are written
errors.jsonl                              while a batch runs: a line for every file without rows, and why
errors.parquet                            the same, once it is over
batch.json                                by which model and how: another one needs another folder
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self
from urllib.parse import quote

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq
from rich.console import Console

from observer_rt import __version__
from observer_rt.config.bench import Bench
from observer_rt.config.own_effects import OwnEffects
from observer_rt.daemon.persistence.state_file import model_hash
from observer_rt.desk.fleet.cluster import Broken, Jobs, Work
from observer_rt.desk.fleet.job import OLD_NAMES, SCHEMA, FailedFile, Task, evaluated, hashed
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.files import file_errors, file_hash, replacing
from observer_rt.model.effects import BUILT_IN

if TYPE_CHECKING:
    from observer_rt.desk.fleet.discovering import FoundAnswers

INJECTIONS = "injections"
_DONE, _ERRORS, _SETTINGS = "done.jsonl", "errors.parquet", "batch.json"
_ERRORS_SO_FAR = "errors.jsonl"
_FAILED = pa.schema([(name, pa.string()) for name in ("file", "sha256", "injector", "problem")])
_PARTITION = "injector"
_WAITING = 4  # files at a worker, so that it need not wait for the next
_Outcome = tuple[Path, str, pa.Table | FailedFile | None]
"""A file, its hash, and its rows; None: they were there before."""


class Dataset:
    """Takes results in whatever order; what is there when the power fails is whole, and is not done again.

    A context in which files are evaluated: what failed in an earlier one is forgotten, as it is tried again.
    """

    def __init__(self, folder: Path, settings: dict[str, Any]) -> None:
        """settings: what the rows depend on beside the files. Raises `UserError` for a folder with others."""
        self.folder = folder
        with file_errors(folder):
            (folder / INJECTIONS).mkdir(parents=True, exist_ok=True)
            self._refuse_other({**settings, "columns": SCHEMA.names})
            self._done = self._read_done()
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
        """Rows of one file; first they are written, then it is noted as done."""
        with file_errors(self.folder):
            for name in pc.unique(rows[_PARTITION]).to_pylist():
                place = self.folder / INJECTIONS / f"{_PARTITION}={quote(name, safe='')}"
                place.mkdir(exist_ok=True)
                its = rows.filter(pc.equal(rows[_PARTITION], name)).drop_columns([_PARTITION])
                write_table(place / f"{sha256}.parquet", its)
            with (self.folder / _DONE).open("a", encoding="utf-8") as done:
                line = {"sha256": sha256, "file": str(path), "injections": rows.num_rows}
                done.write(json.dumps(line) + "\n")
        self._done.add(sha256)
        self.injections += rows.num_rows

    def take_failures(self, failed: Sequence[FailedFile]) -> None:
        """Files without rows, or that discovery could not take."""
        if not failed:
            return
        self._failed += failed
        with file_errors(self.folder), (self.folder / _ERRORS_SO_FAR).open("a", encoding="utf-8") as errors:
            errors.writelines(json.dumps(_row(each)) + "\n" for each in failed)

    def __enter__(self) -> Self:
        with file_errors(self.folder):
            for name in (_ERRORS, _ERRORS_SO_FAR):
                (self.folder / name).unlink(missing_ok=True)
        return self

    def __exit__(self, *_: object) -> None:
        if self._failed:
            table = pa.Table.from_pylist([_row(each) for each in self._failed], _FAILED)
            write_table(self.folder / _ERRORS, table)
            (self.folder / _ERRORS_SO_FAR).unlink()

    def _read_done(self) -> set[str]:
        path = self.folder / _DONE
        if not path.exists():
            return set()
        text = path.read_text(encoding="utf-8")
        if not text.endswith("\n"):  # the power failed within the last line: that file is done again
            text = text[: text.rfind("\n") + 1]
            path.write_text(text, encoding="utf-8")
        return {str(json.loads(line)["sha256"]) for line in text.splitlines()}

    def _refuse_other(self, settings: dict[str, Any]) -> None:
        path = self.folder / _SETTINGS
        if not path.exists():
            if there := [name for name in (_DONE, _ERRORS, _ERRORS_SO_FAR) if (self.folder / name).exists()]:
                raise UserError(
                    f"--out {self.folder}", f"holds {there[0]}, of no batch", "name another folder"
                )
            path.write_text(json.dumps(settings, indent=2), encoding="utf-8")
            return
        before = json.loads(path.read_text(encoding="utf-8"))
        other = [key for key in settings if before.get(key) != settings[key]]
        if other:
            raise UserError(
                f"--out {self.folder}",
                f"holds the results of another batch: {', '.join(other)} differ",
                "name another folder",
            )


def write_table(path: Path, table: pa.Table) -> None:
    """A table as Parquet, whole whenever somebody looks."""
    with file_errors(path), replacing(path) as part:
        pq.write_table(table, part)


def _row(failed: FailedFile) -> dict[str, str | None]:
    said = {**vars(failed), "file": failed.file and str(failed.file), "injector": failed.injector or None}
    return {name: said[name] for name in _FAILED.names}


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


@dataclass
class Evaluated:
    """Numbers of files by outcome; paths: of those that did not fail, by SHA-256."""

    done: int = 0
    skipped: int = 0
    failed: int = 0
    paths: dict[str, Path] = field(default_factory=dict)

    @property
    def well(self) -> int:
        """Files whose rows are there."""
        return self.done + self.skipped


def evaluate_all(work: Work, task: Task, paths: Sequence[Path], dataset: Dataset) -> Evaluated:
    """Rows of all files into the dataset. Raises `InterruptionError` when it is interrupted."""
    counts = Evaluated()
    with progress_bar(work.console, "evaluating", len(paths)) as progress:
        for path, sha256, rows in _outcomes(work, task, paths, dataset):
            _take(dataset, counts, path, sha256, rows)
            progress(counts.well + counts.failed)
    work.refuse_interrupted(counts.well, len(paths), "files")
    return counts


def _outcomes(work: Work, task: Task, paths: Sequence[Path], dataset: Dataset) -> Iterator[_Outcome]:
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
    dataset: Dataset, counts: Evaluated, path: Path, sha256: str, rows: pa.Table | FailedFile | None
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
    counts.paths.setdefault(sha256, path)


def settings_of(
    bench: Bench, state: Path | None, learning: bool, pattern: str | None, effects: OwnEffects
) -> dict[str, Any]:
    """Settings that rows depend on beside the files."""
    in_force = {effect.id for each in bench.injectors for effect in each.parameters.effects}
    return {
        "software": __version__,
        "models": [model_hash(each.parameters) for each in bench.injectors],
        "bench": file_hash(bench.path),
        "state": file_hash(state) if state is not None else None,
        "learning": learning,
        "injector_from": pattern,
        "effects": list(effects.digests) if in_force - BUILT_IN.keys() else [],
    }


def tell(
    dataset: Dataset, counts: Evaluated, found: "FoundAnswers | None", as_json: bool, console: Console
) -> None:
    """Print the outcome: files, and answers if asked for, in words or JSON; those that failed."""
    for failed in dataset.failed:
        say(console, f"left out: {failed.problem}")
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
        text += f"; {counts.failed} could not be evaluated, see {dataset.folder / 'errors.parquet'}"
    say(results(), f"{text}; {dataset.folder}")
    if found is not None:
        found.show(dataset.folder)
