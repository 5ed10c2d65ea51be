"""The runner of campaigns: cases worked through on a few processes, resumably; results on disk, a JSON line each."""

import hashlib
import json
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

from pydantic import TypeAdapter, ValidationError

import observer_rt
from observer_rt.foundation.errors import RunError
from tests.plants import plant
from tools.benchmarks.command_line import messages, tracked

BENCHMARKS = Path(__file__).parent
PLANTS = Path(plant.__file__).parent
MEASURING = (BENCHMARKS, PLANTS)
"""What a score depends on beside the package."""
PACKAGE = Path(observer_rt.__file__).parent
_SINGLE_THREADED = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_AHEAD = 2  # tasks handed out per process: an interrupted run loses no more


class Labelled(Protocol):
    """What is worked on case by case, or comes of it."""

    @property
    def label(self) -> str:
        """Label of the case."""


Item = TypeVar("Item")
Result = TypeVar("Result")
Given = TypeVar("Given", bound=Labelled)
Part = TypeVar("Part", bound=Labelled)


@dataclass(frozen=True)
class Crash(Generic[Item]):
    """A task that raised an exception."""

    task: Item
    message: str


@dataclass(frozen=True)
class Found(Generic[Result]):
    """What came out, and a line for every case that crashed: at what, which case, and why."""

    results: tuple[Result, ...]
    crashes: tuple[str, ...]


@dataclass(frozen=True)
class Task:
    """One case, by what determines it."""

    class_name: str
    master_seed: int
    number: int

    @property
    def label(self) -> str:
        """The same as text."""
        return f"{self.class_name} {self.master_seed} {self.number}"


@dataclass(frozen=True)
class Plan:
    """What to run: cases 0..cases-1 of every class, on a few processes; results are kept in `out`."""

    classes: tuple[str, ...]
    cases: int
    master_seed: int
    workers: int
    out: Path
    peers: bool

    @property
    def tasks(self) -> tuple[Task, ...]:
        """All cases, class by class."""
        return tuple(Task(c, self.master_seed, n) for c in self.classes for n in range(self.cases))

    @property
    def campaign(self) -> "Campaign":
        """On its processes, kept in its folder."""
        return Campaign(self.out, self.workers)


def digest_of(sources: Iterable[Path]) -> str:
    """Digest of Python files, and of all in folders: results belong to one state of the code."""
    digest = hashlib.sha256()
    for source in sources:
        for path in sorted(source.rglob("*.py")) if source.is_dir() else [source]:
            digest.update(path.relative_to(source).as_posix().encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


class Store(Generic[Result]):
    """A file of results of one type; lines of another state of the code, or cut short, do not count."""

    def __init__(self, path: Path, result_type: type[Result], digest: str) -> None:
        """The folder is made when the first result is added."""
        self.path = path
        self._adapter = TypeAdapter(result_type)
        self._digest = digest

    def load(self) -> list[Result]:
        """All results of this state of the code."""
        if not self.path.exists():
            return []
        results = []
        for line in self.path.read_text().splitlines():
            try:
                entry = json.loads(line)
                if entry["digest"] == self._digest:
                    results.append(self._adapter.validate_python(entry["score"]))
            except (json.JSONDecodeError, KeyError, TypeError, ValidationError):
                continue  # the line an interrupted run was writing
        return results

    def add(self, result: Result) -> None:
        """Append one result and flush it."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        cut_short = self.path.exists() and not self.path.read_bytes().endswith(b"\n")
        with self.path.open("a") as file:
            if cut_short:
                file.write("\n")
            file.write(json.dumps({"digest": self._digest, "score": asdict(result)}) + "\n")  # type: ignore[call-overload]


class Campaign:
    """Cases worked through on a few processes; results are kept in a folder, of what fails is told at the end."""

    def __init__(self, out: Path, workers: int) -> None:
        """Nothing is done yet."""
        self._out, self._workers = out, workers
        self.crashes: list[str] = []

    def found(self, cases: Iterable[Labelled], results: Mapping[str, Result]) -> Found[Result]:
        """Results by label in the order of the cases, and what crashed so far."""
        return Found(
            tuple(results[case.label] for case in cases if case.label in results), tuple(self.crashes)
        )

    def store(self, name: str, result_type: type[Result], *sources: Path) -> Store[Result]:
        """Where results that depend on these sources are kept."""
        return Store(self._out / f"{name}.jsonl", result_type, digest_of(sources))

    def results(
        self,
        what: str,
        store: Store[Part],
        work: Callable[[Given], Part],
        cases: Sequence[Given],
        warm_up: Callable[[], None] | None = None,
    ) -> dict[str, Part]:
        """Results by label: those in the store, and the missing ones worked out."""
        labels = {case.label for case in cases}
        done = {part.label: part for part in store.load() if part.label in labels}
        missing = [case for case in cases if case.label not in done]
        if done and missing:
            messages.print(f"{what}: {len(done)} of {len(labels)} cases are there already, in {self._out}")
        if not missing:
            return done
        for result in tracked(run_tasks(work, missing, self._workers, warm_up), what, len(missing)):
            if isinstance(result, Crash):
                self.crashes.append(f"{what}: {result.task.label}: {result.message}")
            else:
                store.add(result)
                done[result.label] = result
        return done


def on_case(make: Callable[[str, int, int], Item], score: Callable[[Item], Result], task: Task) -> Result:
    """Work of one process: draw the case of a task, and score it."""
    return score(make(task.class_name, task.master_seed, task.number))


def run_tasks(
    work: Callable[[Item], Result], tasks: Sequence[Item], workers: int, warm_up: Callable[[], None] | None
) -> Iterator[Result | Crash[Item]]:
    """Results in the order they are ready; `work` and `warm_up` (once a process) are module-level functions."""
    for variable in _SINGLE_THREADED:  # the processes share the cores already
        os.environ.setdefault(variable, "1")
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, initializer=_prepare, initargs=(warm_up,)) as pool:
        waiting = list(reversed(tasks))
        running: dict[Future[Result], Item] = {}
        while waiting or running:
            while waiting and len(running) < _AHEAD * workers:
                task = waiting.pop()
                running[pool.submit(work, task)] = task
            done, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in done:
                task = running.pop(future)
                error = future.exception()
                if isinstance(error, BrokenProcessPool):
                    raise RunError("a process of the bench was killed; what is scored is kept, run it again")
                yield Crash(task, f"{type(error).__name__}: {error}") if error else future.result()


def _prepare(warm_up: Callable[[], None] | None) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's: it lets the cases under way end
    if warm_up is not None:
        warm_up()
