"""What holds for every command: help for people, exit codes, output that cannot be written, a system that refuses."""

import json
import os
import re
import subprocess
import sys
import threading
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import Mock

import pytest

from observer_rt import __version__
from observer_rt.desk.cli.app import EXIT_CODES, app_of, main
from tests.daemon.participants import bench_file
from tests.desk.cli.conftest import Command, module


def test_help_fits_80_columns(command: Command) -> None:
    outcome = command.done("--help")
    assert max(map(len, outcome.out.splitlines())) <= 80


def test_version(command: Command) -> None:
    assert command("--version").out == f"observer-rt {__version__}\n"


def test_an_error_is_written_at_once(command: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    """A signal that ends the process then leaves no `error: ` without its message."""
    written = list[str]()
    monkeypatch.setattr(sys.stderr, "write", written.append)
    assert command("convert", "none.csv").code == 2
    assert [text[:16] for text in written if text.strip()] == ["error: convert: "]


def test_as_a_module_results_and_messages_apart_and_a_figure_without_a_notebook(worn: Path, tmp_path: Path) -> None:
    figure = tmp_path / "worn.svg"
    process = module("evaluate", worn, "--json", "--plot", figure, environment={"MPLBACKEND": "absent"})
    out, err = process.communicate()
    assert process.returncode == 0, err
    assert len(json.loads(out)["recordings"][0]["injections"]) == 4
    assert figure.exists()


def test_evaluate_does_not_wait_for_libraries_of_other_formats(resting: Path) -> None:
    code = (
        "import sys\n"
        "from observer_rt.__main__ import main\n"
        "try:\n"
        "    main()\n"
        "except SystemExit:\n"
        "    pass\n"
        "sys.exit(str({'asammdf'} & sys.modules.keys()))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "evaluate", str(resting)], capture_output=True, text=True, check=False
    )
    assert find_spec("asammdf")
    assert done.stderr.splitlines()[-1] == "set()"


def test_results_that_cannot_be_written() -> None:
    with Path("/dev/full").open("w") as full:
        process = module("run", "--print-example-bench", stdout=full.fileno())
        _, err = process.communicate()
    assert (process.returncode, err) == (1, "error: output: No space left on device\n")


def test_reader_that_goes_away() -> None:
    with module("run", "--print-example-bench") as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert (process.stderr.read(), process.wait()) == ("", 1)


@pytest.mark.decisive(1)
@pytest.mark.parametrize("closed", ["<&- >&- 2>&-", ">&-", "2>&-"])
def test_streams_that_are_closed(resting: Path, tmp_path: Path, closed: str) -> None:
    line = f'"$0" -m observer_rt convert {resting} copy.csv {closed}'
    done = subprocess.run(["bash", "-c", line, sys.executable], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, "Traceback" in done.stderr) == (0, False), done.stderr
    copied = (tmp_path / "copy.csv").read_text()
    assert (copied.splitlines()[0], copied.count("\n")) == (resting.read_text().splitlines()[0], 2001)


@pytest.mark.decisive(1)
@pytest.mark.parametrize(
    ("encoding", "command"),
    [
        ("utf-8:strict", "convert {0} {0}.csv"),
        ("ascii:strict", "evaluate {0}"),
        ("utf-8:surrogateescape", "evaluate {0}.txt"),
    ],
)
def test_a_name_a_terminal_obeys_or_cannot_show(resting: Path, tmp_path: Path, encoding: str, command: str) -> None:
    name = tmp_path / "a\x1b[31mü\udcfc.csv"
    name.write_bytes(resting.read_bytes())
    words = [sys.executable, "-m", "observer_rt", *command.format(name).split()]
    done = subprocess.run(words, capture_output=True, env=os.environ | {"PYTHONIOENCODING": encoding})
    said = done.stdout + done.stderr
    assert (b"Traceback" in said, rb"a\x1b[31m" in said, b"\x1b" in said) == (False, True, False), said


# Python imports a module of this name, if there is one, before anything else.
HOOK = """
import sys
class Interrupting:
    def find_spec(self, name, path=None, target=None):
        if name == "{module}":
            raise KeyboardInterrupt
sys.meta_path.insert(0, Interrupting())
"""


@pytest.mark.parametrize("name", ["typer", "numpy"])
def test_ctrl_c_while_modules_are_imported(tmp_path: Path, name: str) -> None:
    (tmp_path / "sitecustomize.py").write_text(HOOK.format(module=name))
    path = os.pathsep.join([str(tmp_path), *filter(None, sys.path)])
    done = subprocess.run(
        [sys.executable, "-m", "observer_rt", "check"],
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "")


REGISTERED = [command for command in app_of().registered_commands if command.callback]
COMMANDS = [command.name for command in REGISTERED if command.name]
HEADINGS = list(dict.fromkeys(str(command.rich_help_panel) for command in REGISTERED))


def test_the_list_of_commands_cuts_no_sentence(command: Command) -> None:
    listed = command.done("-h").out.split(f"\n{HEADINGS[0]}:\n")[1].split("\n\n  Every command")[0]
    assert re.findall(r"^  ([\w-]+)", listed, re.MULTILINE) == COMMANDS
    assert re.findall(r"^(\w[\w ]*):$", listed, re.MULTILINE) == HEADINGS[1:]
    sentences = re.split(r"^  [\w-]+ +", re.sub(r"\n\n.*:\n", "\n", listed), flags=re.MULTILINE)[1:]
    assert all(sentence.rstrip().endswith(".") and "..." not in sentence for sentence in sentences)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_names_no_types_and_has_an_example(command: Command, name: str) -> None:
    text = command.done(name, "-h").out
    assert text == command.done(name, "--help").out
    assert not re.search(r"<\w+(\[\w+\])?( range)?>", text)
    assert f"Example: observer-rt {name}" in text
    assert EXIT_CODES in " ".join(text.split())


def test_no_more_threads(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    refusal = RuntimeError("can't start new thread")  # in Python's words, as under `ulimit -v`
    monkeypatch.setattr(sys, "argv", ["observer-rt", "run", "--bench", str(bench_file(tmp_path, "limits"))])
    monkeypatch.setattr(threading.Thread, "start", Mock(side_effect=refusal))
    with pytest.raises(SystemExit) as ended:
        main()
    assert ended.value.code == 1
    said = capfd.readouterr().err
    assert "error: this process may start no more threads" in said
    assert "ulimit -v" in said
