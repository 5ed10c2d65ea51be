"""Findings about the signals of one injector on the buses: their mapping, ranges, protection and time."""

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bus_map import BusMap, KnownMessage, layout_of, timing_row
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.role_range import message_of, role_factor, role_range, role_resolution
from observer_rt.bus.mapping.timing import LINE_SLOPE, TOLERANCE
from observer_rt.config.bench import PACKAGE_DATA, BenchInjector
from observer_rt.config.signals import OPTIONAL_SIGNALS, Role
from observer_rt.core.frames.frames import Joining, Numbering
from observer_rt.desk.check.findings import WITHOUT_LIFT, Finding, Statement, graded, ruled, warning
from observer_rt.engine.service.noise import configured_noise
from observer_rt.foundation import units
from observer_rt.foundation.errors import UserError

if TYPE_CHECKING:
    from observer_rt.bus.mapping.optional_inputs import EnergizingLayout, SlowSignal

COARSE = 1 * units.MILLISECOND  # s from frame to frame of a level, between which a whole pilot may come and go
HIGHEST_PRESSURE = 200 * units.MEGAPASCAL
PERIOD_TOLERANCE = 1.0  # ns, what rounding to whole nanoseconds may take
CYCLE_TOLERANCE = 0.5e6  # ns, what rounding to whole milliseconds may take
_NUMBERED = {
    Numbering.INDEX: "by its sample index",
    Numbering.COUNTER: "counted by its counter and receive stamps",
    Numbering.E2E_COUNTER: "counted by its E2E counter and receive stamps",
    Numbering.STAMPS: "counted by receive stamps",
}


@ruled("mapping")
def _inputs(injector: BenchInjector, bus: BusMap) -> Iterator[Statement]:
    for role in ROLES:
        yield _mapping(injector, bus, role)
    for slow in bus.slow:
        for signal in slow.signals:
            name = f"{signal.role}: {bus.name_of(slow.layout)} 0x{slow.layout.frame_id:X}, {signal.name}"
            yield _optional(name, signal)
    if bus.energizing is not None:
        yield from _energizing(bus.energizing)


def _optional(name: str, signal: "SlowSignal") -> Finding:
    (lowest, highest), carried = signal.range, OPTIONAL_SIGNALS[signal.role]
    counts = f"a value counts for {signal.timeout:g} s"
    if math.isinf(signal.timeout):
        counts = "a value counts until the next (no cycle time, no timeout_ms)"
    factor, origin = carried.to_si(carried.shown)
    start, end = (f"{(limit - origin) / factor:{'.0f' if origin else '.6g'}}" for limit in (lowest, highest))
    limits = f"{start} to {end} {carried.shown}" if carried.shown else ""
    words = (name, limits, carried.use, counts if carried.expires else "")
    least, most = carried.possible
    return graded(lowest <= most and highest >= least, ", ".join(filter(None, words)), carried.wrong)


def _energizing(energizing: "EnergizingLayout") -> Iterator[Statement]:
    layout, names = energizing.layout, energizing.names
    signals = names[0] if len(names) == 1 else f"{len(names)} samples a frame, {names[0]} to {names[-1]}"
    kind = "energized while it is not 0" if energizing.is_level else "energizing time"
    yield (
        f"energizing: {layout.name} 0x{layout.frame_id:X}, {signals}, {kind}; an injection is missing "
        f"{energizing.window / units.MILLISECOND:g} ms after its command"
    )
    cycle = energizing.cycle if energizing.is_level and len(names) == 1 else None
    prefix = f"{layout.name}: opening delays by"
    if energizing.index is not None:
        yield graded(True, f"{prefix} the sample index", topic="time")
    else:
        text = f"{prefix} receive stamps, too short by the jitter of its frames"
        yield warning(text, "an index of the line pressure's time base would tell them to a sample", topic="time")
    if cycle is not None and cycle >= COARSE:
        text = (
            f"{layout.name}: a level every {cycle / units.MILLISECOND:g} ms misses shorter energizing; "
            "send it faster, on change, or as a duration"
        )
        yield warning(text, topic="time")


def mapping_findings(injector: BenchInjector, bus: BusMap, messages: Sequence[KnownMessage]) -> list[Finding]:
    """All findings about the mapping of an injector; messages: the messages of all databases."""
    return _inputs(injector, bus) + _protection(injector, bus) + _sample_periods(injector, bus, messages)


@ruled("protection")
def _protection(injector: BenchInjector, bus: BusMap) -> Iterator[Statement]:
    limits = injector.config.e2e
    protected = [layout for layout in bus.received if layout.e2e_profile is not None]
    bare = [bus.name_of(layout) for layout in bus.received if layout.e2e_profile is None]
    if protected:
        named = ", ".join(f"{bus.name_of(layout)} by E2E profile {layout.e2e_profile}" for layout in protected)
        errors = f"more than {limits.valid_max_errors} wrong of {limits.window} frames"
        yield f"{named}; INVALID, and not taken, after {errors}"
    if bare:
        yield f"not protected: {', '.join(bare)}; a damaged frame cannot be distinguished from a good one"


