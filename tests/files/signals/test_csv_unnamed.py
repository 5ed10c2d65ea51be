"""CSV files without a line of names, and such that tell the time by the calendar."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.files.formats import open_recording
from observer_rt.foundation.errors import UserError
from tests.files.signals import foreign
from tests.files.signals.foreign import PLACES, RATE, bench, read, signals

reuse_folder = settings(
    suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None, max_examples=40
)
START = datetime(2026, 3, 1, 23, 59, 59, 999_900, UTC)  # midnight is among the samples
ISO = ""  # no `format`
FORMATS = {
    ISO: "%Y-%m-%dT%H:%M:%S.%fZ",
    'format = "%d.%m.%Y %H:%M:%S,%f"': "%d.%m.%Y %H:%M:%S,%f",
    'format = "%Y/%m/%d %H:%M:%S.%f"': "%Y/%m/%d %H:%M:%S.%f",
}


def rows(separator: str, decimal: str, form: str | None = None, samples: int = 40) -> list[str]:
    """Time [ms], or a stamp, and the three signals."""
    columns = signals(samples)
    lines = []
    for k in range(samples):
        at = START + timedelta(microseconds=10 * k)
        number = f"{columns['t'][k] * 1e3:.6g}".replace(".", decimal)
        numbers = (f"{columns[name][k]:.6g}".replace(".", decimal) for name in ("p_Rail", "lift", "p_Line"))
        lines.append(separator.join((number if form is None else at.strftime(FORMATS[form]), *numbers)))
    return lines


def write(folder: Path, lines: list[str]) -> Path:
    return foreign.write(folder, "\n".join(lines) + "\n")


@given(
    separator=st.sampled_from([";", "\t", "|", ",", " "]),
    decimal=st.sampled_from([".", ","]),
    preamble=st.lists(st.sampled_from(["", "# a tool", "Bench 7", "1;2", "t;p;lift;p"]), max_size=4),
    form=st.sampled_from([None, *FORMATS]),
    further=st.booleans(),
)
@reuse_folder
def test_columns_by_their_places(
    tmp_path: Path, separator: str, decimal: str, preamble: list[str], form: str | None, further: bool
) -> None:
    if separator in (",", " "):
        decimal = "."
        form = None if separator == " " or (form or "").endswith(',%f"') else form
    body = rows(separator, decimal, form)
    if further:
        body = [f"{line}{separator}on" for line in body]
    time = 'unit = "ms"' if form is None else form
    recording = read(write(tmp_path, [*preamble, *body]), bench(tmp_path, text=PLACES, time=time))
    columns = signals(40)
    assert (recording.samples, recording.sample_rate) == (40, RATE)
    np.testing.assert_allclose(recording.rail_pressure, columns["p_Rail"] * 1e5, rtol=1e-12)
    np.testing.assert_allclose(recording.needle_lift, columns["lift"] * 1e-6, rtol=1e-12)
    np.testing.assert_allclose(recording.line_pressure, columns["p_Line"] * 1e6, rtol=1e-12)


def test_the_calendar_is_told_and_loses_no_digit(tmp_path: Path) -> None:
    path = write(tmp_path, ["t;p_Rail;lift;p_Line", *rows(";", ".", ISO)])
    stream = open_recording(path, bench(tmp_path, time="").injector)
    assert "calendar stamps as ISO 8601, counted from 2026-03-01T23:59:59.999900000" in stream.details[0]
    assert stream.notes == ()  # seconds since 1970 would lie 0.02 samples off the grid
    assert stream.collected().time[-1] == pytest.approx(39 / RATE, abs=1e-12)


def test_a_gap_in_the_calendar_splits(tmp_path: Path) -> None:
    body = rows(";", ".", ISO, 100)
    path = write(tmp_path, ["t;p_Rail;lift;p_Line", *body[:40], *body[70:]])
    stream = open_recording(path, bench(tmp_path, time="").injector)
    assert [stretch.samples for stretch in stream.stretches] == [40, 30]


@pytest.mark.parametrize(
    ("time", "cell", "said"),
    [
        ("", "yesterday", "line 13: column t (time): 'yesterday' is no stamp of the calendar"),
        ("", "n/a", "line 13: the time is not a finite number"),
        ('format = "%Q"', None, "'Q' is a bad directive"),
        ('format = "%H:%M"', None, "is no stamp of the calendar as %H:%M"),
        ('unit = "ms"', None, "is not a number with decimal '.'"),
        ('format = "%H"\nunit = "ms"', None, "stamps of a calendar have no 'unit'"),
    ],
)
def test_what_is_no_calendar_is_named(tmp_path: Path, time: str, cell: str | None, said: str) -> None:
    body = rows(";", ".", ISO)
    if cell is not None:
        body[11] = f"{cell};1000;1;99"
    path = write(tmp_path, ["t;p_Rail;lift;p_Line", *body])
    with pytest.raises(UserError) as refused:
        read(path, bench(tmp_path, time=time))
    assert said in str(refused.value)
    assert refused.value.remedy


def test_places_that_are_not_there(tmp_path: Path) -> None:
    path = write(tmp_path, ["made by a tool", *(";".join(row.split(";")[:3]) for row in rows(";", "."))])
    with pytest.raises(UserError, match="has numbers in columns 2, 3, 4, 1"):
        read(path, bench(tmp_path, text=PLACES))


def test_names_and_places_are_not_mixed(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="name all, or give places only"):
        bench(tmp_path, text=PLACES.replace("column = 3", 'column = "lift"'))


def test_a_file_without_names_is_told_of_places(tmp_path: Path) -> None:
    with pytest.raises(UserError, match=r"column = 1, 2, \.\.\."):
        read(write(tmp_path, rows(";", ".")), bench(tmp_path))
