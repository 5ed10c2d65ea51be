"""The site of docs/: what is generated is complete, every page has its place, and a link into nothing is found."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.pages import ROOT, Page
from tools.lib.docs_site.links import objections
from tools.lib.docs_site.notebooks import notebook_page
from tools.lib.docs_site.pages import api, bench_file, options, places, section_of, words_of_example

CONFIGURATION = ROOT / "tools/lib/docs_site/mkdocs.yml"


def built(into: Path) -> subprocess.CompletedProcess[str]:
    """Build the site as tools/docs does."""
    return subprocess.run(
        [sys.executable, *["-m", "mkdocs", "build", "--strict", "-f"], str(CONFIGURATION), "-d", str(into)],
        env=os.environ
        | {"PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tools/lib'}", "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_every_link_leads_somewhere(tmp_path: Path) -> None:
    done = built(tmp_path)
    assert done.returncode == 0, done.stderr
    assert list(objections(tmp_path)) == []
    pages = {path.name for path in tmp_path.glob("*.html")}
    assert {"index.html", "tutorial.html", "bench-file.html", "api.html", "commands.html"} <= pages
    assert 'src="wear_1.png"' in (tmp_path / "notebooks" / "wear.html").read_text(encoding="utf-8")
    assert 'href="notebooks/wear.html"' in (tmp_path / "library.html").read_text(encoding="utf-8")
    assert 'id="observer_rt.config.bench.load_bench"' in (tmp_path / "api.html").read_text(encoding="utf-8")


def test_every_key_of_the_bench_file_is_listed_with_words() -> None:
    words, page = words_of_example(), bench_file()
    assert len(list(places())) > 20
    for place in places():
        for key, field in place.model.model_fields.items():
            if section_of(field.annotation) is None:
                assert f"`{place.written}`" in page
                assert words.of(place.written.strip("[]"), key), f"{place.written} {key}"


def test_a_key_has_its_limits_default_and_words() -> None:
    (row,) = (line for line in bench_file().splitlines() if line.startswith("| `event_gap_ms`"))
    assert row == (
        "| `event_gap_ms` | a number from 2 to 50 ms | `10` "
        "| needle openings within this are one event (pilot, main, post) |"
    )


def test_every_option_of_a_command_is_listed() -> None:
    run = options().split("### observer-rt run\n")[1].split("\n### ")[0]
    assert "| `--view` | Show the live terminal view. |" in run
    assert "    observer-rt run --bench bench.toml --state learned.json" in run
    assert set(re.findall(r"^### observer-rt ([\w-]+)", options(), re.MULTILINE)) == set(
        re.findall(r"^\| `observer-rt ([\w-]+)` \|", Page("docs/commands.md").text, re.MULTILINE)
    )


def test_the_library_is_listed_as_its_page_has_it() -> None:
    rows = Page("docs/library.md").text.count("| `observer_rt")
    assert api().count("\n## ") == rows > 0
    assert "::: observer_rt.desk.evaluation.evaluate.evaluate\n" in api()


NOTEBOOK = {
    "cells": [
        {"cell_type": "markdown", "source": ["# A heading\n", "\n", "Words, [more](../fit.md)."]},
        {
            "cell_type": "code",
            "source": ["print(1)\n", "figure"],
            "outputs": [
                {"output_type": "stream", "name": "stdout", "text": ["1\n"]},
                {"output_type": "display_data", "data": {"image/png": "AAEC", "text/plain": ["<Figure>"]}},
                {
                    "output_type": "execute_result",
                    "data": {
                        "text/html": [
                            "<div>\n<style scoped>\n.x {}\n</style>\n",
                            '<table border="1">\n</table></div>',
                        ]
                    },
                },
            ],
        },
    ]
}


def test_a_notebook_is_a_page_with_what_it_showed(tmp_path: Path) -> None:
    path = tmp_path / "some.ipynb"
    path.write_text(json.dumps(NOTEBOOK))
    page = notebook_page(path)
    assert page.pictures == {"some_1.png": b"\x00\x01\x02"}
    lines = [line for line in page.markdown.splitlines() if line]
    assert lines[0] == "# A heading"
    assert "(some.ipynb)" in lines[1]
    assert lines[2:] == [
        "Words, [more](../fit.md).",
        *("```python", "print(1)", "figure", "```", "```text", "1", "```"),
        "![What the program draws](some_1.png)",
        *("<div>", "<table>", "</table></div>"),
    ]


@pytest.mark.parametrize(
    ("target", "problem"),
    [
        ("other.html#there", ""),
        ("other.html#elsewhere", "there is no such anchor"),
        ("nowhere.html", "there is no such file"),
        ("https://example.org/", ""),
    ],
)
def test_a_link_into_nothing_is_found(target: str, problem: str, tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text(f'<a href="{target}">link</a>')
    (tmp_path / "other.html").write_text('<h2 id="there">heading</h2>')
    found = [each.rpartition(": ")[2] for each in objections(tmp_path)]
    assert found == ([problem] if problem else [])


def test_what_is_fetched_from_elsewhere_is_found(tmp_path: Path) -> None:
    (tmp_path / "page.html").write_text('<script src="https://example.org/some.js"></script>')
    (found,) = objections(tmp_path)
    assert found.endswith("is fetched from elsewhere")
