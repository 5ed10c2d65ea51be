"""A daemon as one writes it in Python: python-can, cantools once a frame, numpy over the block, no log.

Less is asked of it than of ours: nothing learned or judged, no CRC, no lost or late frames.

usage: python -m tools.benchmarks.speed.python_peer CHANNEL DATABASE INPUT_ID RATE_ID AHEAD pair|quasi_static
"""

import signal
import sys
import time
from collections import deque

import can
import cantools
import numpy as np

from observer_rt.config.bench import load_injector
from observer_rt.foundation.units import MEGAPASCAL, MICROMETRE, MICROSECOND, MM3_PER_MS
from tools.benchmarks.speed.python_observer import Estimator, Pair, QuasiStaticNozzle

SAMPLES, RATES = 9, 28
STAGES = ("receive", "decode", "compute", "encode", "send")
SAMPLE_RATE = 100e3  # Hz


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
                bus.send(_answer(rate_id, payload))
            was_waited_for = message.timestamp > done
            done = time.time()
            if results and was_waited_for:
                spent.append([received - message.timestamp, *peer.spent, done - handled])
    if spent:
        medians = np.median(spent, axis=0) / MICROSECOND
        stages = (f"{name} {time_:.0f}" for name, time_ in zip(STAGES, medians, strict=True))
        print(f"us a frame: {', '.join(stages)}", flush=True)


def _answer(frame_id: int, payload: bytes) -> can.Message:
    return can.Message(
        arbitration_id=frame_id, data=payload, is_fd=True, bitrate_switch=True, is_extended_id=False
    )


if __name__ == "__main__":
    nominal = load_injector()
    chosen = Pair(nominal, SAMPLE_RATE) if sys.argv[6] == "pair" else QuasiStaticNozzle(nominal)
    input_number, rate_number, samples_ahead = map(int, sys.argv[3:6])
    serve(sys.argv[1], sys.argv[2], input_number, rate_number, samples_ahead, chosen)
