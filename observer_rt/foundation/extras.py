"""Libraries that some commands need only: an extra of the package brings each."""

from importlib.util import find_spec

from observer_rt.foundation.errors import UserError

EXTRAS = {
    "asammdf": "desk",
    "jinja2": "desk",
    "matplotlib": "desk",
    "dask": "batch",
    "distributed": "batch",
    "tornado": "monitor",
}


def missing_library(module: str) -> UserError | None:
    """The error for a module that is not installed; None where no extra brings it."""
    library = module.partition(".")[0]
    if library not in EXTRAS:
        return None
    return UserError(library, "is not installed", f"pip install 'observer-rt[{EXTRAS[library]}]'")


def require(*modules: str) -> None:
    """Raise `UserError` where a module is not installed: before long work, or in the place of another process."""
    for module in modules:
        if find_spec(module) is None and (error := missing_library(module)) is not None:
            raise error
