"""The bench of the page on several injectors, and what its user has beside it."""

import re
from collections.abc import Iterator
from pathlib import Path

from observer_rt.config.bench import NOMINAL_INJECTOR, PACKAGE_DATA
from tests.pages import Page
from tests.three_injectors import with_copies

PAGE = Page("docs/several-injectors.md")
NAMES = ("left", "right")


def write_bench(folder: Path) -> None:
    (folder / "engine.toml").write_text(PAGE.fenced("toml")[0])
    (folder / "right.toml").write_text(NOMINAL_INJECTOR.read_text())


def make_log() -> Iterator[list[str]]:
    """Arguments of commands that simulate each injector, and make a log of its devices."""
    for name, wear in zip(NAMES, ("0.3", "0.1"), strict=True):
        yield ["simulate", "--injections", "4", "--effect", f"orifice_area:v_H={wear}", "--output", f"{name}.csv"]
        yield ["convert", f"{name}.csv", f"{name}.log", "--bench", "engine.toml", "--injector", name]


def merge_logs(folder: Path) -> None:
    """The frames of all devices in `engine.log`; the rail pressure is that of the first."""
    lines = [
        line
        for name in NAMES
        for line in (folder / f"{name}.log").read_text().splitlines(keepends=True)
        if name == NAMES[0] or " can0 " not in line
    ]
    (folder / "engine.log").write_text("".join(sorted(lines, key=lambda line: float(line[1 : line.index(")")]))))


def on_one_bus(folder: Path) -> str:
    """The bench file with the page's sections for one bus; writes the database."""
    bench, part = PAGE.fenced("toml")
    text = re.sub(r"\[links\.\w+\]\nchannel.*\n|^link = .*\n", "", bench, flags=re.MULTILINE)
    lift, outputs = part.split("[outputs]\n")
    text = re.sub(r"\[signals.needle_lift\]\n(?:\w.*\n)+", lift, text)
    text = text.replace("[outputs]\n", f"[outputs]\n{outputs}").replace("observer_fd.dbc", "engine.dbc")
    named = {900 + number: f"NeedleLift_{name}" for number, name in enumerate(NAMES)}
    (folder / "engine.dbc").write_text(with_copies((PACKAGE_DATA / "observer_fd.dbc").read_text(), {273: named}))
    return text
