"""Findings about one injector: its signals on the buses, their time and ranges, and its observer."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping import bus_map
from observer_rt.bus.mapping.bench_map import KnownMessage
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.timing import LINE_SLOPE, TOLERANCE
from observer_rt.config.bench import PACKAGE_DATA, BenchInjector
from observer_rt.config.signals import OPTIONAL_SIGNALS, Role, effects_after_alignment
from observer_rt.core.frames.frames import Joining, Numbering
from observer_rt.core.stream.stream import MAX_EVENT, dead_band
from observer_rt.desk.check.findings import WITHOUT_LIFT, Finding, Said, graded, ruled
from observer_rt.desk.simulation.schedule import REFERENCE_PRESSURE, make_schedule
from observer_rt.desk.simulation.simulate import simulate
from observer_rt.engine.observer import Durations, constants_for
from observer_rt.engine.service.injector import bench_constants, calibration_of, configured_noise, doubt_about_fit
from observer_rt.engine.stream.state import noise_gain
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import (
    LENGTH_UNITS,
    MEGAPASCAL,
    MICROMETRE,
    MICROSECOND,
    MILLISECOND,
    PRESSURE_UNITS,
    Z_95,
    ZERO_CELSIUS,
)
from observer_rt.model.effects import effective_model, sized
from observer_rt.model.stability import MAX_SUBSTEPS, fastest_rate
from observer_rt.model.surroundings import at_temperature

if TYPE_CHECKING:
    from observer_rt.bus.mapping.optional_inputs import EnergizingLayout, SlowSignal

SHOWN_TEMPERATURES = 20.0, 40.0, 80.0  # degC
COARSE = 1 * MILLISECOND  # s from frame to frame of a level, between which a whole pilot may come and go
HIGHEST_PRESSURE = 200 * MEGAPASCAL
PERIOD_TOLERANCE = 1.0  # ns, what rounding to whole nanoseconds may take
CYCLE_TOLERANCE = 0.5e6  # ns, what rounding to whole milliseconds may take
_NUMBERED = {
    Numbering.INDEX: "by its sample index",
    Numbering.COUNTER: "counted by its counter and receive stamps",
    Numbering.E2E_COUNTER: "counted by its E2E counter and receive stamps",
    Numbering.STAMPS: "counted by receive stamps",
}
SAMPLES_PER_PERIOD = 10  # of the line's own oscillation, below which it is not seen well
SHORT, WIDER, SHOWN = 0.6 * MILLISECOND, 0.01, 0.03  # energizing [s]; nozzle that is compared; of a mass
LARGEST_DEAD_BAND = 0.1  # of the full lift
MEASURED_PERCENT = 0.2  # of a mass, one sigma: a good injection meter
_LEVEL = {
    "file": "absolute level by A_L/(rho_L L_L) of the file, not measured",
    "measured_rate": "absolute level by the measured rate",
    "measured_mass": "absolute level by measured masses",
}


@ruled("mapping")
def optional_findings(bus: bus_map.BusMap) -> Iterator[Said]:
    """Findings about every optional input of a bench."""
    for slow in bus.slow:
        for signal in slow.signals:
            name = f"{signal.role}: {bus.name_of(slow.layout)} 0x{slow.layout.frame_id:X}, {signal.name}"
            yield _optional(name, signal)
    if bus.energizing is not None:
        yield from _energizing(bus.energizing)


@ruled("fuel")
def fuel_findings(injector: BenchInjector) -> Iterator[Said]:
    """Density and bulk modulus of the fuel over its temperature, where a bench measures that."""
    if injector.config.signals.fuel_temperature is None:
        return
    fluids = {at: at_temperature(injector.parameters, at + ZERO_CELSIUS).fluid for at in SHOWN_TEMPERATURES}
    yield "; ".join(
        f"{celsius:.0f} degC: {fluid.density_nozzle:.0f} kg/m3, {fluid.bulk_modulus_line / 1e9:.2f} GPa"
        for celsius, fluid in fluids.items()
    )


def _optional(name: str, signal: "SlowSignal") -> Said:
    (lowest, highest), carried = signal.range, OPTIONAL_SIGNALS[signal.role]
    counts = f"a value counts for {signal.timeout:g} s"
    if math.isinf(signal.timeout):
        counts = "a value counts until the next (no cycle time, no timeout_ms)"
    factor, origin = carried.to_si(carried.shown)
    start, end = (f"{(limit - origin) / factor:{'.0f' if origin else '.6g'}}" for limit in (lowest, highest))
    limits = f"{start} to {end} {carried.shown}" if carried.shown else ""
    said = (name, limits, carried.use, counts if carried.expires else "")
    least, most = carried.possible
    return lowest <= most and highest >= least, ", ".join(filter(None, said)), carried.wrong


def _energizing(energizing: "EnergizingLayout") -> Iterator[Said]:
    """Mapping of the energizing signal, and the stamps behind opening delays."""
    layout, names = energizing.layout, energizing.names
    signals = names[0] if len(names) == 1 else f"{len(names)} samples a frame, {names[0]} to {names[-1]}"
    kind = "energized while it is not 0" if energizing.is_level else "energizing time"
    yield (
        f"energizing: {layout.name} 0x{layout.frame_id:X}, {signals}, {kind}; an injection is missing "
        f"{energizing.window / MILLISECOND:g} ms after its command"
    )
    cycle = energizing.cycle if energizing.is_level and len(names) == 1 else None
    prefix = f"{layout.name}: opening delays by"
    if energizing.index is not None:
        yield graded("time", True, f"{prefix} the sample index")
    else:
        text = f"{prefix} receive stamps, too short by the jitter of its frames"
        remedy = "an index of the line pressure's time base would tell them to a sample"
        yield graded("time", False, text, remedy)
    if cycle is not None and cycle >= COARSE:
        text = (
            f"{layout.name}: a level every {cycle / MILLISECOND:g} ms misses shorter energizing; "
            "send it faster, on change, or as a duration"
        )
        yield graded("time", False, text)


def mapping_findings(injector: BenchInjector, bus: bus_map.BusMap, messages: Sequence[KnownMessage]) -> list[Finding]:
    """All findings about the mapping of an injector; messages: the messages of all databases."""
    findings = [_mapping(injector, bus, role) for role in ROLES] + optional_findings(bus)
    return findings + _protection(injector, bus) + _sample_periods(injector, bus, messages)


@ruled("protection")
def _protection(injector: BenchInjector, bus: bus_map.BusMap) -> Iterator[Said]:
    """Lists the inputs with and without end-to-end protection."""
    limits = injector.config.e2e
    protected = [layout for layout in bus.received if layout.e2e_profile is not None]
    bare = [bus.name_of(layout) for layout in bus.received if layout.e2e_profile is None]
    if protected:
        named = ", ".join(f"{bus.name_of(layout)} by E2E profile {layout.e2e_profile}" for layout in protected)
        errors = f"more than {limits.valid_max_errors} wrong of {limits.window} frames"
        yield f"{named}; INVALID, and not taken, after {errors}"
    if bare:
        yield f"not protected: {', '.join(bare)}; a damaged frame cannot be distinguished from a good one"


def _mapping(injector: BenchInjector, bus: bus_map.BusMap, role: Role) -> Finding:
    if role is Role.NEEDLE_LIFT and not injector.has_lift:
        return graded("mapping", True, WITHOUT_LIFT)
    number = bus_map.message_of(bus, role)
    layout, message = bus.input_layouts[number], bus.inputs.messages[number]
    is_lift = role is Role.NEEDLE_LIFT
    needed = injector.parameters.seat.max_lift if is_lift else HIGHEST_PRESSURE
    unit, factor = ("um", MICROMETRE) if is_lift else ("MPa", MEGAPASCAL)
    limits = bus_map.role_range(bus, role)
    resolution = bus_map.role_resolution(bus, role, needed)
    noise: float = getattr(configured_noise(injector), role.value)
    units = LENGTH_UNITS if is_lift else PRESSURE_UNITS
    code = bus_map.role_factor(bus, role)
    coded = next((name for name, known in units.items() if known == code), f"units of {code:g} {next(iter(units))}")
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
        return graded("mapping", False, text, f"cannot hold 0 to {needed / factor:g} {unit}")
    is_fine = resolution <= noise
    return graded("mapping", is_fine, text, f"coarser than the noise configured, {noise / factor:g} {unit}")


@ruled("sampling")
def _sample_periods(injector: BenchInjector, bus: bus_map.BusMap, messages: Sequence[KnownMessage]) -> Iterator[Said]:
    rate = injector.config.sampling.rate_hz
    yield f"{rate:g} Hz, a sample every {1e9 / rate:.6g} ns"
    for number, layout in enumerate(bus.input_layouts):
        message = bus.inputs.messages[number]
        expected = 1e9 * float(bus_map.message_timing(bus, number)["interval"])
        periods = _periods(layout, int(message["samples"]), int(message["kind_count"]), expected)
        if _is_of_the_user(layout, messages) and _is_another(layout.sample_period_ns, expected):
            _, problem, remedy = next(periods)
            yield UserError(injector.location("sampling.rate_hz"), f"is {rate:g}, but {problem}", remedy)
        yield from periods
    for sent in (bus.rate, bus.corrected):
        if sent is not None and _is_of_the_user(sent.layout, messages):
            yield from _periods(sent.layout, sent.samples, 1, 1e9 / rate)


def _is_of_the_user(layout: MessageLayout, messages: Sequence[KnownMessage]) -> bool:
    """Whether a message is of a database of the user; sample periods of ours are examples that nobody can change."""
    return next(message.path for message in messages if message.name == layout.name).parent != PACKAGE_DATA


def _is_another(period: int | None, expected: float) -> bool:
    """Whether a sample period that a database states is not that of the bench file [ns]."""
    return period is not None and abs(period - expected) > PERIOD_TOLERANCE


def _periods(layout: MessageLayout, samples: int, frames: int, expected: float) -> Iterator[tuple[bool, str, str]]:
    """Compares the time between samples [ns] in the database with `expected`, that of the bench file.

    samples: of every role that `frames` frames together carry.
    """
    period = layout.sample_period_ns
    if period is not None and _is_another(period, expected):
        yield (
            False,
            f"{layout.name} states a sample period of {period} ns in the bus database",
            f"set sampling.rate_hz = {1e9 / period:g}, or its SamplePeriodNs to {expected:.0f}",
        )
    cycle = layout.cycle_time_ns
    if period is None and cycle is not None and abs(cycle * frames - samples * expected) > CYCLE_TOLERANCE:
        meant = f"which means {1e9 * samples / (cycle * frames):g} Hz"
        text = f"{layout.name} states a cycle time of {cycle / 1e6:g} ms in the bus database, {meant}"
        yield False, text, "correct sampling.rate_hz or its GenMsgCycleTime"
    if layout.samples_per_frame not in (None, samples):
        stated = f"{layout.name} states {layout.samples_per_frame} samples a frame in the bus database"
        yield False, f"{stated}, {samples} are named", "name them all, or correct its SamplesPerFrame"


@ruled("time")
def time_findings(bus: bus_map.BusMap) -> Iterator[Said]:
    """One finding for each input message, warnings where something of its time cannot be seen."""
    for stream, timing in enumerate(bus.inputs.timing):
        name = bus.name_of(bus_map.layout_of(bus, stream))
        yield f"{name}: {_NUMBERED[Numbering(int(timing['numbering']))]}{_joined(timing)}"
        if timing["numbering"] == Numbering.STAMPS:
            seen = "lost frames are seen, and results valid, only while its jitter stays below a quarter of its cycle"
            yield False, f"{name} has neither index nor counter: {seen}", "name its counter, if it has one"
    if any(timing["joining"] == Joining.CLOCK for timing in bus.inputs.timing):
        yield (
            f"two time bases: not valid while more than {TOLERANCE / MICROSECOND:g} us between line pressure and "
            f"lift are unknown ({TOLERANCE * LINE_SLOPE / MEGAPASCAL:.2g} MPa); the stamps must be the bus's "
            "(hardware or kernel), an adapter that hands frames over in batches cannot tell"
        )


def _joined(timing: np.void) -> str:
    joining = Joining(int(timing["joining"]))
    if joining is Joining.RATIO:
        return f", every {timing['steps']}th sample; held at most {timing['hold'] / MILLISECOND:g} ms"
    if joining is Joining.NEAREST:
        return f", nearest sample of the same time base; stamps {timing['delay'] / MICROSECOND:.4g} us after it"
    if joining is Joining.CLOCK:
        held = f", held at most {timing['hold'] / MILLISECOND:g} ms" if timing["steps"] > 1 else ""
        return f"; by its clock, stamps {timing['delay'] / MICROSECOND:.4g} us after the last sample{held}"
    return ""


def observer_findings(injector: BenchInjector) -> list[Finding]:
    """All findings about the observer of an injector; none with too many cells to be stable."""
    integration = _integration(injector)
    is_stable = integration[0].error is None
    steps_itself = injector.coefficients.line.fastest == 0.0
    fuel = fuel_findings(injector) if is_stable else []
    observer = _observer(injector) if is_stable or not steps_itself else []
    return [*integration, *fuel, *_fitted_model(injector), *level_findings(injector), *observer]


@ruled("integration")
def _integration(injector: BenchInjector) -> Iterator[Said]:
    """Steps that integrate a sample, and how near the limits they are."""
    substeps = bench_constants(injector).substeps
    model, rate = effective_model(injector.parameters), injector.config.sampling.rate_hz
    if stepping := model.coefficients.line.stepping(1.0 / rate):
        yield f"{substeps} steps a sample at {rate:g} Hz; {stepping}"
        return
    fastest = fastest_rate(model.injector, model.coefficients)
    yield (
        f"{substeps} steps a sample (at most {MAX_SUBSTEPS}) at {rate:g} Hz, for a fastest rate of {fastest:.3g} 1/s"
    )


@ruled("fitted model")
def _fitted_model(injector: BenchInjector) -> Iterator[Said]:
    """Findings about the fit that the injector file states; none where it was not fitted."""
    baseline = injector.parameters.baseline
    if baseline is None:
        return
    doubt = doubt_about_fit(injector)
    if doubt is not None:
        yield False, doubt.text, doubt.remedy
        return
    yield (
        f"{injector.parameters_path.name}: adequate, by {baseline.injections} healthy injections at "
        f"{baseline.sample_rate_Hz:g} Hz; {_LEVEL[baseline.level]}"
    )


@ruled("level")
def level_findings(injector: BenchInjector) -> Iterator[Said]:
    """How well the level of all masses is known, and what would make it better known."""
    calibration = calibration_of(injector)
    if calibration.is_calibrated:
        if text := calibration.as_text():
            yield text
        return
    bore, length = 100.0 * calibration.line_diameter, 100.0 * calibration.line_length
    measured = replace(calibration, measured=0.01 * MEASURED_PERCENT)
    yield (
        False,
        f"{calibration.as_text()}: by the line's bore (known to {bore:g} %) and length ({length:g} %), the pressure "
        f"sensors ({100.0 * calibration.line_sensor:g} and {100.0 * calibration.rail_sensor:g} %) and flow beside "
        "the nozzle",
        f"one measured mass known to {MEASURED_PERCENT:g} % makes it ±{measured.bound_pct:.1f} %: "
        "`observer-rt fit --mass`",
    )


@ruled("mass")
def mass_findings(injector: BenchInjector) -> Iterator[Said]:
    """How well the line pressure of one injection tells its mass, where all but the nozzle's flow is known."""
    schedule = make_schedule([REFERENCE_PRESSURE], 1, 30 * MILLISECOND, [SHORT])
    rate, wider = injector.config.sampling.rate_hz, sized("orifice_area", v_H=WIDER)
    file, other = (simulate(injector.parameters, schedule, rate, effects).truth for effects in ((), (wider,)))
    gap = (other.line_pressure - file.line_pressure) / (WIDER * configured_noise(injector).line_pressure)
    if not gap.any():
        return
    mass, share = file.injection_rate.sum() / rate * injector.coefficients.density, Z_95 / float(np.linalg.norm(gap))
    text = f"one injection of {mass / 1e-6:.2g} mg at 100 MPa shows its mass to ±{share:.1%} at best (95 %)"
    yield share < SHOWN, text, "a quieter line-pressure sensor, or one nearer to the injector, shows more"


