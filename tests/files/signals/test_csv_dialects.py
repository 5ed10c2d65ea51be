"""CSV as other tools write it."""

import codecs
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from observer_rt.files.formats import open_recording, read_recording, write_recording
from observer_rt.foundation.errors import UserError
from tests.files.signals.foreign import COLUMNS, PLACES, RATE, bench, damaged, read, signals, tells, write

reuse_folder = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
NAMES = ("t", "p_Rail", "lift", "p_Line")


def lines(
    samples: int = 40, separator: str = ";", decimal: str = ",", extra: Sequence[str] = ()
) -> list[str]:
    columns = signals(samples)
    return [
        separator.join(
            [
                *(
                    f"{columns[name][k] * (1e3 if name == 't' else 1):.6g}".replace(".", decimal)
                    for name in NAMES
                ),
                *extra,
            ]
        )
        for k in range(samples)
    ]


def named(*rows: str) -> str:
    """Text of rows under the names of their columns."""
    return "\n".join([";".join(NAMES), *rows, ""])


def message(path: Path, folder: Path, **bench_options: str) -> str:
    with pytest.raises(UserError) as raised:
        read(path, bench(folder, **bench_options))
    return str(raised.value)


@given(
    separator=st.sampled_from([";", "\t", "|", ",", " "]),
    decimal=st.sampled_from([".", ","]),
    encoding=st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "cp1252"]),
    ending=st.sampled_from(["\n", "\r\n"]),
    order=st.permutations(range(4)),
    has_units=st.booleans(),
    preamble=st.lists(
        st.sampled_from(["", "# made by a tool", "Prüfstand 7", "date;2024-01-02"]), max_size=4
    ),
    is_quoted=st.booleans(),
)
@reuse_folder
def test_every_dialect_gives_the_same_signals(
    tmp_path: Path,
    separator: str,
    decimal: str,
    encoding: str,
    ending: str,
    order: list[int],
    has_units: bool,
    preamble: list[str],
    is_quoted: bool,
) -> None:
    quote = '"' if is_quoted and separator != " " else ""
    if separator == "," and decimal == "," and not quote:
        decimal = "."
    result = signals(30)
    columns = [NAMES[i] for i in order]
    units = {"t": "ms", "p_Rail": "bar", "lift": "µm", "p_Line": "MPa"}
    rows = [columns, *([[units[name] for name in columns]] * has_units)]
    for k in range(30):
        numbers = (result[name][k] * (1e3 if name == "t" else 1.0) for name in columns)
        rows.append([f"{quote}{number:.6g}{quote}".replace(".", decimal) for number in numbers])
    path = write(tmp_path, ending.join([*preamble, *map(separator.join, rows), ""]), encoding)
    recording = read(path, bench(tmp_path))
    assert recording.samples == 30
    assert recording.sample_rate == RATE
    np.testing.assert_allclose(recording.rail_pressure, result["p_Rail"] * 1e5, rtol=1e-12)
    np.testing.assert_allclose(recording.needle_lift, result["lift"] * 1e-6, rtol=1e-12)
    np.testing.assert_allclose(recording.line_pressure, result["p_Line"] * 1e6, rtol=1e-12)


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
    text = message(write(tmp_path, named(*lines())), tmp_path, rail="")
    assert "column p_Rail (rail_pressure): has no unit" in text
    assert "[recording.rail_pressure] unit" in text


def test_factor_and_offset_make_a_signal_of_volts(tmp_path: Path) -> None:
    path = write(tmp_path, named(*lines()))
    recording = read(path, bench(tmp_path, rail='unit = "MPa"\nfactor = 0.2\noffset = -50'))
    assert recording.rail_pressure[0] == 150e6


def test_a_missing_column_names_line_and_the_nearest(tmp_path: Path) -> None:
    text = message(write(tmp_path, "\n".join(["made by a tool", "t;pRail;lift;p_Line", *lines()])), tmp_path)
    assert "line 2: column 'p_Rail' is missing; the nearest is 'pRail'" in text
    assert "it has t, pRail, lift, p_Line" in text


@pytest.mark.parametrize("bad", ["abc", "1.5", "12:30", "1_0", "10\x1c"])
def test_a_cell_that_is_no_number_names_line_and_column(tmp_path: Path, bad: str) -> None:
    rows = lines()
    rows[11] = f"0,11;1000;{bad};99"
    text = message(write(tmp_path, named(*rows)), tmp_path)
    assert f"line 13: column lift (needle_lift): '{bad}' is not a number" in text


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
    said = message(write(tmp_path, named(*rows)), tmp_path)
    assert f"line {row + 2}: column p_Rail (rail_pressure): '{cell}' is not a number" in said
    assert "write the file again without separators of thousands" in said


