"""Tells Numba where code is kept: by unit and state of the source, see `foundation.compilation`."""

from collections.abc import Callable
from typing import Any

from numba import config
from numba.core.caching import UserProvidedCacheLocator

from observer_rt.foundation.compilation import unit_folder, unit_of


class UnitCacheLocator(UserProvidedCacheLocator):
    """The folder of a function's unit, in it one for each folder of source."""

    def __init__(self, py_func: Callable[..., Any], py_file: str) -> None:
        super().__init__(py_func, py_file)
        folder = unit_folder(config.CACHE_DIR, unit_of(py_file))
        self._cache_path = str(folder / self.get_suitable_cache_subpath(py_file))
