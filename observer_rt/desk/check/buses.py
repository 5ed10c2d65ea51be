"""Findings about the buses of a bench: contents of each, comparable stamps, names, identifiers, load."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from observer_rt.bus.can_frame import frame_time
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.links.opening import require_interface
from observer_rt.bus.mapping.bus_map import BenchMap, shared_resources, timing_row
from observer_rt.bus.mapping.output_signals import RESULTS
from observer_rt.config.bench import Bench
from observer_rt.config.bench_file import RESULT_IDS
from observer_rt.core.frames.frames import Joining, Numbering
from observer_rt.desk.check.findings import Finding, Statement, graded, ruled, warning
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND

_OUTPUT_KEYS = f" (of results: outputs.{', '.join(RESULT_IDS)} in the bench file)"
INJECTIONS_PER_SECOND = 17.0
WINDOW = 6 * MILLISECOND  # of samples that a windowed source sends for an injection
HIGH_LOAD = 0.6
_LOAD_REMEDY = "state the rates this bus has, sample slower, or spread the messages over several buses"


def buses_findings(bench: Bench, mapped: BenchMap) -> list[Finding]:
    """All findings about the buses, those of their load where every message fits its kind of frame."""
    findings = _links(bench) + _contents(bench, mapped) + _results(bench, mapped)
    findings += _identifiers(bench, mapped) + _databases(mapped) + _frames(bench, mapped)
    if any(finding.topic == "frames" and finding.error for finding in findings):
        return findings
    return findings + _load(bench, mapped)


@ruled("buses")
def _links(bench: Bench) -> Iterator[Statement]:
    """Unknown interfaces, and data bit rates below the bit rate."""
    for link in bench.config.buses:
        config, location = link.config, f"{bench.path}: {link.location}"
        require_interface(f"{location}.interface", config.interface)
        if config.fd and config.data_bit_rate < config.bit_rate:
            problem = f"{config.data_bit_rate:g} bit/s, less than bit_rate, {config.bit_rate:g} bit/s"
            remedy = "state both in bit/s; the data phase of CAN FD is the faster one"
            yield UserError(f"{location}.data_bit_rate", problem, remedy)


@ruled("buses")
def _contents(bench: Bench, mapped: BenchMap) -> Iterator[Statement]:
    """Lists inputs and results of each of several buses; warns of stamps that are too rough for a bus's inputs."""
    links = bench.config.buses
    if len(links) == 1:
        return
    for number, link in enumerate(links):
        ways = (
            f"{way} {', '.join(names)}"
            for way, layouts in (("in", mapped.received), ("out", mapped.sent))
            if (names := [layout.name for layout in layouts if layout.bus == number])
        )
        carried = ", ".join(ways)
        text = f"{link.label}, {link.config.interface}: {carried or 'nothing'}"
        remedy = f"state link for a [[dbc]], a signal or the outputs, or leave [{link.location}] out"
        yield graded(bool(carried), text, remedy)
    rough = {n for n, link in enumerate(links) if link.config.interface != "socketcan"}
    by_stamps = set()
    for bus in mapped.injectors:
        timing = bus.inputs.timing
        if np.any((timing["numbering"] != Numbering.INDEX) | (timing["joining"] == Joining.CLOCK)):
            by_stamps |= {layout.bus for layout in bus.input_layouts}
    for number in sorted(by_stamps & rough):
        yield warning(
            f"{links[number].label}: beside other buses its frames are stamped when this process reads them, too "
            "roughly for messages of several time bases, or without index",
            "use SocketCAN, or give all messages an index and one time base",
        )


@ruled("outputs")
def _results(bench: Bench, mapped: BenchMap) -> Iterator[Statement]:
    """Refuses results that share a message or, of several injectors, what distinguishes them."""
    for resource, names in shared_resources(bench, mapped):
        is_of_one = len(set(names)) == 1
        owners = f"{len(names)} results" if is_of_one else " and ".join(names)
        location = f"{bench.path}: {'outputs' if is_of_one else 'injectors'}"
        yield UserError(location, f"{owners} share {resource}", "give each its own")


@ruled("identifiers")
def _identifiers(bench: Bench, mapped: BenchMap) -> Iterator[Statement]:
    """Refuses messages that share an identifier; warns of one that an unused message of a database has, too."""
    owners: dict[int, list[MessageLayout]] = {}
    for layout in mapped.layouts:
        owners.setdefault(layout.key, []).append(layout)
    clashes = {key: layouts for key, layouts in owners.items() if len(layouts) > 1}
    for key, layouts in clashes.items():
        shared = f"{' and '.join(map(mapped.name_of, layouts))} share 0x{key & 0x1FFFFFFF:X}"
        remedy = f"give every message its own identifier{_OUTPUT_KEYS}"
        part = "outputs" if any(layout in mapped.sent for layout in layouts) else "signals"
        yield UserError(f"{bench.path}: {part}", shared, remedy)
    used = {(layout.name, layout.bus) for layout in mapped.layouts}
    others = [
        message
        for message in mapped.database_messages
        if message.key in owners and (message.name, message.bus) not in used
    ]
    for message in others:
        name = mapped.name_of(owners[message.key][0])
        yield warning(
            f"{name} shares 0x{message.key & 0x1FFFFFFF:X} with {message.name} of {message.path}",
            f"if that one is on this bus too, give one of them another identifier{_OUTPUT_KEYS}",
        )
    if not (clashes or others):
        yield f"{len(owners)} messages, all different"


