"""Recordings named by files, folders and patterns: injectors and dates in their paths, and when they began."""

import re
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from enum import StrEnum
from glob import glob
from pathlib import Path

from observer_rt.config.bench import Bench
from observer_rt.desk.fleet.path_pattern import PathPattern
from observer_rt.files.formats import SUFFIXES, is_log, open_log
from observer_rt.files.signals.mdf4_table import stated_start
from observer_rt.files.signals.recording import SHOTS_SUFFIX, TRUTH_SUFFIX
from observer_rt.files.signals.stream import SignalStream
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import NANOSECONDS

_GLOB = re.compile(r"[*?\[]")
_NOTES = {".txt"}  # in folders more often notes than recordings: to be named
_SINCE_1970 = 1e9  # s, in 2001: time in a recording is never so late unless it counts from 1970


def recordings_in(sources: Sequence[str]) -> list[Path]:
    """All files, each once, in order: of a folder those, at any depth, whose suffix is a recording's or a log's.

    Tables of shots are left out, in a folder truths, too. Raises `UserError` for a name under which nothing is.
    """
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
    """Name of a recording's injector: by the recording's path, or without a pattern by the bench.

    Raises `UserError` for a path without a match.
    """
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
