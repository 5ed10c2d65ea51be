"""Findings about the buses of a bench: what is on which, whose stamps can be compared, names, identifiers, load."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bench_map import BenchMap, in_common, map_bench
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.load import frame_time
from observer_rt.bus.mapping.timing import Joining, Numbering
from observer_rt.check.findings import Finding, Level, graded, refused
from observer_rt.config.bench import Bench
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND
from observer_rt.recording.replay.framing import message_timing

_OUTPUT_KEYS = " (of results: outputs.injection_rate_id, injection_summary_id, status_id in the bench file)"
INJECTIONS_PER_SECOND = 17.0
WINDOW = 6 * MILLISECOND  # of samples that a windowed source sends for an injection
HIGH_LOAD = 0.6
_LESS = "state the rates this bus has, sample slower, or spread the messages over several buses"


def refuse_errors(bench: Bench) -> None:
    """Raise `UserError` for the first of all errors about the buses of a bench."""
    errors = [each.error for each in buses_findings(bench, map_bench(bench)) if each.error is not None]
    if not errors:
        return
    first, *others = errors
    more = f"; `observer-rt check` names {len(others)} more" if others else ""
    raise UserError(first.place, first.problem, first.remedy + more)


def buses_findings(bench: Bench, mapped: BenchMap) -> list[Finding]:
    """All findings about the buses, those of their load where every message fits its kind of frame."""
    findings = _carried(bench, mapped) + _stamps(bench, mapped)
    findings += _results(bench, mapped) + _identifiers(bench, mapped) + _databases(mapped)
    numbers = range(len(bench.config.buses))
    frames = [finding for number in numbers for finding in _frames(bench, mapped, number)]
    if frames:
        return findings + frames
    findings.append(Finding("frames", Level.OK, "every message fits its kind of frame"))
    return findings + [finding for number in numbers for finding in _load(bench, mapped, number)]


def _carried(bench: Bench, mapped: BenchMap) -> list[Finding]:
    """What comes in and goes out on each bus, where there are several."""
    links = bench.config.buses
    if len(links) == 1:
        return []
    findings = []
    for number, link in enumerate(links):
        ways = (
            f"{way} {', '.join(names)}"
            for way, layouts in (("in", mapped.received), ("out", mapped.sent))
            if (names := [layout.name for layout in layouts if layout.bus == number])
        )
        carried = ", ".join(ways)
        text = f"{link.label}, {link.config.interface}: {carried or 'nothing'}"
        remedy = f"state link for a [[dbc]], a signal or the outputs, or leave [{link.place}] out"
        findings.append(graded("buses", bool(carried), text, remedy))
    return findings


def _stamps(bench: Bench, mapped: BenchMap) -> list[Finding]:
    """Inputs that depend on stamps, on buses whose stamps are too rough beside others."""
    links = bench.config.buses
    if len(links) == 1:
        return []
    rough = {n for n, link in enumerate(links) if link.config.interface != "socketcan"}
    by_stamps = {layout.bus for bus in mapped.injectors if _needs_stamps(bus) for layout in bus.input_layouts}
    return [
        Finding(
            "buses",
            Level.WARNING,
            f"{links[number].label}: beside other buses its frames are stamped when this process reads them, too "
            "roughly for messages of several time bases, or without index; use SocketCAN, or give all messages an "
            "index and one time base",
        )
        for number in sorted(by_stamps & rough)
    ]


def _needs_stamps(bus: BusMap) -> bool:
    timing = bus.inputs.timing
    return bool(np.any((timing["numbering"] != Numbering.INDEX) | (timing["joining"] == Joining.CLOCK)))


def _results(bench: Bench, mapped: BenchMap) -> list[Finding]:
    """What results cannot have in common: their messages and, of several injectors, what tells them apart."""
    findings = []
    for what, names in in_common(bench, mapped):
        is_of_one = len(set(names)) == 1
        owners = f"{len(names)} results" if is_of_one else " and ".join(names)
        place = f"{bench.path}: {'outputs' if is_of_one else 'injectors'}"
        findings.append(
            refused("outputs", UserError(place, f"{owners} have one {what}", "give each its own"))
        )
    return findings


def _identifiers(bench: Bench, mapped: BenchMap) -> list[Finding]:
    owners: dict[int, list[MessageLayout]] = {}
    for layout in mapped.layouts:
        key = frame_key(layout.frame_id, layout.is_extended, layout.bus)
        owners.setdefault(key, []).append(layout)
    clashes = [
        refused(
            "identifiers",
            UserError(
                _place_of(bench, mapped, layouts),
                f"{' and '.join(map(mapped.name_of, layouts))} share 0x{key & 0x1FFFFFFF:X}",
                f"give every message its own identifier{_OUTPUT_KEYS}",
            ),
        )
        for key, layouts in owners.items()
        if len(layouts) > 1
    ]
    used = {(layout.name, layout.bus) for layout in mapped.layouts}
    others = [
        Finding(
            "identifiers",
            Level.WARNING,
            f"{mapped.name_of(owners[message.key][0])} shares 0x{message.key & 0x1FFFFFFF:X} with {message.name} of "
            f"{message.path}; "
            f"if that one is on this bus too, give one of them another identifier{_OUTPUT_KEYS}",
        )
        for message in mapped.known
        if message.key in owners and (message.name, message.bus) not in used
    ]
    return clashes + others or [Finding("identifiers", Level.OK, f"{len(owners)} messages, all different")]


def _place_of(bench: Bench, mapped: BenchMap, layouts: Sequence[MessageLayout]) -> str:
    """The key to change where messages share an identifier: that of a result, one that is stated before others."""
    place = f"{bench.path}: signals"
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        outputs = injector.config.outputs
        for layout, key, stated in (
            (bus.rate and bus.rate.layout, "injection_rate_id", outputs.injection_rate_id),
            (bus.summary.layout, "injection_summary_id", outputs.injection_summary_id),
            (bus.status.layout, "status_id", outputs.status_id),
        ):
            if layout in layouts:
                place = injector.place(f"outputs.{key}")
                if stated is not None:
                    return place
    return place


def _databases(mapped: BenchMap) -> list[Finding]:
    """Names that several databases define, and what is wrong with those read leniently."""
    findings = []
    for layout in mapped.layouts:
        named = [message for message in mapped.known if message.name == layout.name]
        of_bus = [message for message in named if message.bus == layout.bus]
        files = [str(message.path) for message in of_bus or named]
        if len(files) > 1:
            text = f"{layout.name} is in {' and in '.join(files)}; the first is used, rename the other"
            findings.append(Finding("databases", Level.WARNING, text))
    findings += [Finding("databases", Level.WARNING, f"overlooked: {text}") for text in mapped.overlooked]
    return findings


def _frames(bench: Bench, mapped: BenchMap, number: int) -> list[Finding]:
    """Messages on the bus of this number that no frame of their kind can hold."""
    findings = []
    link = bench.config.buses[number]
    for layout in (layout for layout in mapped.layouts if layout.bus == number):
        if layout.is_fd and not link.config.fd:
            place = f"{link.place}.fd"
            problem = f"{layout.name} is a CAN FD message, but {place} is false"
            error = UserError(f"{bench.path}: {place}", problem, f"set {place} = true")
            findings.append(refused("frames", error))
    return findings


@dataclass(frozen=True)
class _Traffic:
    """A message as it is sent: `frames` at once, either for `samples` at a `rate` [Hz], or `often` a second."""

    layout: MessageLayout
    frames: int
    samples: int = 1
    rate: float = 0.0
    often: float = 0.0

    @property
    def continuous(self) -> float:
        """Frames a second."""
        return self.frames * (self.often + self.rate / self.samples)

    @property
    def windowed(self) -> float:
        """Frames a second with only `WINDOW` of samples for each injection."""
        blocks = -(-round(WINDOW * self.rate) // self.samples)
        return self.frames * (self.often + INJECTIONS_PER_SECOND * blocks)


@dataclass(frozen=True)
class BusLoad:
    """Expected share of a bus's time, inputs and outputs together."""

    continuous: float
    windowed: float


