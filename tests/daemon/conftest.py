"""What the tests of the daemon share: undisturbed traffic, interfaces of their own."""

import contextlib
from collections.abc import Iterator

import pytest

from tests.interface import OwnInterface
from tests.undisturbed import bench, clean, frames

__all__ = ["bench", "clean", "frames"]


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
