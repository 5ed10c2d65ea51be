"""What a worker of this computer does before its first job."""

import gc

import observer_rt.fleet.job  # noqa: F401 - imported for what it imports


def dask_setup(_worker: object) -> None:
    """All that is imported stays: the search for garbage need not go through it again and again."""
    gc.collect()
    gc.freeze()
