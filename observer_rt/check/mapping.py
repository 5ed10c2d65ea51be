"""Findings about what one injector has on the buses: which messages carry it, with which range, how often sampled."""

from collections.abc import Sequence

import numpy as np

from observer_rt.bus.database.lookup import MessageLayout
from observer_rt.bus.mapping.bench_map import KnownMessage
from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.signal_range import message_of, role_factor, role_range, role_resolution
from observer_rt.check.findings import Finding, Level, graded
from observer_rt.check.optional_inputs import optional_findings
from observer_rt.config.bench import PACKAGE_DATA, BenchInjector
from observer_rt.config.signals import Role
from observer_rt.foundation.units import LENGTH_UNITS, MEGAPASCAL, MICROMETRE, PRESSURE_UNITS
from observer_rt.recording.replay.framing import message_timing
from observer_rt.service.compiled.constants import configured_noise

HIGHEST_PRESSURE = 200 * MEGAPASCAL
PERIOD_TOLERANCE = 1.0  # ns, what rounding to whole nanoseconds may take
CYCLE_TOLERANCE = 0.5e6  # ns, what rounding to whole milliseconds may take


def mapping_findings(fitted: BenchInjector, bus: BusMap, known: Sequence[KnownMessage]) -> list[Finding]:
    """All findings about the mapping of an injector; known: the messages of all databases."""
    findings = [_mapping(fitted, bus, role) for role in ROLES] + optional_findings(fitted, bus)
    return findings + _sample_periods(fitted, bus, known)


def _mapping(fitted: BenchInjector, bus: BusMap, role: Role) -> Finding:
    number = message_of(bus, role)
    layout, message = bus.input_layouts[number], bus.inputs.messages[number]
    is_lift = role is Role.NEEDLE_LIFT
    needed = fitted.parameters.seat.max_lift if is_lift else HIGHEST_PRESSURE
    unit, factor = ("um", MICROMETRE) if is_lift else ("MPa", MEGAPASCAL)
    limits = role_range(bus, role)
    resolution = role_resolution(bus, role, needed)
    noise: float = getattr(configured_noise(fitted), role.value)
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
    named = next((unit for unit, known in units.items() if known == factor), None)
    return named or f"units of {factor:g} {next(iter(units))}"


def _sample_periods(fitted: BenchInjector, bus: BusMap, known: Sequence[KnownMessage]) -> list[Finding]:
    rate = fitted.config.sampling.rate_hz
    findings = [Finding("sampling", Level.OK, f"{rate:g} Hz, a sample every {1e9 / rate:.6g} ns")]
    for number, layout in enumerate(bus.input_layouts):
        message = bus.inputs.messages[number]
        expected = 1e9 * float(message_timing(bus, number)["interval"])
        findings += _periods(layout, int(message["samples"]), int(message["kind_count"]), expected)
    if bus.rate is not None and not _is_shipped(known, bus.rate.layout.name):
        findings += _periods(bus.rate.layout, bus.rate.samples, 1, 1e9 / rate)
    return findings


def _is_shipped(known: Sequence[KnownMessage], name: str) -> bool:
    """Whether a message is of a database of ours, whose example of a sample period no user can change."""
    return next(message.path for message in known if message.name == name).parent == PACKAGE_DATA


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
