"""What the tests of the core share: a bench file of one message, and undisturbed traffic for it."""

from pathlib import Path

import pytest

from observer_rt.recording.replay.framing import TimedFrame
from tests.benches import sample_bench
from tests.device import Device, simulated


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_bench(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="module")
def frames(bench: Path) -> list[TimedFrame]:
    return Device(bench).send(simulated())
