"""A plugin of pytest, for `tools/test`: files with a slow test come first, so that no core waits for one."""

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files stay together, and otherwise in their order."""
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)
