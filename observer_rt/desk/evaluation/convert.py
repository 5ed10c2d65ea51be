"""`observer-rt convert`: recordings and CAN logs from format to format, nothing lost without a word."""

from collections.abc import Sequence
from itertools import chain, groupby, islice
from pathlib import Path

from rich.console import Console

from observer_rt.bus.mapping.bus_map import map_bus
from observer_rt.config.bench import Bench
from observer_rt.desk.evaluation.logged import LoggedSignals, open_source
from observer_rt.files.canlog.can_log import LogFrame
from observer_rt.files.formats import LOGS_WRITTEN, SIGNALS_WRITTEN, is_log, open_log, open_writer, stamp_step
from observer_rt.files.replay.framing import bench_for
from observer_rt.files.replay.recording_frames import Device
from observer_rt.files.signals.doubts import refuse_without_lift
from observer_rt.files.signals.table_writers import recording_writer
from observer_rt.foundation.console import progress_bar, say
from observer_rt.foundation.errors import UserError, file_errors
from observer_rt.foundation.files import replacing
from observer_rt.foundation.outputs import check_output

FIRST_FRAMES = 1000  # the earliest is among them: drivers swap frames, channels have their own time
FRAMES_PER_STEP = 5000  # of the progress bar


def convert(
    source: Path, target: Path, bench: Bench | None, from_channels: Sequence[str], force: bool, console: Console
) -> str:
    """Convert a file, the formats by suffix, a log by a bench file; returns a line on the result.

    Raises `UserError` for a pair that does not fit and for content the target cannot hold, which is then as before.
    """
    holds_frames = is_log(source)
    takes_signals = target.suffix.lower() in SIGNALS_WRITTEN
    if source.exists() and target.exists() and target.samefile(source):
        raise UserError(str(target), "is the file to be converted", "name another file")
    check_output("OUT", target, force, suffixes=tuple(dict.fromkeys((*SIGNALS_WRITTEN, *LOGS_WRITTEN))))
    if not holds_frames and not takes_signals:
        return _encoded(source, target, bench, console)
    if holds_frames and not takes_signals:
        return _frames(source, target, from_channels, console)
    if holds_frames and bench is None:
        raise UserError("--bench", "is missing: it says which signals the frames carry", "name a bench file")
    return _signals(source, target, bench, from_channels, force, console)


def _signals(
    source: Path, target: Path, bench: Bench | None, from_channels: Sequence[str], force: bool, console: Console
) -> str:
    """Convert the signals of a recording or log; a file that was split gives a file for each stretch."""
    stream = open_source(source, bench, from_channels, console)
    if isinstance(stream, LoggedSignals) and (lost := stream.counters.lost_samples):
        gaps = f"{lost} samples are missing, and have empty cells: frames were lost, or without a value"
        say(console, f"{source}: {gaps}")
    targets = _numbered(target, len(stream.stretches), force)
    with progress_bar(console, f"converting {source.name}", stream.samples) as progress:
        done = 0
        chunks = stream.chunks()
        for number, part_of in groupby(chunks, key=lambda chunk: chunk.stretch):
            with (
                replacing(targets[number]) as part,
                file_errors(targets[number]),
                recording_writer(part, stream.recorded) as write,
            ):
                for chunk in part_of:
                    write(chunk)
                    done += chunk.samples
                    progress(done)
    origin = f", from sample index {stream.logged[0].start} on" if isinstance(stream, LoggedSignals) else ""
    names = f"{targets[0]}" + (f" to {targets[-1].name}" if len(targets) > 1 else "")
    return f"{names}: {stream.samples} samples at {stream.sample_rate:g} Hz{origin}"


def _numbered(target: Path, stretches: int, force: bool) -> list[Path]:
    if stretches == 1:
        return [target]
    targets = [target.with_name(f"{target.stem}_{number:04d}{target.suffix}") for number in range(1, stretches + 1)]
    for file_target in targets:
        check_output("OUT", file_target, force)
    return targets


def _encoded(source: Path, target: Path, bench: Bench | None, console: Console) -> str:
    """Frames of a measuring device, by the bench file."""
    if bench is None:
        remedy = "name a bench file by --bench, which says how they are sent"
        raise UserError(f"{source} -> {target}", "a recording of signals has no frames", remedy)
    stream = open_source(source, bench, (), console)
    refuse_without_lift(stream, "convert a recording with a lift: frames of samples carry no commands")
    bench = bench_for(bench, stream)
    names = [link.config.channel for link in bench.config.buses]
    device = Device(map_bus(bench))
    count = done = 0
    with (
        progress_bar(console, f"converting {source.name}", stream.samples) as progress,
        replacing(target) as part,
        file_errors(target),
        open_writer(part, 0) as writer,
    ):
        for chunk in device.chunks(stream.chunks()):
            if chunk.first == 0:
                device.begin(stream.sample_rate)
            for number, frame in device.frames(chunk):
                writer.write(LogFrame(frame._replace(bit_rate_switch=frame.is_fd), names[number]))
                count += 1
            done += chunk.samples
            progress(done)
    return f"{target}: {count} frames"


def _frames(source: Path, target: Path, channels: Sequence[str], console: Console) -> str:
    log = open_log(source)
    step = stamp_step(target)
    count = rounded = 0
    entries = (entry for entry in log if not channels or entry.channel in channels)
    first = list(islice(entries, FIRST_FRAMES))
    if not first:
        what, remedy = "frame", "record it while frames are on the bus"
        if channels:
            what, remedy = f"frame of channel {', '.join(channels)}", "leave --from-channel out to take all"
        raise UserError(str(source), "; ".join([f"holds no data {what}", *log.notes()]), remedy)
    start_ns = min(entry.frame.stamp_ns for entry in first)
    with (
        progress_bar(console, f"converting {source.name}", 1.0) as progress,
        replacing(target) as part,
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
