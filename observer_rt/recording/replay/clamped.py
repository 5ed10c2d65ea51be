"""Values of a recording that the signals of a bus cannot hold."""

from observer_rt.bus.mapping.bus_map import BusMap
from observer_rt.bus.mapping.input_tables import ROLES
from observer_rt.bus.mapping.signal_range import message_of, role_range, role_resolution
from observer_rt.config.signals import Role
from observer_rt.foundation.units import MEGAPASCAL, MILLIMETRE
from observer_rt.recording.signals.survey import Survey

_SHOWN_UNIT = {
    Role.RAIL_PRESSURE: ("MPa", MEGAPASCAL),
    Role.NEEDLE_LIFT: ("mm", MILLIMETRE),
    Role.LINE_PRESSURE: ("MPa", MEGAPASCAL),
}


def clamped_in(survey: Survey, bus: BusMap) -> list[str]:
    """One line for every role with values that the bus cannot hold, which are clamped when sent."""
    warnings = []
    for role in ROLES:
        found, limits = survey.signals[role.value], role_range(bus, role)
        unit, factor = _SHOWN_UNIT[role]
        for reached, limit, is_beyond in (
            (found.lowest, limits.lowest, limits.lowest - found.lowest),
            (found.highest, limits.highest, found.highest - limits.highest),
        ):
            if is_beyond > 0.5 * role_resolution(bus, role, limit):
                name = bus.input_layouts[message_of(bus, role)].name
                warnings.append(
                    f"{role}: reaches {reached / factor:.6g} {unit}, beyond {limit / factor:.6g} {unit}, the limit "
                    f"of {name}, and is clamped to it"
                )
    return warnings
