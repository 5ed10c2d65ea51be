"""A daemon as one writes it in Python: python-can, cantools once a frame, numpy over the block, no log.

Numpy for what does not recur, plain floats for what does: numpy takes longer for three numbers than Python does for
each of them. Less is asked of it than of ours: nothing learned or judged, no CRC, no lost or late frames.

usage: python -m tools.benchmarks.speed.python_peer CHANNEL DATABASE INPUT_ID RATE_ID AHEAD pair|quasi_static
"""

import math
import signal
import sys
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Sequence
from typing import Protocol

import can
import cantools
import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MM3_PER_MS
from observer_rt.model.effective import Coefficients, coefficients
from observer_rt.model.parameters import InjectorParameters
from observer_rt.model.stability import substeps_needed

DEAD_BAND = 2.5e-6  # m
EMPTY = 1e-7  # of p_0
GAIN = (0.05, 0.02)  # of p_L and Q_L, about the steady Kalman gain at 100 kHz
_Array = NDArray[np.float64]
_State = tuple[float, float, float]
SAMPLES, RATES = 9, 28
STAGES = ("receive", "decode", "compute", "encode", "send")
SAMPLE_RATE = 100e3  # Hz


class Estimator(Protocol):
    """Turns blocks of samples that follow one another into injection rates."""

    @abstractmethod
    def rates(self, rail: _Array, lift: _Array, line: _Array) -> Sequence[float]:
        """Injection rates [m3/s] of (n,) samples of rail pressure [Pa], needle lift [m], line pressure [Pa]."""


class QuasiStaticNozzle(Estimator):
    """No observer: what the seat lets in at the measured line pressure goes out at once."""

    def __init__(self, injector: InjectorParameters) -> None:
        self._area = _SeatArea(injector)
        self._c = coefficients(injector)
        self._inlet = self._c.sac.a5 / self._c.sac.a6

    def rates(self, rail: _Array, lift: _Array, line: _Array) -> Sequence[float]:
        """See `Estimator`."""
        inlet = (self._inlet * self._area.of(lift)) ** 2
        difference = (line - self._c.chamber_pressure) / self._c.pressure_scale
        # the share of the pressure difference that is left to the orifices
        root = np.sqrt(np.maximum(inlet / (inlet + 1.0) * difference, 0.0))
        return (self._c.nozzle.flow * root).tolist()  # type: ignore[no-any-return]


class Pair(Estimator):
    """x~ corrected by the measured line pressure and, while the needle is open, x^ beside it; nothing learned."""

    def __init__(self, injector: InjectorParameters, sample_rate: float) -> None:
        self._area = _SeatArea(injector)
        self._c = coefficients(injector)
        self._substeps = substeps_needed(injector, sample_rate)
        self._interval = 1.0 / sample_rate
        self._tilde: _State | None = None
        self._hat: _State = (0.0, 0.0, 0.0)
        self._before = (0.0, 0.0)

    def rates(self, rail: _Array, lift: _Array, line: _Array) -> Sequence[float]:
        """See `Estimator`."""
        c = self._c
        areas = self._area.of(lift).tolist()
        rails = ((rail - c.chamber_pressure) / c.pressure_scale).tolist()
        outputs = ((line - c.chamber_pressure) / c.pressure_scale).tolist()
        return [self._sample(*each) for each in zip(rails, areas, outputs, strict=True)]

    def _sample(self, rail: float, area: float, output: float) -> float:
        if self._tilde is None:
            self._tilde, self._before = (output, 0.0, 0.0), (rail, area)
        tilde = self._advance(self._tilde, rail, area)
        innovation = output - tilde[0]
        self._tilde = (tilde[0] + GAIN[0] * innovation, tilde[1] + GAIN[1] * innovation, tilde[2])
        is_at_rest = area == 0.0 and self._before[1] == 0.0 and abs(tilde[2]) < EMPTY
        if is_at_rest:
            self._tilde = (*self._tilde[:2], 0.0)
            self._hat = self._tilde
        else:
            self._hat = self._advance(self._hat, rail, area)
        self._before = (rail, area)
        return self._c.nozzle.flow * _root(self._hat[2], self._c.nozzle.transition)

    def _advance(self, x: _State, rail: float, area: float) -> _State:
        """One sample on, inputs linear in between."""
        c, (rail_before, area_before) = self._c, self._before
        steps = self._substeps if area > 0.0 or area_before > 0.0 or x[2] != 0.0 else 1
        step, half = self._interval / steps, 0.5 * self._interval / steps
        for i in range(steps):
            s, m, e = i / steps, (i + 0.5) / steps, (i + 1) / steps
            mid = rail_before + m * (rail - rail_before), area_before + m * (area - area_before)
            k = _slope(x, rail_before + s * (rail - rail_before), area_before + s * (area - area_before), c)
            l = _slope((x[0] + half * k[0], x[1] + half * k[1], x[2] + half * k[2]), *mid, c)  # noqa: E741
            n = _slope((x[0] + half * l[0], x[1] + half * l[1], x[2] + half * l[2]), *mid, c)
            o = _slope(
                (x[0] + step * n[0], x[1] + step * n[1], x[2] + step * n[2]),
                rail_before + e * (rail - rail_before),
                area_before + e * (area - area_before),
                c,
            )
            sixth = step / 6.0
            x = (
                x[0] + sixth * (k[0] + 2.0 * (l[0] + n[0]) + o[0]),
                x[1] + sixth * (k[1] + 2.0 * (l[1] + n[1]) + o[1]),
                x[2] + sixth * (k[2] + 2.0 * (l[2] + n[2]) + o[2]),
            )
        return x


