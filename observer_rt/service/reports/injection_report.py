"""What the service says of one injection, in SI units."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from observer_rt.estimation.scalars import NOZZLE, SCALARS
from observer_rt.foundation.units import MICROSECOND
from observer_rt.observer.learning.indicators import Estimate, Indicators, indicators_of
from observer_rt.observer.learning.interval import is_revised, rate_sigma, volume_interval
from observer_rt.observer.stream.state import Reason, State
from observer_rt.observer.stream.validity import InjectionFacts, contested, reason_of_injection
from observer_rt.service.reports.judging import EventRecord


@dataclass(frozen=True)
class CommandedOpening:
    """The command an opening belongs to: its number, and what it says of the injector.

    opening_delay [s]: from the start of energizing to the first sample with the needle open, nan when one of the
    two is not known; energizing_time [s], nan while not known.
    """

    command: int
    opening_delay: float
    energizing_time: float

    def as_text(self) -> str:
        """Command and opening delay in a few words."""
        if math.isnan(self.opening_delay):
            return f"command {self.command}"
        return f"command {self.command}, opened after {self.opening_delay / MICROSECOND:.0f} us"


@dataclass(frozen=True, eq=False)
class InjectionReport:
    """One injection, judged with its event.

    start, end are positions in the stream of samples, the indices those of the device. `volume` [m3], `mass`
    [kg] and `peak_rate` [m3/s] are nan when some sample had no rate; `mass_ci95` [kg] is
    known once its event was learned from, as is `rate_sigma` (n,) [m3/s], the standard deviation of the published
    rate at the n samples from start to end; `rail_pressure` [Pa] at the opening; `density` [kg/m3] and
    `fuel_temperature` [K] of the fuel, the latter None where it is not measured; `commanded` is None where it is not
    known. reason: the most severe, further: others.
    """

    number: int
    event: int
    start: int
    end: int
    start_index: int
    end_index: int
    volume: float
    mass: float
    mass_ci95: tuple[float, float] | None
    rate_sigma: NDArray[np.float64] | None
    peak_rate: float
    rail_pressure: float
    valid: bool
    reason: Reason
    state: State
    phi_version: int
    indicators: Indicators
    density: float
    fuel_temperature: float | None
    commanded: CommandedOpening | None
    further: tuple[Reason, ...] = ()

    @property
    def reasons(self) -> tuple[Reason, ...]:
        """All reasons why it is not valid, the most severe first."""
        return () if self.valid else (self.reason, *self.further)


def report_of(
    injection: np.void, judged: EventRecord, commanded: CommandedOpening | None, is_contested: bool = False
) -> InjectionReport:
    """What to say of an injection (row of dtype `stream.state.INJECTION`).

    commanded: by which command it opened; is_contested: another node sends the same results.
    """
    event, outcome = judged.event, judged.outcome
    c = judged.fuel.constants.coefficients
    middle = injection["middle_x"], injection["middle_u"]
    estimate = (judged.in_force, None) if outcome is None else (outcome.estimate, outcome.covariance)
    scalars = SCALARS if outcome is None else outcome.knowledge.scalars
    indicators = indicators_of(*estimate, *middle, scalars)
    wear = judged.phi.nozzle_wear(*middle, c)
    if wear is not None:
        indicators = {**indicators, NOZZLE: Estimate(wear)}
    volume = float(injection["volume"])
    interval, sigma, revised = None, None, False
    belongs = injection["event"] == event["number"]
    if belongs and outcome is not None and outcome.resimulated is not None:
        first = int(event["window_start"])
        window = slice(int(injection["start"]) - first, int(injection["end"]) - first + 1)
        interval = volume_interval(outcome.resimulated, window)
        sigma = rate_sigma(outcome.resimulated, window)
        revised = is_revised(outcome.resimulated, window, volume)
    passed = not judged.objections
    reason = reason_of_injection(
        InjectionFacts(
            of_samples=Reason(int(injection["reason"])),
            of_event=Reason.NONE if passed else judged.objections[0].reason,
            of_inputs=Reason(int(event["doubtful"])),
            was_outlier=passed and outcome is not None and outcome.outliers > 0,
            is_revised=revised,
        )
    )
    state = State(int(injection["state"]))
    reasons: tuple[Reason, ...] = (reason,)
    if is_contested:
        state, reasons = contested(state, reason)
    return InjectionReport(
        number=int(injection["number"]),
        event=int(injection["event"]),
        start=int(injection["start"]),
        end=int(injection["end"]),
        start_index=int(injection["start_index"]),
        end_index=int(injection["end_index"]),
        volume=volume,
        mass=volume * c.density,
        peak_rate=float(injection["peak_rate"]),
        rail_pressure=float(injection["rail_pressure"]) * c.pressure_scale + c.chamber_pressure,
        mass_ci95=None if interval is None else (interval[0] * c.density, interval[1] * c.density),
        rate_sigma=sigma,
        valid=reasons[0] is Reason.NONE,
        reason=reasons[0],
        state=state,
        phi_version=int(injection["phi_version"]),
        indicators=indicators,
        density=c.density,
        fuel_temperature=judged.fuel.temperature,
        commanded=commanded,
        further=reasons[1:],
    )