def _mapping(injector: BenchInjector, bus: BusMap, role: Role) -> Finding:
    if role is Role.NEEDLE_LIFT and not injector.has_lift:
        return graded(True, WITHOUT_LIFT)
    number = message_of(bus, role)
    layout, message = bus.input_layouts[number], bus.inputs.messages[number]
    is_lift = role is Role.NEEDLE_LIFT
    needed = injector.parameters.seat.max_lift if is_lift else HIGHEST_PRESSURE
    unit, factor = ("um", units.MICROMETRE) if is_lift else ("MPa", units.MEGAPASCAL)
    limits = role_range(bus, role)
    resolution = role_resolution(bus, role, needed)
    noise: float = getattr(configured_noise(injector), role.value)
    factors = units.LENGTH_UNITS if is_lift else units.PRESSURE_UNITS
    code = role_factor(bus, role)
    coded = next((name for name, si in factors.items() if si == code), f"units of {code:g} {next(iter(factors))}")
    samples, frames = int(message["samples"]), int(message["kind_count"])
    division = "1 sample a frame" if samples == 1 else f"{samples} samples a frame"
    if frames > 1:
        division = f"{samples} samples in {frames} frames that take turns,"
    text = (
        f"{role}: {bus.name_of(layout)} 0x{layout.frame_id:X}, {division} in {coded}, "
        f"{limits.lowest / factor:.6g} to {limits.highest / factor:.6g} {unit} in steps of "
        f"{resolution / factor:.3g} {unit}"
    )
    if not (limits.lowest <= 0.0 and limits.highest >= needed):
        return warning(text, f"cannot hold 0 to {needed / factor:g} {unit}")
    return graded(resolution <= noise, text, f"coarser than the noise configured, {noise / factor:g} {unit}")


@ruled("sampling")
def _sample_periods(injector: BenchInjector, bus: BusMap, messages: Sequence[KnownMessage]) -> Iterator[Statement]:
    rate = injector.sample_rate
    yield f"{rate:g} Hz, a sample every {units.NANOSECONDS / rate:.6g} ns"
    for number, layout in enumerate(bus.input_layouts):
        message = bus.inputs.messages[number]
        expected = units.NANOSECONDS * float(timing_row(bus, number)["interval"])
        refusing = injector if _is_of_the_user(layout, messages) else None
        yield from _periods(layout, int(message["samples"]), int(message["kind_count"]), expected, refusing)
    for sent in (bus.rate, bus.corrected):
        if sent is not None and _is_of_the_user(sent.layout, messages):
            yield from _periods(sent.layout, sent.samples, 1, units.NANOSECONDS / rate)


def _is_of_the_user(layout: MessageLayout, messages: Sequence[KnownMessage]) -> bool:
    """Whether a message is of a database of the user; sample periods of ours are examples that nobody can change."""
    return next(message.path for message in messages if message.name == layout.name).parent != PACKAGE_DATA


def _periods(
    layout: MessageLayout, samples: int, frames: int, expected: float, refusing: BenchInjector | None = None
) -> Iterator[Statement]:
    """Compare times between samples [ns] with `expected`, the bench file's; refusing: injector for an error."""
    period = layout.sample_period_ns
    if period is not None and abs(period - expected) > PERIOD_TOLERANCE:
        problem = f"{layout.name} states a sample period of {period} ns in the bus database"
        remedy = f"set sampling.rate_hz = {units.NANOSECONDS / period:g}, or its SamplePeriodNs to {expected:.0f}"
        if refusing is None:
            yield warning(problem, remedy)
        else:
            stated = f"is {refusing.sample_rate:g}, but {problem}"
            yield UserError(refusing.location("sampling.rate_hz"), stated, remedy)
    cycle = layout.cycle_time_ns
    if period is None and cycle is not None and abs(cycle * frames - samples * expected) > CYCLE_TOLERANCE:
        meant = f"which means {units.NANOSECONDS * samples / (cycle * frames):g} Hz"
        text = f"{layout.name} states a cycle time of {cycle / 1e6:g} ms in the bus database, {meant}"
        yield warning(text, "correct sampling.rate_hz or its GenMsgCycleTime")
    if layout.samples_per_frame not in (None, samples):
        stated = f"{layout.name} states {layout.samples_per_frame} samples a frame in the bus database"
        yield warning(f"{stated}, {samples} are named", "name them all, or correct its SamplesPerFrame")


@ruled("time")
def time_findings(bus: BusMap) -> Iterator[Statement]:
    """One finding for each input message, warnings where something of its time cannot be seen."""
    for stream, timing in enumerate(bus.inputs.timing):
        name = bus.name_of(layout_of(bus, stream))
        yield f"{name}: {_NUMBERED[Numbering(int(timing['numbering']))]}{_joined(timing)}"
        if timing["numbering"] == Numbering.STAMPS:
            seen = "lost frames are seen, and results valid, only while its jitter stays below a quarter of its cycle"
            yield warning(f"{name} has neither index nor counter: {seen}", "name its counter, if it has one")
    if any(timing["joining"] == Joining.CLOCK for timing in bus.inputs.timing):
        yield (
            f"two time bases: not valid while more than {TOLERANCE / units.MICROSECOND:g} us between line pressure "
            f"and lift are unknown ({TOLERANCE * LINE_SLOPE / units.MEGAPASCAL:.2g} MPa); the stamps must be the "
            "bus's (hardware or kernel), an adapter that hands frames over in batches cannot tell"
        )


def _joined(timing: np.void) -> str:
    joining = Joining(int(timing["joining"]))
    if joining is Joining.RATIO:
        return f", every {timing['steps']}th sample; held at most {timing['hold'] / units.MILLISECOND:g} ms"
    if joining is Joining.NEAREST:
        return f", nearest sample of the same time base; stamps {timing['delay'] / units.MICROSECOND:.4g} us after it"
    if joining is Joining.CLOCK:
        held = f", held at most {timing['hold'] / units.MILLISECOND:g} ms" if timing["steps"] > 1 else ""
        return f"; by its clock, stamps {timing['delay'] / units.MICROSECOND:.4g} us after the last sample{held}"
    return ""
