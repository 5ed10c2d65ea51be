"""The site of docs/: built without a warning, complete in its generated pages, fetching nothing from elsewhere."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.pages import ROOT, Page
from tools.lib.docs_site.hook import api, bench_file, command_help, notebook

CONFIGURATION = ROOT / "tools/lib/docs_site/mkdocs.yml"
FETCHED = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)=\"?(?:https?:)?//[^>]*>")
PICTURE = "iVBORw0KGgo="


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    built = subprocess.run(  # --strict: a link into nothing is an error
        [
            sys.executable,
            *["-m", "mkdocs", "build", "--strict", "-f"],
            str(CONFIGURATION),
            "-d",
            str(tmp_path),
        ],
        env=os.environ | {"PYTHONPATH": f"{ROOT}", "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    pages = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.html")}
    assert {"index.html", "tutorial.html", "bench-file.html", "api.html", "commands.html"} <= set(pages)
    fetched = [
        tag for text in pages.values() for tag in FETCHED.findall(text) if 'rel="canonical"' not in tag
    ]
    assert fetched == []
    assert re.search(r'src="wear_\d+_\d+\.png"', pages["wear.html"])
    assert 'href="notebooks/wear.html"' in pages["library.html"]
    assert 'id="observer_rt.config.bench.load_bench"' in pages["api.html"]


def test_every_command_has_its_help_and_its_row() -> None:
    run = command_help().split("### observer-rt run\n")[1].split("\n### ")[0]
    assert "--view" in run
    assert "Example: observer-rt run --bench bench.toml" in run
    assert set(re.findall(r"^### observer-rt ([\w-]+)", command_help(), re.MULTILINE)) == set(
        re.findall(r"^\| `observer-rt ([\w-]+)` \|", Page("docs/commands.md").text, re.MULTILINE)
    )


def test_the_bench_file_page_is_the_example() -> None:
    assert "event_gap_ms = 10" in bench_file()


def test_the_library_is_listed_as_its_page_has_it() -> None:
    rows = Page("docs/library.md").text.count("| `observer_rt")
    assert api().count("\n## ") == rows > 0
    assert "::: observer_rt.desk.evaluation.evaluate.evaluate\n" in api()


def test_a_notebook_is_a_page_with_its_outputs(tmp_path: Path) -> None:
    code = {"cell_type": "code", "metadata": {}, "execution_count": 1, "source": ["print(1)"]}
    outputs = [
        {"output_type": "stream", "name": "stdout", "text": ["1\n"]},
        {"output_type": "display_data", "metadata": {}, "data": {"image/png": PICTURE}},
    ]
    heading = {"cell_type": "markdown", "metadata": {}, "source": ["# A heading\n", "\n", "Words."]}
    path = tmp_path / "some.ipynb"
    cells = [heading, code | {"outputs": outputs}]
    path.write_text(json.dumps({"cells": cells, "metadata": {}, "nbformat": 4, "nbformat_minor": 2}))
    markdown, pictures = notebook(path)
    assert markdown.startswith("# A heading\n\n*Made of [some.ipynb]")
    ((name, content),) = pictures.items()
    assert content.startswith(b"\x89PNG")
    assert f"]({name})" in markdown
    assert "print(1)" in markdown
