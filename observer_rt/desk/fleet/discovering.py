"""`observer-rt batch --discover`: what is missing in the model, injector by injector, and one table of it.

discovered/INJECTOR/             report.html, findings.json, amended.toml as `discover` writes them
discovered/INJECTOR/group.json   what the answer belongs to, and the recordings that could not be taken
discovered.parquet               a row an injector, `answers.DiscoveredRow`, the most affected first
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.config.channels import effects_on_one_raster
from observer_rt.desk.evaluation.logged import open_source
from observer_rt.desk.fleet.answers import FOLDER, Answers, DiscoveredRow, Ended, answer_table
from observer_rt.desk.fleet.cluster import Broken, Jobs, Work
from observer_rt.desk.fleet.dataset import Results, read_injections
from observer_rt.desk.fleet.groups import NEEDED, Group, ModelGroup, groups_of, kinds_of
from observer_rt.desk.fleet.job import NO_MEMORY, FailedFile
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import ObserverError, UserError
from observer_rt.foundation.files import file_errors, file_hash
from observer_rt.foundation.outputs import make_folder
from observer_rt.identification.discovery.discover import (
    AMENDED,
    REPORT,
    DiscoveryTask,
    answer,
    fits_in,
    refuse_incomparable,
    write_findings,
)
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
from observer_rt.identification.likelihood.measurement import Measurement
from observer_rt.identification.likelihood.reading import (
    hashes,
    read_measured,
    refuse_rates_missing,
    refuse_sample_rates,
)

SAMPLES = 4 * MOST_SAMPLES
"""Most samples of all recordings of an injector together: a search takes memory and time by samples."""
_WAITING = 2  # groups at a worker, so that it need not wait for the next


@dataclass(frozen=True)
class Inquiry:
    """Settings shared by all groups.

    folder: where relative paths begin; out: of all answers; healthy: recordings the model is judged against; threads:
    of each search.
    """

    folder: Path
    out: Path
    healthy: tuple[Path, ...]
    threads: int


def discovered(inquiry: Inquiry, group: Group) -> Ended:
    """Write the answer on a group into its folder."""
    left_out: list[FailedFile] = []
    problem = ""
    try:
        _look(inquiry, group, left_out)
    except ObserverError as error:
        problem = str(error)
    except MemoryError:
        problem = NO_MEMORY
    return Ended(tuple(left_out), problem)


def _look(inquiry: Inquiry, group: Group, left_out: list[FailedFile]) -> None:
    """left_out: of recordings that cannot be taken. Raises `UserError` where there is no other."""
    begin, quiet = time.monotonic(), Console(quiet=True)
    injector = group.kind.alone.injector
    stated = effects_on_one_raster(injector)
    open_one = partial(open_source, bench=group.kind.alone, from_channels=(), console=quiet)

    def read(paths: Sequence[Path], most: int = MOST_SAMPLES) -> tuple[Measurement, ...]:
        return read_measured(paths, open_one, quiet, min(most, MOST_SAMPLES), stated) if paths else ()

    taken: dict[Path, Measurement] = {}  # what can be judged with the latest one
    for name, sha256 in group.files:
        path = inquiry.folder / name
        try:
            (one,) = read([path], SAMPLES // len(group.files))
            with_first = [each.recording for each in (*list(taken.values())[:1], one)]
            refuse_sample_rates(with_first)
            refuse_rates_missing(with_first)
        except ObserverError as error:
            left_out.append(FailedFile(name, sha256, str(error), group.injector))
        else:
            taken[path] = one
    if not taken:
        raise UserError(
            f"{len(left_out)} recordings", f"none can be taken, the latest because {left_out[0].problem}"
        )
    measured, healthy = tuple(taken.values()), read(inquiry.healthy)
    refuse_sample_rates([one.recording for one in (*measured, *healthy)])
    task = DiscoveryTask(injector.parameters, measured, healthy, hashes(list(taken)))
    refuse_incomparable(task, group.kind.file.name)
    folder = inquiry.out / group.folder
    make_folder("--out", folder)
    with fits_in(folder, task, stated) as store:
        found = answer(task, store, lambda _: None, AMENDED, inquiry.threads)
    found = replace(found, seconds=time.monotonic() - begin)
    write_findings(folder, task, found, group.kind.file, inquiry.healthy)


@dataclass(frozen=True)
class Discovering:
    """Request for every injector. healthy: recordings the model is judged against, by path, with SHA-256."""

    kinds: tuple[ModelGroup, ...]
    healthy: Mapping[Path, str]

    @classmethod
    def of(cls, bench: Bench, pattern: str | None, healthy: Sequence[Path]) -> "Discovering":
        """Raises `UserError` for files with which discovery could not begin."""
        hashes = {}
        for path in healthy:
            with file_errors(path):
                hashes[path.absolute()] = file_hash(path)
        return cls(kinds_of(bench, pattern), hashes)

    def of_groups(self, work: Work, files: Mapping[str, Path], dataset: Results) -> "FoundAnswers":
        """Have the workers look for what is missing in every injector. files: those of this run by SHA-256.

        Raises `InterruptionError` when it is interrupted.
        """
        answers, found = Answers(dataset.folder), FoundAnswers()
        groups = groups_of(read_injections(dataset.folder, NEEDED), files, self.kinds)
        keys = {group.injector: group.key(tuple(self.healthy.values())) for group in groups}
        waiting: list[Group] = []
        for group in groups:
            left_out = answers.left_out(group, keys[group.injector])
            if left_out is None:
                waiting.append(group)
            else:
                found.skipped += 1
                dataset.take_failures(left_out)
        with progress_bar(work.console, "looking for what is missing", len(waiting)) as progress:
            for group, ended in _outcomes(work, self, answers.place, waiting):
                answers.take(group, keys[group.injector], ended)
                dataset.take_failures(ended.left_out)
                if ended.problem:
                    said = f"injector {group.injector}: {ended.problem}"
                    dataset.take_failures([FailedFile(None, "", said, group.injector)])
                found.failed += bool(ended.problem)
                found.done += not ended.problem
                progress(found.done + found.failed)
        found.answers = answers.table()
        work.refuse_interrupted(found.done + found.skipped, len(groups), "injectors")
        return found


@dataclass
class FoundAnswers:
    """Numbers of injectors with an answer, from this run or an earlier one, or none; answers: all there are."""

    answers: tuple[DiscoveredRow, ...] = ()
    done: int = 0
    skipped: int = 0
    failed: int = 0

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        counts = {"done": self.done, "skipped": self.skipped, "failed": self.failed}
        return {**counts, "injectors": [row.model_dump() for row in self.answers]}

    def show(self, folder: Path) -> None:
        """On the screen; folder: of the batch."""
        text = f"{self.done} injectors"
        if self.skipped:
            text += f"; {self.skipped} were done before"
        if self.failed:
            text += f"; {self.failed} have no answer"
        results().print(answer_table(self.answers))
        say(results(), f"{text}; {folder}/{FOLDER}/INJECTOR/{REPORT}")


def _outcomes(
    work: Work, asked: Discovering, place: Path, groups: Sequence[Group]
) -> Iterator[tuple[Group, Ended]]:
    """Outcome of each group, as it becomes known."""
    jobs: Jobs[Group] = Jobs(work.cluster.client)
    threads = jobs.places // max(1, len(groups)) if work.cluster.local else 1
    inquiry = Inquiry(Path.cwd(), place.absolute(), tuple(asked.healthy), max(1, threads))
    remaining = iter(groups)

    def begin_more() -> None:
        for group in islice(remaining, max(0, _WAITING * jobs.places - len(jobs))):
            jobs.begin(group, discovered, inquiry, group)

    for group, result in jobs.outcomes(work.stop, begin_more):
        yield group, Ended(problem=str(result)) if isinstance(result, Broken) else result
