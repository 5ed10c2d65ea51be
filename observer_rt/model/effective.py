"""The effective model: the nominal injector with the effects in force on dynamics, inputs and sensor."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

from observer_rt.model.coefficients import Coefficients, coefficients
from observer_rt.model.parameters import NO_DEPARTURES, Departures, InjectorParameters


class InputTerms(NamedTuple):
    """From measured to true inputs: true = factor * measured + shift (the lift's only while the needle is open).

    lift_lag: time constant of a first-order lift sensor, undone before; rail_delay: by which the rail pressure is
    recorded later than the other two.
    """

    rail_factor: float = 1.0
    rail_shift: float = 0.0  # Pa
    lift_factor: float = 1.0
    lift_shift: float = 0.0  # m
    lift_lag: float = 0.0  # s
    rail_delay: float = 0.0  # s, < 0: early


class SensorTerms(NamedTuple):
    """The line-pressure sensor: a first-order lag, its signal recorded late by `delay`, an offset added."""

    lag: float = 0.0  # s
    offset: float = 0.0  # Pa
    delay: float = 0.0  # s, < 0: early


TRUE_INPUTS = InputTerms()
TRUE_SENSOR = SensorTerms()


@dataclass(frozen=True)
class EffectiveModel:
    """An injector and its sensors as they are taken to be. Immutable; effects make changed copies.

    injector: its parameters, changed by the effects that are changes of a parameter; departures: effects for which
    the nominal injector has no parameter.
    """

    injector: InjectorParameters
    departures: Departures = NO_DEPARTURES
    inputs: InputTerms = TRUE_INPUTS
    sensor: SensorTerms = TRUE_SENSOR

    @cached_property
    def coefficients(self) -> Coefficients:
        """What the compiled right-hand side needs."""
        return coefficients(self.injector, self.departures)

    def with_section(self, section: str, **factors: float) -> "EffectiveModel":
        """The model with parameters of a section of the injector file multiplied by factors."""
        before = getattr(self.injector, section)
        after = before.model_copy(update={k: getattr(before, k) * factor for k, factor in factors.items()})
        return replace(self, injector=self.injector.model_copy(update={section: after}))

    def with_terms(self, terms: str, **changes: float) -> "EffectiveModel":
        """The model with other values in its `departures`, `inputs` or `sensor`."""
        changed = getattr(self, terms)._replace(**changes)
        return replace(self, **{terms: changed})
