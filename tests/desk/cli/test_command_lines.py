"""Mistakes in the arguments of a command: each is named with its remedy, before any work, and nothing is written."""

from pathlib import Path

import pytest

from tests.desk.cli.conftest import Command

# {worn}, {resting}: recordings, {log}: a log of one frame, {bench}: a bench file; all else is not there
MISTAKES = [
    ("simulate --output x.csv --rail-pressure -5", "error: --rail-pressure"),
    ("simulate --output x.csv --rail-pressure 60,,100", "error: --rail-pressure"),
    ("simulate --output x.csv --rail-pressure 60e6", "error: --rail-pressure"),
    ("simulate --output x.csv --energizing-time nan", "error: --energizing-time"),
    ("simulate --output x.csv --energizing-time 90", "error: --period"),
    ("simulate --output x.csv --shots 1.0", "error: --shots"),
    ("simulate --output x.csv --shots 1@0,1@0.5", "error: --shots"),
    ("simulate --output x.csv --effect rust=1", "error: --effect"),
    ("simulate --output x.csv --effect orifice_area:v_H=-2", "error: --effect"),
    ("simulate --output x.csv --effect channel_skew:d=10ms", "give the number in us"),
    ("simulate --output x.csv --effect lift_ofset=20", "the nearest is 'lift_offset'"),
    ("simulate --output x.csv --effect lift_ofset=20", "lift_dependent_seat_coefficient:a:x_c"),
    ("simulate --output x.csv --noise maybe", "error: --noise"),
    ("simulate --output x.csv --sample-rate 5", "error: --sample-rate"),
    ("simulate --output x.csv --injections 100000000", "error: --injections"),
    ("simulate --output x.csv --period 1e9", "error: --injections"),
    ("simulate --output x.csv --model nowhere.toml", "error: nowhere.toml"),
    ("simulate --output x.csv --fuel-temperature 300", "300 degC is no temperature of a fuel"),
    ("simulate --output no/x.csv --injections 3000", "error: --output: no: no such folder"),
    ("simulate --output x.txt --injections 3000", "error: --output x.txt: unknown kind of file '.txt'"),
    ("simulate --output x --injections 3000", "unknown kind"),
    ("simulate --output folder.csv --injections 3000", "error: --output folder.csv: is a folder"),
    ("evaluate {worn} {resting} --output x.csv", "--output x.csv: names a file"),
    ("evaluate {worn} {worn} --output traces", "worn.csv.trace.csv would be written twice"),
    ("evaluate {worn} --injections 1", "no --plot is given"),
    ("evaluate {worn} --plot x.png --injections 1,0", "--injections: '0' is no number"),
    ("evaluate {worn} --plot x.png --injections 2,9", "--injections: there is no injection 9"),
    ("evaluate {worn} --plot x.png --injections 2,9", "opens 4 times"),
    ("evaluate {worn} {resting} --save-state x.json", "--save-state: needs one history"),
    ("evaluate {worn} --output {worn}", "is a recording to be evaluated"),
    ("evaluate {worn} --output no/x.csv", "--output: no: no such folder"),
    ("evaluate {worn} --output x.xlsx", "known suffixes: .csv, .mf4, .parquet"),
    ("evaluate {worn} --plot no/x.png", "--plot: no: no such folder"),
    ("evaluate {worn} --plot x.bmp", "known suffixes: .png, .svg, .pdf"),
    ("evaluate {worn} --plot x", "known suffixes: .png, .svg, .pdf"),
    ("evaluate {worn} --save-state no/s.json", "--save-state: no: no such folder"),
    ("evaluate {worn} --state no.json", "--state no.json: no such file"),
    ("evaluate {worn} --bench no.toml", "no.toml: no such file"),
    ("evaluate {resting} --bench {bench}", "sampling.rate_hz: is 50000 Hz"),
    ("evaluate {worn} --fuel-temperature 300", "--fuel-temperature: 300 degC is no temperature of a fuel"),
    ("evaluate {worn} --fuel-temperature 300", "give -40 to 150 degC"),
    ("evaluate no.csv", "no.csv: no such file"),
    ("evaluate no.log", "no.log: no such file"),
    ("evaluate no.db", "known suffixes: .csv, .mf4, .parquet, .txt"),
    ("evaluate folder.csv", "folder.csv: cannot be opened: Is a directory"),
    ("convert no.blf x.log", "no.blf: no such file"),
    ("convert {log} x.xyz", "unknown kind of file '.xyz'"),
    ("convert no.xyz x.log", "unknown kind of file '.xyz'"),
    ("convert {log} x.csv", "--bench: is missing"),
    ("convert {log} {log} --force", "is the file to be converted"),
    ("convert {worn} x.blf", "a recording of signals has no frames"),
    ("convert {log} x.blf --from-channel can9", "holds no data frame of channel can9"),
    ("convert {log} no/x.blf", "no such folder"),
    ("replay no.csv", "no.csv: no such file"),
    ("replay no.log", "no.log: no such file"),
    ("replay no.blf", "no.blf: no such file"),
    ("replay no.xyz", "known suffixes: .csv, .mf4, .parquet, .txt"),
    ("replay {log} --map-id 0x123", "--map-id: '0x123' is not of the form FROM=TO"),
    ("replay {log} --map-id 0x124=0x200", "--map-id: no frame with identifier 0x124"),
    ("replay {log} --map-id 0x123=0x800", "--map-id: 0x800 is too long for the standard frame 0x123"),
    ("replay {log} --map-channel can7=x", "channel can7: is not in"),
    ("replay {worn} --map-channel can7=x", "is no CAN log: it has no channels"),
    ("replay {worn} --start 0.2 --stop 0.1", "--start, --stop: 0.2 s is not before 0.1 s"),
    ("replay {worn} --start nan", "--start, --stop"),
    ("replay {worn} --start 99", "select 0 samples"),
    ("replay {worn} --stop 0.05 --windowed", "--windowed: no injection"),
    ("replay {log} --windowed", "--windowed: a log is sent as it was recorded"),
    ("replay {worn} --interface nosuch", "link.interface: unknown interface 'nosuch'"),
    ("record --out x.mf4", "cannot be recorded into safely"),
    ("record --out no/x.blf", "no such folder"),
    ("record --out x.blf --interface nosuch", "unknown interface 'nosuch'"),
    ("discover --out found", "RECORDING: is missing"),
    ("discover --out found --choose seat_rea {worn}", "nearest is 'seat_area'"),
    ("discover --out found {log}", "--bench: is missing: it says which signals the frames of {log} carry"),
    ("compare {here}", "two folders"),
    ("compare {here} {here}", "findings.json: no such file"),
    ("effects channel_scew", "the nearest is 'channel_skew'"),
    ("effects channel_scew", "channel_skew:d [us]"),
    ("demo --figure no/demo.png", "--figure"),
    ("demo --figure demo.doc", "--figure"),
    ("demo --wear 2", "--wear"),
    ("demo --injections 1", "--injections"),
    ("journal x.sqlite --csv --json", "leave one of them out"),
    ("journal x.sqlite", "no such file"),
    ("journal {bench}", "is no journal of injections"),
    ("run", "--print-example-bench"),
    ("run --bench {bench} --state no/learned.json", "no such folder"),
    ("run --bench {bench} --state {here}", "is a folder"),
    ("run --bench {bench} --journal no/injections.sqlite", "--journal"),
    ("run --bench {bench} --journal {here}", "--journal"),
    ("run --bench {bench} --journal {log}", "holds a log of candump, not a journal of injections"),
    ("run --bench {bench} --log no/run.log", "no such folder"),
    ("run --bench {bench} --log new --journal new", "--log new: is the learned state or the journal"),
    # whatever the command
    ("nosuch", "remedy: `observer-rt"),
    ("evaluate", "remedy: `observer-rt"),
    ("evaluate {worn} --bogus", "remedy: `observer-rt"),
    ("replay {worn} --speed fast", "remedy: `observer-rt"),
]


def contents(folder: Path) -> dict[Path, bytes | None]:
    return {path: path.read_bytes() if path.is_file() else None for path in folder.iterdir()}


@pytest.mark.parametrize(("line", "said"), MISTAKES)
def test_a_mistake_is_named_before_any_work(
    command: Command,
    worn: Path,
    resting: Path,
    bench: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    line: str,
    said: str,
) -> None:
    copy, log = tmp_path / "worn.csv", tmp_path / "a.log"
    copy.write_bytes(worn.read_bytes())
    log.write_text("(100.000000) can0 123#AA\n")
    (tmp_path / "folder.csv").mkdir()
    before = contents(tmp_path)
    places = {"worn": copy, "resting": resting, "log": log, "bench": bench, "here": tmp_path}
    monkeypatch.chdir(tmp_path)
    outcome = command(*(word.format(**places) for word in line.split()))
    assert (outcome.code, outcome.out) == (2, "")
    assert outcome.err.startswith("error: ")
    assert "  remedy: " in outcome.err
    assert said.format(**places) in outcome.err
    assert "ready" not in outcome.err
    assert contents(tmp_path) == before
