"""Fixtures: a bench file of one message, undisturbed traffic for it, what comes of that."""

from pathlib import Path

import pytest

from observer_rt.files.replay.framing import TimedFrame
from tests.benches import sample_bench
from tests.device import Device, Traffic, run, simulated


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sample_bench(tmp_path_factory.mktemp("core"))


@pytest.fixture(scope="session")
def frames(bench: Path) -> list[TimedFrame]:
    return Device(bench).send(simulated())


@pytest.fixture(scope="session")
def clean(bench: Path, frames: list[TimedFrame]) -> Traffic:
    return Traffic(bench, frames, run(bench, frames))
