"""Sections of a bench file on the pages are read as those of the example."""

import tomllib
from pathlib import Path

import pytest

from observer_rt.config.bench import EXAMPLE_BENCH
from observer_rt.config.bench_file import read_buses
from observer_rt.config.injector_sections import InjectorConfig
from observer_rt.config.toml_file import validated
from tests.pages import Page


@pytest.mark.parametrize("page", ["docs/time.md", "docs/evidence.md"])
def test_sections_are_those_of_a_bench_file(page: str) -> None:
    bench = tomllib.loads(EXAMPLE_BENCH.read_text(encoding="utf-8"))
    (block,) = Page(page).fenced("toml")
    for name, section in tomllib.loads(block).items():
        for key, value in section.items():
            before = bench.setdefault(name, {}).get(key)
            bench[name][key] = {**before, **value} if isinstance(before, dict) else value
    read_buses(Path(page), bench)
    validated(InjectorConfig, bench, lambda *place: f"{page}: {place}", "bench")
