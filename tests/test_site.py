"""The site of docs/: built without a warning, complete in its generated pages, fetching nothing from elsewhere."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.pages import ROOT, Page
from tools.lib.docs_site.hook import command_help

CONFIGURATION = ROOT / "tools/lib/docs_site/mkdocs.yml"
FETCHED = re.compile(r"<(?:script|link|img|iframe|source)\b[^>]*\b(?:src|href)=\"?(?:https?:)?//[^>]*>")


@pytest.mark.slow
def test_the_site_is_built_without_a_warning_and_fetches_nothing(tmp_path: Path) -> None:
    built = subprocess.run(  # --strict: a link into nothing is an error
        [sys.executable, *["-m", "mkdocs", "build", "--strict", "-f"], str(CONFIGURATION), "-d", str(tmp_path)],
        env=os.environ | {"PYTHONPATH": f"{ROOT}", "NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    pages = {path.name: path.read_text(encoding="utf-8") for path in tmp_path.rglob("*.html")}
    assert {"index.html", "tutorial.html", "bench-file.html", "api.html", "commands.html"} <= set(pages)
    fetched = [tag for text in pages.values() for tag in FETCHED.findall(text) if 'rel="canonical"' not in tag]
    assert fetched == []
    assert re.search(r'src="wear_\d+_\d+\.png"', pages["wear.html"])
    assert 'href="notebooks/wear.html"' in pages["library.html"]
    assert 'id="observer_rt.config.bench.load_bench"' in pages["api.html"]


def test_every_command_has_its_help_and_its_row() -> None:
    run = command_help().split("### observer-rt run\n")[1].split("\n### ")[0]
    assert "--view" in run
    assert "Example: observer-rt run --bench bench.toml" in run
    assert set(re.findall(r"^### observer-rt ([\w-]+)", command_help(), re.MULTILINE)) == set(
        re.findall(r"^- \[`([\w-]+)`\]", Page("docs/commands.md").text, re.MULTILINE)
    )
