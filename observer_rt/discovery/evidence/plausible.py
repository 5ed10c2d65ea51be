"""Recordings nobody should look for effects in: refused with file and remedy."""

from collections.abc import Sequence

from observer_rt.discovery.evidence.measurement import Measurement
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE
from observer_rt.recording.signals.recording import Recording

RAIL_PRESSURES = (5 * MEGAPASCAL, 400 * MEGAPASCAL)  # Pa, of common-rail injection
LARGEST_LIFT = 2 * MILLIMETRE
_RATE_TOLERANCE = 1e-6  # relative


def refuse_sample_rates(recordings: Sequence[Recording]) -> None:
    """Refuse recordings of different sample rates."""
    first = recordings[0]
    for other in recordings[1:]:
        if abs(other.sample_rate - first.sample_rate) > _RATE_TOLERANCE * first.sample_rate:
            raise UserError(
                str(other.path),
                f"is sampled at {other.sample_rate:g} Hz, {first.path} at {first.sample_rate:g} Hz",
                "give recordings of one sample rate: sort them into several calls, or resample them",
            )


def refuse_rates_missing(recordings: Sequence[Recording]) -> None:
    """Refuse a measured injection rate that some recordings have and others have not."""
    first = recordings[0]
    for other in recordings[1:]:
        if (other.injection_rate is None) != (first.injection_rate is None):
            without = other if other.injection_rate is None else first
            raise UserError(
                str(without.path),
                "has no measured injection rate, other recordings have one",
                "leave the column out of all recordings, or give only those that have it",
            )


def refuse_implausible(measurement: Measurement) -> None:
    """Refuse pressures and lifts that are no injector's, most often given in another unit."""
    recording = measurement.recording
    lowest, highest = RAIL_PRESSURES
    openings = [opening for event in measurement.events for opening in event.openings]
    for name, values in (
        ("rail_pressure", recording.rail_pressure),
        ("line_pressure", recording.line_pressure),
    ):
        mean = float(sum(values[opening.first] for opening in openings)) / len(openings)
        if not lowest <= mean <= highest:
            raise UserError(
                f"{recording.path}, {name}",
                f"is {mean / MEGAPASCAL:.4g} MPa when the needle opens",
                f"give pressures of {lowest / MEGAPASCAL:g} to {highest / MEGAPASCAL:g} MPa; mind the unit",
            )
    lift = max(float(recording.needle_lift[o.first : o.last + 1].max()) for o in openings)
    if lift > LARGEST_LIFT:
        raise UserError(
            f"{recording.path}, needle_lift",
            f"reaches {lift / MILLIMETRE:.4g} mm",
            f"give lifts below {LARGEST_LIFT / MILLIMETRE:g} mm; mind the unit",
        )
