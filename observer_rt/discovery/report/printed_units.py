"""Fitted parameters in the units people read."""

from dataclasses import dataclass

from observer_rt.discovery.search.result import FittedParameter
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MILLIGRAM, MM3_PER_MS
from observer_rt.model.effect import EffectParameter
from observer_rt.model.effects import VOCABULARY

_SIGNS = {"um": "µm", "us": "µs", "mm3/ms": "mm³/ms", "m3/(s Pa)": "m³/(s Pa)", "-": ""}
"""How people write the units that are written otherwise in files."""
UNITS = {"MPa": MEGAPASCAL, "mm³/ms": MM3_PER_MS, "mg": MILLIGRAM, "µm": MICROMETRE}
"""SI values of the units of signals, as people write them."""
_DIGITS = 8  # of printed values: far below any interval, free of conversion noise


@dataclass(frozen=True)
class Printed:
    """A parameter with its 95 % interval in its printed unit."""

    name: str
    value: float
    ci95: tuple[float, float]
    unit: str

    @property
    def value_text(self) -> str:
        """Such as `v_H = 0.301`, with the unit, digits as the interval deserves."""
        return f"{self.name} = {shown(self.value, self._step)}{self._unit}"

    @property
    def interval_text(self) -> str:
        """Such as `0.295 to 0.307`, with the unit."""
        low, high = (shown(bound, self._step) for bound in self.ci95)
        return f"{low} to {high}{self._unit}"

    @property
    def text(self) -> str:
        """Such as `v_H = 0.301 (95 %: 0.295 to 0.307)`."""
        return f"{self.value_text} (95 %: {self.interval_text})"

    @property
    def _unit(self) -> str:
        return f" {sign(self.unit)}" if sign(self.unit) else ""

    @property
    def _step(self) -> float:
        return significant(max(self.ci95[1] - self.value, self.value - self.ci95[0]))


def sign(unit: str) -> str:
    """A unit as people write it."""
    return _SIGNS.get(unit, unit)


def printed(effect_id: str, parameter: FittedParameter) -> Printed:
    """A fitted parameter of an effect, printed."""
    unit = definition(effect_id, parameter.name)
    low, high = (_rounded(bound / unit.si) for bound in parameter.ci95)
    return Printed(parameter.name, _rounded(parameter.value / unit.si), (low, high), unit.unit)


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


def _rounded(value: float) -> float:
    return float(f"{value:.{_DIGITS}g}")
