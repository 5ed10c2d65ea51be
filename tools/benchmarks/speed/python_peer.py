"""A daemon as one writes it in Python: python-can, cantools once a frame, numpy over the block, no log.

It computes less than ours: no x^ and no x~, only the rate of a nozzle whose sac is always filled, at the measured
line pressure. A daemon with the observer's recursion in Python takes longer still.

usage: python -m tools.benchmarks.speed.python_peer CHANNEL DATABASE INPUT_ID RATE_ID AHEAD
"""

import signal
import sys
import time
from collections import deque

import can
import cantools
import numpy as np
from numpy.typing import NDArray

from observer_rt.config.bench import load_injector
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MM3_PER_MS
from observer_rt.model.parameters import InjectorParameters

SAMPLES, RATES = 9, 28
STAGES = ("receive", "decode", "compute", "encode", "send")
DEAD_BAND = 2.5e-6  # m


class QuasiStaticNozzle:
    """Injection rate of a nozzle that passes on what its seat lets in."""

    def __init__(self, injector: InjectorParameters) -> None:
        seat, nozzle = injector.seat, injector.nozzle
        half = np.deg2rad(seat.cone_angle) / 2.0
        self._circumference, self._narrowing = np.pi * np.sin(half), 0.5 * np.sin(2.0 * half)
        self._seat_diameter, self._seat_coefficient = seat.diameter, seat.flow_coefficient
        area = nozzle.holes * np.pi / 4.0 * nozzle.hole_diameter**2
        self._outlet = nozzle.flow_coefficient * area
        self._density, self._chamber = injector.fluid.density_nozzle, injector.chamber.pressure

    def rate(self, lift: NDArray[np.float64], line_pressure: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of a block of lifts [m] and line pressures [Pa], (n,): m3/s."""
        lift = np.where(lift > DEAD_BAND, lift, 0.0)
        inlet = self._seat_coefficient * self._circumference * lift
        inlet *= self._seat_diameter - self._narrowing * lift
        share = inlet**2 / (
            inlet**2 + self._outlet**2
        )  # of the pressure difference that is left to the orifices
        difference = np.maximum(share * (line_pressure - self._chamber), 0.0)
        return np.asarray(self._outlet * np.sqrt(2.0 * difference / self._density))


class Peer:
    """Frames in, rate frames out; `spent`: seconds by stage."""

    def __init__(self, database: str, input_id: int, rate_id: int, ahead: int) -> None:
        loaded = cantools.database.load_file(database)
        self._input, self._output = (loaded.get_message_by_frame_id(number) for number in (input_id, rate_id))
        self._lifts = [f"NeedleLift_{n:02d}" for n in range(SAMPLES)]
        self._pressures = [f"LinePressure_{n:02d}" for n in range(SAMPLES)]
        self._rates = [f"InjectionRate_{n:02d}" for n in range(RATES)]
        self._nozzle = QuasiStaticNozzle(load_injector())
        self._ahead = ahead
        self._known: deque[float] = deque()
        self._begin = -1  # index of the first known rate
        self._count = 0
        self.spent = dict.fromkeys(STAGES, 0.0)
        self.frames = 0

    def handle(self, payload: bytes) -> list[bytes]:
        """Take a frame, return the payloads of the rate frames it completes."""
        begin = time.perf_counter()
        values = self._input.decode(payload, decode_choices=False)
        assert isinstance(values, dict)
        decoded = time.perf_counter()
        lift = np.array([values[name] for name in self._lifts], float) * MICROMETRE
        pressure = np.array([values[name] for name in self._pressures], float) * MEGAPASCAL
        rates = self._nozzle.rate(lift, pressure) / MM3_PER_MS
        index = int(values["SampleIndex"])  # type: ignore[arg-type]
        if self._begin < 0 or index != self._begin + len(self._known):
            self._known.clear()
            self._begin = index
        self._known.extend(rates.tolist())
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
        self.spent["decode"] += decoded - begin
        self.spent["compute"] += computed - decoded
        self.spent["encode"] += time.perf_counter() - computed
        self.frames += 1
        return results


def serve(channel: str, database: str, input_id: int, rate_id: int, ahead: int) -> None:
    """Answer until SIGTERM, then print microseconds a frame by stage."""
    peer = Peer(database, input_id, rate_id, ahead)
    filters: list[can.typechecking.CanFilter] = [{"can_id": input_id, "can_mask": 0x7FF, "extended": False}]
    stopped: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: stopped.append(number))
    with can.Bus(interface="socketcan", channel=channel, fd=True, can_filters=filters) as bus:
        print("ready", flush=True)
        while not stopped:
            message = bus.recv(0.1)
            if message is None:
                continue
            begin = time.perf_counter()
            results = peer.handle(bytes(message.data))
            handled = time.perf_counter()
            for payload in results:
                bus.send(
                    can.Message(
                        arbitration_id=rate_id,
                        data=payload,
                        is_fd=True,
                        bitrate_switch=True,
                        is_extended_id=False,
                    )
                )
            peer.spent["send"] += time.perf_counter() - handled
            # What the kernel and python-can took until here, by the kernel's stamp; a backlog counts as well.
            peer.spent["receive"] += max(0.0, time.time() - message.timestamp - (time.perf_counter() - begin))
    stages = (f"{name} {peer.spent[name] / max(peer.frames, 1) / MICROSECOND:.0f}" for name in STAGES)
    print(f"us a frame: {', '.join(stages)}", flush=True)


if __name__ == "__main__":
    serve(sys.argv[1], sys.argv[2], *map(int, sys.argv[3:]))
