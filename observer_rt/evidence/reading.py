"""Recordings from files, all that is refused before any work begins."""

from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path

from observer_rt.evidence.measurement import Measurement, measurements
from observer_rt.evidence.plausible import refuse_sample_rates
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.file_hash import file_hash
from observer_rt.recording.signals.plausible import refuse_implausible
from observer_rt.recording.signals.recording import Recording
from observer_rt.recording.signals.stream import HeldSignals


def read_measured(paths: Sequence[Path], read: Callable[[Path], Recording]) -> tuple[Measurement, ...]:
    """Recordings, read and looked through.

    read: takes a file the user named, and refuses one that is none. Raises `UserError` for recordings that cannot
    serve, or not together.
    """
    for number, path in enumerate(paths):
        if path.resolve() in {other.resolve() for other in paths[:number]}:
            raise UserError(str(path), "is given twice", "give every recording once")
    recordings = [read(path) for path in paths]
    refuse_sample_rates(recordings)
    for recording in recordings:
        refuse_implausible(recording.path, HeldSignals(recording).survey)
    return measurements(recordings)


def hashes(paths: Sequence[Path]) -> dict[str, str]:
    """SHA-256 of recordings by file name, by path where two have one name."""
    names = Counter(path.name for path in paths)
    return {path.name if names[path.name] == 1 else str(path): file_hash(path) for path in paths}
