"""The processes that do the work: of this computer, or of a Dask cluster that is there already."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from observer_rt.foundation.errors import RunError

CONNECT_TIMEOUT = 10.0  # s
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


@contextmanager
def connected(address: str | None, workers: int | None) -> Iterator[Any]:
    """A `distributed.Client` of workers. address: of their scheduler; None: some are started here, one a CPU unless
    stated.

    Raises `RunError` for a scheduler that cannot be reached.
    """
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