def _root(difference: float, transition: float) -> float:
    return difference / math.sqrt(math.sqrt(difference * difference + transition * transition))


def _slope(x: _State, rail: float, area: float, c: Coefficients) -> _State:
    """(25) of the nominal model."""
    q_h = _root(x[2], c.nozzle.transition) if x[2] else 0.0
    q_s = area * _root(x[0] - x[2], c.seat.transition) if area else 0.0
    line = c.line
    return (
        line.a1 * x[1] - line.a2_nozzle * q_h,
        line.a3 * (rail - x[0]) - line.a4 * x[1] * abs(x[1]),
        c.sac.a5 * q_s - c.sac.a6 * q_h,
    )


class _SeatArea:
    """Normalised area of lifts [m]."""

    def __init__(self, injector: InjectorParameters) -> None:
        half = math.radians(injector.seat.cone_angle / 2.0)
        self._slope = math.pi * math.sin(half) / injector.scaling.area
        self._diameter, self._narrowing = injector.seat.diameter, 0.5 * math.sin(2.0 * half)

    def of(self, lift: _Array) -> _Array:
        lift = np.where(lift > DEAD_BAND, lift, 0.0)
        return np.asarray(self._slope * lift * (self._diameter - self._narrowing * lift))


class Peer:
    """Frames in, rate frames out; `spent`: seconds by stage."""

    def __init__(self, database: str, input_id: int, rate_id: int, ahead: int, estimator: Estimator) -> None:
        loaded = cantools.database.load_file(database)
        self._input, self._output = (loaded.get_message_by_frame_id(number) for number in (input_id, rate_id))
        self._rails = [f"RailPressure_{n:02d}" for n in range(SAMPLES)]
        self._lifts = [f"NeedleLift_{n:02d}" for n in range(SAMPLES)]
        self._pressures = [f"LinePressure_{n:02d}" for n in range(SAMPLES)]
        self._rates = [f"InjectionRate_{n:02d}" for n in range(RATES)]
        self._estimator = estimator
        self._ahead = ahead
        self._known: deque[float] = deque()
        self._begin = -1  # index of the first known rate
        self._count = 0
        self.spent = [0.0, 0.0, 0.0]
        """Seconds to decode, compute and encode the last frame."""

    def handle(self, payload: bytes) -> list[bytes]:
        """Take a frame, return the payloads of the rate frames it completes."""
        begin = time.perf_counter()
        values = self._input.decode(payload, decode_choices=False)
        assert isinstance(values, dict)
        decoded = time.perf_counter()
        rail = np.array([values[name] for name in self._rails], float) * MEGAPASCAL
        lift = np.array([values[name] for name in self._lifts], float) * MICROMETRE
        line = np.array([values[name] for name in self._pressures], float) * MEGAPASCAL
        rates = [rate / MM3_PER_MS for rate in self._estimator.rates(rail, lift, line)]
        index = int(values["SampleIndex"])
        if self._begin < 0 or index != self._begin + len(self._known):
            self._known.clear()
            self._begin = index
        self._known.extend(rates)
        while self._begin % RATES and self._known:
            self._known.popleft()
            self._begin += 1
        computed = time.perf_counter()
        results = []
        while len(self._known) >= RATES + self._ahead:
            block = {name: self._known.popleft() for name in self._rates}
            header = {"CRC": 0, "Counter": self._count % 256, "Valid": 1, "Learning": 0, "State": 2}
            results.append(self._output.encode({**header, "SampleIndex": self._begin, **block}))
            self._begin += RATES
            self._count += 1
        self.spent = [decoded - begin, computed - decoded, time.perf_counter() - computed]
        return results


def serve(channel: str, database: str, input_id: int, rate_id: int, ahead: int, estimator: Estimator) -> None:
    """Answer until SIGTERM, then print microseconds by stage: medians of frames waited for and answered."""
    peer = Peer(database, input_id, rate_id, ahead, estimator)
    filters: list[can.typechecking.CanFilter] = [{"can_id": input_id, "can_mask": 0x7FF, "extended": False}]
    stopped: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: stopped.append(number))
    spent, done = [], 0.0
    with can.Bus(interface="socketcan", channel=channel, fd=True, can_filters=filters) as bus:
        print("ready", flush=True)
        while not stopped:
            message = bus.recv(0.1)
            if message is None:
                continue
            received = time.time()
            results = peer.handle(bytes(message.data))
            handled = time.time()
            for payload in results:
                fields = {"is_fd": True, "bitrate_switch": True, "is_extended_id": False}
                bus.send(can.Message(arbitration_id=rate_id, data=payload, **fields))
            was_waited_for = message.timestamp > done
            done = time.time()
            if results and was_waited_for:
                spent.append([received - message.timestamp, *peer.spent, done - handled])
    if spent:
        medians = np.median(spent, axis=0) / MICROSECOND
        stages = (f"{name} {time_:.0f}" for name, time_ in zip(STAGES, medians, strict=True))
        print(f"us a frame: {', '.join(stages)}", flush=True)


if __name__ == "__main__":
    nominal = load_injector()
    chosen = Pair(nominal, SAMPLE_RATE) if sys.argv[6] == "pair" else QuasiStaticNozzle(nominal)
    input_number, rate_number, samples_ahead = map(int, sys.argv[3:6])
    serve(sys.argv[1], sys.argv[2], input_number, rate_number, samples_ahead, chosen)
