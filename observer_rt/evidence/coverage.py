"""What of a recording is judged, in words: samples, gaps, injections, and those it leaves out."""

from observer_rt.evidence.excerpts import MOST_SAMPLES
from observer_rt.evidence.measurement import Measurement
from observer_rt.foundation.units import MILLISECOND

_SHOWN = 5  # of the injections left out for one reason


def coverage(measurement: Measurement) -> str:
    """One line for a recording used as a whole, else several. Pilot, main and post are one injection."""
    recording, found = measurement.recording, measurement.found
    judged, left_out = len(measurement.events), found.left_out
    lines = [
        f"{recording.path or 'recording'}: {found.gaps.samples} samples at {recording.sample_rate:g} Hz, "
        f"{_gaps(measurement)}, {judged} of {found.complete + len(left_out)} injections judged"
    ]
    if chosen := chosen_words(measurement):
        lines.append(f"  {chosen}")
    for lack in sorted({event.lack for event in left_out}):
        times = [f"{event.time:.4f} s" for event in left_out if event.lack is lack]
        more = f" and {len(times) - _SHOWN} more" if len(times) > _SHOWN else ""
        lines.append(f"  left out, {lack}: at {', '.join(times[:_SHOWN])}{more}")
    return "\n".join(lines)


def is_chosen(measurement: Measurement) -> bool:
    """Whether not all injections are judged, so that times are not those of the recording."""
    return len(measurement.events) != measurement.found.complete


def chosen_words(measurement: Measurement) -> str:
    """How injections were chosen of a recording too long to be judged as a whole; empty for others."""
    judged, complete = len(measurement.events), measurement.found.complete
    if not is_chosen(measurement):
        return ""
    return (
        f"{judged} of {complete} complete injections chosen, spread evenly over each operating point: no more than "
        f"{MOST_SAMPLES} samples of a recording are kept"
    )


def _gaps(measurement: Measurement) -> str:
    gaps = measurement.found.gaps
    if not gaps.count:
        return "no gap"
    longest = gaps.longest * measurement.interval / MILLISECOND
    number = "1 gap" if gaps.count == 1 else f"{gaps.count} gaps"
    return f"{number} of {gaps.missing} samples in all, the longest {longest:.3g} ms"
