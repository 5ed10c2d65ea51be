"""The injector that is demonstrated on: (19)-(23) as printed, solved by scipy, with a needle and a rail of its own.

It shares no code with the model that observes it: sharp orifice laws, hard stops, a rail that dips and ripples.
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.integrate import odeint

from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.units import Floats

DENSITY = 830.0  # kg/m3
STIFFNESS = 1.6e9  # of fuel in line and sac, Pa
LINE_LENGTH, LINE_AREA, LINE_VOLUME, LOSS_FACTOR = 0.15, math.pi / 4 * 2.4e-3**2, 0.9e-6, 8.0  # m, m2, m3, -
SEAT_FLOW, SEAT_DIAMETER, HALF_CONE, HIGHEST_LIFT = 0.75, 2.2e-3, math.radians(30.0), 0.30e-3  # -, m, rad, m
NOZZLE_AREA, SAC_VOLUME = 0.78 * 8 * math.pi / 4 * 0.17e-3**2, 0.075e-6  # with its flow coefficient, m2; m3
CHAMBER_PRESSURE = 5e6  # Pa
REFERENCE_PRESSURE = 100e6  # Pa, of the needle's speeds and of the stiffness

FIRST_EVENT = 0.15  # s before the first energizing: the observer learns noise and offsets
OPENING_DELAY, CLOSING_DELAY = 0.30e-3, 0.25e-3  # s
OPENING_SPEED, CLOSING_SPEED = 0.8, 0.9  # m/s
ACCELERATION_TIME = 30e-6  # s until the needle is at speed
RAIL_DIP, RAIL_RECOVERY = 0.4e6, 8e-3  # Pa per ms of energizing; s
RIPPLE, PUMP_FREQUENCY = 0.1e6, 90.0  # Pa, Hz
PRESSURE_NOISE, LIFT_NOISE, LINE_NOISE = 0.1e6, 0.4e-6, 0.15e6  # one sigma a sample: Pa, m, Pa
PRESSURE_CODE, LIFT_CODE = 5e3, 1e-8  # steps of the bus: Pa, m

_LAMINAR = 1e3  # Pa, below which a flow follows the pressure drop, so that a shut sac comes to rest
_SCALES = np.array([100e6, 60e-6, 100e6])  # of the states p_L, Q_L, p_S: one tolerance fits all
# The longest step [s] is so short that no injection lies between two.
_SOLVER = {"rtol": 1e-8, "atol": 1e-8, "hmax": 10e-6, "mxstep": 100_000}


class Departure(NamedTuple):
    """Deviation of the injector from the equations; by default it has none."""

    nozzle: float = 1.0  # factor of its flow
    loss: Callable[[float], float] = lambda _: 0.0  # of pressure along the line [MPa] by its flow [mm3/ms]
    stiffening: float = 0.0  # n in K = K_0 + n (p - 100 MPa)
    rail_gain: float = 0.0  # of the sensor, less 1
    hidden_lift: float = 0.0  # by which the lift is recorded too low [m]


class BenchOperation(NamedTuple):
    """Injections, one every `period` [s], in turn at these rail pressures [Pa] and energizing times [s]."""

    rail_pressures: Sequence[float]
    energizing_times: Sequence[float]
    injections: int
    period: float

    def rail_pressure(self, time: float) -> float:
        """Pressure in the rail [Pa]: set for the event, changed half way to the next, dipping and rippling."""
        number, since, energizing = self._event(time)
        before, after = self._set_pressure(number), self._set_pressure(number + 1)
        share = min(max(4.0 * since / self.period - 1.5, 0.0), 1.0)
        pressure = before + (after - before) * 0.5 * (1.0 - math.cos(math.pi * share))
        pressure += RIPPLE * math.sin(2.0 * math.pi * PUMP_FREQUENCY * time)
        if number >= 0 and since > 0.0:
            dip = RAIL_DIP * 1e3 * min(since, energizing)
            pressure -= dip * math.exp(-max(since - energizing, 0.0) / RAIL_RECOVERY)
        return pressure

    def lift(self, time: float) -> float:
        """Needle lift [m]."""
        number, since, energizing = self._event(time)
        since -= OPENING_DELAY
        if number < 0 or since <= 0.0:
            return 0.0
        relative = self._set_pressure(number) / REFERENCE_PRESSURE
        speed = OPENING_SPEED * relative**0.4
        falling = since - energizing - CLOSING_DELAY + OPENING_DELAY
        if falling <= 0.0:
            return float(min(speed * _travelled(since), HIGHEST_LIFT))
        highest = min(speed * _travelled(since - falling), HIGHEST_LIFT)
        speed = CLOSING_SPEED * relative**0.3
        return float(max(highest - speed * _travelled(falling), 0.0))

    def _event(self, time: float) -> tuple[int, float, float]:
        """Number of the event, -1 before the first, the time since its energizing, and how long that lasts [s]."""
        number = min(math.floor((time - FIRST_EVENT) / self.period), self.injections - 1)
        energizing = self.energizing_times[number % len(self.energizing_times)]
        return number, time - FIRST_EVENT - number * self.period, energizing

    def _set_pressure(self, number: int) -> float:
        return self.rail_pressures[min(max(number, 0), self.injections - 1) % len(self.rail_pressures)]


class BenchRecording(NamedTuple):
    """A recording as sensors and bus give it, and the true injection rate [m3/s], (n,)."""

    recording: Recording
    injection_rate: Floats

    def mass(self, first: int, last: int) -> float:
        """Mass [kg] that was injected over the samples first..last."""
        return float(np.trapezoid(self.injection_rate[first : last + 1])) / self.recording.sample_rate * DENSITY


def record(operation: BenchOperation, departure: Departure, sample_rate: float, seed: int) -> BenchRecording:
    """Run the injector at a sample rate [Hz]; seed: of the sensors' noise."""
    duration = FIRST_EVENT + operation.injections * operation.period
    time = np.arange(round(duration * sample_rate) + 1) / sample_rate
    rail = np.array([operation.rail_pressure(t) for t in time.tolist()])
    initial = [rail[0], 0.0, CHAMBER_PRESSURE] / _SCALES
    states = odeint(_rates, initial, time, (operation, departure), **_SOLVER) * _SCALES
    lift = np.array([operation.lift(t) for t in time.tolist()])
    rate = np.array([_nozzle_flow(sac, departure) for sac in states[:, 2].tolist()])
    shown_lift = np.where(lift > 0.0, np.maximum(lift - departure.hidden_lift, 0.0), 0.0)
    noise = np.random.default_rng(seed)
    recording = Recording(
        time=time,
        rail_pressure=_coded(rail * (1.0 + departure.rail_gain), PRESSURE_NOISE, PRESSURE_CODE, noise),
        needle_lift=_coded(shown_lift, LIFT_NOISE, LIFT_CODE, noise),
        line_pressure=_coded(states[:, 0], LINE_NOISE, PRESSURE_CODE, noise),
    )
    return BenchRecording(recording, rate)


