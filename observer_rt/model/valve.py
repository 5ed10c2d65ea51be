"""The pilot valve of a servo injector: how much fuel it takes out of the line's end, and when.

It drains the control chamber into the return, c G(t) sqrt(p_L / 100 MPa), from before the needle leaves its seat to
before it begins to fall: both earlier the lower the rail pressure, as (p_R / 100 MPa)^-n. Where the injector's
command is known, it opens and shuts some time after the edges of that. The equations are
`core/model/valve.pxd` and `core/model/servo.pxi`; none of that fuel is injected.
"""

import math
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from observer_rt.model.parameters import InjectorParameters

START, END = 0.25e-3, 0.20e-3  # s, of an injector whose file does not state them
DELAY = 0.1e-3  # s, after both edges of the injector's command
AT = 100e6  # Pa, of the line and of the rail, to which flow and times belong


class Valve(NamedTuple):
    """When the valve is open, and how its flow changes."""

    start: float = START  # s before the needle leaves its seat, at 100 MPa
    end: float = END  # s before it begins to fall
    hold: float = 0.0  # h: share by which the flow is larger while the needle is at its stop
    exponent: float = 0.0  # n
    # 1: start and end are counted from the edges of the command, whatever the rail pressure.
    commanded: float = 0.0

    def by_commands(self) -> "Valve":
        """The valve of an injector whose commands are known."""
        return Valve(-DELAY, -DELAY, self.hold, commanded=1.0)


def valve_of(parameters: "InjectorParameters") -> Valve:
    """The valve of an injector's file."""
    line = parameters.line
    stated = line.control_start, line.control_end, line.control_hold, line.control_exponent
    return Valve(*(usual if one is None else one for one, usual in zip(stated, Valve(), strict=False)))


def control_flow_at_scale(parameters: "InjectorParameters") -> float:
    """c at the pressure scale p_0 [m3/s]."""
    return (parameters.line.control_flow or 0.0) * math.sqrt(parameters.scaling.pressure / AT)
