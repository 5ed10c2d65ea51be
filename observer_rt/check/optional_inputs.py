"""What `check` says of the optional inputs."""

import math

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.energizing import EnergizingLayout
from observer_rt.bus.mapping.optional_inputs import SlowSignal
from observer_rt.check.findings import Finding, Level, graded
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import OptionalRole
from observer_rt.foundation.units import MICROSECOND, MILLIGRAM, MILLISECOND, ZERO_CELSIUS
from observer_rt.model.fuel import HIGHEST_TEMPERATURE, LOWEST_TEMPERATURE, at_temperature

SHOWN_TEMPERATURES = 20.0, 40.0, 80.0  # degC
COARSE = 1 * MILLISECOND  # s from frame to frame of a level, between which a whole pilot may come and go


def optional_findings(fitted: BenchInjector, bus: BusMap) -> list[Finding]:
    """Findings about every optional input of a bench."""
    found = [
        _finding(
            f"{signal.role}: {bus.name_of(slow.layout)} 0x{slow.layout.frame_id:X}, {signal.name}", signal
        )
        for slow in bus.slow
        for signal in slow.signals
    ]
    return found + _energizing(fitted, bus)


def fuel_findings(fitted: BenchInjector) -> list[Finding]:
    """How the fuel changes with its temperature, where a bench measures that."""
    if fitted.config.signals.fuel_temperature is None:
        return []
    shown = []
    for celsius in SHOWN_TEMPERATURES:
        fluid = at_temperature(fitted.parameters, celsius + ZERO_CELSIUS).fluid
        shown.append(
            f"{celsius:.0f} degC: {fluid.density_nozzle:.0f} kg/m3, {fluid.bulk_modulus_line / 1e9:.2f} GPa"
        )
    return [Finding("fuel", Level.OK, "; ".join(shown))]


def _finding(name: str, signal: SlowSignal) -> Finding:
    lowest, highest = signal.range
    if signal.role is OptionalRole.FUEL_TEMPERATURE:
        limits = f"{lowest - ZERO_CELSIUS:.0f} to {highest - ZERO_CELSIUS:.0f} degC"
        is_fuel = lowest < HIGHEST_TEMPERATURE and highest > LOWEST_TEMPERATURE
        said = f"{name}, {limits}, {_counts(signal)}"
        return graded("mapping", is_fuel, said, "no temperature of a fuel; what is its unit?")
    if signal.role is OptionalRole.MEASURED_MASS:
        limits = f"{lowest / MILLIGRAM:.6g} to {highest / MILLIGRAM:.6g} mg"
        return graded(
            "mapping", highest > 0.0, f"{name}, {limits}, compared with the estimate", "never positive"
        )
    can_be_zero = lowest <= 0.0 <= highest
    said = f"{name}, learning stops while it is 0, {_counts(signal)}"
    return graded("mapping", can_be_zero, said, "which it cannot be")


def _counts(signal: SlowSignal) -> str:
    """For how long a value counts."""
    if math.isinf(signal.timeout):
        return "a value counts until the next (no cycle time, no timeout_ms)"
    return f"a value counts for {signal.timeout:g} s"


def _energizing(fitted: BenchInjector, bus: BusMap) -> list[Finding]:
    """Its mapping, and how well opening delays will be known; nothing where it is no input."""
    energizing = bus.energizing
    if energizing is None:
        return []
    layout = energizing.layout
    names = energizing.names
    signals = names[0] if len(names) == 1 else f"{len(names)} samples a frame, {names[0]} to {names[-1]}"
    kind = "energized while it is not 0" if energizing.is_level else "energizing time"
    text = f"energizing: {layout.name} 0x{layout.frame_id:X}, {signals}, {kind}"
    window = f"an injection is missing {energizing.window / MILLISECOND:g} ms after its command"
    findings = [Finding("mapping", Level.OK, f"{text}; {window}"), _accuracy(fitted, energizing)]
    is_coarse = energizing.is_level and len(names) == 1 and (energizing.cycle or 0.0) >= COARSE
    if is_coarse and energizing.cycle is not None:
        findings.append(
            Finding(
                "time",
                Level.WARNING,
                f"{layout.name}: a level every {energizing.cycle / MILLISECOND:g} ms misses shorter energizing, "
                "whose injections then count as without a command; send it faster, on change, or as a duration",
            )
        )
    return findings


def _accuracy(fitted: BenchInjector, energizing: EnergizingLayout) -> Finding:
    sample = 1.0 / fitted.config.sampling.rate_hz
    name = f"{energizing.layout.name}: opening delays"
    between = 0.0
    if energizing.is_level and len(energizing.names) == 1 and energizing.cycle is not None:
        between = energizing.cycle / 2
    if energizing.index is not None:
        text = f"{name} by the sample index, to {(sample + between) / MICROSECOND:.4g} us"
        return Finding("time", Level.OK, text)
    off = f", and {between / MICROSECOND:.4g} us more between two frames" if between else ""
    delay = energizing.delay / MICROSECOND
    text = f"{name} by receive stamps, {delay:.4g} us after it: too short by the jitter of its frames{off}"
    return graded(
        "time", False, text, "an index of the line pressure's time base would tell them to a sample"
    )
