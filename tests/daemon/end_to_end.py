"""The service as its users meet it: bench file, replay player, daemon and a listener that only knows cantools."""

import signal
import subprocess
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import can
import cantools.database
import numpy as np
from cantools.database.can import Message
from numpy.typing import NDArray

from observer_rt.bus.links.link import Frame
from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR, PACKAGE_DATA, exact_text, load_bench
from observer_rt.engine.service.messages import OutputFrame
from observer_rt.engine.stream.state import samples_ahead

DATABASE = cantools.database.load_file(PACKAGE_DATA / "observer_fd.dbc")
RATE = DATABASE.get_message_by_name("InjectionRate")
SUMMARY = DATABASE.get_message_by_name("InjectionSummary")
STATUS = DATABASE.get_message_by_name("ObserverStatus")
OUTPUTS: list[can.typechecking.CanFilter] = [
    {"can_id": message.frame_id, "can_mask": 0x7FF, "extended": False} for message in (RATE, SUMMARY, STATUS)
]
START_TIMEOUT = 120.0  # s, in which the daemon must be ready, compiling included
END_TIMEOUT = 60.0  # s, in which it must work off what the bus still holds


def write_bench(folder: Path, interface: str, channel: str, rate_hz: float) -> Path:
    text = exact_text(EXAMPLE_BENCH)
    for old, new in (
        ('interface = "socketcan"', f'interface = "{interface}"'),
        ('channel = "can0"', f'channel = "{channel}"'),
        ("rate_hz = 100e3", f"rate_hz = {rate_hz}"),
        ("lockstep = false", "lockstep = true"),
        ('# file = "injector.toml"  #', 'file = "exact.toml"  #'),
    ):
        assert old in text
        text = text.replace(old, new)
    (folder / "exact.toml").write_text(exact_text(NOMINAL_INJECTOR))
    path = folder / "bench.toml"
    path.write_text(text)
    return path


def command(*arguments: str | Path) -> list[str]:
    return [sys.executable, "-m", "observer_rt", *map(str, arguments)]


@dataclass
class ResultFrames:
    rates: list[bytes]
    summaries: list[bytes]
    statuses: list[bytes]

    @property
    def results(self) -> tuple[list[bytes], list[bytes]]:
        return self.rates, self.summaries

    def last_status(self) -> dict[str, float]:
        return decoded(STATUS, self.statuses[-1])


def payloads(frames: Iterable[OutputFrame] | Iterable[Frame], message: Message) -> list[bytes]:
    return [frame.payload for frame in frames if frame.frame_id == message.frame_id]


def results_of(frames: Sequence[OutputFrame]) -> tuple[list[bytes], list[bytes]]:
    return payloads(frames, RATE), payloads(frames, SUMMARY)


def decoded(message: Message, payload: bytes) -> dict[str, float]:
    values = message.decode(payload, decode_choices=False, scaling=True)
    assert isinstance(values, dict)
    return {name: float(value) for name, value in values.items()}


def published_rates(payloads: Sequence[bytes], samples: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Injection rate [mm3/ms] by sample index (nan: not available), and how often each index was published."""
    rate = np.full(samples, np.nan)
    count = np.zeros(samples, np.int64)
    for payload in payloads:
        signals = RATE.decode(payload, decode_choices=False, scaling=False)
        assert isinstance(signals, dict)
        index = int(signals["SampleIndex"])
        for k in range(28):
            raw = int(signals[f"InjectionRate_{k:02d}"])
            if index + k < samples:
                count[index + k] += 1
                if raw < 0xFFFE:
                    rate[index + k] = raw * 0.01 - 100.0
    return rate, count


def output_bus(interface: str, channel: str, filters: can.typechecking.CanFilters = OUTPUTS) -> can.BusABC:
    return can.Bus(interface=interface, channel=channel, fd=True, can_filters=filters)


class Listener:
    """Third participant of the bus: notes every frame of the daemon; payloads: by identifier."""

    def __init__(self, bus: can.BusABC) -> None:
        self.payloads: dict[int, list[bytes]] = defaultdict(list)
        self.results = ResultFrames(*(self.payloads[message.frame_id] for message in (RATE, SUMMARY, STATUS)))
        self._bus = bus
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._listen, name="listener")
        self._thread.start()

    def _listen(self) -> None:
        while not self._stop.is_set():
            message = self._bus.recv(0.1)
            if message is not None:
                self.payloads[message.arbitration_id].append(bytes(message.data))

    def stop(self) -> ResultFrames:
        time.sleep(0.3)
        self._stop.set()
        self._thread.join()
        return self.results


def run_over(
    bench: Path, recording: Path, bus: can.BusABC, speed: float, samples: int, *options: str
) -> ResultFrames:
    listener = Listener(bus)
    daemon = subprocess.Popen(command("run", "--bench", bench, *options), stderr=subprocess.PIPE, text=True)
    try:
        wait_for(lambda: bool(listener.results.statuses), START_TIMEOUT, daemon)
        player = subprocess.run(
            command("replay", recording, "--bench", bench, "--speed", str(speed)),
            capture_output=True,
            text=True,
            check=False,
        )
        assert player.returncode == 0, player.stderr
        ahead = samples_ahead(1.0 / load_bench(bench).injector.sample_rate)
        wait_for(lambda: _processed(listener.results) + ahead >= samples, END_TIMEOUT, daemon)
        daemon.send_signal(signal.SIGTERM)
        _, messages = daemon.communicate(timeout=END_TIMEOUT)
        assert daemon.returncode == 0, messages
    finally:
        daemon.kill()
        results = listener.stop()
    return results


def _processed(results: ResultFrames) -> int:
    """Samples the daemon has been through or knows to be lost; its look-ahead holds the last ones it received."""
    status = results.last_status()
    return int(status["SamplesProcessed"] + status["LostSamples"])


def wait_for(condition: Callable[[], bool], timeout: float, process: subprocess.Popen[str]) -> None:
    end = time.monotonic() + timeout
    while not condition():
        assert process.poll() is None, f"it ended: {process.stderr.read() if process.stderr else ''}"
        assert time.monotonic() < end, "machine too slow: it did not get so far in time"
        time.sleep(0.05)
