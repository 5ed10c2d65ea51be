"""What `check` says of the optional inputs."""

from observer_rt.bus.mapping import BusMap
from observer_rt.bus.slow_inputs import SlowSignal, value_range
from observer_rt.config import OptionalRole
from observer_rt.service.findings import Finding, graded
from observer_rt.units import MILLIGRAM


def slow_findings(bus: BusMap) -> list[Finding]:
    """A finding for every optional input of a bench."""
    return [
        _finding(
            f"{signal.role}: {bus.name_of(slow.layout)} 0x{slow.layout.frame_id:X}, {signal.name}", signal
        )
        for slow in bus.slow
        for signal in slow.signals
    ]


def _finding(name: str, signal: SlowSignal) -> Finding:
    lowest, highest = value_range(signal)
    if signal.role is OptionalRole.MEASURED_MASS:
        limits = f"{lowest / MILLIGRAM:.6g} to {highest / MILLIGRAM:.6g} mg"
        return graded(
            "mapping", highest > 0.0, f"{name}, {limits}, compared with the estimate", "never positive"
        )
    can_be_zero = lowest <= 0.0 <= highest
    return graded("mapping", can_be_zero, f"{name}, learning stops while it is 0", "which it cannot be")
