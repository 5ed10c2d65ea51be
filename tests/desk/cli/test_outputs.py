"""Outputs of every command: files of others stay, and every file written is whole whenever the command ends."""

import re
import resource
import signal
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import get_type_hints

import pytest
from typer.models import OptionInfo

from observer_rt.config.bench import EXAMPLE_BENCH, NOMINAL_INJECTOR
from observer_rt.desk.cli.app import app_of
from observer_rt.files.signals.recording import TRUTH_SUFFIX
from tests.desk.cli.conftest import Command, module

# how each output is asked for; {out}: the file without its suffix, or the folder; {worn}: a recording
REPLACED = {  # with --force, where a file of the same kind is there
    ("demo", "--figure"): "demo --figure {out}.png",
    ("record", "--out"): "record --interface virtual --out {out}.log",
    ("simulate", "--output"): "simulate --injections 1 --output {out}.csv",
    ("evaluate", "--output"): "evaluate {worn} --output {out}.csv",
    ("evaluate", "--plot"): "evaluate {worn} --plot {out}.png",
    ("evaluate", "--save-state"): "evaluate {worn} --save-state {out}",
    ("convert", "OUT"): "convert {worn} {out}.parquet",
    ("fit", "--output"): "fit {worn} --model model.toml --output {out}.toml",
    ("fit", "--plot"): "fit {worn} --model model.toml --output fitted.toml --plot {out}.png",
    ("trend", "--plot"): "trend {here} --plot {out}.png",
}
CONTINUED = {
    ("run", "--state"): "run --bench bench.toml --state {out}",
    ("run", "--journal"): "run --bench bench.toml --journal {out}",
    ("run", "--log"): "run --bench bench.toml --log {out}",
}
FILES = REPLACED | CONTINUED
FOLDERS = {  # and the names in it that are written
    ("reproduce", "--out"): ("reproduce --out {out}", ("figure_3.png", "figure_4.png", "figure_5.png", "table.csv")),
    ("discover", "--out"): ("discover {worn} --out {out}", ("findings.json", "report.html", "amended.toml")),
    ("batch", "--out"): ("batch {worn} --out {out}", ("batch.json", "injections")),
}
ELSEWHERE = {("demo", "--out"), ("monitor", "--out"), ("take-over", "--bench")}
# parameters that name what is read; a new one that names a file must be among them, or declare what is written
READ = {"amended", "bench", "effects", "file", "from_evidence", "healthy", "log", "map", "mass", "model", "recording"}
READ |= {"recordings", "results_of", "state"}
SAMPLES = b"time_s,rail_pressure_MPa,needle_lift_mm,line_pressure_MPa\n0,100,0,100\n"
SAME_KIND = {
    ".png": b"\x89PNG\r\n\x1a\n",
    ".svg": b"<svg>",
    ".csv": SAMPLES,
    ".log": b"(100.000000) can0 123#AA\n",
    ".parquet": b"PAR1",
    ".toml": NOMINAL_INJECTOR.read_bytes(),
    ".html": b"<!DOCTYPE html>",
    "": b'{\n "version": 4,\n "sha256": "ab"\n}\n',
}
STRANGERS = ("observer.log", "bench.toml", "learned.json", "evidence/mine.parquet", "notes.txt")


HAVE_FORCE = {command.name for command in app_of().registered_commands if "force" in get_type_hints(command.callback)}


def test_every_output_is_tried() -> None:
    named: set[tuple[str, str]] = set()
    for command in app_of().registered_commands:
        for name, hint in get_type_hints(command.callback, include_extras=True).items():
            if "Path" in str(hint):
                info = hint.__metadata__[0]
                option = info.default if isinstance(info, OptionInfo) else info.metavar
                named.add((command.name or "", name if name in READ else str(option)))
    written = {(command, option) for command, option in named if option not in READ}
    changed = {("take-over", "--bench"), ("run", "--state"), ("run", "--log")}  # which other commands read
    assert written | changed == {*FILES, *FOLDERS, *ELSEWHERE}


def contents(folder: Path) -> Mapping[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in folder.rglob("*")
        if path.is_file() and not path.name.endswith(".lock")
    }


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    text = EXAMPLE_BENCH.read_text().replace('interface = "socketcan"', 'interface = "virtual"')
    Path("bench.toml").write_text(text)
    Path("model.toml").write_bytes(NOMINAL_INJECTOR.read_bytes())
    return tmp_path


def words(key: tuple[str, str], worn: Path, out: str = "out") -> list[str]:
    line = FILES[key] if key in FILES else FOLDERS[key][0]
    return [word.format(worn=worn, here=Path.cwd(), out=out) for word in line.split()]


def file_of(key: tuple[str, str]) -> Path:
    (named,) = re.findall(r"\{out\}(\S*)", FILES[key])
    return Path(f"out{named}")


