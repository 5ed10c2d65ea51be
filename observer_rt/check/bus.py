"""Findings about the bus: mapping, sampling, frames, identifiers, load."""

from dataclasses import dataclass

import numpy as np

from observer_rt.bus.database.frame_key import frame_key
from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.load import frame_time
from observer_rt.bus.mapping.signal_range import message_of, role_factor, role_range, role_resolution
from observer_rt.check.buses import buses_findings
from observer_rt.check.energizing import energizing_findings
from observer_rt.check.findings import Finding, Level, graded
from observer_rt.check.optional_inputs import slow_findings
from observer_rt.config.bench import PACKAGE_DATA, Bench
from observer_rt.config.links import LinkConfig
from observer_rt.config.signals import Role
from observer_rt.foundation.units import LENGTH_UNITS, MEGAPASCAL, MICROMETRE, MILLISECOND, PRESSURE_UNITS
from observer_rt.recording.replay.framing import message_timing
from observer_rt.service.core.constants import configured_noise

HIGHEST_PRESSURE = 200 * MEGAPASCAL
INJECTIONS_PER_SECOND = 17.0
WINDOW = 6 * MILLISECOND  # of samples that a windowed source sends for an injection
HIGH_LOAD = 0.6
CLASSIC_LENGTH = 8  # bytes
PERIOD_TOLERANCE = 1.0  # ns, what rounding to whole nanoseconds may take
CYCLE_TOLERANCE = 0.5e6  # ns, what rounding to whole milliseconds may take


@dataclass(frozen=True)
class BusLoad:
    """Expected share of the bus's time, inputs and outputs together."""

    continuous: float
    windowed: float


def bus_findings(bench: Bench, bus: BusMap) -> list[Finding]:
    """All findings about the bus of a bench."""
    findings = buses_findings(bench, bus)
    findings += [_mapping(bench, bus, role) for role in ROLES] + slow_findings(bus)
    findings += energizing_findings(bench.injector, bus)
    findings += _sample_periods(bench, bus)
    findings += _identifiers(bus) + _databases(bus)
    links = bench.config.buses
    frames = [finding for number in range(len(links)) for finding in _frames(bench, bus, number)]
    if frames:
        return findings + frames
    findings.append(Finding("frames", Level.OK, "every message fits its kind of frame"))
    for number, link in enumerate(links):
        on = f"{link.label}, " if len(links) > 1 else ""
        findings += _load_findings(expected_load(bench, bus, number), link.config, on)
    return findings