def _observer(injector: BenchInjector) -> list[Finding]:
    rate = injector.config.sampling.rate_hz
    stated = effects_after_alignment(injector.config.signals)
    constants = constants_for(injector.parameters, rate, Durations(), events_required=0, stated=stated)
    lookahead = constants.timing.lookahead + constants.undoing.ahead
    line_mode = constants.coefficients.line.mode / (2 * math.pi)
    opens, shuts = dead_band(configured_noise(injector).needle_lift * noise_gain(constants.undoing.lift_lag))
    gap, delay = injector.config.learning.event_gap_ms, injector.config.learning.learning_delay_ms
    longest = MAX_EVENT / rate / MILLISECOND
    return [
        graded(
            "line mode",
            rate >= SAMPLES_PER_PERIOD * line_mode,
            f"{line_mode:.0f} Hz, {rate / line_mode:.3g} samples a period",
            f"sample at {SAMPLES_PER_PERIOD * line_mode:.0f} Hz or more, for {SAMPLES_PER_PERIOD} a period",
        ),
        graded(
            "dead band",
            opens <= LARGEST_DEAD_BAND * injector.parameters.seat.max_lift,
            f"opens above {opens / MICROMETRE:.3g} um of lift, shuts below {shuts / MICROMETRE:.3g} um",
            f"above {LARGEST_DEAD_BAND:.0%} of the full lift short injections are missed: "
            "lower the noise of the needle lift",
        ),
        graded("look-ahead", True, f"{lookahead} samples, {lookahead / rate / MICROSECOND:.4g} us"),
        graded(
            "events",
            longest >= 2 * gap,
            f"openings within {gap:g} ms are one event; a new correction takes force {gap + delay:g} ms after the "
            f"needle shuts; learned from events up to {longest:.0f} ms, gap included",
            "shorten learning.event_gap_ms or sample slower",
        ),
    ]