@ruled("databases")
def _databases(mapped: BenchMap) -> Iterator[Statement]:
    """Names that several databases define, and the faults of those read leniently."""
    for layout in mapped.layouts:
        named = [message for message in mapped.database_messages if message.name == layout.name]
        of_bus = [message for message in named if message.bus == layout.bus]
        files = [str(message.path) for message in of_bus or named]
        if len(files) > 1:
            yield warning(f"{layout.name} is in {' and in '.join(files)}", "the first is used, rename the other")
    for text in mapped.overlooked_faults:
        yield warning(f"overlooked: {text}")


@ruled("frames")
def _frames(bench: Bench, mapped: BenchMap) -> Iterator[Statement]:
    """Messages that no frame of their kind can hold on their bus, or one finding that all can be."""
    fit = True
    for number, link in enumerate(bench.config.buses):
        location = f"{link.location}.fd"
        for layout in mapped.layouts:
            if layout.bus == number and layout.is_fd and not link.config.fd:
                fit = False
                problem = f"{layout.name} is a CAN FD message, but {location} is false"
                yield UserError(f"{bench.path}: {location}", problem, f"set {location} = true")
    if fit:
        yield "every message fits its kind of frame"


class BusLoad(NamedTuple):
    """Expected share of a bus's time, inputs and outputs together."""

    continuous: float
    windowed: float


@ruled("bus load")
def _load(bench: Bench, mapped: BenchMap) -> Iterator[Statement]:
    links = bench.config.buses
    for number, named in enumerate(links):
        load, link = expected_load(bench, mapped, number), named.config
        on = f"{named.label}, " if len(links) > 1 else ""
        rates = f"at {link.bit_rate / 1e3:g}k{f'/{link.data_bit_rate / 1e6:g}M' if link.fd else ''} bit/s"
        windowed = (
            f"{on}windowed, {INJECTIONS_PER_SECOND:g} injections/s of {WINDOW / MILLISECOND:g} ms: "
            f"{load.windowed:.0%} {rates}"
        )
        continuous = f"{on}continuous: {load.continuous:.0%} {rates}"
        if load.windowed > 1.0:
            key = f"{bench.path}: {named.location}.{'data_bit_rate' if link.fd else 'bit_rate'}"
            yield UserError(key, windowed, _LOAD_REMEDY)
            yield UserError(key, continuous, _LOAD_REMEDY)
            continue
        yield graded(load.windowed <= HIGH_LOAD, windowed)
        must = "the source must send windowed" if load.continuous > 1.0 else ""
        yield graded(load.continuous <= HIGH_LOAD, continuous, must)


def expected_load(bench: Bench, mapped: BenchMap, number: int = 0) -> BusLoad:
    """Load of a bus; windowed: by `WINDOW` of samples, and a message without cycle time, once an injection.

    Raises `ValueError` for a message that does not fit its kind of frame.
    """
    link = bench.config.buses[number].config
    continuous = windowed = 0.0
    for layout, always, in_windows in _traffic(bench, mapped):
        if layout.bus == number:
            time = frame_time(layout.length, layout.is_fd, link.bit_rate, link.data_bit_rate, layout.is_extended)
            continuous += time * always
            windowed += time * in_windows
    return BusLoad(continuous, windowed)


def _traffic(bench: Bench, mapped: BenchMap) -> Iterator[tuple[MessageLayout, float, float]]:
    """Every message with its frames a second: of a continuous source, and with only `WINDOW` for each injection."""
    sources = ((bus, number) for bus in mapped.injectors for number in range(len(bus.input_layouts)))
    by_frame = {bus.input_layouts[number].key: (bus, number) for bus, number in sources}  # a shared one counts once
    for bus, number in by_frame.values():
        message, layout = bus.inputs.messages[number], bus.input_layouts[number]
        rate = 1 / float(timing_row(bus, number)["interval"])
        frames, (always, in_windows) = int(message["kind_count"]), _blocks(int(message["samples"]), rate)
        yield layout, frames * always, frames * in_windows
    sampled = {layout for bus in mapped.injectors for layout in bus.input_layouts}
    for layout in mapped.received:
        if layout not in sampled:
            often = 1e9 / layout.cycle_time_ns if layout.cycle_time_ns else INJECTIONS_PER_SECOND
            yield layout, often, often
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        if bus.rate is not None:
            yield bus.rate.layout, *_blocks(bus.rate.samples, injector.sample_rate)
        if bus.corrected is not None:
            often = _blocks(bus.corrected.samples, injector.sample_rate)[1]
            yield bus.corrected.layout, often, often
        period = injector.config.outputs.status_period_ms * MILLISECOND
        for key, result in bus.results.items():
            often = len(result.pages) * (INJECTIONS_PER_SECOND if RESULTS[key].per_injection else 1 / period)
            yield result.layout, often, often


def _blocks(samples: int, rate: float) -> tuple[float, float]:
    """A second, of so many samples each at a rate [Hz]: of a continuous source, and of a windowed one."""
    return rate / samples, INJECTIONS_PER_SECOND * -(-round(WINDOW * rate) // samples)
