"""`tools/bench batch`: files unlike each other, and a batch of them measured."""

from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.foundation.errors import RunError
from observer_rt.foundation.files import file_hash
from tools.benchmarks.batch import INJECTIONS, run, write_files


def test_a_batch_is_measured_and_its_injections_counted(tmp_path: Path) -> None:
    files = write_files(tmp_path, 2, 1)
    assert len({file_hash(path) for path in files.iterdir()}) == 2
    row = run("few", files, 2, 2 * INJECTIONS, EXAMPLE_BENCH, "--no-learning", "--workers", "1")
    assert row["clock"] > 0.0
    assert row["processor"] > 0.0
    assert row["peak_mib"] > 50.0
    with pytest.raises(RunError):
        run("few", files, 2, 2 * INJECTIONS + 5, EXAMPLE_BENCH, "--no-learning", "--workers", "1")
