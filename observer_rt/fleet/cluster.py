"""The processes that do the work: of this computer, or of a Dask cluster that is there already."""

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from observer_rt.foundation.errors import RunError, UserError

CONNECT_TIMEOUT = 10.0  # s


@contextmanager
def connected(address: str | None, workers: int | None) -> Iterator[Any]:
    """A `distributed.Client`. address: of a scheduler; None: of workers started here, one a CPU unless stated.

    Raises `UserError` without Dask, `RunError` for a scheduler that cannot be reached.
    """
    try:
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
            yield client
        return
    with (
        LocalCluster(
            n_workers=workers,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # None is not none, but port 8787
            memory_limit=0,  # a file takes what it takes, whatever its length; compiling takes more for once
            silence_logs=logging.ERROR,
        ) as local,
        Client(local) as client,
    ):
        yield client