def expected_load(bench: Bench, bus: BusMap, number: int = 0) -> BusLoad:
    """Load of the bus of this number by all that is sent; windowed: only `WINDOW` of samples for each injection.

    A message of optional inputs without a cycle time counts as sent once an injection.

    Raises:
        ValueError: a message does not fit its kind of frame.
    """
    link = bench.config.buses[number].config
    rate = bench.injector.config.sampling.rate_hz

    def time_of(layout: MessageLayout) -> float:
        if layout.bus != number:
            return 0.0
        return frame_time(layout.length, layout.is_fd, link.bit_rate, link.data_bit_rate, layout.is_extended)

    blocks = [
        (
            time_of(layout) * int(message["kind_count"]),
            int(message["samples"]),
            1 / float(message_timing(bus, n)["interval"]),
        )
        for n, (layout, message) in enumerate(zip(bus.input_layouts, bus.inputs.messages, strict=True))
    ]
    if bus.rate is not None:
        blocks.append((time_of(bus.rate.layout), bus.rate.samples, rate))
    other = INJECTIONS_PER_SECOND * len(bus.summary.pages) * time_of(bus.summary.layout)
    status_period = bench.injector.config.outputs.status_period_ms * MILLISECOND
    other += len(bus.status.pages) * time_of(bus.status.layout) / status_period
    other += sum(
        time_of(slow.layout)
        * (1e9 / slow.layout.cycle_time_ns if slow.layout.cycle_time_ns else INJECTIONS_PER_SECOND)
        for slow in bus.slow
        if not slow.is_input
    )
    return BusLoad(
        continuous=other + sum(time * own_rate / size for time, size, own_rate in blocks),
        windowed=other
        + sum(
            time * INJECTIONS_PER_SECOND * -(-round(WINDOW * own_rate) // size)
            for time, size, own_rate in blocks
        ),
    )


def _layouts(bus: BusMap) -> list[MessageLayout]:
    return [*bus.received, *bus.sent]


def _mapping(bench: Bench, bus: BusMap, role: Role) -> Finding:
    number = message_of(bus, role)
    layout, message = bus.input_layouts[number], bus.inputs.messages[number]
    is_lift = role is Role.NEEDLE_LIFT
    needed = bench.injector.parameters.seat.max_lift if is_lift else HIGHEST_PRESSURE
    unit, factor = ("um", MICROMETRE) if is_lift else ("MPa", MEGAPASCAL)
    limits = role_range(bus, role)
    resolution = role_resolution(bus, role, needed)
    noise: float = getattr(configured_noise(bench.injector), role.value)
    text = (
        f"{role}: {bus.name_of(layout)} 0x{layout.frame_id:X}, {_division(message)} in "
        f"{_unit(role, role_factor(bus, role))}, {limits.lowest / factor:.6g} to "
        f"{limits.highest / factor:.6g} {unit} in steps of {resolution / factor:.3g} {unit}"
    )
    if not (limits.lowest <= 0.0 and limits.highest >= needed):
        return graded("mapping", False, text, f"cannot hold 0 to {needed / factor:g} {unit}")
    is_fine = resolution <= noise
    return graded("mapping", is_fine, text, f"coarser than the noise configured, {noise / factor:g} {unit}")


def _division(message: np.void) -> str:
    samples, frames = int(message["samples"]), int(message["kind_count"])
    if frames > 1:
        return f"{samples} samples in {frames} frames that take turns,"
    return "1 sample a frame" if samples == 1 else f"{samples} samples a frame"


def _unit(role: Role, factor: float) -> str:
    units = LENGTH_UNITS if role is Role.NEEDLE_LIFT else PRESSURE_UNITS
    return next(unit for unit, known in units.items() if known == factor)


def _sample_periods(bench: Bench, bus: BusMap) -> list[Finding]:
    rate = bench.injector.config.sampling.rate_hz
    findings = [Finding("sampling", Level.OK, f"{rate:g} Hz, a sample every {1e9 / rate:.6g} ns")]
    for number, layout in enumerate(bus.input_layouts):
        message = bus.inputs.messages[number]
        expected = 1e9 * float(message_timing(bus, number)["interval"])
        findings += _periods(layout, int(message["samples"]), int(message["kind_count"]), expected)
    if bus.rate is not None and not _is_shipped(bus, bus.rate.layout.name):
        findings += _periods(bus.rate.layout, bus.rate.samples, 1, 1e9 / rate)
    return findings


def _is_shipped(bus: BusMap, name: str) -> bool:
    """Whether a message is of a database of ours, whose example of a sample period no user can change."""
    return next(message.path for message in bus.known if message.name == name).parent == PACKAGE_DATA


def _periods(layout: MessageLayout, samples: int, frames: int, expected: float) -> list[Finding]:
    """What the database says of the time between samples [ns], which `expected` is by the bench file.

    samples: of every role that `frames` frames together carry.
    """
    findings = []
    period = layout.sample_period_ns
    if period is not None and abs(period - expected) > PERIOD_TOLERANCE:
        findings.append(
            f"{layout.name} states a sample period of {period} ns in the bus database; "
            f"set sampling.rate_hz = {1e9 / period:g}, or its SamplePeriodNs to {expected:.0f}"
        )
    cycle = layout.cycle_time_ns
    if period is None and cycle is not None and abs(cycle * frames - samples * expected) > CYCLE_TOLERANCE:
        findings.append(
            f"{layout.name} states a cycle time of {cycle / 1e6:g} ms in the bus database, which means "
            f"{1e9 * samples / (cycle * frames):g} Hz; correct sampling.rate_hz or its GenMsgCycleTime"
        )
    if layout.samples_per_frame not in (None, samples):
        findings.append(
            f"{layout.name} states {layout.samples_per_frame} samples a frame in the bus database, "
            f"{samples} are named; name them all, or correct its SamplesPerFrame"
        )
    return [Finding("sampling", Level.WARNING, text) for text in findings]


def _identifiers(bus: BusMap) -> list[Finding]:
    owners: dict[int, list[MessageLayout]] = {}
    for layout in _layouts(bus):
        key = frame_key(layout.frame_id, layout.is_extended, layout.bus)
        owners.setdefault(key, []).append(layout)
    clashes = [
        Finding(
            "identifiers",
            Level.ERROR,
            f"{' and '.join(map(bus.name_of, layouts))} share 0x{key & 0x1FFFFFFF:X}; give every message its own "
            "identifier",
        )
        for key, layouts in owners.items()
        if len(layouts) > 1
    ]
    used = {(layout.name, layout.bus) for layout in _layouts(bus)}
    others = [
        Finding(
            "identifiers",
            Level.WARNING,
            f"{bus.name_of(owners[message.key][0])} shares 0x{message.key & 0x1FFFFFFF:X} with {message.name} of "
            f"{message.path}; "
            "if that one is on this bus too, give one of them another identifier",
        )
        for message in bus.known
        if message.key in owners and (message.name, message.bus) not in used
    ]
    return clashes + others or [Finding("identifiers", Level.OK, f"{len(owners)} messages, all different")]


def _databases(bus: BusMap) -> list[Finding]:
    """Names that several databases define, and what is wrong with those read leniently."""
    findings = []
    for layout in _layouts(bus):
        named = [message for message in bus.known if message.name == layout.name]
        of_bus = [message for message in named if message.bus == layout.bus]
        files = [str(message.path) for message in of_bus or named]
        if len(files) > 1:
            text = f"{layout.name} is in {' and in '.join(files)}; the first is used, rename the other"
            findings.append(Finding("databases", Level.WARNING, text))
    findings += [Finding("databases", Level.WARNING, f"overlooked: {text}") for text in bus.overlooked]
    return findings


def _frames(bench: Bench, bus: BusMap, number: int) -> list[Finding]:
    """Messages on the bus of this number that no frame of their kind can hold."""
    findings = []
    link = bench.config.buses[number]
    for layout in (layout for layout in _layouts(bus) if layout.bus == number):
        if not layout.is_fd and layout.length > CLASSIC_LENGTH:
            problem = (
                f"{layout.name} is a classic CAN message of {layout.length} bytes, more than {CLASSIC_LENGTH}; "
                "set its VFrameFormat to 14 (StandardCAN_FD) or 15 (ExtendedCAN_FD)"
            )
        elif layout.is_fd and not link.config.fd:
            problem = (
                f"{layout.name} is a CAN FD message, but {link.place}.fd is false; set {link.place}.fd = true"
            )
        else:
            continue
        findings.append(Finding("frames", Level.ERROR, problem))
    return findings


def _load_findings(load: BusLoad, link: LinkConfig, on: str) -> list[Finding]:
    """on: which bus it is, where there are several."""
    rates = f"at {link.bit_rate / 1e3:g}k{f'/{link.data_bit_rate / 1e6:g}M' if link.fd else ''} bit/s"
    windowed = (
        f"{on}windowed, {INJECTIONS_PER_SECOND:g} injections/s of {WINDOW / MILLISECOND:g} ms: "
        f"{load.windowed:.0%} {rates}"
    )
    continuous = f"{on}continuous: {load.continuous:.0%} {rates}"
    return [
        Finding("bus load", _level(load.windowed, load.windowed), windowed),
        Finding(
            "bus load",
            _level(load.continuous, load.windowed),
            f"{continuous}; the source must send windowed" if load.continuous > 1.0 else continuous,
        ),
    ]


def _level(load: float, at_least: float) -> Level:
    """Of a load [share], when another way of sending would need `at_least`."""
    if load <= HIGH_LOAD:
        return Level.OK
    return Level.ERROR if at_least > 1.0 else Level.WARNING
