"""What `check` says of the energizing: its mapping, and how well opening delays will be known."""

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.energizing import Energizing
from observer_rt.check.findings import Finding, Level, graded
from observer_rt.config.bench import BenchInjector
from observer_rt.foundation.units import MICROSECOND, MILLISECOND

COARSE = 1 * MILLISECOND  # s from frame to frame of a level, between which a whole pilot may come and go


def energizing_findings(fitted: BenchInjector, bus: BusMap) -> list[Finding]:
    """Findings about the energizing of a bench, none where it is no input."""
    energizing = bus.energizing
    if energizing is None:
        return []
    layout = energizing.layout
    names = energizing.names
    signals = names[0] if len(names) == 1 else f"{len(names)} samples a frame, {names[0]} to {names[-1]}"
    kind = "energized while it is not 0" if energizing.is_level else "energizing time"
    text = f"energizing: {layout.name} 0x{layout.frame_id:X}, {signals}, {kind}"
    window = f"an injection is missing {energizing.window / MILLISECOND:g} ms after its command"
    findings = [Finding("mapping", Level.OK, f"{text}; {window}"), _accuracy(fitted, energizing)]
    is_coarse = energizing.is_level and len(names) == 1 and (energizing.cycle or 0.0) >= COARSE
    if is_coarse and energizing.cycle is not None:
        findings.append(
            Finding(
                "time",
                Level.WARNING,
                f"{layout.name}: a level every {energizing.cycle / MILLISECOND:g} ms misses shorter energizing, "
                "whose injections then count as without a command; send it faster, on change, or as a duration",
            )
        )
    return findings


def _accuracy(fitted: BenchInjector, energizing: Energizing) -> Finding:
    sample = 1.0 / fitted.config.sampling.rate_hz
    name = f"{energizing.layout.name}: opening delays"
    between = 0.0
    if energizing.is_level and len(energizing.names) == 1 and energizing.cycle is not None:
        between = energizing.cycle / 2
    if energizing.index is not None:
        text = f"{name} by the sample index, to {(sample + between) / MICROSECOND:.4g} us"
        return Finding("time", Level.OK, text)
    off = f", and {between / MICROSECOND:.4g} us more between two frames" if between else ""
    delay = energizing.delay / MICROSECOND
    text = f"{name} by receive stamps, {delay:.4g} us after it: too short by the jitter of its frames{off}"
    return graded(
        "time", False, text, "an index of the line pressure's time base would tell them to a sample"
    )
