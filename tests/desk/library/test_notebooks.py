"""The notebooks of docs/notebooks, run in an empty folder, and their outputs, which `python -m` of this keeps."""

import re
from collections.abc import Iterable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import nbformat
import pytest
from nbclient import NotebookClient

FOLDER = Path(__file__).parents[3] / "docs" / "notebooks"
NOTEBOOKS = sorted(path.name for path in FOLDER.glob("*.ipynb"))
LARGEST = 1_500_000  # bytes of a file
PROGRESS = re.compile(r"^\w+: \d+%$", re.MULTILINE)  # said where a cell takes long, and nowhere else
OF_THIS_RUN = re.compile(r"(?<![\w<.])/\w[\w.-]*/|\b[A-Z]:\\|\b0x[0-9a-f]{6,}")  # absolute paths, and addresses


def kept(name: str) -> Any:
    return nbformat.read(FOLDER / name, nbformat.NO_CONVERT)


def run(name: str, folder: Path) -> Any:
    notebook = kept(name)
    NotebookClient(notebook, timeout=900, record_timing=False, resources={"metadata": {"path": folder}}).execute()
    for cell in (each for each in notebook.cells if each.cell_type == "code"):
        cell.outputs = [each for each in cell.outputs if not PROGRESS.search(texts([each]))]
    return notebook


def outputs_of(notebook: Any) -> list[Any]:
    return [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]


def kinds_of(notebook: Any) -> list[list[list[str]]]:
    return [
        [sorted(output.get("data", {output.output_type: None})) for output in cell.outputs]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def texts(outputs: Iterable[Any]) -> str:
    shown = (
        [output.get("text"), *(text for form, text in output.get("data", {}).items() if form[:5] == "text/")]
        for output in outputs
    )
    return "\n".join(str(text) for each in shown for text in each if text)


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
    fresh, before = run(name, tmp_path), kept(name)
    assert kinds_of(fresh) == kinds_of(before)
    for notebook in (fresh, before):
        outputs = outputs_of(notebook)
        assert shown in texts(outputs)
        assert any("image/png" in output.get("data", {}) for output in outputs)
        assert not [output for output in outputs if output.get("name") == "stderr"]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_what_is_kept_is_of_one_run_and_of_no_machine(name: str) -> None:
    notebook = kept(name)
    numbers = [cell.execution_count for cell in notebook.cells if cell.cell_type == "code"]
    assert numbers == list(range(1, len(numbers) + 1))
    assert not [output for output in outputs_of(notebook) if output.output_type == "error"]
    assert OF_THIS_RUN.findall(texts(outputs_of(notebook))) == []
    assert (FOLDER / name).stat().st_size < LARGEST


def main() -> None:
    for name in NOTEBOOKS:
        stated = kept(name).metadata  # not the Python that happens to be here
        with TemporaryDirectory() as folder:
            notebook = run(name, Path(folder))
        notebook.metadata = stated
        nbformat.write(notebook, FOLDER / name)


if __name__ == "__main__":
    main()
