"""Commands between files and buses: `replay`, `record` and `convert`."""

import json
import math
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from rich.live import Live
from rich.text import Text

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench
from observer_rt.config.bench_file import of_links, refuse_shared_channels
from observer_rt.desk.cli import options
from observer_rt.desk.cli.options import (
    CLASSIC_ONLY,
    RECORDED,
    Writes,
    argument,
    decoder_of,
    file_option,
    link_option,
    messages,
    option,
)
from observer_rt.foundation.console import progress_bar, say, stop_on_signals
from observer_rt.foundation.errors import UserError

if TYPE_CHECKING:
    from observer_rt.files.recorder import RecordStatistics

ChannelOption = Annotated[
    list[str] | None,
    link_option(
        "--channel",
        "CAN channel, instead of the bench file's; LINK=CHANNEL for one bus of [links]; repeatable.",
    ),
]
InterfaceOption = Annotated[
    list[str] | None,
    link_option(
        "--interface",
        "python-can interface, instead of the bench file's; LINK=INTERFACE for one bus of [links].",
    ),
]
MEGABYTE = 1_000_000


def replay(
    recording: options.RecordingArgument,
    bench: options.BenchOption = EXAMPLE_BENCH,
    channel: ChannelOption = None,
    interface: InterfaceOption = None,
    speed: Annotated[float, option("--speed", "1 = real time; 0 = as fast as the bus takes.", min=0.0)] = 1.0,
    loop: Annotated[int, option("--loop", "Number of repetitions; 0 = until stopped.", min=0)] = 1,
    start: Annotated[float | None, option("--start", "Begin at this time of the recording [s].")] = None,
    stop: Annotated[float | None, option("--stop", "End at this time of the recording [s].")] = None,
    windowed: Annotated[bool, option("--windowed", "Send only about 6 ms around each injection.")] = False,
    map_id: Annotated[
        list[str] | None, option("--map-id", "Send under another identifier; repeatable.", "FROM=TO")
    ] = None,
    map_channel: Annotated[
        list[str] | None,
        option("--map-channel", "Send the frames of a log's channel to one bus only.", "FROM=TO"),
    ] = None,
    force: Annotated[
        bool, option("--force", "Send even if another node sends the same identifiers.")
    ] = False,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Send a recording onto its buses as the measuring devices would, on an absolute time grid."""
    from observer_rt.bus.links.opening import open_link
    from observer_rt.files.formats import is_log
    from observer_rt.files.replay.log_frames import (
        channel_map,
        identifier_map,
        remapped,
        remapped_identifiers,
    )
    from observer_rt.files.replay.player import log_source, play, recording_source, refuse_traffic

    chosen = _with_links(load_bench(bench, lenient=lenient).of(injector), interface, channel)
    channels, identifiers = channel_map(map_channel or ()), identifier_map(map_id or ())
    if is_log(recording):
        if windowed:
            raise UserError("--windowed", "a log is sent as it was recorded", "leave out --windowed")
        source = log_source(chosen, recording, channels, start, stop, loop, messages)
    else:
        source = recording_source(chosen, recording, windowed, start, stop, loop, messages)
        if channels:
            raise UserError("--map-channel", f"{recording} is no CAN log: it has no channels", "leave it out")
    sent = remapped_identifiers(source.identifiers, identifiers)
    total = source.extent.duration * loop if loop else None
    with stop_on_signals() as stopped, ExitStack() as stack:
        if not force:
            refuse_traffic(source.buses, sent, stopped)
        links = {
            number: stack.enter_context(open_link(config.interface, config.channel, config.fd, []))
            for number, config in source.buses.items()
        }
        progress = stack.enter_context(progress_bar(messages, f"replaying {recording.name}", total))
        frames = remapped(source.frames, identifiers)
        first = min(links.items())[1]
        statistics = play(frames, first, speed or math.inf, progress, stopped, links, partial(say, messages))
    print(json.dumps(statistics.as_json(), indent=2) if as_json else statistics.as_text())


def record(
    out: Annotated[
        Path,
        file_option("--out", f"Log to write ({RECORDED})."),
        Writes("log, begun at the first frame; with `--rotate-…` a series `*_0001`, …, which is always new"),
    ],
    bench: options.BenchOption = EXAMPLE_BENCH,
    channel: ChannelOption = None,
    interface: InterfaceOption = None,
    duration: Annotated[float | None, option("--duration", "Stop after this time [s].", min=0.0)] = None,
    frames: Annotated[int | None, option("--frames", "Stop after this number of frames.", min=1)] = None,
    rotate_size: Annotated[
        float | None, option("--rotate-size", "Begin a new file at this size [MB].", min=0.001)
    ] = None,
    rotate_time: Annotated[
        float | None, option("--rotate-time", "Begin a new file after this time [s].", min=0.001)
    ] = None,
    force: options.ForceOption = False,
    as_json: options.JsonOption = False,
) -> None:
    """Write every frame of the bench's buses into a log until stopped; lost frames are noted in it."""
    from observer_rt.bus.links.opening import open_link
    from observer_rt.files.recorder import RecordLimits, check_recording_path
    from observer_rt.files.recorder import record as record_links

    limits = RecordLimits(
        duration, frames, None if rotate_size is None else round(rotate_size * MEGABYTE), rotate_time
    )
    buses = _with_links(load_bench(bench), interface, channel).config.buses
    check_recording_path(out, limits, force)
    channels = [bus.config.channel for bus in buses]
    names = [
        bus.name if channels.count(bus.config.channel) > 1 and bus.name else bus.config.channel
        for bus in buses
    ]
    with (
        stop_on_signals() as stop,
        ExitStack() as stack,
        Live(console=messages, auto_refresh=False, transient=True) as live,
    ):
        links = [
            stack.enter_context(
                open_link(link.interface, link.channel, link.fd, computer_time=len(buses) > 1)
            )
            for link in (bus.config for bus in buses)
        ]
        say(messages, f"recording {', '.join(f'{bus.config.interface} {bus.label}' for bus in buses)}")
        further = list(zip(links[1:], names[1:], strict=True))
        statistics = record_links(links[0], names[0], out, limits, stop, _FrameCount(live), further, force)
    print(json.dumps(statistics.as_json(), indent=2) if as_json else statistics.as_text())


def convert(
    recording: options.RecordingArgument,
    target: Annotated[
        Path,
        argument(f"File to write, in the format of its suffix; no CAN FD in {CLASSIC_ONLY}.", "OUT"),
        Writes("recording or log; of one in stretches a series `*_0001`, …"),
    ],
    bench: options.DecoderOption = None,
    from_channel: options.FromChannelOption = None,
    injector: options.InjectorOption = None,
    lenient: options.LenientOption = False,
    force: options.ForceOption = False,
) -> None:
    """Convert recordings and CAN logs to other formats; with a bench file, logs to recordings."""
    from observer_rt.desk.evaluation.convert import convert as convert_file

    chosen = decoder_of(bench, injector, lenient)
    print(convert_file(recording, target, chosen, from_channel or (), force, messages))


def _with_links(bench: Bench, interfaces: list[str] | None, channels: list[str] | None) -> Bench:
    """The bench with the interfaces and channels of the command line."""
    config = bench.config
    changes: dict[int, dict[str, str]] = {}
    for key, texts in (("interface", interfaces), ("channel", channels)):
        for bus, value in of_links(f"--{key}", texts or (), config.buses, "can1").items():
            changes.setdefault(bus, {})[key] = value
    link = config.link.model_copy(update=changes.get(0, {}))
    links = {
        name: further.model_copy(update=changes.get(bus, {}))
        for bus, (name, further) in enumerate(config.links.items(), 1)
    }
    config = config.model_copy(update={"link": link, "links": links})
    refuse_shared_channels("--channel: ", config.buses)
    return replace(bench, config=config)


class _FrameCount:
    """Frames so far, and how many came in a second of late; on a terminal only."""

    def __init__(self, live: Live) -> None:
        self._live = live
        self._frames, self._moment = 0, 0.0

    def __call__(self, so_far: "RecordStatistics") -> None:
        if not self._live.console.is_terminal:
            return
        passed = so_far.duration - self._moment
        rate = (so_far.frames - self._frames) / passed if passed else 0.0
        self._frames, self._moment = so_far.frames, so_far.duration
        name = so_far.files[-1].name if so_far.files else "waiting for frames"
        line = f"{name}: {so_far.frames} frames, {rate:.0f} a second, {so_far.lost} lost, {so_far.duration:.0f} s"
        self._live.update(Text(line), refresh=True)
