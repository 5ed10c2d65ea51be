"""What a worker makes of one file, which it reads once."""

import gc
import threading
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest
from distributed import Client
from rich.console import Console

from observer_rt.config.bench import load_bench
from observer_rt.desk.fleet.batch import Dataset, evaluate_all, read_injections
from observer_rt.desk.fleet.job import FailedFile, Task, evaluate_file
from observer_rt.engine.service.core import Core
from observer_rt.engine.signal_survey import refuse_implausible
from observer_rt.files.formats import open_recording, write_recording
from observer_rt.files.signals.recording import Recording
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import masses
from tests.device import worn_recording


def worn() -> Recording:
    return worn_recording(24, 0.2)


def result_of(path: Path) -> pa.Table | FailedFile:
    return evaluate_file(Task(load_bench().exact, path.parent, learning=False), Path(path.name), "hash")


def test_rows_are_those_of_evaluate(tmp_path: Path) -> None:
    """A recording, a copy of it and a file that is not there, given to a worker in this process."""
    path, copy, missing = paths = [tmp_path / f"{name}.parquet" for name in ("worn", "copy", "missing")]
    write_recording(path, worn())
    copy.write_bytes(path.read_bytes())
    dataset, task = Dataset(tmp_path, {}), Task(load_bench().exact, tmp_path, learning=False)
    with Client(processes=False, n_workers=1, threads_per_worker=1, dashboard_address=None) as client:
        counts = evaluate_all(client, threading.Event(), task, paths, dataset, Console())
    assert (counts.done, counts.skipped, [failed.file for failed in counts.failed]) == (1, 1, [missing])
    table = read_injections(tmp_path)
    assert table.num_rows == 24
    assert table["mass_mg"].to_pylist() == pytest.approx(masses(path, learning=False), rel=1e-12)


def test_what_is_no_injector_has_no_rows(tmp_path: Path) -> None:
    """As it is refused where a file is looked through before."""
    path = tmp_path / "bar.parquet"
    write_recording(path, replace(worn(), rail_pressure=0.1 * worn().rail_pressure))
    source = open_recording(path)
    with pytest.raises(UserError) as refused:
        refuse_implausible(path, source.survey)
    failed = result_of(path)
    assert isinstance(failed, FailedFile)
    assert failed.problem == str(refused.value)


def test_nothing_is_left_of_a_file(tmp_path: Path) -> None:
    """Thousands of them follow each other, and some 10 MB of each would add up until somebody looks for garbage."""
    path = tmp_path / "worn.parquet"
    write_recording(path, worn())
    gc.collect()
    gc.disable()
    before = _cores()  # that other tests keep
    try:
        result_of(path)
        assert _cores() == before
    finally:
        gc.enable()


def _cores() -> set[int]:
    """All that are there; not by isinstance: some are weak proxies."""
    return {id(each) for each in gc.get_objects() if type(each) is Core}
