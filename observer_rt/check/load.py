"""Findings about the load of the buses: all that is sent on each, once, whoever reads it."""

from collections.abc import Iterator
from dataclasses import dataclass

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bench_map import BenchMap
from observer_rt.bus.mapping.load import frame_time
from observer_rt.check.findings import Finding, Level, refused
from observer_rt.config.bench import Bench
from observer_rt.config.links import LinkConfig
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MILLISECOND
from observer_rt.recording.replay.framing import message_timing

INJECTIONS_PER_SECOND = 17.0
WINDOW = 6 * MILLISECOND  # of samples that a windowed source sends for an injection
HIGH_LOAD = 0.6
_LESS = "state the rates this bus has, sample slower, or spread the messages over several buses"


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


def load_findings(bench: Bench, mapped: BenchMap) -> list[Finding]:
    """How full every bus will be."""
    links = bench.config.buses
    findings = []
    for number, link in enumerate(links):
        on = f"{link.label}, " if len(links) > 1 else ""
        place = f"{bench.path}: {link.place}"
        findings += _load_findings(expected_load(bench, mapped, number), link.config, on, place)
    return findings


def expected_load(bench: Bench, mapped: BenchMap, number: int = 0) -> BusLoad:
    """Load of the bus of this number by all that is sent; windowed: only `WINDOW` of samples for each injection.

    A message of optional inputs without a cycle time counts as sent once an injection.

    Raises:
        ValueError: a message does not fit its kind of frame.
    """
    link = bench.config.buses[number].config
    continuous = windowed = 0.0
    for sent in (*_inputs(mapped), *_results(bench, mapped)):
        layout = sent.layout
        if layout.bus != number:
            continue
        time = frame_time(layout.length, layout.is_fd, link.bit_rate, link.data_bit_rate, layout.is_extended)
        continuous += time * sent.continuous
        windowed += time * sent.windowed
    return BusLoad(continuous, windowed)


def _inputs(mapped: BenchMap) -> Iterator[_Traffic]:
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


def _results(bench: Bench, mapped: BenchMap) -> Iterator[_Traffic]:
    for injector, bus in zip(bench.injectors, mapped.injectors, strict=True):
        if bus.rate is not None:
            yield _Traffic(bus.rate.layout, 1, bus.rate.samples, injector.config.sampling.rate_hz)
        yield _Traffic(bus.summary.layout, len(bus.summary.pages), often=INJECTIONS_PER_SECOND)
        period = injector.config.outputs.status_period_ms * MILLISECOND
        yield _Traffic(bus.status.layout, len(bus.status.pages), often=1 / period)


def _load_findings(load: BusLoad, link: LinkConfig, on: str, place: str) -> list[Finding]:
    """on: which bus it is, where there are several; place: its section of the bench file."""
    rates = f"at {link.bit_rate / 1e3:g}k{f'/{link.data_bit_rate / 1e6:g}M' if link.fd else ''} bit/s"
    windowed = (
        f"{on}windowed, {INJECTIONS_PER_SECOND:g} injections/s of {WINDOW / MILLISECOND:g} ms: "
        f"{load.windowed:.0%} {rates}"
    )
    continuous = f"{on}continuous: {load.continuous:.0%} {rates}"
    if load.windowed > 1.0:
        key = f"{place}.{'data_bit_rate' if link.fd else 'bit_rate'}"
        return [refused("bus load", UserError(key, text, _LESS)) for text in (windowed, continuous)]
    return [
        Finding("bus load", _level(load.windowed), windowed),
        Finding(
            "bus load",
            _level(load.continuous),
            f"{continuous}; the source must send windowed" if load.continuous > 1.0 else continuous,
        ),
    ]


def _level(load: float) -> Level:
    """Of a load [share] that can be carried in one way of sending or the other."""
    return Level.OK if load <= HIGH_LOAD else Level.WARNING
