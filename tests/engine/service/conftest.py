"""What the tests of the service share: undisturbed traffic."""

from tests.undisturbed import bench, clean, frames

__all__ = ["bench", "clean", "frames"]
