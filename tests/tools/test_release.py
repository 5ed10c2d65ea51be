"""A release: one version everywhere, packages that work where nothing else is installed, a container that starts."""

import hashlib
import re
import shlex
import subprocess
import zipfile
from fnmatch import fnmatch
from itertools import pairwise
from pathlib import Path

import pytest
import typer.main
import yaml

import observer_rt
from observer_rt.desk.cli.app import app_of

ROOT = Path(__file__).parents[2]
CONTAINER = ROOT / "tools" / "container" / "Containerfile"


def instructions() -> dict[str, list[str]]:
    """Arguments of each instruction of the container file, by its name, in their order."""
    text = CONTAINER.read_text().replace("\\\n", "")
    arguments_of: dict[str, list[str]] = {}
    for line in text.splitlines():
        if line and not line.startswith("#"):
            name, arguments = line.split(maxsplit=1)
            arguments_of.setdefault(name, []).append(arguments)
    return arguments_of


def test_one_version_everywhere() -> None:
    versions = re.findall(r"^## (\d[\d.]*)$", (ROOT / "docs" / "CHANGELOG.md").read_text(), re.MULTILINE)
    assert versions[0] == observer_rt.__version__
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == observer_rt.__version__


def test_the_container_starts_what_was_installed_with_options_that_there_are() -> None:
    arguments_of = instructions()
    (program,), (name, *arguments) = (yaml.safe_load(arguments_of[key][0]) for key in ("ENTRYPOINT", "CMD"))
    commands = typer.main.get_command(app_of()).commands  # type: ignore[attr-defined]
    options = {option for parameter in commands[name].params for option in parameter.opts}
    assert {argument for argument in arguments if argument.startswith("--")} <= options
    made = " ".join(arguments_of["RUN"])
    assert f"venv {Path(program).parents[1]}" in made
    bench = arguments[arguments.index("--bench") + 1]
    assert f"{program} run --print-example-bench >{bench}" in made
    folders = shlex.split(made.split("mkdir -p ")[1])[:2]
    assert {str(Path(argument).parent) for argument in arguments if argument.startswith("/")} == set(folders)
    assert set(yaml.safe_load(arguments_of["VOLUME"][0])) == set(folders)


def test_the_page_keeps_both_folders_of_the_container_beyond_it() -> None:
    page = (ROOT / "docs" / "operating.md").read_text()
    command = shlex.split(page.split("podman run ")[1].split("\n\n")[0])
    mounted = [after for option, after in pairwise(command) if option == "-v"]
    assert [each.split(":")[1] for each in mounted] == yaml.safe_load(instructions()["VOLUME"][0])


def test_the_container_takes_the_wheel_that_a_release_makes() -> None:
    (copied,) = instructions()["COPY"]
    wheel = f"dist/observer_rt-{observer_rt.__version__}-cp311-abi3-manylinux_2_17_x86_64.whl"
    assert fnmatch(wheel, copied.split()[0])


@pytest.mark.slow
def test_a_release_is_made_and_works() -> None:
    done = subprocess.run(
        [ROOT / "tools" / "release", "x86_64"], capture_output=True, text=True, check=False, timeout=1800
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("PASSED") == 2  # by twine
    assert done.stderr.count("installed and tried") == 2
    files = [line.split() for line in done.stdout.splitlines()]
    assert {Path(name).suffix for _, name in files} == {".gz", ".whl"}
    wheel = next(name for _, name in files if name.endswith(".whl"))
    assert "observer_rt/core/frames/frames.pyi" in zipfile.ZipFile(ROOT / "dist" / wheel).namelist()
    for digest, name in files:
        assert hashlib.sha256((ROOT / "dist" / name).read_bytes()).hexdigest() == digest
