"""Recordings named by files, folders and patterns, and gathered by injector, as discovery takes them."""

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from glob import glob
from pathlib import Path
from typing import ClassVar
from urllib.parse import quote

import pyarrow as pa

from observer_rt.config.bench import Bench
from observer_rt.config.channels import effects_on_one_raster
from observer_rt.config.injector_file import InjectorFile
from observer_rt.desk.fleet.moving_wear import COLUMNS, steady_stretch
from observer_rt.files.formats import formats, suffixes_of
from observer_rt.files.signals.recording import TRUTH_SUFFIX
from observer_rt.foundation.console import suffix_of
from observer_rt.foundation.errors import UserError
from observer_rt.identification.discovery.search.candidates import problem_key

_PATTERN = re.compile(r"[*?\[]")
_DATE_FORMATS = {8: 6, 12: 10, 14: 12}  # characters of the format by digits
MOST_RECORDINGS = 16
"""The latest ones of an injector: wear of months is no single size, and a search takes time and memory by samples."""
NEEDED = ("injector", "sha256", "time", *COLUMNS)
"""Columns of a batch's rows that groups are made of."""


def recordings_in(sources: Sequence[str]) -> list[Path]:
    """All files, each once, in order: of a folder those, at any depth, whose suffix is a recording's or a log's.

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


_OTHER_FILES_OF_FOLDERS = {
    ".txt",
    ".txt.gz",
    ".dat",
    ".npy",
}  # notes, more often than recordings: to be named


def _files(source: str) -> Iterator[Path]:
    path = Path(source)
    if path.is_dir():
        known = set(_suffixes()) - _OTHER_FILES_OF_FOLDERS
        for each in sorted(path.rglob("*")):
            if each.is_file() and suffix_of(each) in known and not each.name.endswith(TRUTH_SUFFIX):
                yield each
    elif path.exists():
        yield path
    elif _PATTERN.search(source):
        for name in sorted(glob(source, recursive=True)):  # noqa: PTH207 (an absolute pattern, too)
            yield from _files(name)


def _suffixes() -> tuple[str, ...]:
    return suffixes_of(formats())


class _PathPattern:
    """A regular expression of the command line, looked for in paths; None: nothing is."""

    OPTION: ClassVar[str]
    EXAMPLE: ClassVar[str]

    def __init__(self, pattern: str | None) -> None:
        """Raises `UserError` for what is no regular expression."""
        try:
            self._pattern = None if pattern is None else re.compile(pattern)
        except re.error as error:
            problem = f"is no regular expression: {error}"
            raise UserError(f"{self.OPTION} {pattern}", problem, f"write it like '{self.EXAMPLE}'") from error

    def _found(self, path: Path) -> str:
        """The first group, or all that matches, of a path; empty where nothing does."""
        found = self._pattern and self._pattern.search(str(path))
        return (found[1] if found.groups() else found[0]) or "" if found else ""


class InjectorNames(_PathPattern):
    """Injector of a recording, and its name in tables; without a pattern that of the bench's injector."""

    OPTION = "--injector-from"
    EXAMPLE = r"injector_(\w+)"

    def of(self, path: Path, alone: Bench) -> str:
        """The injector's name. Raises `UserError` for a path that the pattern does not match."""
        if self._pattern is None:
            return alone.injector.name or f"injector_{alone.injector.config.outputs.injector_id}"
        if not (name := self._found(path)):
            raise UserError(str(path), f"'{self._pattern.pattern}' is not in its path", f"see {self.OPTION}")
        return name


def doubt_of_one(paths: Sequence[Path], pattern: str | None, bench: Bench) -> str:
    """Warning that recordings count as those of one injector only because nothing names it; or empty.

    pattern: of `--injector-from`.
    """
    if pattern is not None or len(paths) < 2 or len(bench.injectors) > 1 or bench.injector.name:
        return ""
    is_in_folders = len({path.parent for path in paths}) > 1
    likely = r"([^/]+)/[^/]+$" if is_in_folders else r"([^/]+)\.\w+$"
    return (
        f"all {len(paths)} recordings count as those of one injector, {InjectorNames(None).of(Path(), bench)}\n"
        f"  remedy: if they are of several, say what in their paths names it, such as {InjectorNames.OPTION} "
        f"'{likely}', into a new folder"
    )


