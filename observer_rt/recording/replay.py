"""`observer-rt replay`: a file onto a bus."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.bus.link import open_link
from observer_rt.bus.mapping import BusMap, map_bus
from observer_rt.config import Bench
from observer_rt.errors import UserError
from observer_rt.recording.bus_range import recorded_out_of_range
from observer_rt.recording.files import READERS, read_recording
from observer_rt.recording.framing import TimedFrame, bench_for
from observer_rt.recording.log_frames import log_extent, log_frames
from observer_rt.recording.player import PlayStatistics, play
from observer_rt.recording.recording_frames import Extent, recording_extent, recording_frames
from observer_rt.screen import progress_bar, say
from observer_rt.signals import stop_on_signals

LOG_SUFFIX = ".log"


@dataclass(frozen=True)
class ReplayOptions:
    """speed 0: as fast as the bus takes; loop 0: for ever; start, stop [s] of the recording's own time."""

    speed: float = 1.0
    loop: int = 1
    start: float | None = None
    stop: float | None = None
    windowed: bool = False


def replay_onto(bench: Bench, path: Path, options: ReplayOptions, console: Console) -> PlayStatistics:
    """Send a recording, encoded by the bench file, or a candump log, as recorded, onto the bench's bus.

    Raises `UserError` for a file that does not fit, `RunError` when the bus fails.
    """
    suffix = path.suffix.lower()
    if suffix != LOG_SUFFIX and suffix not in READERS:
        raise UserError(
            str(path),
            f"unknown kind of file '{path.suffix}'",
            f"known suffixes: {', '.join(READERS)}, {LOG_SUFFIX}",
        )
    bus = map_bus(bench)
    if suffix == LOG_SUFFIX:
        frames, extent = _log(path, bus, options)
    else:
        frames, extent = _recording(bench, path, bus, options, console)
    link_config = bench.config.link
    total = extent.duration * options.loop if options.loop else None
    with (
        stop_on_signals() as stop,
        open_link(link_config.interface, link_config.channel, link_config.fd, []) as link,
        progress_bar(console, f"replaying {path.name}", total) as progress,
    ):
        return play(frames, link, options.speed or math.inf, progress, stop)


def _log(path: Path, bus: BusMap, options: ReplayOptions) -> tuple[Iterator[TimedFrame], Extent]:
    if options.windowed:
        raise UserError("--windowed", "a log is sent as it was recorded", "leave out --windowed")
    # results recorded beside the inputs are not sent again: the daemon sends its own
    results = [(m.layout.frame_id, m.layout.is_extended) for m in (bus.rate, bus.summary, bus.status) if m]
    extent = log_extent(path, options.start, options.stop, results)
    return log_frames(path, options.loop, options.start, options.stop, results), extent


def _recording(
    bench: Bench, path: Path, bus: BusMap, options: ReplayOptions, console: Console
) -> tuple[Iterator[TimedFrame], Extent]:
    recording = read_recording(path)
    bench_for(bench, recording)
    for warning in recorded_out_of_range(recording, bus):
        say(console, f"warning: {warning}")
    extent = recording_extent(recording, bus, options.windowed, options.start, options.stop)
    frames = recording_frames(recording, bus, options.windowed, options.loop, options.start, options.stop)
    return frames, extent