@given(cut=st.integers(1, 60), encoding=st.sampled_from(("utf-8", "utf-16", "utf-16-be", "cp1252")))
@reuse_folder
def test_a_recording_cut_anywhere_has_the_samples_of_its_whole_lines(
    tmp_path: Path, cut: int, encoding: str
) -> None:
    path, fitted = tmp_path / "foreign.csv", bench(tmp_path)
    text = named(*lines())
    mark = codecs.BOM_UTF16_BE if encoding == "utf-16-be" else b""
    path.write_bytes(mark + text.encode(encoding))
    complete = read(path, fitted)
    path.write_bytes(mark + text[:-cut].encode(encoding))
    stream = open_recording(path, fitted.injector)
    ended = text[:-cut].count("\n") + 40 - text.count("\n")
    np.testing.assert_array_equal(stream.collected().line_pressure, complete.line_pressure[:ended])
    assert [note.endswith("is left out: it may be cut short") for note in stream.notes] == [True] * (
        not text[:-cut].endswith("\n")
    )


def test_our_own_layout_is_read_as_ever_beside_a_mapping(tmp_path: Path) -> None:
    fitted = bench(tmp_path)
    foreign = read(write(tmp_path, named(*lines())), fitted)
    for suffix in (".csv", ".mf4", ".parquet"):
        own = tmp_path / f"own{suffix}"
        write_recording(own, foreign)
        again = read_recording(own, fitted.injector)
        np.testing.assert_array_equal(again.line_pressure, foreign.line_pressure)
        np.testing.assert_array_equal(again.needle_lift, read_recording(own).needle_lift)


@pytest.mark.parametrize("mapping", [COLUMNS, PLACES], ids=["by names", "by places"])
@given(data=st.data())
@reuse_folder
def test_damage_is_told_and_never_a_traceback(tmp_path: Path, mapping: str, data: st.DataObject) -> None:
    heading = ["p;q", ";".join(NAMES), "ms;bar;um;MPa"] if mapping == COLUMNS else []
    path = tmp_path / "foreign.csv"
    path.write_bytes(damaged(data.draw, "\n".join([*heading, *lines(25)])))
    assert tells(path, bench(tmp_path, text=mapping))


@pytest.mark.parametrize(("separator", "decimal"), [(";", ","), (",", "."), (" ", "."), ("\t", ",")])
def test_a_line_with_a_separator_too_many_is_refused(tmp_path: Path, separator: str, decimal: str) -> None:
    rows = lines(separator=separator, decimal=decimal)
    rows[20] += f"{separator}7"
    path = write(tmp_path, "\n".join([separator.join(NAMES), *rows]))
    said = message(path, tmp_path)
    assert "line 22: 5 cells, but there are 4 columns" in said
    assert "mend the line" in said


def test_a_separator_behind_every_line_is_no_cell(tmp_path: Path) -> None:
    plain = read(write(tmp_path, named(*lines())), bench(tmp_path))
    trailing = read(write(tmp_path, named(*(f"{row};" for row in lines()))), bench(tmp_path))
    np.testing.assert_array_equal(trailing.line_pressure, plain.line_pressure)


def column_of(cells: Sequence[str]) -> list[str]:
    """Lines whose rail pressure is written so."""
    rows = [row.split(";") for row in lines(len(cells), decimal=".")]
    return [";".join([row[0], cell, *row[2:]]) for row, cell in zip(rows, cells, strict=True)]


@pytest.mark.parametrize("sign", [".", ","])
def test_whole_numbers_with_separators_of_thousands_are_no_decimals(tmp_path: Path, sign: str) -> None:
    """999 and 1.002 in one column, of bar."""
    cells = [f"{990 + k % 30:,}".replace(",", sign) for k in range(120)]
    rows = [row.replace(".", sign) for row in column_of(cells)]
    said = message(write(tmp_path, named(*rows)), tmp_path)
    assert "is a whole number with a separator of thousands" in said


@pytest.mark.parametrize("form", ["{:.3f}", "{:g}"])
def test_numbers_of_three_decimals_are_decimals(tmp_path: Path, form: str) -> None:
    cells = [form.format(value / 1000) for value in [999_000, *range(1001, 1101)]]
    recording = read(write(tmp_path, named(*column_of(cells))), bench(tmp_path))
    np.testing.assert_allclose(recording.rail_pressure, [float(cell) * 1e5 for cell in cells])


def test_rows_that_are_not_in_the_order_of_time_are_refused(tmp_path: Path) -> None:
    rows = np.array(lines(400))
    np.random.default_rng(3).shuffle(rows)
    said = message(write(tmp_path, named(*rows)), tmp_path)
    assert "its rows are not in the order of time" in said
    assert "sort the rows by their time" in said


def test_a_row_of_types_is_no_row_of_units(tmp_path: Path) -> None:
    """As INCA writes it."""
    rows = [";".join(NAMES), "f8;f8;f8;f8", "ms;kPa;um;MPa", *lines(), ""]
    assert read(write(tmp_path, "\n".join(rows)), bench(tmp_path, rail="")).rail_pressure[0] == 1000e3


@pytest.mark.parametrize(
    ("unit", "factor"), [("BAR", 1e5), ("MPA", 1e6), ("N/mm²", 1e6), ("PSI", 6894.757293168)]
)
def test_units_are_known_in_other_spellings(tmp_path: Path, unit: str, factor: float) -> None:
    path = write(tmp_path, "\n".join([f"t;p_Rail [{unit}];lift [micron];p_Line", *lines(), ""]))
    assert read(path, bench(tmp_path, rail="")).rail_pressure[0] == pytest.approx(1000 * factor)
