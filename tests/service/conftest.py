"""What the tests of the core share: a bench file of one message, undisturbed traffic for it, what comes of that."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.recording.replay.framing import TimedFrame
from tests.benches import sample_bench
from tests.device import Device, Traffic, run, simulated
from tests.interface import OwnInterface


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_bench(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="session")
def frames(bench: Path) -> list[TimedFrame]:
    return Device(bench).send(simulated())


@pytest.fixture(scope="session")
def clean(bench: Path, frames: list[TimedFrame]) -> Traffic:
    return Traffic(bench, frames, run(bench, frames))


FURTHER = ("vcan1", "vcan2", "vcan3")


@pytest.fixture
def interfaces(vcan: str) -> Iterator[list[OwnInterface]]:
    """Further SocketCAN interfaces of this test's own, beside vcan0."""
    made = [OwnInterface(name) for name in FURTHER]
    try:
        yield made
    finally:
        for interface in made:
            with contextlib.suppress(pytest.fail.Exception):  # where the test took it away
                interface.remove()
