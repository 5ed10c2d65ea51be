"""How much of a recording is judged, in words."""

from observer_rt.foundation.units import first_of
from observer_rt.identification.likelihood.excerpts import MOST_SAMPLES
from observer_rt.identification.likelihood.measurement import Measurement


def coverage(measurement: Measurement) -> str:
    """Lines on the samples and injections of a recording; pilot, main and post are one injection."""
    recording, injections = measurement.recording, measurement.injections
    judged, left_out = len(measurement.events), injections.left_out
    lines = [
        f"{recording.path or 'recording'}: {injections.samples} samples at {recording.sample_rate:g} Hz, "
        f"{injections.missing or 'none'} missing, {judged} of {injections.complete + len(left_out)} injections judged"
    ]
    if chosen := chosen_words(measurement):
        lines.append(f"  {chosen}")
    for lack in sorted({event.lack for event in left_out}):
        times = [f"{event.time:.4f} s" for event in left_out if event.lack is lack]
        lines.append(f"  left out, {lack}: at {first_of(times)}")
    return "\n".join(lines)


def chosen_words(measurement: Measurement) -> str:
    """How injections were chosen from a recording too long to be judged whole; empty for others."""
    judged, complete = len(measurement.events), measurement.injections.complete
    if judged == complete:
        return ""
    return (
        f"{judged} of {complete} complete injections chosen, spread evenly over each operating point: no more than "
        f"{MOST_SAMPLES} samples of a recording are kept"
    )
