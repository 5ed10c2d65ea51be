"""Kinds of failure a user can meet, their exit codes; what a misspelt name meant; which extra brings a library."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from difflib import SequenceMatcher
from importlib.util import find_spec
from pathlib import Path

REMEDY = "\n  remedy: "  # between a problem and what to do
CUTOFF = 0.6  # likeness below which two names have nothing to do with each other

EXTRAS = {
    "asammdf": "desk",
    "jinja2": "desk",
    "markupsafe": "desk",
    "matplotlib": "desk",
    "dask": "batch",
    "distributed": "batch",
    "tornado": "monitor",
}


class ObserverError(Exception):
    """A failure with a message for the user; `exit_code` is what the command line returns."""

    exit_code = 1


class RunError(ObserverError):
    """Failed at run time: the interface went away, the disk is full (exit code 1)."""


class InterruptionError(ObserverError):
    """The user stopped a command that has no result before its end (exit code 130: 128 and SIGINT, as of a shell)."""

    exit_code = 130


class UserError(ObserverError):
    """The command line or a file the user supplied must change (exit code 2).

    The message names the location (file, key or line), the problem (found against expected) and the remedy.
    """

    exit_code = 2

    def __init__(self, location: str, problem: str, remedy: str = "") -> None:
        self.location = location
        self.problem = problem
        self.remedy = remedy
        super().__init__(f"{location}: {problem}" + (f"{REMEDY}{remedy}" if remedy else ""))


@contextmanager
def file_errors(path: Path) -> Iterator[None]:
    """Turn the operating system's errors on a file the user named into `UserError` and `RunError`."""
    try:
        yield
    except FileNotFoundError:
        raise UserError(str(path), "no such file or folder", "check the path") from None
    except (PermissionError, IsADirectoryError, NotADirectoryError) as error:
        remedy = "name a file, for parts in a folder must be joined" if path.is_dir() else "check path and rights"
        raise UserError(str(path), f"cannot be opened: {error.strerror}", remedy) from None
    except OSError as error:
        raise RunError(f"{path}: {error.strerror or error}") from error


def nearest(name: str, names: Iterable[str]) -> str | None:
    """The known name most like `name`, whatever its case; None when none is like it."""

    def likeness(other: str) -> tuple[float, float]:
        return SequenceMatcher(None, name.lower(), other.lower()).ratio(), SequenceMatcher(None, name, other).ratio()

    best = max(names, key=likeness, default=None)
    return best if best is not None and likeness(best)[0] >= CUTOFF else None


def did_you_mean(name: str, names: Iterable[str]) -> str:
    """Beginning of a remedy: `did you mean 'X'? `, or nothing when no known name is near."""
    best = nearest(name, names)
    return "" if best is None else f"did you mean '{best}'? "


def hint(name: str, names: Iterable[str]) -> str:
    """End of a message: `; the nearest is 'X'`, or nothing when no known name is near."""
    best = nearest(name, names)
    return "" if best is None else f"; the nearest is '{best}'"


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
