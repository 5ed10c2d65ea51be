"""Blocks of README and docs that are no command lines: each is run or read by a test, which is named here."""

import re
import tomllib

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.config.bench_file import BenchConfig
from observer_rt.config.toml_file import validated
from tests.pages import PAGES, Page, needs_bus, serves_a_page

LOOKED_AFTER = {  # blocks by page and language: how many, and the tests that have them
    ("docs/evidence.md", "toml"): (1, "tests/desk/cli/test_pages.py"),
    ("docs/library.md", "python"): (5, "tests/desk/cli/test_pages.py"),
    ("docs/measurement-tools.md", "python"): (2, "tests/files/test_foreign_readers.py"),
    ("docs/operating.md", "toml"): (1, "here"),
    ("docs/own-injector.md", "csv"): (1, "tests/own_injector.py"),
    ("docs/own-injector.md", "toml"): (2, "tests/own_injector.py"),
    ("docs/recordings.md", "toml"): (1, "tests/desk/cli/test_pages.py"),
    ("docs/several-injectors.md", "toml"): (2, "tests/several_injectors.py"),
    ("docs/terms.md", "toml"): (1, "tests/config/test_terms.py"),
    ("docs/time.md", "toml"): (1, "here"),
    ("docs/tutorial.md", "python"): (1, "tests/desk/cli/test_tutorial.py"),
    ("docs/tutorial.md", "toml"): (1, "tests/desk/cli/test_tutorial.py"),
}

RUN = {  # commands that need no bus, by page; the others: tests/daemon/test_on_vcan_pages.py
    "docs/buses.md": "tests/desk/cli/test_dbc_page.py",
    "docs/dbc.md": "tests/desk/cli/test_dbc_page.py",
    "docs/tutorial.md": "tests/desk/cli/test_tutorial.py",
} | dict.fromkeys(
    (
        "README.md",
        "docs/batch.md",
        "docs/discovery.md",
        "docs/evidence.md",
        "docs/fit.md",
        "docs/measurement-tools.md",
        "docs/own-injector.md",
        "docs/recordings.md",
        "docs/several-injectors.md",
    ),
    "tests/desk/cli/test_pages.py",
)


def test_the_commands_of_every_page_are_run() -> None:
    with_commands = {
        page.path
        for page in PAGES
        for line in page.commands
        if line.startswith("observer-rt ") and not needs_bus(line) and not serves_a_page(line)
    }
    assert with_commands == set(RUN)


def test_every_block_is_looked_after() -> None:
    counts: dict[tuple[str, str], int] = {}
    for page in PAGES:
        for language in re.findall(r"^ *```(\w+)$", page.text, re.MULTILINE):
            counts[page.path, language] = counts.get((page.path, language), 0) + 1
    assert counts == {key: count for key, (count, _) in LOOKED_AFTER.items()}


@pytest.mark.parametrize("page", ["docs/operating.md", "docs/time.md"])
def test_sections_are_those_of_a_bench_file(page: str) -> None:
    bench = tomllib.loads(EXAMPLE_BENCH.read_text(encoding="utf-8"))
    (block,) = Page(page).fenced("toml")
    for name, section in tomllib.loads(block).items():
        for key, value in section.items():
            before = bench.setdefault(name, {}).get(key)
            bench[name][key] = {**before, **value} if isinstance(before, dict) else value
    validated(BenchConfig, bench, lambda *place: f"{page}: {place}", "bench")
