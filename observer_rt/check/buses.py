"""Findings about several buses: what is on which, and whether their stamps can be compared."""

import numpy as np

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.timing import Joining, Numbering
from observer_rt.check.findings import Finding, Level, graded
from observer_rt.config.bench import Bench


def buses_findings(bench: Bench, bus: BusMap) -> list[Finding]:
    """What comes in and goes out on each bus, where there are several, and whether its stamps serve."""
    links = bench.config.buses
    if len(links) == 1:
        return []
    findings = []
    for number, link in enumerate(links):
        ways = (
            f"{way} {', '.join(names)}"
            for way, layouts in (("in", bus.received), ("out", bus.sent))
            if (names := [layout.name for layout in layouts if layout.bus == number])
        )
        carried = ", ".join(ways)
        text = f"{link.label}, {link.config.interface}: {carried or 'nothing'}"
        remedy = f"state link for a [[dbc]], a signal or the outputs, or leave [{link.place}] out"
        findings.append(graded("buses", bool(carried), text, remedy))
    return findings + _stamps(bench, bus)


def _stamps(bench: Bench, bus: BusMap) -> list[Finding]:
    """Inputs that depend on stamps, on buses whose stamps are too rough beside others."""
    timing = bus.inputs.timing
    rough = {n for n, link in enumerate(bench.config.buses) if link.config.interface != "socketcan"}
    if not np.any((timing["numbering"] != Numbering.INDEX) | (timing["joining"] == Joining.CLOCK)):
        return []
    return [
        Finding(
            "buses",
            Level.WARNING,
            f"{bus.labels[number]}: beside other buses its frames are stamped when this process reads them, too "
            "roughly for messages of several time bases, or without index; use SocketCAN, or give all messages an "
            "index and one time base",
        )
        for number in sorted({layout.bus for layout in bus.input_layouts} & rough)
    ]
