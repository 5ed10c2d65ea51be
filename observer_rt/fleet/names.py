"""What a user names as recordings: files, folders, patterns; and which injector a file is of."""

import re
from collections.abc import Iterator, Sequence
from glob import glob
from pathlib import Path

from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import UserError
from observer_rt.recording.formats import formats, suffixes_of
from observer_rt.recording.signals.recording import TRUTH_SUFFIX
from observer_rt.terminal.destinations import suffix_of

_PATTERN = re.compile(r"[*?\[]")


def recordings_in(sources: Sequence[str]) -> list[Path]:
    """All files, each once, in order: of a folder those, at any depth, whose suffix is known.

    Truths beside simulated recordings are left out. Raises `UserError` for a name under which nothing is.
    """
    found: dict[Path, None] = {}
    for source in sources:
        files = list(_files(source))
        if not files:
            raise UserError(
                source, "names no recording", f"give files, folders or patterns of {', '.join(_suffixes())}"
            )
        found |= dict.fromkeys(files)
    return list(found)


def _files(source: str) -> Iterator[Path]:
    path = Path(source)
    if path.is_dir():
        yield from (each for each in sorted(path.rglob("*")) if each.is_file() and _is_recording(each))
    elif path.exists():
        yield path
    elif _PATTERN.search(source):
        for each in sorted(glob(source, recursive=True)):  # noqa: PTH207 (an absolute pattern, too)
            yield from _files(each)


def _is_recording(path: Path) -> bool:
    return suffix_of(path) in _suffixes() and not path.name.endswith(TRUTH_SUFFIX)


def _suffixes() -> tuple[str, ...]:
    return suffixes_of(formats())


class InjectorNames:
    """Which injector a recording is of, and its name in tables."""

    OPTION = "--injector-from"

    def __init__(self, pattern: str | None) -> None:
        """pattern: of which the first group, or all that matches, of a file's path is the injector's name.

        None: every recording is of the bench's injector. Raises `UserError` for what is no regular expression.
        """
        try:
            self._pattern = None if pattern is None else re.compile(pattern)
        except re.error as error:
            raise UserError(
                f"{self.OPTION} {pattern}",
                f"is no regular expression: {error}",
                r"write it like 'injector_(\w+)'",
            ) from error

    def of(self, path: Path, alone: Bench) -> str:
        """The injector's name. Raises `UserError` for a path that the pattern does not match."""
        own = alone.injector.name or f"injector_{alone.injector.config.outputs.injector_id}"
        if self._pattern is None:
            return own
        found = self._pattern.search(str(path))
        name = found and (found[1] if found.groups() else found[0])
        if not name:
            raise UserError(str(path), f"'{self._pattern.pattern}' is not in its path", f"see {self.OPTION}")
        return name
