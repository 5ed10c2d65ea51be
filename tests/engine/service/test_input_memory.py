"""How long what frames say of optional inputs counts, by the time of the samples: the fuel's temperature."""

import math
from collections.abc import Callable
from pathlib import Path

import pytest

from observer_rt.core.frames.frames import GRACE
from observer_rt.files.replay.framing import Span, TimedFrame
from tests.benches import SAMPLE_RATE
from tests.device import Device, core_of, hand, simulated
from tests.engine.service.test_fuel_temperature import BLOCK, bench, sensor

Fuel = Callable[..., float | None]


def made(folder: Path, timeout: float) -> Fuel:
    """The temperature that counts [degC] at a time [s], after a frame that is sent then; timeout [s]."""
    path = bench(folder, "" if math.isinf(timeout) else f"timeout_ms = {1e3 * timeout}\n")
    core, device = core_of(path), Device(path)

    def at(time: float, *optional_frames: TimedFrame) -> float | None:
        device.index = round(time * SAMPLE_RATE)
        samples = device.send(simulated(), Span(0, BLOCK))
        hand(
            core, [*samples, *(optional_frames or samples)]
        )  # a frame that is repeated brings nothing but a look
        kelvin = float(core.compiled.pipeline.input_memory.memory["measured"][0])
        return None if math.isnan(kelvin) else round(kelvin - 273.15, 1)

    return at


def test_a_value_counts_until_its_time_out(tmp_path: Path) -> None:
    at = made(tmp_path, 0.5)
    assert at(9.0) is None
    assert at(10.0, sensor(30.0)) == at(10.4) == 30.0
    assert at(10.6) is None
    assert at(11.0, sensor(40.0)) == at(11.4) == 40.0


def test_without_a_time_out_it_counts_for_ever(tmp_path: Path) -> None:
    at = made(tmp_path, math.inf)
    assert at(0.0, sensor(30.0)) == at(3600.0) == 30.0


@pytest.mark.parametrize("timeout", [0.5 * GRACE, 5 * GRACE, math.inf])
def test_a_sender_without_a_value_is_borne_for_a_while(tmp_path: Path, timeout: float) -> None:
    at = made(tmp_path, timeout)
    borne = min(timeout, 0.1 + GRACE)
    assert at(0.0, sensor(30.0)) == at(0.1, sensor(None)) == at(borne - 0.01) == 30.0
    assert at(borne + 0.01) is None
    assert at(borne + 1.0, sensor(None)) is None
    assert at(borne + 1.1) is None


def test_a_new_beginning_of_time_takes_nothing_from_it(tmp_path: Path) -> None:
    """The measuring device restarts 0.3 s after the value came: 0.2 s are left."""
    at = made(tmp_path, 0.5)
    assert at(100.0, sensor(30.0)) == at(100.3) == at(0.0) == at(0.19) == 30.0
    assert at(0.21) is None
