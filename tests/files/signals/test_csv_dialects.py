"""CSV as other tools write it, with a line of names, and with a time by the calendar."""

import codecs
import re
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from observer_rt.files.formats import open_recording
from observer_rt.foundation.errors import UserError
from tests.files.signals.foreign import COLUMNS, RATE, bench, read, signals, write

NAMES = ("t", "p_Rail", "lift", "p_Line")
START = datetime(2026, 3, 1, 23, 59, 59, 999_900, UTC)  # midnight is among the samples
ISO = ""  # no `format`
OF_DAY = 'format = "%H:%M:%S.%f"'
FORMATS = {
    ISO: "%Y-%m-%dT%H:%M:%S.%fZ",
    'format = "%d.%m.%Y %H:%M:%S,%f"': "%d.%m.%Y %H:%M:%S,%f",
    'format = "%Y/%m/%d %H:%M:%S.%f"': "%Y/%m/%d %H:%M:%S.%f",
    OF_DAY: "%H:%M:%S.%f",
}


def cells(k: int, columns: Sequence[str], decimal: str, form: str | None) -> list[str]:
    """Row k of some columns: time [ms], or a stamp, and the three signals."""
    values = {name: f"{column[k] * (1e3 if name == 't' else 1):.6g}" for name, column in signals(k + 1).items()}
    texts = {name: text.replace(".", decimal) for name, text in values.items()}
    if form is not None:
        texts["t"] = (START + timedelta(microseconds=10 * k)).strftime(FORMATS[form])
    return [texts[name] for name in columns]


def lines(
    samples: int = 40, separator: str = ";", decimal: str = ",", extra: Sequence[str] = (), form: str | None = None
) -> list[str]:
    return [separator.join([*cells(k, NAMES, decimal, form), *extra]) for k in range(samples)]


def stamped(samples: int = 40) -> list[str]:
    return lines(samples, decimal=".", form=ISO)


def named(*rows: str) -> str:
    return "\n".join([";".join(NAMES), *rows, ""])


def require_refusal(path: Path, folder: Path, *said: str, **bench_options: str) -> None:
    with pytest.raises(UserError, match="(?s)" + ".*".join(map(re.escape, said))):
        read(path, bench(folder, **bench_options))


