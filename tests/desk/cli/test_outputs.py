"""Outputs of every command: what is there and of another kind is refused by name, and stays as it is."""

from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR
from tests.desk.cli.conftest import Command

SAMPLES = b"time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa\n0,100,0,100\n"
STATE = b'{\n "version": 4,\n "sha256": "ab"\n}\n'
PICTURE = b"\x89PNG\r\n\x1a\n"
# the command, which of its outputs is there, as what, and what is said of that; {worn}: a recording
OTHERS = [
    ("run --bench bench.toml --state other", EXAMPLE_BENCH.read_bytes(), "a bench file, not a learned state"),
    ("run --bench bench.toml --state other", SAMPLES, "a table of samples, not a learned state"),
    ("run --bench bench.toml --state other", b"mine", "something else, not a learned state"),
    ("run --bench bench.toml --journal other", STATE, "a learned state, not a journal"),
    ("run --bench bench.toml --log other", SAMPLES, "a table of samples, not a log of `observer-rt run`"),
    ("check --bench bench.toml --state other", SAMPLES, ""),
    ("demo --figure other.png", SAMPLES, "a table of samples, not a PNG figure"),
    ("simulate --output other.csv --force", PICTURE, "a PNG figure, not a table of samples"),
    ("simulate --output other.mf4 --force", SAMPLES, "not an MDF file"),
    ("evaluate {worn} --output other.csv --force", b"name,kind\n", "something else, not a table of samples"),
    ("evaluate {worn} --plot other.pdf --force", SAMPLES, "not a PDF figure"),
    ("evaluate {worn} --save-state other --force", SAMPLES, "a table of samples, not a learned state"),
    ("evaluate {worn} --save-state other.csv --force", SAMPLES, "a table of samples, not a learned state"),
    ("convert {worn} other.log --bench bench.toml --force", b"mine\n", "something else, not a log of candump"),
    ("convert {worn} other.blf --bench bench.toml --force", SAMPLES, "not a log of Vector, binary"),
    ("convert {worn} other.parquet --force", SAMPLES, "not a Parquet file"),
    ("record --interface virtual --out other.blf --force", SAMPLES, "not a log of Vector, binary"),
    ("record --interface virtual --out other.log --force", b"2 notes\n", "not a log of candump"),
    ("fit {worn} --model model.toml --output other.toml --force", EXAMPLE_BENCH.read_bytes(),
        "a bench file, not an injector file"),
    ("fit {worn} --model model.toml --output x.toml --plot other.png --force", SAMPLES, "not a PNG figure"),
    ("trend {here} --out other.html", SAMPLES, "a table of samples, not a page"),
    ("trend {here} --plot other.svg", SAMPLES, "a table of samples, not an SVG figure"),
]  # fmt: skip
# the same of names in a folder that the command fills
IN_FOLDERS = [
    ("record --interface virtual --out o.log --rotate-size 1 --force", "o_0001.log", "not a log of candump"),
    ("simulate --output o.csv --force", "o.csv.truth.csv", "something else, not a table of samples"),
    ("reproduce --out {here}", "figure_4.png", "not a PNG figure"),
    ("reproduce --out {here}", "report.md", "not a table or report of `reproduce`"),
    ("discover {worn} --out {here} --force", "findings.json", "not the findings of `discover`"),
    ("discover {worn} --out {here} --force", "amended.toml", "not an injector file"),
    ("discover {worn} --out {here} --force", "report.html", "not a page"),
    ("discover {worn} --out {here} --force", "fits.jsonl", "not the fits of `discover`"),
    ("batch {worn} --out {here}", "errors.parquet", "holds errors.parquet, of no batch"),
    ("batch {worn} --out {here}", "done.jsonl", "holds done.jsonl, of no batch"),
    ("run --bench bench.toml --state learned", "learned.lock", "something else than the id of a process"),
]


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    text = EXAMPLE_BENCH.read_text().replace('interface = "socketcan"', 'interface = "virtual"')
    Path("bench.toml").write_text(text)
    Path("model.toml").write_bytes(NOMINAL_INJECTOR.read_bytes())
    return tmp_path


@pytest.mark.parametrize(("line", "content", "said"), OTHERS)
def test_another_kind_of_file_is_refused(
    command: Command, folder: Path, worn: Path, line: str, content: bytes, said: str
) -> None:
    (other,) = (Path(word) for word in line.split() if word.startswith("other"))
    other.write_bytes(content)
    outcome = command(*(word.format(worn=worn, here=folder) for word in line.split()))
    assert outcome.code == (1 if line.startswith("check") else 2)
    assert f"other{other.suffix}" in outcome.err + outcome.out
    assert said in outcome.err
    assert "move this one away" in " ".join((outcome.err + outcome.out).split())
    assert other.read_bytes() == content
    assert not list(folder.glob("*set-aside*"))


@pytest.mark.parametrize(("line", "name", "said"), IN_FOLDERS)
def test_nothing_in_a_folder_is_replaced_that_is_of_another_kind(
    command: Command, folder: Path, worn: Path, line: str, name: str, said: str
) -> None:
    Path(name).write_bytes(b"mine\n")
    said_instead = command.refused(*(word.format(worn=worn, here=folder) for word in line.split()))
    assert name in said_instead
    assert said in said_instead
    assert Path(name).read_bytes() == b"mine\n"


def test_what_holds_nothing_is_in_nobodys_way(command: Command, folder: Path, worn: Path) -> None:
    for number, content in enumerate((b"", bytes(5000))):
        path = Path(f"{number}.json")
        path.write_bytes(content)
        command.done("evaluate", worn, "--save-state", path, "--force")
        assert b'"sha256"' in path.read_bytes()
