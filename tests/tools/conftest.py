"""The benchmarks' own tests are for `tools/test --all`, and for who changes a benchmark."""

from pathlib import Path

import pytest

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark them as slow."""
    for item in items:
        if item.path.is_relative_to(HERE) and item.path.name.startswith("test_bench_"):
            item.add_marker(pytest.mark.slow)
