"""Units of signals: as the bench file says, or else as the bus database states them."""

from collections.abc import Iterable, Mapping

from cantools.database.can import Message

from observer_rt.bus.database.lookup import find_signal
from observer_rt.foundation.errors import UserError
from observer_rt.foundation.units import factor_of


def from_unit(
    place: str, message: Message, signal: str, unit: str | None, units: Mapping[str, float]
) -> float:
    """What a signal's unit is in SI, by `unit` of the bench file, or else what the database states.

    Raises `UserError` naming `place` of the bench file for a unit that is none of `units`, nor a number of one.
    """
    stated = stated_unit(message, signal, unit)
    factor = factor_of(stated, units)
    if factor is None:
        name = next(iter(units))
        raise unknown_unit(place, message, stated, units, f', or a number of them ("98066.5 {name}")')
    return factor


def stated_unit(message: Message, signal: str, unit: str | None) -> str:
    """The unit of a signal: `unit` of the bench file, or else what the database states; empty without."""
    return unit or find_signal(message, signal).unit or ""


def unknown_unit(
    place: str, message: Message, stated: str, units: Iterable[str], others: str = ""
) -> UserError:
    """The error for a unit that is none of `units`; others: what else there could be."""
    return UserError(
        place,
        f"unit {stated!r} of {message.name} is not known" if stated else f"{message.name} states no unit",
        f'add unit = "..." with one of {", ".join(units)}{others}',
    )
