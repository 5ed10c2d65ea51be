"""`observer-rt replay`: a file onto a bus."""

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.bus.link import Link, open_link
from observer_rt.bus.mapping import BusMap, map_bus
from observer_rt.config import Bench, LinkConfig
from observer_rt.errors import UserError
from observer_rt.recording.bus_range import recorded_out_of_range
from observer_rt.recording.files import READERS, read_recording
from observer_rt.recording.framing import TimedFrame, bench_for
from observer_rt.recording.log_frames import LogPart, log_frames
from observer_rt.recording.logs import LOG_READERS, is_log
from observer_rt.recording.player import PlayStatistics, play
from observer_rt.recording.recording_frames import Extent, recording_extent, recording_frames
from observer_rt.recording.remapping import channel_map, identifier_map, remapped, remapped_identifiers
from observer_rt.recording.traffic import refuse_traffic
from observer_rt.screen import progress_bar, say
from observer_rt.signals import stop_on_signals


@dataclass(frozen=True)
class ReplayOptions:
    """Options of the command.

    speed 0: as fast as the bus takes; loop 0: for ever; start, stop [s] of the recording's own time. map_id,
    map_channel: texts `FROM=TO`; force: send although others send the same identifiers.
    """

    speed: float = 1.0
    loop: int = 1
    start: float | None = None
    stop: float | None = None
    windowed: bool = False
    map_id: Sequence[str] = ()
    map_channel: Sequence[str] = ()
    force: bool = False


@dataclass(frozen=True)
class _Source:
    """What is to be sent: frames as they are in the file, how many, and which (identifier, is extended)."""

    frames: Iterator[TimedFrame]
    extent: Extent
    identifiers: frozenset[tuple[int, bool]]


def replay_onto(bench: Bench, path: Path, options: ReplayOptions, console: Console) -> PlayStatistics:
    """Send a recording, encoded by the bench file, or a CAN log, as recorded, onto the bench's bus.

    Raises `UserError` for a file that does not fit and for identifiers that others send already, `RunError` when
    the bus fails.
    """
    suffix = path.suffix.lower()
    if suffix not in LOG_READERS and suffix not in READERS:
        raise UserError(
            str(path),
            f"unknown kind of file '{path.suffix}'",
            f"known suffixes: {', '.join({**READERS, **LOG_READERS})}",
        )
    channels = channel_map(options.map_channel)
    identifiers = identifier_map(options.map_id)
    bus = map_bus(bench)
    if is_log(path):
        source = _log(path, bus, options, tuple(channels) or None, console)
    else:
        source = _recording(bench, path, bus, options, console)
        if channels:
            raise UserError("--map-channel", f"{path} is no CAN log: it has no channels", "leave it out")
    sent = remapped_identifiers(source.identifiers, identifiers)
    link_config = bench.config.link
    total = source.extent.duration * options.loop if options.loop else None
    with stop_on_signals() as stop, ExitStack() as stack:
        targets = sorted(set(channels.values())) or [link_config.channel]
        if not options.force:
            refuse_traffic(link_config, targets, sorted(sent), stop)
        links = {target: stack.enter_context(_sender(link_config, target)) for target in targets}
        progress = stack.enter_context(progress_bar(console, f"replaying {path.name}", total))
        return play(
            remapped(source.frames, identifiers),
            links[targets[0]],
            options.speed or math.inf,
            progress,
            stop,
            {channel: links[target] for channel, target in channels.items()},
        )


def _sender(config: LinkConfig, channel: str) -> Link:
    return open_link(config.interface, channel, config.fd, [])


def _log(
    path: Path, bus: BusMap, options: ReplayOptions, channels: tuple[str, ...] | None, console: Console
) -> _Source:
    if options.windowed:
        raise UserError("--windowed", "a log is sent as it was recorded", "leave out --windowed")
    # results recorded beside the inputs are not sent again: the daemon sends its own
    results = [(m.layout.frame_id, m.layout.is_extended) for m in (bus.rate, bus.summary, bus.status) if m]
    part = LogPart(path, options.start, options.stop, results, channels)
    extent = part.extent()
    for note in extent.notes:
        say(console, note)
    if len(extent.channels) > 1 and channels is None:
        say(
            console,
            f"frames of {', '.join(extent.channels)} all go onto one bus; --map-channel CHANNEL=BUS chooses",
        )
    return _Source(log_frames(part, options.loop), extent, extent.identifiers)


def _recording(bench: Bench, path: Path, bus: BusMap, options: ReplayOptions, console: Console) -> _Source:
    recording = read_recording(path)
    bench_for(bench, recording)
    for warning in recorded_out_of_range(recording, bus):
        say(console, f"warning: {warning}")
    extent = recording_extent(recording, bus, options.windowed, options.start, options.stop)
    frames = recording_frames(recording, bus, options.windowed, options.loop, options.start, options.stop)
    inputs = frozenset((layout.frame_id, layout.is_extended) for layout in bus.input_layouts)
    return _Source(frames, extent, inputs)
