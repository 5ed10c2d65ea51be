"""How a needle answers the commands of its injector; the law is `core/model/needle.pxd`."""

from observer_rt.core.model.needle import NeedleLaw
from observer_rt.model.parameters import InjectorParameters


def needle_law(parameters: InjectorParameters) -> NeedleLaw:
    """The needle of an injector's file."""
    needle = parameters.needle
    return NeedleLaw(
        opening_delay=needle.opening_delay,
        opening_speed=needle.opening_speed,
        closing_delay=needle.closing_delay,
        closing_speed=needle.closing_speed,
        stop=parameters.seat.max_lift,
    )
