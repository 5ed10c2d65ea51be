"""The effective model of an injector: parameters with the effects in force, and the coefficients of (25) by them."""

import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from observer_rt.core.model.model import InputTerms, Nozzle, Sac, Seat, Sensor
from observer_rt.foundation.units import MILLIMETRE, Floats
from observer_rt.model.fuel import USUAL_PRESSURE
from observer_rt.model.hydraulics import Valve, jet_velocity, nozzle_of, sac_of, seat_of, valve_of
from observer_rt.model.line import LumpLine
from observer_rt.model.parameters import NO_DEPARTURES, WAVE_LINES, Departures, InjectorParameters
from observer_rt.model.terms.term import Term
from observer_rt.model.terms.variable import Variable
from observer_rt.model.wave_line import WaveLine

LAG_UNIT = 1e-4  # s, in which theta counts lags and delays, so that all parameters are of order one
LIFT_UNIT = 1e-5  # m, in which theta counts a bounce
NO_PROGRAM = np.empty((0, 2))  # of a model without terms
LINES: dict[str, Any] = {"lump": LumpLine, **dict.fromkeys(WAVE_LINES, WaveLine)}
"""Models of the line by their names, `LINE_MODELS` of the injector file."""


class Coefficients(NamedTuple):
    """Coefficients of the compiled right-hand side; rates in 1/s for states normalised by (24)."""

    line: Any  # of a class of `LINES`
    seat: Seat
    nozzle: Nozzle
    sac: Sac
    valve: Valve
    pressure_scale: float  # p_0, Pa
    flow_scale: float  # Q_0, m3/s
    area_scale: float  # A_0, m2
    chamber_pressure: float  # p_C, Pa
    density: float  # rho_C, kg/m3, at which volume is counted: it turns injected volume into mass
    compression: float  # p_0/K_L, of the nominal line

    @property
    def states(self) -> int:
        """Number of states: p_L, Q_L, p_S and the line's further ones."""
        return 3 + int(self.line.further)


def coefficients(parameters: InjectorParameters, departures: Departures = NO_DEPARTURES) -> Coefficients:
    """Coefficients of (25) and scalings of (24); without effects in force, see `effects.effective_model`."""
    nozzle = nozzle_of(parameters, departures)
    seat_flow = parameters.seat.flow_coefficient * parameters.scaling.area * jet_velocity(parameters)
    return Coefficients(
        line=LINES[parameters.line.model].of(parameters, departures, nozzle.flow, seat_flow),
        seat=seat_of(parameters, departures),
        nozzle=nozzle,
        sac=sac_of(parameters, nozzle.flow, seat_flow),
        valve=valve_of(parameters),
        pressure_scale=parameters.scaling.pressure,
        flow_scale=parameters.scaling.flow,
        area_scale=parameters.scaling.area,
        chamber_pressure=parameters.chamber.pressure,
        density=parameters.fluid.density_nozzle,
        compression=parameters.scaling.pressure / parameters.fluid.in_line.stiffness(USUAL_PRESSURE),
    )


def averaged(c: Coefficients) -> Coefficients:
    """Coefficients for samples that are means over the sample period before them."""
    return c._replace(line=c.line.with_mean())


class SensorTerms(NamedTuple):
    """The line-pressure sensor: a first-order lag, its signal recorded late by `delay`, an offset added."""

    lag: float = 0.0  # s
    offset: float = 0.0  # Pa
    delay: float = 0.0  # s, < 0: early


TRUE_INPUTS = InputTerms(1.0, 0.0, 1.0, 0.0, lift_lag=0.0, rail_delay=0.0)
TRUE_SENSOR = SensorTerms()


@dataclass(frozen=True)
class EffectiveModel:
    """An injector and its sensors as they are taken to be. Immutable; effects make changed copies."""

    injector: InjectorParameters  # its parameters, changed by the effects that change a parameter
    departures: Departures = NO_DEPARTURES  # effects for which the nominal injector has no parameter
    inputs: InputTerms = TRUE_INPUTS
    sensor: SensorTerms = TRUE_SENSOR
    terms: tuple[Term, ...] = ()  # corrections of its equations by laws

    @cached_property
    def coefficients(self) -> Coefficients:
        """Coefficients of the compiled right-hand side."""
        return coefficients(self.injector, self.departures)

    @cached_property
    def program(self) -> Floats:
        """Program of the terms (n, 2) for compiled code, empty without any."""
        if not self.terms:
            return NO_PROGRAM
        from observer_rt.model.terms.term import program_of  # optional: [[terms]]

        return program_of(self.terms, {Variable.MAX_LIFT: self.injector.seat.max_lift / MILLIMETRE})

    def with_term(self, term: Term) -> "EffectiveModel":
        """The model with a term more."""
        return replace(self, terms=(*self.terms, term))

    def part(self, name: str) -> Any:
        """Its `departures`, `inputs` or `sensor`, or a section of the injector file."""
        return getattr(self if hasattr(self, name) else self.injector, name)

    def with_changes(self, part: str, **changes: float) -> "EffectiveModel":
        """The model with other values in a part of it, which are not validated."""
        if hasattr(self, part):
            return replace(self, **{part: self.part(part)._replace(**changes)})
        section = self.part(part).model_copy(update=changes)
        return replace(self, injector=self.injector.model_copy(update={part: section}))


def sensor_of(terms: SensorTerms, pressure_scale: float, interval: float) -> Sensor:
    """A sensor at a sample interval [s]; pressure_scale p_0 [Pa]."""
    delay = terms.delay / interval
    late = math.floor(delay)
    return Sensor(terms.lag, terms.offset / pressure_scale, late, delay - late)


class Clock(NamedTuple):
    """Time [s] and number of openings of the needle up to a sample, for laws that go by them."""

    time: float = 0.0
    injections: float = 0.0


NO_CLOCK = Clock()
