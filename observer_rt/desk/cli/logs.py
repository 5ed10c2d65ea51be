"""Commands between files and buses: `replay`, `record` and `convert`."""

import math
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from json import dumps
from pathlib import Path
from typing import Annotated

from observer_rt.config.bench import EXAMPLE_BENCH, Bench, load_bench
from observer_rt.config.bench_file import refuse_shared_channels, values_by_bus
from observer_rt.desk.cli.command import decoder_of, messages
from observer_rt.desk.recording_options import RECORDED, Recording
from observer_rt.foundation.console import progress_bar, results, say
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.options import Argument, BenchFile, Decoder, Force, FromChannel, Injector, Json, Option
from observer_rt.foundation.stop_request import stop_on_signals

Channel = Annotated[
    tuple[str, ...],
    Option(
        "CAN channel, instead of the bench file's; LINK=CHANNEL for one bus of [links]; repeatable.", "[LINK=]CHANNEL"
    ),
]
Interface = Annotated[
    tuple[str, ...],
    Option(
        "python-can interface, instead of the bench file's; LINK=INTERFACE for one bus of [links].",
        "[LINK=]INTERFACE",
    ),
]


def replay(
    recording: Recording,
    bench: BenchFile = EXAMPLE_BENCH,
    channel: Channel = (),
    interface: Interface = (),
    speed: Annotated[float, Option("1 = real time; 0 = as fast as the bus takes.", minimum=0.0)] = 1.0,
    windowed: Annotated[bool, Option("Send only about 6 ms around each injection.")] = False,
    from_channel: FromChannel = (),
    force: Annotated[bool, Option("Send even if another node sends the same identifiers.")] = False,
    injector: Injector = None,
    json: Json = False,
) -> None:
    """Send a recording onto its buses as the measuring devices would, on an absolute time grid."""
    from observer_rt.bus.links.opening import open_link
    from observer_rt.files.formats import is_log
    from observer_rt.files.replay import player

    chosen = _with_links(load_bench(bench).of(injector), interface, channel)
    if is_log(recording):
        if windowed:
            raise UserError("--windowed", "a log is sent as it was recorded", "leave out --windowed")
        source = player.log_source(chosen, recording, from_channel, messages)
    else:
        if from_channel:
            raise UserError("--from-channel", f"{recording} is no CAN log: it has no channels", "leave it out")
        source = player.recording_source(chosen, recording, windowed, messages)
    with stop_on_signals() as stopped, ExitStack() as stack:
        if not force:
            player.refuse_traffic(source.buses, source.sent, stopped)
        links = {
            number: stack.enter_context(open_link(bus.interface, bus.channel, bus.fd, [], False, bus.bit_rates))
            for number, bus in source.buses.items()
        }
        progress = stack.enter_context(progress_bar(messages, f"replaying {recording.name}", source.duration))
        first = min(links.items())[1]
        tell = partial(say, messages)
        statistics = player.play(source.frames, first, speed or math.inf, progress, stopped, links, tell)
    print(dumps(statistics.as_json(), indent=2) if json else statistics.as_text())


def record(
    out: Annotated[Path, Option(f"Log to write ({RECORDED}).")],
    bench: BenchFile = EXAMPLE_BENCH,
    channel: Channel = (),
    interface: Interface = (),
    duration: Annotated[float | None, Option("Stop after this time [s].", minimum=0.0)] = None,
    frames: Annotated[int | None, Option("Stop after this number of frames.", minimum=1)] = None,
    force: Force = False,
    json: Json = False,
) -> None:
    """Write every frame of the bench's buses into a log until stopped; lost frames are noted in it."""
    from observer_rt.bus.links.opening import open_link
    from observer_rt.files.recorder import check_recording_path
    from observer_rt.files.recorder import record as record_links

    buses = _with_links(load_bench(bench), interface, channel).config.buses
    check_recording_path(out, force)
    channels = [bus.config.channel for bus in buses]
    names = [bus.name if channels.count(bus.config.channel) > 1 and bus.name else bus.config.channel for bus in buses]
    with stop_on_signals() as stop, ExitStack() as stack, messages.status("waiting for frames") as status:
        several = len(buses) > 1
        links = {
            name: stack.enter_context(open_link(bus.interface, bus.channel, bus.fd, None, several, bus.bit_rates))
            for name, bus in zip(names, (bus.config for bus in buses), strict=True)
        }
        say(messages, f"recording {', '.join(f'{bus.config.interface} {bus.label}' for bus in buses)}")
        limits = force, duration, frames
        statistics = record_links(
            links, out, stop, lambda so_far: status.update(f"{so_far.frames} frames, {so_far.lost} lost"), *limits
        )
    print(dumps(statistics.as_json(), indent=2) if json else statistics.as_text())


def convert(
    recording: Recording,
    target: Annotated[Path, Argument("File to write, in the format of its suffix.", "OUT")],
    bench: Decoder = None,
    from_channel: FromChannel = (),
    injector: Injector = None,
    force: Force = False,
) -> None:
    """Convert recordings and CAN logs to other formats; with a bench file, logs to recordings."""
    from observer_rt.desk.evaluation.convert import convert as convert_file

    say(results(), convert_file(recording, target, decoder_of(bench, injector), from_channel, force, messages))


def _with_links(bench: Bench, interface: Interface, channel: Channel) -> Bench:
    """The bench with the interfaces and channels of the command line."""
    config = bench.config
    changes: dict[int, dict[str, str]] = {}
    for key, texts in (("interface", interface), ("channel", channel)):
        for bus, value in values_by_bus(f"--{key}", texts, config.buses, "can1").items():
            changes.setdefault(bus, {})[key] = value
    link = config.link.model_copy(update=changes.get(0, {}))
    links = {
        name: further.model_copy(update=changes.get(bus, {}))
        for bus, (name, further) in enumerate(config.links.items(), 1)
    }
    config = config.model_copy(update={"link": link, "links": links})
    refuse_shared_channels("--channel: ", config.buses)
    return replace(bench, config=config)
