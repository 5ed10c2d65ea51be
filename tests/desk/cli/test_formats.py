"""The registry of formats: the page and the help agree with it."""

from tests.desk.cli.conftest import Command


def test_the_help_lists_the_formats_of_the_registry(command: Command) -> None:
    text = " ".join(command("convert", "--help").out.split())
    recordings, logs = ".csv, .mf4, .parquet, .txt", ".log, .blf, .asc, .trc, .mf4, .csv"
    assert f"Recording ({recordings}) or CAN log ({logs})." in text
    assert "no CAN FD in .trc" in text
    assert "Log to write (.log, .blf)" in " ".join(command("record", "--help").out.split())
