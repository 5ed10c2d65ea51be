"""The notebooks of docs/notebooks, run in an empty folder."""

from pathlib import Path
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[3] / "docs" / "notebooks"


def run(name: str, folder: Path) -> list[Any]:
    """Outputs of a notebook's cells, in order. Raises CellExecutionError for a cell that fails."""
    notebook = nbformat.read(FOLDER / name, nbformat.NO_CONVERT)
    NotebookClient(notebook, timeout=900, resources={"metadata": {"path": folder}}).execute()
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def texts(outputs: list[Any]) -> str:
    """What a reader sees of outputs, but for pictures."""
    return "\n".join(
        str(output.get("text") or output.get("data", {}).get("text/plain", "")) for output in outputs
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("fit.ipynb", "adequate: chi2"),
        ("wear.ipynb", "1. injection, change [%]"),
        ("missing_effect.ipynb", "named: orifice_area"),
        ("live_bus.ipynb", "true mass [mg]"),
    ],
)
def test_a_notebook_shows_what_it_is_about(name: str, shown: str, tmp_path: Path) -> None:
    outputs = run(name, tmp_path)
    assert shown in texts(outputs)
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output for output in outputs if output.get("name") == "stderr"]


def test_every_notebook_is_run() -> None:
    named = test_a_notebook_shows_what_it_is_about.pytestmark[0].args[1]  # type: ignore[attr-defined]
    assert {name for name, _ in named} == {path.name for path in FOLDER.glob("*.ipynb")}