@pytest.mark.parametrize("key", FILES, ids=" ".join)
def test_a_file_of_others_is_refused(command: Command, folder: Path, worn: Path, key: tuple[str, str]) -> None:
    out = file_of(key)
    consents = [[]] if key in CONTINUED else [[], ["--force"]]
    for path in (out, *([Path(f"{out}{TRUTH_SUFFIX}")] if key[0] == "simulate" else [])):
        for content in (b"mine\n", EXAMPLE_BENCH.read_bytes()):
            path.write_bytes(content)
            before = contents(folder)
            for consent in consents:
                said = command.refused(*words(key, worn), *consent)
                assert str(path) in said
                assert "stays as it is" in " ".join(said.split())
                assert contents(folder) == before
        path.unlink()
    if key in REPLACED:
        out.write_bytes(SAME_KIND[out.suffix])
        before = contents(folder)
        said = command.refused(*words(key, worn))
        assert f"{out}: exists already" in said
        assert "add --force" in said
        assert contents(folder) == before


@pytest.mark.parametrize("key", FOLDERS, ids=" ".join)
def test_a_folder_of_others_is_left_alone(command: Command, folder: Path, worn: Path, key: tuple[str, str]) -> None:
    for name in FOLDERS[key][1]:
        for content in (b"mine\n", SAME_KIND.get(Path(name).suffix, b"[1]")):
            position = folder / str(len(list(folder.iterdir())))
            for stranger in (*STRANGERS, name):
                (position / stranger).parent.mkdir(parents=True, exist_ok=True)
                (position / stranger).write_bytes(content)
            asked = words(key, worn, str(position))
            before = contents(folder)
            for consent in ([], ["--force"]) if key[0] in HAVE_FORCE else ([],):
                if consent and key[0] == "reproduce" and content != b"mine\n":
                    continue  # which replaces it
                said = command.refused(*asked, *consent)
                assert str(position) in said
                assert name.partition("/")[0] in said
                assert contents(folder) == before


def test_a_demonstration_takes_an_empty_folder_only(command: Command, folder: Path) -> None:
    for name in STRANGERS:
        location = folder / f"of_{Path(name).stem}"
        (location / name).parent.mkdir(parents=True)
        (location / name).write_bytes(b"mine\n")
        before = contents(folder)
        for consent in ([], ["--force"]):
            said = command.refused("demo", "--missing-effect", "--out", location, "--figure", "x.png", *consent)
            assert f"{location}: is not empty" in said
            assert contents(folder) == before


WRITTEN = [
    *(("simulate", "--output"), ("convert", "OUT"), ("evaluate", "--output")),
    *(("evaluate", "--plot"), ("evaluate", "--save-state")),
]


@pytest.mark.parametrize("key", WRITTEN, ids=" ".join)
def test_force_replaces_its_own_names_only(command: Command, folder: Path, worn: Path, key: tuple[str, str]) -> None:
    out = file_of(key)
    own = {str(out), *([f"{out}{TRUTH_SUFFIX}"] if key[0] == "simulate" else [])}
    for name in (*STRANGERS[2:], f".{out.stem}.part{out.suffix}", f"{out}.new", f"{out}.part"):
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(b"mine\n")
    out.write_bytes(SAME_KIND[out.suffix])
    before = contents(folder)
    command.done(*words(key, worn), "--force")
    after = contents(folder)
    assert {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)} == own


@contextmanager
def full_disk(most: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    ("line", "old"), [("evaluate {worn} --output out.csv", SAMPLES), ("convert {log} out.blf", b"LOGG")]
)
def test_a_full_disk_leaves_the_old_file(command: Command, folder: Path, worn: Path, line: str, old: bytes) -> None:
    out = Path(next(word for word in line.split() if word.startswith("out")))
    out.write_bytes(old)
    Path("a.log").write_text("".join(f"({100 + k / 1000:.6f}) can0 123#{k:016X}\n" for k in range(20_000)))
    before = contents(folder)
    with full_disk(1000):
        outcome = command(*(word.format(worn=worn, log="a.log") for word in line.split()), "--force")
    assert outcome.code == 1, outcome.err
    assert f"error: {out}: " in outcome.err
    assert "File too large" in outcome.err
    assert contents(folder) == before


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_an_end_while_writing_leaves_the_old_file_whole(folder: Path, number: signal.Signals, code: int) -> None:
    out = Path("out.csv")
    out.write_bytes(SAMPLES)
    process = module("simulate", "--injections", 150, "--noise", "off", "--output", out, "--force")
    while not any(part.stat().st_size for part in folder.glob(".out.*.part.csv")):
        assert process.poll() is None, process.communicate()
        time.sleep(0.002)
    process.send_signal(number)
    process.communicate()
    assert (process.returncode, out.read_bytes()) == (code, SAMPLES)
    assert number is signal.SIGKILL or not list(folder.glob(".out*"))


def test_what_holds_nothing_is_in_nobodys_way(command: Command, folder: Path, worn: Path) -> None:
    for number, content in enumerate((b"", bytes(5000))):
        path = Path(f"{number}.json")
        path.write_bytes(content)
        command.done("evaluate", worn, "--save-state", path, "--force")
        assert b'"sha256"' in path.read_bytes()


def test_a_lock_of_somebody_else_is_left_alone(command: Command, folder: Path) -> None:
    Path("learned.lock").write_bytes(b"mine\n")
    said = command.refused("run", "--bench", "bench.toml", "--state", "learned")
    assert "something else than the id of a process" in said
    assert Path("learned.lock").read_bytes() == b"mine\n"
