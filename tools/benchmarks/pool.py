"""Many cases on a few processes."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from typing import Generic, TypeVar

from observer_rt.foundation.errors import RunError

Item = TypeVar("Item")
Result = TypeVar("Result")
_SINGLE_THREADED = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
_AHEAD = 2  # tasks handed out per process: an interrupted run loses no more


@dataclass(frozen=True)
class Crash(Generic[Item]):
    """A task that raised an exception."""

    task: Item
    message: str


@dataclass(frozen=True)
class Task:
    """One case, by what determines it."""

    class_name: str
    master_seed: int
    number: int


def run_tasks(
    work: Callable[[Item], Result], tasks: Sequence[Item], workers: int, warm_up: Callable[[], None]
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


def _prepare(warm_up: Callable[[], None]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's: it lets the cases under way end
    warm_up()