def _rates(x: Floats, time: float, operation: BenchOperation, departure: Departure) -> tuple[float, float, float]:
    """Rates of p_L, Q_L and p_S [1/s], each over its scale."""
    line, flow, sac = (x * _SCALES).tolist()
    lift = operation.lift(time)
    seat_area = math.pi * lift * math.sin(HALF_CONE) * (SEAT_DIAMETER - 0.5 * lift * math.sin(2.0 * HALF_CONE))
    seat = SEAT_FLOW * seat_area * _velocity(line - sac)  # (21)
    nozzle = _nozzle_flow(sac, departure)
    lost = 1e6 * departure.loss(flow * 1e6)
    stiffness = STIFFNESS + departure.stiffening * (line - REFERENCE_PRESSURE)
    driven = LINE_AREA / (DENSITY * LINE_LENGTH) * (operation.rail_pressure(time) - lost - line)
    slowed = LOSS_FACTOR / (2.0 * LINE_AREA * LINE_LENGTH) * flow * abs(flow)
    return (
        stiffness / LINE_VOLUME * (flow - nozzle) / _SCALES[0],  # (20)
        (driven - slowed) / _SCALES[1],  # (19)
        STIFFNESS / SAC_VOLUME * (seat - nozzle) / _SCALES[2],  # (22)
    )


def _nozzle_flow(sac: float, departure: Departure) -> float:
    return departure.nozzle * NOZZLE_AREA * _velocity(sac - CHAMBER_PRESSURE)


def _velocity(drop: float) -> float:
    """Velocity [m/s] behind an orifice: sgn(drop) sqrt(2 |drop| / rho), in proportion to the drop near 0."""
    return drop * math.sqrt(2.0 / (DENSITY * (abs(drop) + _LAMINAR)))


def _travelled(time: float) -> float:
    """Way of a needle at 1 m/s [m] that has to accelerate first."""
    if time <= ACCELERATION_TIME:
        return 0.5 * time * time / ACCELERATION_TIME if time > 0.0 else 0.0
    return time - 0.5 * ACCELERATION_TIME


def _coded(values: Floats, sigma: float, code: float, noise: np.random.Generator) -> Floats:
    """Values (n,) as a sensor shows them, in codes of the bus."""
    return np.asarray(np.rint((values + noise.normal(0.0, sigma, values.size)) / code) * code)
