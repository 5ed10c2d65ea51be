"""The messages of results and their signals: where each lies in our databases, and where its value comes from."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, NamedTuple, get_type_hints

from observer_rt.foundation.units import CUBIC_MILLIMETRE, MEGAPASCAL, MILLIGRAM, MM3_PER_MS


class SentQuantity(NamedTuple):
    """Coding of a value sent, its largest code "not available"; has_error: the next is "error"; si: of the unit."""

    scale: float
    offset: float
    unit: str
    si: float = 1.0
    has_error: bool = True


MASS = SentQuantity(0.01, -50.0, "mg", MILLIGRAM)
MASS_SIGMA = SentQuantity(0.001, 0.0, "mg", MILLIGRAM)
VOLUME = SentQuantity(0.01, -50.0, "mm3", CUBIC_MILLIMETRE)
PRESSURE = SentQuantity(0.005, -10.0, "MPa", MEGAPASCAL)
OFFSET = SentQuantity(0.001, -30.0, "MPa", MEGAPASCAL)
RATE = SentQuantity(0.01, -100.0, "mm3/ms", MM3_PER_MS)
WEAR = SentQuantity(0.0001, -3.0, "-")
WEAR_SIGMA = SentQuantity(0.0001, 0.0, "-")
DENSITY = SentQuantity(0.5, 200.0, "kg/m3")
AGE = SentQuantity(0.1, 0.0, "s", has_error=False)
LATENCY = SentQuantity(1e-6, 0.0, "s", has_error=False)


@dataclass(frozen=True)
class OutputSignal:
    """A signal of a message of ours.

    source: of its value, as `engine.service.messages.value_of` finds it. fd: first of its bits in `observer_fd.dbc`;
    page, classic: its page and first bit in `observer_classic.dbc`; without any it has room in neither, but a user's
    message may have it. quantity: None: a whole number, which stays at its largest or, if it wraps, begins anew.
    says: comment of the databases; counts, remedy: of a counter (docs/operating.md).
    """

    source: str
    bits: int = 32
    fd: int | None = None
    page: int | None = None
    classic: int | None = None
    quantity: SentQuantity | None = None
    wraps: bool = False
    says: str = ""
    counts: str = ""
    remedy: str = "nothing"

    def sent(self, value: Any) -> Any:
        """A value (SI; None: no value) as it is sent, in the database's unit."""
        if self.quantity is not None:
            return math.nan if value is None else value / self.quantity.si
        return (value or 0) & ((1 << self.bits) - 1) if self.wraps else value or 0


# fmt: off
class SummaryValues(NamedTuple):
    """The signals of a summary, in the database's units: `mass_sigma` goes out as `MassSigma`."""

    sample_index: Annotated[int, OutputSignal("report.start_index", 32, 32, 0, 16, wraps=True,
        says="Index of the input sample at which the window of the injection starts.")]
    valid: Annotated[bool, OutputSignal("report.valid", 1, 24, None, 15,
        says="1: all its samples were valid and its own event passed its tests; its level: see Calibrated.")]
    learning: Annotated[bool, OutputSignal("learning", 1, 25, 1, 51)]
    state: Annotated[int, OutputSignal("report.state", 3, 26, 1, 48)]
    calibrated: Annotated[bool, OutputSignal("report.calibration.is_calibrated", 1, 29, 1, 52,
        says="1: a measured mass fixed the level of all masses; 0: it is that of the injector file, see MassSigma.")]
    end_index: Annotated[int, OutputSignal("report.end_index", 32, 64, 1, 16, wraps=True,
        says="Index of the input sample at which the window of the injection ends.")]
    injection_number: Annotated[int, OutputSignal("report.number", 32, 96, 2, 16, wraps=True,
        says="Counts needle openings since the start of the observer, from 1.")]
    event_number: Annotated[int, OutputSignal("report.event", 32, 128, 3, 16, wraps=True,
        says="Counts events (pilot, main and post injection together) since the start of the observer, from 1.")]
    phi_version: Annotated[int, OutputSignal("report.phi_version", 16, 160, 2, 48, wraps=True,
        says="Which learned correction was in force: 0 none, then one more with every adoption.")]
    injector_id: Annotated[int, OutputSignal("injector_id", 8, 176, 0, 48)]
    reason: Annotated[int, OutputSignal("report.reason", 8, 184, 0, 56,
        says="Why the injection is not valid or the state is degraded; 0: no reason.")]
    mass: Annotated[float, OutputSignal("report.mass", 16, 192, 3, 48, MASS, says="Injected mass over the window.")]
    mass_sigma: Annotated[float, OutputSignal("mass_sigma", 16, 208, 5, 16, MASS_SIGMA,
        says="Standard deviation of Mass.")]
    volume: Annotated[float, OutputSignal("report.volume", 16, 224, 4, 16, VOLUME,
        says="Injected volume over the window, per stroke.")]
    rail_pressure_at_start: Annotated[float, OutputSignal("report.rail_pressure", 16, 240, 4, 32, PRESSURE,
        says="Rail pressure at the start of the window.")]
    peak_injection_rate: Annotated[float, OutputSignal("report.peak_rate", 16, 256, 4, 48, RATE,
        says="Largest injection rate in the window.")]
    fuel_density: Annotated[float, OutputSignal("report.density", 11, 352, 1, 53, DENSITY,
        says="Density at the nozzle that volume and rates are of: mass over volume.")]
    nozzle_wear: Annotated[float, OutputSignal("report.indicators.orifice_area.value", 16, 272, 5, 32, WEAR,
        says="Relative change of the nozzle orifice area: erosion positive, coking negative.")]
    nozzle_wear_sigma: Annotated[float, OutputSignal("report.indicators.orifice_area.sigma", 16, 288, 5, 48,
        WEAR_SIGMA)]
    seat_wear: Annotated[float, OutputSignal("report.indicators.seat_area.value", 16, 304, 6, 16, WEAR,
        says="Relative change of the needle seat area.")]
    seat_wear_sigma: Annotated[float, OutputSignal("report.indicators.seat_area.sigma", 16, 320, 6, 32, WEAR_SIGMA)]
    line_pressure_offset: Annotated[float, OutputSignal("line_pressure_offset", 16, 336, 6, 48, OFFSET,
        says="Offset of the line pressure sensor against the rail pressure sensor, found at standstill.")]


