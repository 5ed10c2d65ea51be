"""A daemon as one writes it in Python: python-can, cantools once a frame, numpy over the block.

Less is asked of it than of ours: the seat's inflow at the measured line pressure, no observer, nothing learned or
judged, no CRC, no lost or late frames.

usage: python -m tools.benchmarks.speed.python_peer CHANNEL DATABASE INPUT_ID RATE_ID AHEAD
"""

import math
import signal
import sys
from collections import deque

import can
import cantools
import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MM3_PER_MS
from observer_rt.model.effective import coefficients
from tests.plants.arrays import Array

DEAD_BAND = 2.5e-6  # m
SAMPLES, RATES = 9, 28


class QuasiStaticNozzle:
    """What the seat lets in at the measured line pressure goes out at once."""

    def __init__(self) -> None:
        injector = load_injector()
        half = math.radians(injector.seat.cone_angle / 2.0)
        self._c = coefficients(injector)
        self._slope = math.pi * math.sin(half) / injector.scaling.area
        self._diameter, self._narrowing = injector.seat.diameter, 0.5 * math.sin(2.0 * half)

    def rates(self, lift: Array, line: Array) -> Array:
        """Injection rates [m3/s] of (n,) samples of needle lift [m] and line pressure [Pa]."""
        lift = np.where(lift > DEAD_BAND, lift, 0.0)
        area = self._slope * lift * (self._diameter - self._narrowing * lift)
        inlet = (self._c.sac.a5 / self._c.sac.a6 * area) ** 2
        difference = (line - self._c.chamber_pressure) / self._c.pressure_scale
        return np.asarray(self._c.nozzle.flow * np.sqrt(np.maximum(inlet / (inlet + 1.0) * difference, 0.0)))


class Peer:
    def __init__(self, database: str, input_id: int, rate_id: int, ahead: int) -> None:
        loaded = cantools.database.load_file(database)
        self._input, self._output = (loaded.get_message_by_frame_id(number) for number in (input_id, rate_id))
        self._nozzle, self._ahead = QuasiStaticNozzle(), ahead
        self._rates: deque[float] = deque()
        self._begin, self._count = -1, 0  # index of the first rate; frames sent

    def handle(self, payload: bytes) -> list[bytes]:
        values = self._input.decode(payload, decode_choices=False)
        assert isinstance(values, dict)
        lift, line = (
            np.array([values[f"{name}_{n:02d}"] for n in range(SAMPLES)], float)
            for name in ("NeedleLift", "LinePressure")
        )
        index = int(values["SampleIndex"])
        if self._begin < 0 or index != self._begin + len(self._rates):
            self._rates.clear()
            self._begin = index
        self._rates.extend((self._nozzle.rates(lift * MICROMETRE, line * MEGAPASCAL) / MM3_PER_MS).tolist())
        while self._begin % RATES and self._rates:
            self._rates.popleft()
            self._begin += 1
        results = []
        while len(self._rates) >= RATES + self._ahead:
            block = {f"InjectionRate_{n:02d}": self._rates.popleft() for n in range(RATES)}
            header = {"CRC": 0, "Counter": self._count % 256, "Valid": 1, "Learning": 0, "State": 2}
            results.append(self._output.encode({**header, "SampleIndex": self._begin, **block}))
            self._begin += RATES
            self._count += 1
        return results


def serve(channel: str, input_id: int, rate_id: int, peer: Peer) -> None:
    stopped: list[int] = []
    signal.signal(signal.SIGTERM, lambda number, _: stopped.append(number))
    filters: list[can.typechecking.CanFilter] = [{"can_id": input_id, "can_mask": 0x7FF, "extended": False}]
    with can.Bus(interface="socketcan", channel=channel, fd=True, can_filters=filters, ignore_config=True) as bus:
        print("ready", flush=True)
        while not stopped:
            message = bus.recv(0.1)
            for payload in peer.handle(bytes(message.data)) if message is not None else ():
                fields = {"is_fd": True, "bitrate_switch": True, "is_extended_id": False}
                bus.send(can.Message(arbitration_id=rate_id, data=payload, **fields))


if __name__ == "__main__":
    own_channel, own_database, *numbers = sys.argv[1:]
    own_input, own_rate, own_ahead = map(int, numbers)
    serve(own_channel, own_input, own_rate, Peer(own_database, own_input, own_rate, own_ahead))
