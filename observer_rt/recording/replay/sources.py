"""What is replayed, a CAN log or a recording as a bench file encodes it, and who else sends on the bus.

Two senders of one identifier destroy each other's frames, or mix two recordings.
"""

import threading
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from observer_rt.bus.links.link import BusFrame, Link
from observer_rt.bus.links.opening import open_link
from observer_rt.bus.mapping.bus_map import map_bench, map_bus
from observer_rt.config.bench import Bench
from observer_rt.config.links import LinkConfig, NamedLink
from observer_rt.foundation.errors import UserError
from observer_rt.recording.channels import matched_channels
from observer_rt.recording.formats import open_recording
from observer_rt.recording.replay.framing import TimedFrame, bench_for, clamped_in
from observer_rt.recording.replay.log_frames import LogPart, Sent, log_frames
from observer_rt.recording.replay.recording_frames import Extent, RecordingPart
from observer_rt.recording.signals.plausible import refuse_implausible
from observer_rt.recording.signals.stream import HeldSignals
from observer_rt.terminal.console import progress_bar, say

HELD_SAMPLES = 1 << 20  # of a recording that is read before it is sent: reading meanwhile may delay a frame


@dataclass(frozen=True)
class ReplaySource:
    """What is to be sent: frames as they are in the file, how many, which kinds of frames, on which buses."""

    frames: Iterator[TimedFrame]
    extent: Extent
    identifiers: frozenset[Sent]
    buses: Mapping[int, LinkConfig]


def log_source(
    bench: Bench,
    path: Path,
    channels: Mapping[str, str],
    start: float | None,
    stop: float | None,
    loop: int,
    console: Console,
) -> ReplaySource:
    """A CAN log, from start to stop [s] of its own time, `loop` times (0: for ever).

    channels: those of the log, with the channel or the name of `[links]` that each goes onto; empty: as the bench
    file has them. Raises `UserError` for a log that does not fit.
    """
    mapped = map_bench(bench)
    links = bench.config.buses
    buses = {0: links[0].config}
    routes: dict[str, int] | None = None
    if channels:
        routes, buses = _chosen_routes(links, channels)
    elif len(links) > 1:
        needed = {layout.bus for bus in mapped.injectors for layout in bus.input_layouts}
        found = matched_channels(
            path, links, needed, {}, lambda number: f"--map-channel CHANNEL={links[number].config.channel}"
        )
        routes = {channel: number for number, channel in sorted(found.items())}
        buses = {number: links[number].config for number in routes.values()}
    # results recorded beside the inputs are not sent again: the daemon sends its own
    results = frozenset(
        Sent(number, layout.frame_id, layout.is_extended)
        for number in buses
        for layout in mapped.sent
        if layout.bus == number or len(links) == 1 or number >= len(links)
    )
    part = LogPart(path, start, stop, results, routes)
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
    return ReplaySource(log_frames(part, loop), extent, extent.identifiers, buses)


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


def recording_source(
    bench: Bench,
    path: Path,
    windowed: bool,
    start: float | None,
    stop: float | None,
    loop: int,
    console: Console,
) -> ReplaySource:
    """A recording, from start to stop [s] of its own time, `loop` times; windowed: some ms round each injection.

    Raises `UserError` for a file that does not fit.
    """
    bus = map_bus(bench)
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
        part = RecordingPart(stream, bus, windowed, start, stop)
    inputs = frozenset(Sent(layout.bus, layout.frame_id, layout.is_extended) for layout in bus.input_layouts)
    buses = {each.bus: bench.config.buses[each.bus].config for each in inputs}
    return ReplaySource(part.frames(loop), part.extent, inputs, buses)


LISTENING = 0.5  # s; a windowed source pauses for about a tenth
_TURN = 0.02  # s, of one bus among several


def refuse_traffic(buses: Mapping[int, LinkConfig], sent: Collection[Sent], stop: threading.Event) -> None:
    """Listen a moment on all buses. `stop` ends it early.

    Raises:
        UserError: something of what will be sent is sent already, on the same bus.
        RunError: the interface cannot be used.
    """
    with ExitStack() as stack:
        links = {}
        for bus, config in buses.items():
            mine = sorted((each.identifier, each.is_extended) for each in sent if each.bus == bus)
            links[bus] = stack.enter_context(open_link(config.interface, config.channel, config.fd, mine))
        heard = first_heard(links, stop)
    if heard is not None:
        config = buses[heard.bus]
        raise UserError(
            f"{config.interface} {config.channel}",
            f"another sender is active: frames with identifier 0x{heard.frame.frame_id:X} come in already",
            "stop it, send under another identifier (--map-id), or send all the same (--force)",
        )


def first_heard(links: Mapping[int, Link], stop: threading.Event) -> BusFrame | None:
    """The first frame within a moment on links that receive what will be sent; None: nobody else sends it.

    links: by bus; `stop` ends it early. Raises `RunError` when a link fails.
    """
    end = time.monotonic() + LISTENING
    while time.monotonic() < end and not stop.is_set():
        for bus, link in links.items():
            frame = link.receive(_TURN)
            if frame is not None:
                return BusFrame(bus, frame)
    return None