@given(
    separator=st.sampled_from([";", "\t", "|", ",", " "]),
    decimal=st.sampled_from([".", ","]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    ending=st.sampled_from(["\n", "\r\n"]),
    order=st.permutations(NAMES),
    has_units=st.booleans(),
    preamble=st.lists(st.sampled_from(["", "# made by a tool", "Prüfstand 7", "date;2024-01-02", "1;2"]), max_size=4),
    is_quoted=st.booleans(),
    form=st.sampled_from([None, *FORMATS]),
    further=st.sampled_from([[], ["on"]]),
)
def test_every_dialect_gives_the_same_signals(
    tmp_path: Path,
    separator: str,
    decimal: str,
    encoding: str,
    ending: str,
    order: list[str],
    has_units: bool,
    preamble: list[str],
    is_quoted: bool,
    form: str | None,
    further: list[str],
) -> None:
    quote = '"' if is_quoted and separator != " " else ""
    if separator == " " or (separator == "," and not quote):
        decimal = "." if separator == "," else decimal
        form = None if separator == " " or (form or "").endswith(',%f"') else form
    units = {"t": "ms", "p_Rail": "bar", "lift": "µm", "p_Line": "MPa"}
    rows = [[*order, *further]]
    if has_units:
        rows.append([*(units[name] for name in order), *further])
    for k in range(30):
        rows.append([f"{quote}{cell}{quote}" for cell in (*cells(k, order, decimal, form), *further)])
    path = write(tmp_path, ending.join([*preamble, *map(separator.join, rows), ""]), encoding)
    recording = read(path, bench(tmp_path, time='unit = "ms"' if form is None else form))
    result = signals(30)
    assert (recording.samples, recording.sample_rate) == (30, RATE)
    np.testing.assert_allclose(recording.rail_pressure, result["p_Rail"] * 1e5, rtol=1e-12)
    np.testing.assert_allclose(recording.needle_lift, result["lift"] * 1e-6, rtol=1e-12)
    np.testing.assert_allclose(recording.line_pressure, result["p_Line"] * 1e6, rtol=1e-12)


@given(
    order=st.permutations(["t", "p_Rail", "lift", "p_Line", "dm_dt"]),
    separator=st.sampled_from([";", "\t", "|", " "]),
    preamble=st.lists(st.sampled_from(["", "# t rail", "# LabVIEW;9", "Prüfstand 7"]), max_size=3),
    unit=st.sampled_from([("g/s", 1e-3), ("mg/ms", 1e-3), ("kg/s", 1.0)]),
)
def test_columns_go_by_number_and_a_rate_of_mass_by_the_models_density(
    tmp_path: Path, order: list[str], separator: str, preamble: list[str], unit: tuple[str, float]
) -> None:
    rows = [dict(zip(NAMES, cells(k, NAMES, ".", None), strict=True)) | {"dm_dt": f"{k % 9}.5"} for k in range(30)]
    path = write(tmp_path, "\n".join([*preamble, *(separator.join(row[n] for n in order) for row in rows), ""]))
    text = COLUMNS + f'[recording.injection_rate]\ncolumn = "dm_dt"\nunit = "{unit[0]}"\n'
    for number, name in enumerate(order, 1):
        text = text.replace(f'column = "{name}"', f"column = {number}")
    user_bench = bench(tmp_path, text=text)
    recording = read(path, user_bench)
    np.testing.assert_allclose(recording.line_pressure, signals(30)["p_Line"] * 1e6, rtol=1e-12)
    rate = unit[1] * (np.arange(30) % 9 + 0.5) / user_bench.injector.parameters.fluid.density_nozzle
    np.testing.assert_allclose(recording.signals["injection_rate"], rate, rtol=1e-12)


def test_further_columns_trailing_separators_and_comments_are_passed_over(tmp_path: Path) -> None:
    rows = lines(extra=("running", "2024-01-02", ""))
    rows[7] += " # knock"
    rows.insert(20, "# half time")
    path = write(tmp_path, "\n".join([";".join([*NAMES, "mode", "date", ""]), *rows]) + "\n")
    assert read(path, bench(tmp_path)).samples == 40


def test_units_of_the_file_count_where_the_bench_has_none(tmp_path: Path) -> None:
    for header in (["t;p_Rail [kPa];lift;p_Line"], [";".join(NAMES), "ms;kPa;um;MPa"]):
        recording = read(write(tmp_path, "\n".join([*header, *lines()])), bench(tmp_path, rail=""))
        assert recording.rail_pressure[0] == 1000e3
    said = ("column p_Rail (rail_pressure): has no unit", "[recording.rail_pressure] unit")
    require_refusal(write(tmp_path, named(*lines())), tmp_path, *said, rail="")


def test_factor_and_offset_make_a_signal_of_volts(tmp_path: Path) -> None:
    path = write(tmp_path, named(*lines()))
    assert read(path, bench(tmp_path, rail='unit = "MPa"\nfactor = 0.2\noffset = -50')).rail_pressure[0] == 150e6


def test_a_missing_column_names_line_and_the_nearest(tmp_path: Path) -> None:
    path = write(tmp_path, "\n".join(["made by a tool", "t;pRail;lift;p_Line", *lines()]))
    said = "line 2: column 'p_Rail' is missing; the nearest is 'pRail'"
    require_refusal(path, tmp_path, said, "it has t, pRail, lift, p_Line")


def test_cells_without_a_value_are_not_available(tmp_path: Path) -> None:
    rows = lines(samples=400)
    for row in range(100, 200):
        rows[row] = ";".join([rows[row].split(";")[0], *rows[row].split(";")[1:3], "N/A"])
    recording = read(write(tmp_path, named(*rows)), bench(tmp_path))
    assert np.flatnonzero(np.isnan(recording.line_pressure)).tolist() == list(range(100, 200))
    assert not np.isnan(recording.rail_pressure).any()


@pytest.mark.parametrize(
    ("cell", "decimal"), [("1.000,153", ","), ("1'000.5", "."), ("1\u00a0000,5", ","), ("1,001.5", ".")]
)
@pytest.mark.parametrize("row", [0, 5, 300])  # the first, among the lines that tell the dialect, and beyond
def test_separators_of_thousands_are_refused(tmp_path: Path, cell: str, decimal: str, row: int) -> None:
    rows = [row.replace(",", decimal) for row in lines(400)]
    cells = rows[row].split(";")
    rows[row] = ";".join([cells[0], cell, *cells[2:]])
    said = f"line {row + 2}: column p_Rail (rail_pressure): '{cell}' is not a number"
    path = write(tmp_path, named(*rows))
    require_refusal(path, tmp_path, said, "write the file again without separators of thousands")


@given(
    cut=st.integers(1, 60), encoding=st.sampled_from(("utf-8", "utf-16", "utf-16-be", "cp1252")), zeros=st.booleans()
)
def test_a_recording_cut_anywhere_has_its_whole_lines(tmp_path: Path, cut: int, encoding: str, zeros: bool) -> None:
    """Also before the zeros of a file whose size was set beforehand."""
    path, user_bench = tmp_path / "foreign.csv", bench(tmp_path)
    text = named(*lines())
    mark = codecs.BOM_UTF16_BE if encoding == "utf-16-be" else b""
    path.write_bytes(mark + text.encode(encoding))
    complete = read(path, user_bench)
    path.write_bytes(mark + text[:-cut].encode(encoding) + bytes(40_000 * zeros))
    stream = open_recording(path, user_bench.injector)
    ended = text[:-cut].count("\n") + 40 - text.count("\n")
    np.testing.assert_array_equal(stream.collected().line_pressure, complete.line_pressure[:ended])
    is_cut = not text[:-cut].endswith("\n")
    said = ["zeros behind"] if zeros else ["its last line has no"] * is_cut
    assert [word in note for word, note in zip(said, stream.notes, strict=True)] == [True] * len(said)


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (" ", ".")])
def test_a_line_with_a_separator_too_many_is_refused(tmp_path: Path, separator: str, decimal: str) -> None:
    rows = lines(separator=separator, decimal=decimal)
    rows[20] += f"{separator}7"
    path = write(tmp_path, "\n".join([separator.join(NAMES), *rows]))
    require_refusal(path, tmp_path, "line 22: 5 cells, but there are 4 columns", "mend the line")


