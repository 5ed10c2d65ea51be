"""Recordings that cannot be judged together: refused with file and remedy."""

from collections.abc import Sequence

from observer_rt.foundation.errors import UserError
from observer_rt.recording.signals.recording import Recording, Sampled

_RATE_TOLERANCE = 1e-6  # relative


def refuse_sample_rates(recordings: Sequence[Sampled]) -> None:
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
