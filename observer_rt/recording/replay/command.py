"""`observer-rt replay`: a file onto a bus."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from rich.console import Console

from observer_rt.bus.links.open import open_link
from observer_rt.bus.mapping.bench_map import BenchMap, map_bench
from observer_rt.bus.mapping.bus_map import BusMap, map_bus
from observer_rt.config.bench import Bench
from observer_rt.config.links import LinkConfig, NamedLink
from observer_rt.foundation.errors import UserError
from observer_rt.recording.channels import matched_channels
from observer_rt.recording.formats import is_log, open_recording
from observer_rt.recording.replay.clamped import clamped_in
from observer_rt.recording.replay.framing import TimedFrame, bench_for
from observer_rt.recording.replay.log_frames import LogPart, log_frames
from observer_rt.recording.replay.player import PlayStatistics, play
from observer_rt.recording.replay.recording_frames import Extent, RecordingPart
from observer_rt.recording.replay.remapping import (
    Sent,
    channel_map,
    identifier_map,
    remapped,
    remapped_identifiers,
)
from observer_rt.recording.replay.traffic import refuse_traffic
from observer_rt.recording.signals.plausible import refuse_implausible
from observer_rt.recording.signals.stream import HeldSignals
from observer_rt.terminal.console import progress_bar, say
from observer_rt.terminal.stop import stop_on_signals

HELD_SAMPLES = 1 << 20  # of a recording that is read before it is sent: reading meanwhile may delay a frame


@dataclass(frozen=True)
class ReplayOptions:
    """Options of the command.

    speed 0: as fast as the bus takes; loop 0: for ever; start, stop [s] of the recording's own time. map_id,
    map_channel: texts `FROM=TO`, the latter's TO a channel or a name of `[links]`; force: send although others send
    the same identifiers.
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
    """What is to be sent: frames as they are in the file, how many, which kinds of frames, on which buses."""

    frames: Iterator[TimedFrame]
    extent: Extent
    identifiers: frozenset[Sent]
    buses: Mapping[int, LinkConfig]


def replay_onto(bench: Bench, path: Path, options: ReplayOptions, console: Console) -> PlayStatistics:
    """Send a recording, encoded by the bench file, or a CAN log, as recorded, onto the bench's buses.

    Raises `UserError` for a file that does not fit and for identifiers that others send already, `RunError` when
    the bus fails.
    """
    holds_frames = is_log(path)
    channels = channel_map(options.map_channel)
    identifiers = identifier_map(options.map_id)
    if holds_frames:
        source = _log(bench, path, map_bench(bench), options, channels, console)
    else:
        source = _recording(bench, path, map_bus(bench), options, console)
        if channels:
            raise UserError("--map-channel", f"{path} is no CAN log: it has no channels", "leave it out")
    sent = remapped_identifiers(source.identifiers, identifiers)
    total = source.extent.duration * options.loop if options.loop else None
    with stop_on_signals() as stop, ExitStack() as stack:
        if not options.force:
            refuse_traffic(source.buses, sent, stop)
        links = {
            number: stack.enter_context(open_link(config.interface, config.channel, config.fd, []))
            for number, config in source.buses.items()
        }
        progress = stack.enter_context(progress_bar(console, f"replaying {path.name}", total))
        frames = remapped(source.frames, identifiers)
        first = min(links.items())[1]
        speed = options.speed or math.inf
        return play(frames, first, speed, progress, stop, links, partial(say, console))


def _log(
    bench: Bench,
    path: Path,
    mapped: BenchMap,
    options: ReplayOptions,
    channels: Mapping[str, str],
    console: Console,
) -> _Source:
    if options.windowed:
        raise UserError("--windowed", "a log is sent as it was recorded", "leave out --windowed")
    links = bench.config.buses
    buses = {0: links[0].config}
    routes: dict[str, int] | None = None
    if channels:
        routes, buses = _chosen_routes(links, channels)
    elif len(links) > 1:
        routes = _matched_routes(path, mapped, links)
        buses = {number: links[number].config for number in routes.values()}
    # results recorded beside the inputs are not sent again: the daemon sends its own
    results = frozenset(
        Sent(number, layout.frame_id, layout.is_extended)
        for number in buses
        for layout in mapped.sent
        if layout.bus == number or len(links) == 1 or number >= len(links)
    )
    part = LogPart(path, options.start, options.stop, results, routes)
    extent = part.extent()
    for note in extent.notes:
        say(console, note)
    if len(extent.channels) > 1 and routes is None:
        say(
            console,
            f"frames of {', '.join(extent.channels)} all go onto one bus; --map-channel CHANNEL=BUS chooses",
        )
    if routes is not None and not channels:
        say(console, ", ".join(f"{channel} goes onto {links[to].label}" for channel, to in routes.items()))
    return _Source(log_frames(part, options.loop), extent, extent.identifiers, buses)


def _chosen_routes(
    links: Sequence[NamedLink], channels: Mapping[str, str]
) -> tuple[dict[str, int], dict[int, LinkConfig]]:
    """Bus numbers by channel of the log, and the buses: those of the bench by name or channel, others beside them."""
    buses: dict[int, LinkConfig] = {}
    routes: dict[str, int] = {}
    others = sorted(set(channels.values()))
    for channel, target in channels.items():
        found = [n for n, link in enumerate(links) if target in (link.name, link.config.channel)]
        number = found[0] if found else len(links) + others.index(target)
        routes[channel] = number
        first = links[0].config
        buses[number] = links[number].config if found else first.model_copy(update={"channel": target})
    return routes, buses


def _matched_routes(path: Path, mapped: BenchMap, links: Sequence[NamedLink]) -> dict[str, int]:
    needed = {layout.bus for bus in mapped.injectors for layout in bus.input_layouts}
    found = matched_channels(
        path, links, needed, {}, lambda number: f"--map-channel CHANNEL={links[number].config.channel}"
    )
    return {channel: number for number, channel in sorted(found.items())}


def _recording(bench: Bench, path: Path, bus: BusMap, options: ReplayOptions, console: Console) -> _Source:
    with progress_bar(console, f"looking through {path.name}", None):
        stream = open_recording(path, bench.injector)
    refuse_implausible(path, stream.survey, stream.names)
    for note in stream.notes:
        say(console, note)
    bench_for(bench, stream)
    for warning in clamped_in(stream.survey, bus):
        say(console, f"warning: {warning}")
    if stream.grid_samples <= HELD_SAMPLES:
        stream = HeldSignals(stream.collected())
    with progress_bar(console, f"looking through {path.name}", None):
        part = RecordingPart(stream, bus, options.windowed, options.start, options.stop)
    inputs = frozenset(Sent(layout.bus, layout.frame_id, layout.is_extended) for layout in bus.input_layouts)
    buses = {each.bus: bench.config.buses[each.bus].config for each in inputs}
    return _Source(part.frames(options.loop), part.extent, inputs, buses)
