"""The files of docs/own-injector.md, for the tests that run its commands."""

import re
import shutil
import tomllib
from pathlib import Path

from tests.pages import ROOT, Page

PAGE = Page("docs/own-injector.md")
PRINT_BENCH = "observer-rt run --print-example-bench > bench.toml"


def write_files(folder: Path) -> None:
    shutil.copy(ROOT / "docs/own-injector/plant.toml", folder)
    for name, text in zip(("masses.csv", "map.csv"), PAGE.fenced("csv"), strict=True):
        (folder / name).write_text(text)


def change_bench(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    for section, keys in tomllib.loads(PAGE.fenced("toml")[0]).items():
        for key, value in keys.items():
            before, heading, after = text.partition(f"\n[{section}]")
            assert heading, section
            changed, count = re.subn(
                rf'^(?:# )?{key} = "[^"]*"', f'{key} = "{value}"', after, count=1, flags=re.MULTILINE
            )
            assert count == 1, key
            text = before + heading + changed
    path.write_text(text, encoding="utf-8")
