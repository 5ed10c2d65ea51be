"""What of a recording discovery judges, in words: samples, gaps, injections, and those it leaves out."""

import numpy as np

from observer_rt.evidence.measurement import Measurement, missing_samples
from observer_rt.foundation.units import MILLISECOND

_SHOWN = 5  # of the injections left out for one reason


def coverage(measurement: Measurement) -> str:
    """One line for a recording used as a whole, else several. Pilot, main and post are one injection."""
    recording = measurement.recording
    judged, left_out = len(measurement.events), measurement.left_out
    lines = [
        f"{recording.path or 'recording'}: {recording.samples} samples at {recording.sample_rate:g} Hz, "
        f"{_gaps(measurement)}, {judged} of {judged + len(left_out)} injections judged"
    ]
    for lack in sorted({event.lack for event in left_out}):
        times = [f"{event.time:.4f} s" for event in left_out if event.lack is lack]
        more = f" and {len(times) - _SHOWN} more" if len(times) > _SHOWN else ""
        lines.append(f"  left out, {lack}: at {', '.join(times[:_SHOWN])}{more}")
    return "\n".join(lines)


def _gaps(measurement: Measurement) -> str:
    missing = missing_samples(measurement.recording)
    edges = np.flatnonzero(np.diff(missing, prepend=False, append=False))
    lengths = edges[1::2] - edges[::2]
    if not lengths.size:
        return "no gap"
    longest = lengths.max() * measurement.interval / MILLISECOND
    gaps = "1 gap" if lengths.size == 1 else f"{lengths.size} gaps"
    return f"{gaps} of {missing.sum()} samples in all, the longest {longest:.3g} ms"