class StatusValues(NamedTuple):
    """The signals of a status, as in `SummaryValues`."""

    sample_index: Annotated[int, OutputSignal("core.last_index", 32, 32, 0, 16, wraps=True,
        says="Index of the last input sample processed.")]
    valid: Annotated[bool, OutputSignal("valid", 1, 24, 0, 60)]
    learning: Annotated[bool, OutputSignal("core.optional.learning", 1, 25, 0, 51)]
    state: Annotated[int, OutputSignal("state", 3, 26, 0, 48)]
    reason: Annotated[int, OutputSignal("reason", 8, 64, 0, 52, says="Why the state is DEGRADED; 0: no reason.")]
    injector_id: Annotated[int, OutputSignal("injector_id", 8, 72, 1, 16)]
    version_major: Annotated[int, OutputSignal("version.major", 8, 80, 1, 24)]
    version_minor: Annotated[int, OutputSignal("version.minor", 8, 88, 1, 32)]
    version_patch: Annotated[int, OutputSignal("version.patch", 8, 96, 1, 40)]
    model_hash: Annotated[int, OutputSignal("model_hash", 32, 128, 2, 16,
        says="First 32 bits of the SHA-256 of the values in the injector model file, comments left out, as "
        "observer-rt check tells it.")]
    database_hash: Annotated[int, OutputSignal("database_hash", 32, 160, 3, 16,
        says="First 32 bits of the SHA-256 of the database files in use.")]
    samples_processed: Annotated[int, OutputSignal("observer.positions.processed", 32, 192, 4, 16, wraps=True,
        counts="samples observed")]
    lost_samples: Annotated[int, OutputSignal("alignment.lost", 32, 224, 5, 16,
        says="Input samples that never arrived.", counts="samples that never came or had no value",
        remedy="as SAMPLES_LOST")]
    interpolated_samples: Annotated[int, OutputSignal("observer.positions.interpolated", 32, 256, 6, 16,
        says="Input samples put in between their neighbours, where at most two were missing.",
        counts="samples interpolated, two at the most", remedy="as SAMPLES_LOST, if many")]
    crc_errors: Annotated[int, OutputSignal("receiver.crc_errors", 16, 288, 7, 16,
        counts="frames whose end-to-end protection is wrong",
        remedy="check E2EProfile and E2EDataId; cable and termination")]
    sequence_errors: Annotated[int, OutputSignal("receiver.sequence_errors", 16, 320, 8, 16,
        counts="frames out of sequence by their counter",
        remedy="a second sender of an input? a gateway that reorders?")]
    length_errors: Annotated[int, OutputSignal("receiver.length_errors", 16, 112, 1, 48,
        counts="frames of another length than the database says", remedy="correct the database")]
    repeated_frames: Annotated[int, OutputSignal("alignment.repeated", 16, 352, 9, 16,
        says="Frames whose sample index had been received before; the first wins.",
        counts="frames that came twice; the first counts", remedy="a second sender of an input?")]
    old_frames: Annotated[int, OutputSignal("alignment.old", 16, 368, 10, 16,
        says="Frames that came after later ones of their message, dropped; several in a row are a restart of it.",
        counts="frames that came too late", remedy="a second sender of an input? a gateway that reorders?")]
    dropped_frames: Annotated[int, OutputSignal("daemon.dropped", 16, 416, 11, 16,
        says="Frames dropped by kernel or driver before the observer could read them.",
        counts="frames lost before they were read",
        remedy="real-time priority, a processor of its own")]
    link_troubles: Annotated[int, OutputSignal("daemon.troubles", 8, 104, 6, 48,
        says="How often a CAN interface went down or away, and its controller error-passive or bus-off.",
        counts="how often an interface was down, error-passive or bus-off",
        remedy="cable, termination, bit rates, another node that acknowledges")]
    troubled_bus: Annotated[int, OutputSignal("daemon.troubled_bus", 3, 29, 6, 56,
        says="First bus, in the order of the bench file and counted from 1, that is down, bus-off or error-passive; "
        "0: none.")]
    restarts: Annotated[int, OutputSignal("alignment.restarts", 16, 448, 2, 48,
        says="Restarts of a measuring device: its sample index jumped back.",
        counts="restarts of a measuring device", remedy="its power supply")]
    adoptions: Annotated[int, OutputSignal("judging.adoptions", 16, 464, 3, 48,
        says="Learned corrections taken into force.", counts="corrections learned and taken into force")]
    rejected_adoptions: Annotated[int, OutputSignal("judging.rejected", 16, 480, 4, 48,
        says="Learned corrections refused because they did not lower the output error.",
        counts="corrections learned and refused", remedy="nothing, if seldom; else as MODEL_INADEQUATE")]
    late_adoptions: Annotated[int, OutputSignal("judging.late", 16, 496, 5, 48,
        says="Learned corrections that were ready too late for their injection and took force with a later one.",
        counts="corrections in force with a later injection",
        remedy="a faster computer, or a longer learning_delay_ms")]
    foreign_frames: Annotated[int, OutputSignal("daemon.arrivals.foreign_frames", 8, 408, 8, 56,
        says="Frames of another node under the identifiers of this observer.",
        counts="frames of another node under our identifiers", remedy="as SECOND_SENDER")]
    rail_pressure_age: Annotated[float, OutputSignal("ages.rail_pressure", 8, 384, 7, 48, AGE,
        says="Time since the last frame with rail pressure; 255: none came yet.")]
    needle_lift_age: Annotated[float, OutputSignal("ages.needle_lift", 8, 392, 7, 56, AGE,
        says="Time since the last frame with needle lift; 255: none came yet.")]
    line_pressure_age: Annotated[float, OutputSignal("ages.line_pressure", 8, 400, 8, 48, AGE,
        says="Time since the last frame with line pressure; 255: none came yet.")]
    failed_writes: Annotated[int, OutputSignal("daemon.failed_writes", 16, 336, 9, 32,
        says="Failed writes of the learned state or the journal, and log lines given up.",
        counts="failed writes of state, journal or log",
        remedy="room and rights on the disk; see the log")]
    latency_p999: Annotated[float, OutputSignal("daemon.latency.p999", 16, 304, 10, 32, LATENCY,
        says="From the stamp of an input frame until the rates it caused are sent: what 99.9 % stay within; 65533: "
        "longer, 65535: none were sent yet.")]
    largest_latency: Annotated[float, OutputSignal("daemon.latency.largest", 16, 432, 10, 48, LATENCY,
        says="The same, the largest since the start.")]
    missing_injections: Annotated[int, OutputSignal("energizing.missing",
        counts="commands after which the needle did not open", remedy="injector, driver stage")]
    spikes: Annotated[int, OutputSignal("observer.outliers.spikes",
        counts="values that stood out and were replaced",
        remedy="shielding and earth of the cable, if many")]
    bridged_samples: Annotated[int, OutputSignal("observer.outliers.bridged",
        counts="values of a frozen or clipped input, bridged", remedy="as INPUT_FROZEN, if many")]
    refused_frames: Annotated[int, OutputSignal("supervised.refused",
        counts="good frames of a message that is INVALID", remedy="as INPUT_PROTECTION")]
    evidence_kept: Annotated[int, OutputSignal("daemon.evidence_kept",
        counts="events whose inputs were kept as evidence", remedy="`observer-rt discover --from-evidence`, if many")]
    unlearned_events: Annotated[int, OutputSignal("judging.passed_over",
        counts="events not learned from, since more came than can be", remedy="as LateAdoptions")]
# fmt: on


class Result(NamedTuple):
    """Signals of a message, its identifier in our databases; one an injection, else every `status_period_ms`."""

    values: Any
    number: int
    per_injection: bool


RESULTS: Mapping[str, Result] = {
    "injection_summary": Result(SummaryValues, 513, per_injection=True),
    "status": Result(StatusValues, 514, per_injection=False),
}
"""Messages of results by their keys in `[outputs]`."""


def signals_of(values: Any) -> tuple[str, ...]:
    """Names of the signals in a database, in order."""
    return tuple("".join(word.capitalize() for word in field.split("_")) for field in values._fields)


@cache
def rows_of(values: Any) -> dict[str, OutputSignal]:
    """The table of a message's values, as `SummaryValues`, by field."""
    hints = get_type_hints(values, include_extras=True)
    return {field: hints[field].__metadata__[0] for field in values._fields}
