"""What `check` says of the optional inputs."""

import math

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.optional_inputs import SlowSignal
from observer_rt.check.findings import Finding, Level, graded
from observer_rt.config.bench import BenchInjector
from observer_rt.config.signals import OptionalRole
from observer_rt.foundation.units import MILLIGRAM, ZERO_CELSIUS
from observer_rt.model.fuel import HIGHEST_TEMPERATURE, LOWEST_TEMPERATURE, at_temperature

SHOWN_TEMPERATURES = 20.0, 40.0, 80.0  # degC


def slow_findings(bus: BusMap) -> list[Finding]:
    """A finding for every optional input of a bench."""
    return [
        _finding(
            f"{signal.role}: {bus.name_of(slow.layout)} 0x{slow.layout.frame_id:X}, {signal.name}", signal
        )
        for slow in bus.slow
        for signal in slow.signals
    ]


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
