"""What the tests of the core share: a bench file of one message, and undisturbed traffic for it."""

from pathlib import Path

import pytest

from tests.service.core_frames import ONE_MESSAGE, Device, Frame, bench_text, recording


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("core") / "bench.toml"
    path.write_text(bench_text(ONE_MESSAGE))
    return path


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return Device(ONE_MESSAGE).send(recording())
