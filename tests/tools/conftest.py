"""The benchmarks' own tests are for `tools/test --all`, and for who changes a benchmark."""

from pathlib import Path

import pytest

from tools.benchmarks.speed.traffic import Traffic, make_traffic

HERE = Path(__file__).parent


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.is_relative_to(HERE) and item.path.name.startswith("test_bench_"):
            item.add_marker(pytest.mark.slow)


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("speed")


@pytest.fixture(scope="session")
def traffic(folder: Path) -> Traffic:
    """A loop of frames that is sent to a daemon, or its peers, again and again."""
    return make_traffic(folder)
