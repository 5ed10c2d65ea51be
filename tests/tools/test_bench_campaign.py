"""What all campaigns share: rows worked out once, failures reported, bars judged, tables by group, the exit code."""

import math
import os
import signal
from pathlib import Path

import pandas as pd
import pytest
import typer

import tools.benchmarks.__main__  # noqa: F401
from observer_rt.foundation.errors import RunError
from tools.benchmarks.campaign import CHANCE, Bar, Row, chance_of_95, conclude, frame_of, judged, run_cases, table

ROWS: list[Row] = [
    {"label": "a 0", "kind": "a", "errors": [1.0, -3.0], "right": True, "wide": None},
    {"label": "a 1", "kind": "a", "errors": [2.0], "right": False, "wide": None},
    {"label": "b 0", "kind": "b", "errors": [], "right": True, "wide": None},
    {"label": "b 1", "failed": "ValueError: no"},
]


@pytest.fixture
def frame() -> pd.DataFrame:
    return frame_of(ROWS)


def halved(number: int, log: Path) -> Row:
    """Half an even number, with a line for each call."""
    with log.open("a") as file:
        file.write(f"{number}\n")
    if number == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    if number % 2:
        raise ValueError(f"{number} is odd")
    return {"half": number // 2, "infinite": math.inf}


def test_cases_are_worked_once_and_failures_and_kills_told(tmp_path: Path) -> None:
    log = tmp_path / "log"
    cases = {str(n): (n, log) for n in (4, 3, 2)}
    first = run_cases("halves", halved, cases, 2, tmp_path / "out")
    assert first["label"].tolist() == ["4", "3", "2"]
    assert first["half"].dropna().tolist() == [2, 1]
    assert first["failed"].dropna().tolist() == ["ValueError: 3 is odd"]
    kept = tmp_path / "out" / "halves.jsonl"
    kept.write_text(kept.read_text() + "\n[cut sho")  # killed while writing
    with pytest.raises(RunError):
        run_cases("halves", halved, {"6": (6, log), "13": (13, log)}, 1, tmp_path / "out")
    again = run_cases("halves", halved, {label: (int(label), log) for label in "426"}, 1, tmp_path / "out")
    assert again["half"].tolist() == [2, 1, 3]
    assert sorted(map(int, log.read_text().split())) == [2, 3, 4, 6, 13]


@pytest.mark.parametrize(
    ("bar", "value", "met"),
    [
        (Bar("mean", "errors", "mean", least=0.0), 0.0, True),
        (Bar("most", "errors", "max", most=1.9), 2.0, False),
        (Bar("p50", "errors", "p50"), 1.0, None),
        (Bar("share", "right", "mean", 0.5, 0.7), 2 / 3, True),
        (Bar("of some", "right", "mean", least=0.6, of="kind == 'a'"), 0.5, False),
        (Bar("of a flag", "right", "mean", most=0.5, of="not right"), 0.0, True),
        (Bar("worst group", "right", "mean", least=0.5, by="kind"), 0.5, True),
        (Bar("a function", "errors", lambda values: values.abs().max(), most=3.0), 3.0, True),
        (Bar("too few", "errors", "max", most=0.0, from_values=4), 2.0, None),
        (Bar("nothing there", "wide", "max", most=0.0), math.nan, None),
        (Bar("no such column", "narrow", "sum", most=0.0), 0.0, None),
    ],
    ids=lambda each: each.name if isinstance(each, Bar) else "",
)
def test_a_figure_is_judged_by_its_bar(frame: pd.DataFrame, bar: Bar, value: float, met: bool | None) -> None:
    verdict = judged(frame, [bar]).loc[bar.name]
    assert verdict["value"] == pytest.approx(value, nan_ok=True)
    assert (verdict["met"] is None) is (met is None)
    assert bool(verdict["met"]) is bool(met)


def test_the_worst_group_is_named(frame: pd.DataFrame) -> None:
    assert judged(frame, [Bar("x", "right", "mean", least=0.0, by="kind")]).loc["x", "worst"] == "a"
    assert judged(frame, [Bar("x", "right", "mean", most=1.0, by="kind")]).loc["x", "worst"] == "b"


def test_a_table_has_a_row_a_group_and_one_for_all(frame: pd.DataFrame) -> None:
    summary = table(
        frame, "kind", {"n": ("label", "count"), "right": ("right", "of"), "spread": ("errors", "spread")}
    )
    assert summary.index.tolist() == ["a", "b", "all"]
    assert summary["n"].tolist() == [2, 1, 3]
    assert summary["right"].tolist() == ["1/2", "1/1", "2/3"]
    assert summary["spread"].tolist() == ["2 / 2.9 / 3", "-", "2 / 2.9 / 3"]


@pytest.mark.parametrize(("held", "is_likely"), [(95, True), (100, True), (90, True), (80, False)])
def test_intervals_that_hold_too_seldom_are_unlikely(held: int, is_likely: bool) -> None:
    flags = pd.Series([True] * held + [False] * (100 - held))
    assert (chance_of_95(flags) >= CHANCE) is is_likely


@pytest.mark.parametrize(
    ("rows", "most", "code"),
    [(ROWS[:3], 2.0, 0), (ROWS[:3], 1.9, 1), (ROWS, 2.0, 1)],
    ids=["met", "missed", "failed"],
)
def test_exit_code_and_files_tell_what_is_missed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rows: list[Row], most: float, code: int
) -> None:
    bars = [Bar("largest", "errors", "max", most=most), Bar("lost", "wide", "max")]
    try:
        conclude(frame_of(rows), bars, {}, tmp_path)
        exit_code = 0
    except typer.Exit as end:
        exit_code = end.exit_code
    printed = capsys.readouterr().out
    assert exit_code == code
    assert ("MISSED" in printed) == (most < 2.0)
    assert ("failed: b 1: ValueError: no" in printed) == (len(rows) > 3)
    figures = pd.read_csv(tmp_path / "figures.csv", index_col="figure")
    assert figures["value"].to_dict() == pytest.approx({"largest": 2.0, "lost": math.nan}, nan_ok=True)
    assert figures["met"].astype(str).eq("False").to_dict() == {"largest": most < 2.0, "lost": False}
    assert len(pd.read_csv(tmp_path / "rows.csv")) == len(rows)
