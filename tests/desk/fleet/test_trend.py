"""Wear over time: what all recordings of an injector say together, the most worn first."""

import pyarrow as pa
import pytest

from observer_rt.desk.fleet.recordings import PathPattern, TimeFrom
from observer_rt.desk.fleet.trend import trends
from observer_rt.foundation.errors import UserError
from tests.desk.fleet.rows import rows


@pytest.fixture
def table() -> pa.Table:
    return pa.concat_tables(
        [
            rows("aa", "healthy", [0.5, 0.01], day=0),
            rows("bb", "healthy", [0.005], day=1),
            rows("cc", "worn", [0.2], day=0),
            rows("dd", "worn", [0.25], day=2),
            rows("ee", "doubtful", [0.9], valid=False),
        ]
    )


def test_the_most_worn_comes_first_by_the_last_valid_estimate_of_each_recording(table: pa.Table) -> None:
    worn, healthy, doubtful = trends(table)
    assert [worn.injector, healthy.injector, doubtful.injector] == ["worn", "healthy", "doubtful"]
    assert healthy.courses["nozzle"].value.tolist() == [0.01, 0.005]
    assert (healthy.recordings, healthy.injections) == (2, 3)
    assert doubtful.times == ()
    assert worn.courses["nozzle"].now == pytest.approx((0.25, 0.0196))
    assert worn.courses["nozzle"].rate is None


def test_recordings_at_one_time_are_refused() -> None:
    """As files seem to be that were copied together."""
    both = pa.concat_tables([rows("aa", "worn", [0.2, 0.2]), rows("bb", "worn", [0.3, 0.3])])
    with pytest.raises(UserError, match=r"trend of worn: has recordings at the same time(?s:.*)--time-from"):
        trends(both)


def when_written(*files: str) -> pa.Table:
    made = [
        rows(f"{k}", "worn", [0.1, 0.2], file=file, time_from=TimeFrom.WRITTEN)
        for k, file in enumerate(files)
    ]
    return pa.concat_tables(made)


def test_times_that_only_the_file_system_says_are_asked_for() -> None:
    table = when_written("a_20260301_1200.csv", "b_20260401_1200.csv")
    with pytest.raises(
        UserError, match=r"2 recordings, such as a_2026(?s:.*)--time-from PATTERN.*--trust-file-"
    ):
        trends(table)
    (dated,) = trends(table, dates=PathPattern.read("--time-from", r"_(\d{8}_\d{4})"))
    assert [f"{each:%m-%d %H:%M:%S}" for each in dated.times] == ["03-01 12:00:01", "04-01 12:00:01"]


def test_they_are_taken_if_one_says_so() -> None:
    (trusted,) = trends(when_written("a.csv"), trusts_file_times=True)
    assert len(trusted.times) == 1
    (stated,) = trends(rows("aa", "worn", [0.1], time_from=TimeFrom.HEADER))
    assert len(stated.times) == 1
