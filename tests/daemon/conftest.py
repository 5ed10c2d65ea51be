"""What the tests of the daemon share: a bench of the example's message with frames of it, interfaces of their own."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from observer_rt.files.replay.framing import TimedFrame
from tests.daemon.participants import bench_file
from tests.device import frames_of, worn_recording
from tests.interface import OwnInterface, own_interfaces

FURTHER = ("vcan1", "vcan2", "vcan3")


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return bench_file(tmp_path_factory.mktemp("bench"), "can5")


@pytest.fixture(scope="session")
def frames(bench: Path) -> list[TimedFrame]:
    return frames_of(bench, worn_recording())


@pytest.fixture
def interfaces(vcan: str) -> Iterator[list[OwnInterface]]:
    with own_interfaces(*FURTHER) as made:
        yield made
