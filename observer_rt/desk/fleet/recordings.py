"""Recordings named by files, folders and patterns: injectors and dates in their paths, and when they began."""

import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from enum import StrEnum
from glob import glob
from pathlib import Path
from typing import NamedTuple, Self

from observer_rt.config.bench import Bench
from observer_rt.files.formats import SUFFIXES, is_log, open_log
from observer_rt.files.signals.mdf4_table import stated_start
from observer_rt.files.signals.recording import SHOTS_SUFFIX, TRUTH_SUFFIX
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS

INJECTOR_FROM, TIME_FROM = "--injector-from", "--time-from"
_DATE_FORMATS = {8: "%Y%m%d", 12: "%Y%m%d%H%M", 14: "%Y%m%d%H%M%S"}  # by the number of digits
_GLOB = re.compile(r"[*?\[]")
_NOTES = {".txt"}  # in folders more often notes than recordings: to be named
_SINCE_1970 = 1e9  # s, in 2001: time in a recording is never so late unless it counts from 1970


class PathPattern(NamedTuple):
    """A regular expression that an option of the command line gives, for paths."""

    option: str
    expression: re.Pattern[str]

    @classmethod
    def read(cls, option: str, text: str) -> Self:
        """Raises `UserError` for a text that is no regular expression."""
        try:
            return cls(option, re.compile(text))
        except re.error as error:
            raise UserError(f"{option} {text}", f"is no regular expression: {error}", "correct it") from error

    def text_in(self, path: Path) -> str:
        """The pattern's first group in a path, or its whole match. Raises `UserError` for a path without a match."""
        match = self.expression.search(str(path))
        text = match and match[min(1, self.expression.groups)]
        if not text:
            raise UserError(str(path), f"'{self.expression.pattern}' is not in its path", f"see {self.option}")
        return text

    def date_in(self, path: Path) -> datetime:
        """Date in a path, with the time of day (UTC) if it is there. Raises `UserError` for a path without a date."""
        digits = re.sub(r"\D", "", self.text_in(path))
        try:
            return datetime.strptime(digits, _DATE_FORMATS[len(digits)]).replace(tzinfo=UTC)
        except (KeyError, ValueError):
            remedy = f"see {self.option}: year, month, day and, if it is there, the time of day"
            raise UserError(str(path), f"'{self.expression.pattern}' finds no date in its path", remedy) from None


def recordings_in(sources: Sequence[str]) -> list[Path]:
    """Recordings and logs, each once, also deep in folders; no shots or truths. Raises `UserError` without any."""
    paths: dict[Path, None] = {}
    for source in sources:
        files = [file for file in _files(source) if not file.name.endswith(SHOTS_SUFFIX)]
        if not files:
            suffixes = ", ".join(SUFFIXES)
            raise UserError(source, "names no recording", f"give files, folders or patterns of {suffixes}")
        paths |= dict.fromkeys(files)
    return list(paths)


def _files(source: str) -> Iterator[Path]:
    path = Path(source)
    if path.is_dir():
        suffixes = set(SUFFIXES) - _NOTES
        for file in sorted(path.rglob("*")):
            if file.is_file() and file.suffix.lower() in suffixes and not file.name.endswith(TRUTH_SUFFIX):
                yield file
    elif path.exists():
        yield path
    elif _GLOB.search(source):
        for name in sorted(glob(source, recursive=True)):  # noqa: PTH207 (an absolute pattern, too)
            yield from _files(name)


def injector_of(path: Path, names: PathPattern | None, alone: Bench) -> str:
    """Name of a recording's injector: by its path, else the bench. Raises `UserError` for a path without a match."""
    if names is not None:
        return names.text_in(path)
    return alone.injector.name or f"injector_{alone.injector.config.outputs.injector_id}"


class TimeFrom(StrEnum):
    """Source of a recording's time. WRITTEN: when the file was last written, which copying changes."""

    FRAMES = "frames"
    COLUMN = "column"
    HEADER = "header"
    WRITTEN = "written"


def zero_of(path: Path, source: SignalStream) -> tuple[datetime, TimeFrom]:
    """Moment of time 0 in a file and its source: frames, stamps or header; else the file ended when last written."""
    start, end = source.stretches[0].start, source.stretches[-1]
    if is_log(path):
        begin, by = next(iter(open_log(path))).frame.stamp_ns / NANOSECONDS - start, TimeFrom.FRAMES
    elif source.origin + start > _SINCE_1970:
        begin, by = source.origin, TimeFrom.COLUMN
    elif (stated := stated_start(path)) > 0:
        begin, by = stated / NANOSECONDS, TimeFrom.HEADER
    else:
        begin = path.stat().st_mtime - end.start - end.samples / source.sample_rate
        by = TimeFrom.WRITTEN
    return datetime.fromtimestamp(begin, UTC), by