def _load(bench: Bench, mapped: BenchMap, number: int) -> list[Finding]:
    """How full the bus of this number will be."""
    links = bench.config.buses
    named, link = links[number], links[number].config
    load = expected_load(bench, mapped, number)
    on = f"{named.label}, " if len(links) > 1 else ""
    rates = f"at {link.bit_rate / 1e3:g}k{f'/{link.data_bit_rate / 1e6:g}M' if link.fd else ''} bit/s"
    windowed = (
        f"{on}windowed, {INJECTIONS_PER_SECOND:g} injections/s of {WINDOW / MILLISECOND:g} ms: "
        f"{load.windowed:.0%} {rates}"
    )
    continuous = f"{on}continuous: {load.continuous:.0%} {rates}"
    if load.windowed > 1.0:
        key = f"{bench.path}: {named.place}.{'data_bit_rate' if link.fd else 'bit_rate'}"
        return [refused("bus load", UserError(key, text, _LESS)) for text in (windowed, continuous)]
    if load.continuous > 1.0:
        continuous += "; the source must send windowed"
    return [
        Finding("bus load", Level.OK if share <= HIGH_LOAD else Level.WARNING, text)
        for share, text in ((load.windowed, windowed), (load.continuous, continuous))
    ]


def expected_load(bench: Bench, mapped: BenchMap, number: int = 0) -> BusLoad:
    """Load of the bus of this number by all that is sent; windowed: only `WINDOW` of samples for each injection.

    A message of optional inputs without a cycle time counts as sent once an injection.

    Raises:
        ValueError: a message does not fit its kind of frame.
    """
    link = bench.config.buses[number].config
    continuous = windowed = 0.0
    for sent in (*_sent_inputs(mapped), *_sent_results(bench, mapped)):
        layout = sent.layout
        if layout.bus != number:
            continue
        time = frame_time(layout.length, layout.is_fd, link.bit_rate, link.data_bit_rate, layout.is_extended)
        continuous += time * sent.continuous
        windowed += time * sent.windowed
    return BusLoad(continuous, windowed)


def _sent_inputs(mapped: BenchMap) -> Iterator[_Traffic]:
    for to, *_ in mapped.destinations.values():
        bus = mapped.injectors[to.injector]
        message = bus.inputs.messages[to.message]
        rate = 1 / float(message_timing(bus, to.message)["interval"])
        layout = bus.input_layouts[to.message]
        yield _Traffic(layout, int(message["kind_count"]), int(message["samples"]), rate)
    sampled = {layout for bus in mapped.injectors for layout in bus.input_layouts}
    for layout in mapped.received:
        if layout not in sampled:
            cycle = layout.cycle_time_ns
            yield _Traffic(layout, 1, often=1e9 / cycle if cycle else INJECTIONS_PER_SECOND)


def _sent_results(bench: Bench, mapped: BenchMap) -> Iterator[_Traffic]:
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        if bus.rate is not None:
            yield _Traffic(bus.rate.layout, 1, bus.rate.samples, injector.config.sampling.rate_hz)
        yield _Traffic(bus.summary.layout, len(bus.summary.pages), often=INJECTIONS_PER_SECOND)
        period = injector.config.outputs.status_period_ms * MILLISECOND
        yield _Traffic(bus.status.layout, len(bus.status.pages), often=1 / period)
