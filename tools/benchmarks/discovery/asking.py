"""Many cases: asked about with nothing but a label known of them, and worked through once each."""

import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, TypeVar

from rich.console import Console

from observer_rt.config.bench import NOMINAL_INJECTOR
from observer_rt.terminal.console import progress_bar
from tools.benchmarks.discovery.answers import Answer, ask
from tools.benchmarks.pool import Crash, run_tasks
from tools.benchmarks.store import Store


class Labelled(Protocol):
    """What is worked on case by case, or comes of it."""

    @property
    def label(self) -> str:
        """Label of the case."""


Item = TypeVar("Item", bound=Labelled)
Part = TypeVar("Part", bound=Labelled)


def ask_and_keep(
    program: Sequence[str],
    label: str,
    recordings: Sequence[Path],
    out: Path,
    model: Path = NOMINAL_INJECTOR,
    choose: bool = True,
) -> Answer:
    """Ask about recordings in a folder of their own; the findings stay in `out`, nothing else."""
    answer = out / "asked" / label
    try:
        found = ask(program, label, recordings, answer, model, choose)
        kept = out / "findings" / f"{label}.json"
        kept.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(answer / "findings.json", kept)
        return found
    finally:
        for folder in (recordings[0].parent, answer):
            shutil.rmtree(folder, ignore_errors=True)


def ready() -> None:
    """A process needs nothing before its first case."""


def worked_through(
    what: str,
    store: Store[Part],
    work: Callable[[Item], Part],
    items: Sequence[Item],
    workers: int,
    console: Console,
    crashes: list[str],
) -> dict[str, Part]:
    """Results by label: those in the store, and the missing ones worked out."""
    labels = {item.label for item in items}
    done = {part.label: part for part in store.load() if part.label in labels}
    missing = [item for item in items if item.label not in done]
    if done and missing:
        console.print(f"{what}: {len(done)} of {len(items)} are there already")
    if not missing:
        return done
    with progress_bar(console, what, float(len(missing))) as progress:
        for number, result in enumerate(run_tasks(work, missing, workers, ready)):
            if isinstance(result, Crash):
                crashes.append(f"{what}: {result.task.label}: {result.message}")
            else:
                store.add(result)
                done[result.label] = result
            progress(float(number + 1))
    return done