def column_of(cells: Sequence[str]) -> list[str]:
    rows = [row.split(";") for row in lines(len(cells), decimal=".")]
    return [";".join([row[0], cell, *row[2:]]) for row, cell in zip(rows, cells, strict=True)]


@pytest.mark.parametrize("sign", [".", ","])
def test_whole_numbers_with_separators_of_thousands_are_no_decimals(tmp_path: Path, sign: str) -> None:
    cells = [f"{990 + k % 30:,}".replace(",", sign) for k in range(120)]
    rows = [row.replace(".", sign) for row in column_of(cells)]
    require_refusal(write(tmp_path, named(*rows)), tmp_path, "is a whole number with a separator of thousands")


@pytest.mark.parametrize("form", ["{:.3f}", "{:g}"])
def test_numbers_of_three_decimals_are_decimals(tmp_path: Path, form: str) -> None:
    cells = [form.format(value / 1000) for value in [999_000, *range(1001, 1101)]]
    recording = read(write(tmp_path, named(*column_of(cells))), bench(tmp_path))
    np.testing.assert_allclose(recording.rail_pressure, [float(cell) * 1e5 for cell in cells])


def test_rows_that_are_not_in_the_order_of_time_are_refused(tmp_path: Path) -> None:
    rows = np.array(lines(400))
    np.random.default_rng(3).shuffle(rows)
    said = ("its rows are not in the order of time", "sort the rows by their time")
    require_refusal(write(tmp_path, named(*rows)), tmp_path, *said)


def test_a_row_of_types_is_no_row_of_units(tmp_path: Path) -> None:
    """As INCA writes it."""
    rows = [";".join(NAMES), "f8;f8;f8;f8", "ms;kPa;um;MPa", *lines(), ""]
    assert read(write(tmp_path, "\n".join(rows)), bench(tmp_path, rail="")).rail_pressure[0] == 1000e3


@pytest.mark.parametrize(
    ("form", "said"), [(ISO, "ISO 8601, counted from 2026-03-01T"), (OF_DAY, "'%H:%M:%S.%f', counted from ")]
)
def test_the_calendar_is_told_and_loses_no_digit(tmp_path: Path, form: str, said: str) -> None:
    path = write(tmp_path, named(*lines(decimal=".", form=form)))
    stream = open_recording(path, bench(tmp_path, time=form).injector)
    assert f"calendar stamps as {said}23:59:59.999900000" in stream.details[0]
    assert stream.notes == ()  # seconds since 1970 would lie 0.02 samples off the grid
    assert stream.collected().time[-1] == pytest.approx(39 / RATE, abs=1e-12)


def test_a_gap_in_the_calendar_splits(tmp_path: Path) -> None:
    body = stamped(100)
    stream = open_recording(write(tmp_path, named(*body[:40], *body[70:])), bench(tmp_path, time="").injector)
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
    body = stamped()
    if cell is not None:
        body[11] = f"{cell};1000;1;99"
    require_refusal(write(tmp_path, named(*body)), tmp_path, said, "\n  remedy: ", time=time)


def test_a_file_without_names_is_told_to_have_some(tmp_path: Path) -> None:
    path = write(tmp_path, "\n".join([*lines(), ""]))
    with pytest.raises(UserError, match="in text also by number, as column = 2"):
        read(path, bench(tmp_path))
    with pytest.raises(UserError, match="has no names above its numbers"):
        open_recording(path)
