"""Findings about time: how the samples of every message come together, and what cannot be seen of it."""

import numpy as np

from observer_rt.bus.alignment.message_timing import LINE_SLOPE
from observer_rt.bus.mapping.bus_map import BusMap, layout_of
from observer_rt.bus.mapping.timing import TOLERANCE, Joining, Numbering
from observer_rt.check.findings import Finding, Level
from observer_rt.foundation.units import MEGAPASCAL, MICROSECOND, MILLISECOND

_NUMBERED = {
    Numbering.INDEX: "by its sample index",
    Numbering.COUNTER: "counted by its counter and receive stamps",
    Numbering.E2E_COUNTER: "counted by its E2E counter and receive stamps",
    Numbering.STAMPS: "counted by receive stamps",
}


def time_findings(bus: BusMap) -> list[Finding]:
    """One finding for each input message, warnings where something of its time cannot be seen."""
    findings = []
    for stream, timing in enumerate(bus.inputs.timing):
        name = bus.name_of(layout_of(bus, stream))
        text = f"{name}: {_NUMBERED[Numbering(int(timing['numbering']))]}{_joined(timing)}"
        findings.append(Finding("time", Level.OK, text))
        if timing["numbering"] == Numbering.STAMPS:
            findings.append(_no_counter(name))
    if any(timing["joining"] == Joining.CLOCK for timing in bus.inputs.timing):
        findings.append(
            Finding(
                "time",
                Level.OK,
                f"two time bases: not valid while more than {TOLERANCE / MICROSECOND:g} us between line pressure and "
                f"lift are unknown ({TOLERANCE * LINE_SLOPE / MEGAPASCAL:.2g} MPa); the stamps must be the bus's "
                "(hardware or kernel), an adapter that hands frames over in batches cannot tell",
            )
        )
    return findings


def _joined(timing: np.void) -> str:
    joining = Joining(int(timing["joining"]))
    if joining is Joining.RATIO:
        return f", every {timing['steps']}th sample; held at most {timing['hold'] / MILLISECOND:g} ms"
    if joining is Joining.NEAREST:
        return (
            f", nearest sample of the same time base; stamps {timing['delay'] / MICROSECOND:.4g} us after it"
        )
    if joining is Joining.CLOCK:
        held = f", held at most {timing['hold'] / MILLISECOND:g} ms" if timing["steps"] > 1 else ""
        return f"; by its clock, stamps {timing['delay'] / MICROSECOND:.4g} us after the last sample{held}"
    return ""


def _no_counter(name: str) -> Finding:
    return Finding(
        "time",
        Level.WARNING,
        f"{name} has neither index nor counter: lost frames are seen, and results valid, only while its jitter stays "
        "below a quarter of its cycle; name its counter, if it has one",
    )
