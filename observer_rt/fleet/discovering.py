"""`observer-rt batch --discover`: what is missing in the model, injector by injector."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

import pyarrow as pa
from rich.table import Table
from rich.text import Text

from observer_rt.config.bench import Bench
from observer_rt.config.own_effects import OwnEffects
from observer_rt.discovery.folder import REPORT
from observer_rt.fleet.cluster import Broken, Jobs, Work
from observer_rt.fleet.dataset import Dataset, read_injections
from observer_rt.fleet.discovered import FOLDER, SCHEMA, Answers, Ended, Inquiry, discovered
from observer_rt.fleet.groups import NEEDED, Group, ModelGroup, groups_of, kinds_of
from observer_rt.fleet.job import FailedFile
from observer_rt.foundation.files import file_errors, file_hash
from observer_rt.terminal.console import progress_bar, results, say

_WAITING = 2  # groups at a worker, so that it need not wait for the next
_HEADINGS = ("injector", "verdict", "what is missing", "line pressure off [MPa]", "recordings", "but")


@dataclass(frozen=True)
class Discovering:
    """What is asked of every injector. healthy: recordings the model is judged against, by path, with SHA-256."""

    kinds: tuple[ModelGroup, ...]
    healthy: Mapping[Path, str]
    effects: OwnEffects

    @classmethod
    def of(
        cls, bench: Bench, pattern: str | None, healthy: Sequence[Path], effects: OwnEffects
    ) -> "Discovering":
        """Raises `UserError` for files with which discovery could not begin."""
        hashes = {}
        for path in healthy:
            with file_errors(path):
                hashes[path.absolute()] = file_hash(path)
        return cls(kinds_of(bench, pattern), hashes, effects)

    def of_groups(self, work: Work, files: Mapping[str, Path], dataset: Dataset) -> "FoundAnswers":
        """Have the workers look for what is missing in every injector. files: those of this run by SHA-256.

        Raises `RunError` when it is interrupted.
        """
        answers, found = Answers(dataset.folder), FoundAnswers(SCHEMA.empty_table())
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
    """How many injectors have an answer, from this run or an earlier one, or none; answers: all there are."""

    answers: pa.Table
    done: int = 0
    skipped: int = 0
    failed: int = 0

    def as_json(self) -> dict[str, Any]:
        """For programs."""
        counts = {"done": self.done, "skipped": self.skipped, "failed": self.failed}
        return {**counts, "injectors": self.answers.to_pylist()}

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
    """What becomes of each group, as it becomes known."""
    jobs: Jobs[Group] = Jobs(work.cluster.client)
    threads = jobs.places // max(1, len(groups)) if work.cluster.local else 1
    inquiry = Inquiry(Path.cwd(), place.absolute(), tuple(asked.healthy), asked.effects, max(1, threads))
    remaining = iter(groups)

    def begin_more() -> None:
        for group in islice(remaining, max(0, _WAITING * jobs.places - len(jobs))):
            jobs.begin(group, discovered, inquiry, group)

    for group, result in jobs.outcomes(work.stop, begin_more):
        yield group, Ended(problem=str(result)) if isinstance(result, Broken) else result


def answer_table(answers: pa.Table) -> Table:
    """A row an injector, in the order of the table (columns of `discovered.SCHEMA`)."""
    table = Table(box=None, padding=(0, 3, 0, 0), pad_edge=False)
    for heading in _HEADINGS:
        table.add_column(Text(heading, style="bold"), overflow="fold")
    for row in answers.to_pylist():
        table.add_row(*map(Text, (row["injector"], *_cells(row))))
    return table


def _cells(row: dict[str, Any]) -> tuple[str, str, str, str, str]:
    if row["verdict"] is None:
        return "-", "-", "-", str(row["recordings"]), row["problem"].splitlines()[0]
    missing = (
        f"{row['effects']}: {row['sizes']}" if row["sizes"] else row["effects"] or row["proposal"] or "-"
    )
    if row["rivals"]:
        missing += f", or {row['rivals']}"
    but = [row["caveats"]] * bool(row["caveats"])
    if row["left_out"]:
        but.append(f"{row['left_out']} recordings left out")
    return (
        f"{row['verdict']} ({row['confidence']:.2f})",
        missing,
        _off(row),
        f"{row['judged']} of {row['recordings']}",
        "; ".join(but) or "-",
    )


def _off(row: dict[str, Any]) -> str:
    before, after = (row[f"line_pressure_{when}_MPa"] for when in ("before", "after"))
    if before is None:
        return "-"
    return f"{before:.2g} -> {after:.2g}" if row["effects"] and after is not None else f"{before:.2g}"
