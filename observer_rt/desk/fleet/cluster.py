"""The processes that do the work: of this computer, or of a Dask cluster that is there already."""

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any, Generic, TypeVar

from rich.console import Console

from observer_rt.foundation.errors import InterruptionError, RunError, UserError

CONNECT_TIMEOUT = 10.0  # s
_RETRIES = 2  # of a job whose worker is gone
_WAIT = 0.5  # s to a look at Ctrl-C
_SETTINGS = {
    # how often Dask looks at its own processes: as often as it would, that takes some percent of each
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.worker.preload": ["observer_rt.desk.fleet.job"],
    # what workers keep of memory they gave back: with the little that Dask leaves them, a chunk of samples after
    # another is taken from the kernel anew, for a twelfth of all their time
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": 1 << 24,
    "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": 1 << 24,
}

_Name = TypeVar("_Name")


@dataclass(frozen=True)
class Broken:
    """Failure of a job that returned nothing, not even an error its function foresees."""

    problem: str
    remedy: str

    def __str__(self) -> str:
        return f"{self.problem}\n  remedy: {self.remedy}"


class Jobs(Generic[_Name]):
    """Jobs at the workers, each with a name for whoever began it; begun again where a worker dies."""

    def __init__(self, client: Any) -> None:
        self._client = client
        self._submit = partial(client.submit, pure=False, retries=_RETRIES)
        self._running: dict[Any, _Name] = {}

    def __len__(self) -> int:
        return len(self._running)

    @property
    def places(self) -> int:
        """Number of jobs the workers do at the same time."""
        threads: list[int] = list(self._client.ncores().values())
        return max(1, sum(threads))

    def begin(self, name: _Name, function: Callable[..., Any], *arguments: Any) -> None:
        """Have a worker call the function."""
        self._running[self._submit(function, *arguments)] = name

    def ended(self) -> Iterator[tuple[_Name, Any]]:
        """Results of jobs that are over, waiting a moment for the next one: the function's, or `Broken`."""
        from distributed import wait

        try:
            ready = wait(list(self._running), timeout=_WAIT, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            return
        for future in ready:
            yield self._running.pop(future), _result(future)

    def outcomes(self, stop: threading.Event, begin_more: Callable[[], None]) -> Iterator[tuple[_Name, Any]]:
        """Results of all jobs, as they become known; begin_more begins as many as keep the workers busy.

        Gives up what is not over when the user wants no more.
        """
        while not stop.is_set():
            begin_more()
            if not self._running:
                return
            yield from self.ended()
        self._client.cancel(list(self._running))


def _result(future: Any) -> Any:
    error = future.exception()
    if error is None:
        return future.result()
    if type(error).__name__ == "KilledWorker":
        return Broken(f"its worker died {_RETRIES + 1} times", "fewer --workers, if memory is short")
    return Broken(f"{type(error).__name__}: {error}", "please report it, with the file")


@dataclass(frozen=True)
class Cluster:
    """A `distributed.Client` of workers. local: started here for this command, with its CPUs."""

    client: Any
    local: bool


@contextmanager
def connected(address: str | None, workers: int | None) -> Iterator[Cluster]:
    """Workers. address: of their scheduler; None: some are started here, one a CPU unless stated.

    Raises `UserError` without Dask, `RunError` for a scheduler that cannot be reached.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise UserError(
            "batch", "needs Dask, which is not installed", "pip install 'observer-rt[batch]'"
        ) from error
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
            yield Cluster(client, local=False)
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
        yield Cluster(client, local=True)


@dataclass(frozen=True)
class Work:
    """Workers; stop: set when the user wants no more; console: for progress and messages."""

    cluster: Cluster
    stop: threading.Event
    console: Console

    def refuse_interrupted(self, done: int, of: int, what: str) -> None:
        """Raise `InterruptionError` where the user wants no more; done, of: how many of what."""
        if self.stop.is_set():
            raise InterruptionError(
                f"interrupted; {done} of {of} {what} are done\n  remedy: give the same command again to go on"
            )
