"""Terms as effects, tried, fitted and reported alike; size: coefficient of their law, a form of `terms.parser`."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

from observer_rt.model.effect import Component, Effect, EffectParameter
from observer_rt.model.effective import EffectiveModel
from observer_rt.model.terms.law import Law
from observer_rt.model.terms.parser import LETTERS, FormNumber, law_of
from observer_rt.model.terms.term import Term, TermEquation

DEAD_ZONE = 0.002  # of the upper bound: a smaller term does not matter

COMPONENTS = {
    TermEquation.LINE_FLOW: Component.LINE_FLOW,
    TermEquation.LINE_PRESSURE: Component.CLOSED_END,
    TermEquation.SEAT_FLOW: Component.SEAT,
    TermEquation.NOZZLE_FLOW: Component.NOZZLE,
    TermEquation.STIFFNESS: Component.CLOSED_END,
    TermEquation.INERTANCE: Component.LINE_FLOW,
    TermEquation.CHAMBER_PRESSURE: Component.CHAMBER,
    TermEquation.LINE_PRESSURE_SENSOR: Component.LINE_SENSOR,
    TermEquation.NEEDLE_LIFT: Component.LIFT_SENSOR,
    TermEquation.RAIL_PRESSURE: Component.RAIL_SENSOR,
}

LAWS_OF_EFFECTS: Mapping[str, tuple[TermEquation, str]] = {
    "orifice_area": (TermEquation.NOZZLE_FLOW, "1"),
    "seat_area": (TermEquation.SEAT_FLOW, "1"),
    "bulk_modulus": (TermEquation.STIFFNESS, "1"),
    "line_friction": (TermEquation.LINE_FLOW, "line_flow/60*abs(line_flow/60)"),
    "guide_leakage": (TermEquation.LINE_PRESSURE, "(line_pressure - chamber_pressure)/100"),
    "line_pressure_sensor_offset": (TermEquation.LINE_PRESSURE_SENSOR, "1"),
    "rail_pressure_sensor_offset": (TermEquation.RAIL_PRESSURE, "1"),
    "rail_pressure_sensor_gain": (TermEquation.RAIL_PRESSURE, "rail_pressure/100"),
    "chamber_pressure_rise": (TermEquation.CHAMBER_PRESSURE, "open"),
}
"""Effects of the vocabulary that are a law of order 1: a term with such a law is reported by the effect's name."""


@dataclass(frozen=True)
class TermLaw:
    """Change of a model by an effect that is a term. law: that of `form` with `numbers` in it, times `c`."""

    equation: TermEquation
    law: Law
    form: str = ""
    numbers: tuple[FormNumber, ...] = ()

    def __call__(self, model: EffectiveModel, values: Sequence[float]) -> EffectiveModel:
        coefficient, *numbers = values
        law = law_of(self.form, tuple(numbers)) if numbers else self.law
        return model.with_term(Term(self.equation, law, coefficient))


@lru_cache(maxsize=4096)
def term_effect(equation: TermEquation, form: str, numbers: tuple[FormNumber, ...] = ()) -> Effect:
    """A term as an effect with one size, the coefficient; numbers: of the form, fixed. The law is of order 1."""
    applied = TermLaw(equation, law_of(form, tuple(one.value for one in numbers)), form, numbers)
    highest = equation.bounds[1]
    lowest = max(equation.bounds[0], -highest)
    size = EffectParameter("c", str(equation.unit), 1.0, 0.0, lowest, highest, DEAD_ZONE * highest, (0.0,))
    return Effect(f"{equation}: {applied.law}", COMPONENTS[equation], (size,), applied, str(applied.law), "")


def form_freed(effect: Effect) -> Effect:
    """A term with its numbers as further parameters of the effect, to be fitted; any other effect unchanged."""
    law = effect.apply
    if not isinstance(law, TermLaw):
        return effect
    further = (
        EffectParameter(letter, "-", 1.0, one.value, one.lowest, one.highest, 0.0, (one.value,))
        for letter, one in zip(LETTERS, law.numbers, strict=False)
    )
    return replace(effect, parameters=(*effect.parameters, *further))


def form_settled(effect: Effect, numbers: Sequence[float]) -> Effect:
    """A term with its numbers fixed at these values, rounded; any other effect unchanged."""
    law = effect.apply
    if not isinstance(law, TermLaw):
        return effect
    settled = (one.settled(value) for one, value in zip(law.numbers, numbers, strict=True))
    return term_effect(law.equation, law.form, tuple(settled))


def term_of(effect: Effect, coefficient: float) -> Term | None:
    """The term behind an effect made by `term_effect`; None for any other effect."""
    law = effect.apply
    return Term(law.equation, law.law, coefficient) if isinstance(law, TermLaw) else None


def is_term(effect: Effect) -> bool:
    """Whether an effect is a term."""
    return isinstance(effect.apply, TermLaw)
