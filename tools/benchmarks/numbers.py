"""`tools/bench numbers`: the numbers of the learner, and what half and double of one of them do."""

import ast
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import pandas as pd
import typer

from tools.benchmarks import command_line as cli

ROOMS = ("learning", "estimation")
COPIED = "observer_rt", "tests", "tools", "build", "dbc"
NOT_COPIED = shutil.ignore_patterns("__pycache__", "injections-*", "faults-*", "golden")
SCALED = """\n{0} = (lambda by: by(by, {0}))(lambda by, value: tuple(by(by, each) for each in value)
    if isinstance(value, tuple) else max(round(value * {1}), 1) if isinstance(value, int) else value * {1})\n"""


def numbers_in(path: Path) -> Iterator[tuple[str, ast.Assign]]:
    """Constants of a module that are numbers, and where it states them."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for node in (each for each in body if isinstance(each, ast.Assign)):
        parts = [*ast.walk(node)]
        is_number = any(isinstance(each, ast.Constant) and isinstance(each.value, int | float) for each in parts)
        if is_number and not any(isinstance(each, ast.Call) and isinstance(each.func, ast.Name) for each in parts):
            names = (each.id for each in parts if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store))
            yield from ((f"{path.stem}.{name}", node) for name in names if name.isupper() and name[0] != "_")


@cli.app.command(epilog="Examples: tools/bench numbers; tools/bench numbers kinds.SHIFT --sets first,laws")
def numbers(
    name: Annotated[str, typer.Argument(help="One of the list that comes without it.")] = "",
    sets: Annotated[str, typer.Option(help="Sets of `tools/bench injections`, by commas.")] = "first,laws,jumps",
) -> None:
    """The numbers of the learner; what half and double of one do to injections (minutes)."""
    paths = sorted(path for room in ROOMS for path in Path("observer_rt/engine", room).glob("*.py"))
    places = {key: (path, node) for path in paths for key, node in numbers_in(path)}
    for key in cli.chosen_names(name, "NAME", places, ()):
        with tempfile.TemporaryDirectory() as folder:  # one copy, for in it the core is compiled once
            for source in COPIED:
                shutil.copytree(source, Path(folder, source), ignore=NOT_COPIED, symlinks=True)
            by = {factor: _figures(folder, key, places[key], factor, sets) for factor in (0.5, 1.0, 2.0)}
        print(pd.DataFrame(by).add_prefix("x ").to_string(float_format="{:.4g}".format))
    print(*(f"{key:32s} {ast.unparse(node)}" for key, (_, node) in places.items() if not name), sep="\n")


def _figures(folder: str, key: str, site: tuple[Path, ast.Assign], factor: float, sets: str) -> "pd.Series[float]":
    """Figures of sets of injections with a number by a factor, in a copy of the sources in a folder."""
    figures, (path, node) = {}, site
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    lines.insert(node.end_lineno or 0, SCALED.format(key.split(".")[1], factor))
    Path(folder, path).write_text("".join(lines), encoding="utf-8")
    for name in sets.split(","):
        command = ["-m", "tools.benchmarks", "injections", name, "--out", f"x{factor}-{name}"]
        subprocess.run([sys.executable, *command], cwd=folder, stdout=subprocess.DEVNULL, check=False)
        figures[name] = pd.read_csv(Path(folder, f"x{factor}-{name}", "figures.csv"), index_col=0)["value"]
    return pd.concat(figures)
