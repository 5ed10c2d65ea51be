"""Wear that moves has no single size: the latest recordings that agree are asked, and what moved is said."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from observer_rt.config.bench import load_bench
from observer_rt.desk.fleet.groups import Group, groups_of, kinds_of
from tests.desk.fleet.rows import rows


def asked(*tables: pa.Table) -> Group:
    table = pa.concat_tables(tables)
    files = {name: Path(f"{name}.csv") for name in table["sha256"].to_pylist()}
    (group,) = groups_of(table, files, kinds_of(load_bench(), "named_by_rows"))
    return group


def test_wear_that_creeps_is_asked_where_it_stands_still() -> None:
    sizes = np.linspace(0.0, 0.28, 8)
    group = asked(*(rows(f"{day}", "one", [size], day=day) for day, size in enumerate(sizes)))
    assert [sha256 for _, sha256 in group.files] == ["7", "6"]
    assert group.moved == "nozzle flow has moved from +0.0% to +28.0% over 8 recordings: see trend"


def test_a_step_is_asked_from_there_on() -> None:
    sizes = [0.0] * 5 + [-0.2] * 3
    group = asked(*(rows(f"{day}", "one", [0.0, size], day=day) for day, size in enumerate(sizes)))
    assert [sha256 for _, sha256 in group.files] == ["7", "6", "5"]
    assert "to -20.0%" in group.moved


def test_the_seat_counts_as_the_nozzle_does() -> None:
    worn = {"seat_v_S": 0.3, "seat_v_S_ci95_low": 0.28, "seat_v_S_ci95_high": 0.32}
    group = asked(rows("aa", "one", [0.1]), rows("bb", "one", [0.1], day=1, **worn))
    assert [sha256 for _, sha256 in group.files] == ["bb"]
    assert group.moved.startswith("seat flow has moved from +0.0% to +30.0%")


@pytest.mark.parametrize("spread", [0.0, 0.03])
def test_scatter_within_its_intervals_is_no_move(spread: float) -> None:
    sizes = 0.1 + spread * np.array([0.5, -0.5, 0.4, 0.0])
    group = asked(*(rows(f"{day}", "one", [size], day=day) for day, size in enumerate(sizes)))
    assert len(group.files) == 4
    assert group.moved == ""


def test_what_was_never_valid_says_nothing() -> None:
    group = asked(
        rows("aa", "one", [0.1]),
        rows("bb", "one", [0.5], day=1, valid=False),
        rows("cc", "one", [0.1], day=2),
    )
    assert len(group.files) == 3
    assert group.moved == ""
