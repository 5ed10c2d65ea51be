"""`observer-rt convert`: recordings and CAN logs from format to format, nothing lost without a word."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import chain, islice
from pathlib import Path

from rich.console import Console

from observer_rt.config.bench import Bench
from observer_rt.evaluation.logged import read_logged
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_errors import file_errors
from observer_rt.recording.formats import (
    formats,
    is_log,
    log_format,
    log_formats,
    open_log,
    open_writer,
    read_recording,
    signal_formats,
    suffixes_of,
    write_recording,
    written,
)
from observer_rt.terminal.console import progress_bar, say, say_if_compiling
from observer_rt.terminal.destinations import check_destination

FIRST_FRAMES = (
    1000  # among which the earliest is looked for: drivers swap frames, channels have their own time
)
FRAMES_PER_STEP = 5000  # of the progress bar


def convert(
    source: Path,
    target: Path,
    bench: Bench | None,
    from_channels: Sequence[str],
    force: bool,
    console: Console,
) -> str:
    """Convert a file, the formats by suffix; returns one line on what was written.

    A log becomes a recording by a bench file; where OUT may hold either it gets signals with one, else frames.
    Raises `UserError` for what does not fit together and for what the target cannot hold; the target is then
    as it was before.
    """
    holds_frames = is_log(source)
    check_destination("OUT", target, suffixes_of(written(formats())))
    suffix = target.suffix.lower()
    takes_signals = suffix in suffixes_of(written(signal_formats()))
    takes_frames = suffix in suffixes_of(written(log_formats()))
    if target.exists() and not force:
        raise UserError(str(target), "exists already", "name another file, or add --force")
    if target.exists() and target.samefile(source):
        raise UserError(str(target), "is the file to be converted", "name another file")
    if not holds_frames:
        if not takes_signals:
            raise UserError(
                f"{source} -> {target}",
                "a recording of signals has no frames",
                "replay it onto a bus and record that",
            )
        return _recording(source, target)
    if takes_signals and (bench is not None or not takes_frames):
        if bench is None:
            raise UserError(
                "--bench", "is missing: it says which signals the frames carry", "name a bench file"
            )
        return _decoded(source, target, bench, from_channels, console)
    return _frames(source, target, from_channels, console)


def _recording(source: Path, target: Path) -> str:
    recording = read_recording(source)
    with _replacing(target) as part:
        write_recording(part, recording)
    return f"{target}: {recording.samples} samples at {recording.sample_rate:g} Hz"


def _decoded(source: Path, target: Path, bench: Bench, from_channels: Sequence[str], console: Console) -> str:
    say_if_compiling(console)
    with progress_bar(console, f"decoding {source.name}", 1.0) as progress:
        logged = read_logged(bench, source, from_channels, progress)
    for note in logged.notes:
        say(console, note)
    with _replacing(target) as part:
        write_recording(part, logged.recording)
    recording = logged.recording
    return (
        f"{target}: {recording.samples} samples at {recording.sample_rate:g} Hz, from sample index "
        f"{logged.first_index} on"
    )


def _frames(source: Path, target: Path, channels: Sequence[str], console: Console) -> str:
    log = open_log(source)
    step = log_format(target).stamp_step
    count = 0
    rounded = 0
    entries = (entry for entry in log if not channels or entry.channel in channels)
    first = list(islice(entries, FIRST_FRAMES))
    if not first:
        what = f"frame of channel {', '.join(channels)}" if channels else "frame"
        raise UserError(str(source), f"holds no data {what}", "; ".join(log.notes()))
    start_ns = min(entry.frame.stamp_ns for entry in first)
    with (
        progress_bar(console, f"converting {source.name}", 1.0) as progress,
        _replacing(target) as part,
        file_errors(target),
        open_writer(part, start_ns) as writer,
    ):
        for entry in chain(first, entries):
            writer.write(entry)
            count += 1
            rounded += entry.frame.stamp_ns % step != 0
            if count % FRAMES_PER_STEP == 0:
                progress(log.share_read)
    for note in log.notes():
        say(console, note)
    if rounded:
        say(console, f"{target}: {rounded} stamps are rounded to multiples of {step} ns")
    return f"{target}: {count} frames"


@contextmanager
def _replacing(target: Path) -> Iterator[Path]:
    """A file beside the target that takes its place if all goes well, and else is gone."""
    part = target.with_name(f".{target.stem}.part{target.suffix}")
    try:
        yield part
        part.replace(target)
    except UserError as error:
        raise UserError(error.place.replace(str(part), str(target)), error.problem, error.remedy) from None
    finally:
        part.unlink(missing_ok=True)
