"""`check` of a recording by a bench file with `[recording]` alone."""

from pathlib import Path

from tests.desk.cli.conftest import Command
from tests.files.signals.foreign import COLUMNS, signals


def test_a_bench_file_with_the_layout_alone_shows_how_a_file_is_read(
    command: Command, tmp_path: Path
) -> None:
    found = signals(400)
    rows = zip(found["t"] * 1e3, found["p_Rail"], found["lift"], found["p_Line"], strict=True)
    made, layout = tmp_path / "mine.csv", tmp_path / "layout.toml"
    made.write_text("t;p_Rail;lift;p_Line\n" + "".join(f"{t:.5f};{p};{x};{y}\n" for t, p, x, y in rows))
    columns = COLUMNS.format(options="", rail='unit = "bar"', time='unit = "ms"')
    layout.write_text(f"[sampling]\nrate_hz = 100000\n{columns}")
    said = " ".join(command("check", "--bench", layout, "--recording", made).out.split())
    assert "separated by ';'" in said
    assert "400 samples at 100000 Hz" in said
    assert "dbc" not in said