class RecordingTimes(_PathPattern):
    """Begin of recordings by their paths; without a pattern these state none."""

    OPTION = "--time-from"
    EXAMPLE = r"_(\d{8}_\d{6})"

    def of(self, path: Path) -> datetime | None:
        """The time (UTC) that a path says. Raises `UserError` for one that says none, though it should."""
        if self._pattern is None:
            return None
        digits = re.sub(r"\D", "", self._found(path))
        try:
            return datetime.strptime(digits, "%Y%m%d%H%M%S"[: _DATE_FORMATS[len(digits)]]).replace(tzinfo=UTC)
        except (KeyError, ValueError):
            raise UserError(
                str(path),
                f"'{self._pattern.pattern}' finds no date in its path",
                f"see {self.OPTION}: year, month, day and, if it is there, the time of day, such as "
                f"'{self.EXAMPLE}'",
            ) from None


@dataclass(frozen=True)
class ModelGroup:
    """Injectors of one model. alone: the bench with this injector only; file: its model, which is to be amended."""

    alone: Bench
    file: InjectorFile


@dataclass(frozen=True)
class Group:
    """Recordings of an injector, by path and SHA-256, the latest first; recordings: how many there are in all.

    moved: what wear did before these, in words, empty: nothing.
    """

    injector: str
    kind: ModelGroup
    files: tuple[tuple[Path, str], ...]
    recordings: int
    moved: str = ""

    @property
    def folder(self) -> str:
        """Name of its folder: any name of an injector can be one."""
        name = quote(self.injector, safe="")
        return name.replace(".", "%2E") if set(name) == {"."} else name

    def key(self, healthy: Sequence[str]) -> str:
        """SHA-256 of all its answer depends on: recordings, model, vocabulary, program. healthy: hashes of those."""
        injector = self.kind.alone.injector
        own = problem_key(
            injector.parameters, sorted(sha256 for _, sha256 in self.files), effects_on_one_raster(injector)
        )
        content = [own, self.kind.file.sha256, sorted(healthy)]
        return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def kinds_of(bench: Bench, pattern: str | None) -> tuple[ModelGroup, ...]:
    """The injectors of a bench, as discovery needs them.

    Raises `UserError` for a bench file or an injector file discovery cannot use, and for names by a pattern where
    every recording is of several injectors.
    """
    if pattern is not None and len(bench.injectors) > 1:
        names = ", ".join(each.name for each in bench.injectors)
        raise UserError(
            f"{InjectorNames.OPTION} {pattern}",
            f"gives one name to {len(bench.injectors)} injectors of {bench.path}: {names}",
            f"choose one of them, such as --injector {bench.injectors[0].name}, or leave the pattern out",
        )
    for injector in bench.injectors:
        effects_on_one_raster(injector)
    return tuple(
        ModelGroup(alone, InjectorFile.read(alone.injector.parameters_path.absolute()))
        for alone in bench.each
    )


def groups_of(rows: pa.Table, files: Mapping[str, Path], kinds: Sequence[ModelGroup]) -> list[Group]:
    """A group for every injector that has injections in the rows of a batch (columns `NEEDED`), by name.

    files: paths by SHA-256; rows of other files are left out. kinds: one, or those of a bench by their own names.
    """
    own_names = {InjectorNames(None).of(Path(), kind.alone): kind for kind in kinds}
    table = rows.to_pandas()
    first = table.groupby(["injector", "sha256"], as_index=False)["time"].min()
    latest = first[first["sha256"].isin(list(files))].sort_values(["time", "sha256"], ascending=False)

    def group(name: str, recordings: Sequence[str]) -> Group:
        kind = kinds[0] if len(kinds) == 1 else own_names[name]
        asked = steady_stretch(table[table["injector"] == name], recordings[:MOST_RECORDINGS])
        taken = tuple((files[sha256], sha256) for sha256 in asked.recordings)
        return Group(name, kind, taken, len(recordings), asked.says)

    return [group(str(name), list(its["sha256"])) for name, its in latest.groupby("injector")]
