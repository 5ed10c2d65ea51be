"""Fitted parameters and other figures in the units people read, with as many digits as they deserve."""

from collections.abc import Sequence

from observer_rt.discovery.search.result import FittedParameter
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MM3_PER_MS
from observer_rt.model.effect import EffectParameter
from observer_rt.model.effects import VOCABULARY
from observer_rt.model.parameters import EffectValue, Finite

_SIGNS = {"um": "µm", "us": "µs", "mm3/ms": "mm³/ms", "m3/(s Pa)": "m³/(s Pa)", "-": ""}
"""How people write the units that are written otherwise in files."""
UNITS = {"MPa": MEGAPASCAL, "mm³/ms": MM3_PER_MS, "mg": MILLIGRAM, "µm": MICROMETRE}
"""SI values of the units of signals, as people write them."""
_DIGITS = 8  # of printed values: far below any interval, free of conversion noise


class Size(EffectValue):
    """A fitted parameter with its 95 % interval, in its printed unit: as files have it."""

    ci95: tuple[Finite, Finite]

    @property
    def digits(self) -> tuple[str, str, str]:
        """The value and the ends of its interval, digits as the interval deserves."""
        step = significant(max(self.ci95[1] - self.value, self.value - self.ci95[0]))
        return shown(self.value, step), shown(self.ci95[0], step), shown(self.ci95[1], step)

    @property
    def value_text(self) -> str:
        """Such as `0.301`, with the unit."""
        return f"{self.digits[0]} {sign(self.unit)}".rstrip()

    @property
    def interval_text(self) -> str:
        """Such as `0.295 to 0.307`, with the unit."""
        return f"{self.digits[1]} to {self.digits[2]} {sign(self.unit)}".rstrip()


def sign(unit: str) -> str:
    """A unit as people write it."""
    return _SIGNS.get(unit, unit)


def printed(effect_id: str, parameters: Sequence[FittedParameter]) -> dict[str, Size]:
    """The fitted parameters of an effect, printed, by name."""
    sizes = {}
    for one in parameters:
        known = definition(effect_id, one.name)
        value, low, high = (float(f"{si / known.si:.{_DIGITS}g}") for si in (one.value, *one.ci95))
        sizes[one.name] = Size(value=value, ci95=(low, high), unit=known.unit)
    return sizes


def definition(effect_id: str, name: str) -> EffectParameter:
    """The vocabulary's definition of an effect's parameter."""
    return next(p for p in VOCABULARY[effect_id].parameters if p.name == name)


def significant(uncertainty: float) -> float:
    """The unit of the second digit of an uncertainty: what a value is rounded to."""
    return 10.0 ** (int(f"{uncertainty:.0e}".split("e")[1]) - 1) if uncertainty > 0.0 else 0.0


def shown(value: float, step: float) -> str:
    """A value rounded to a step of 10^n; as short as it may be."""
    if not step > 0.0:
        return f"{value:.6g}"
    decimals = -int(f"{step:.0e}".split("e")[1])
    if -3 <= decimals <= 6:
        return f"{round(value, decimals):.{max(decimals, 0)}f}"
    digits = 1 + max(0, int(f"{abs(value) or step:.0e}".split("e")[1]) + decimals)
    return f"{value:.{digits}g}"
