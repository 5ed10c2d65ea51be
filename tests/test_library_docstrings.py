"""Public names of docs/library.md explain themselves."""

import importlib
import inspect
import re
from pathlib import Path

import pytest
from numpydoc.validate import validate

import observer_rt

OPTIONAL = ("ES01", "SA01", "EX01")  # further text, see also, examples
ROOT = Path(__file__).parents[1]
ROW = re.compile(r"^- [^`]+, `(observer_rt[\w.]*)`: (.+)$", re.MULTILINE)
LISTED = [
    (module, name)
    for module, names in ROW.findall((ROOT / "docs" / "library.md").read_text())
    for name in re.findall(r"`(\w+)`", names)
]
CALLS = [
    f"{name}.{method}"
    for name in observer_rt.__all__
    for method, call in vars(getattr(observer_rt, name)).items()
    if method[0] != "_" and len(inspect.signature(call).parameters if callable(call) else ()) > 1
]


@pytest.mark.parametrize("name", [*CALLS, "Injector.load", "Observer", "read", "to_frame", "simulate"])
def test_a_call_of_the_library_has_its_sections(name: str) -> None:
    """Parameters, results and errors as numpydoc has them, for notebooks and the site."""
    errors = validate(f"observer_rt.{name}")["errors"]
    assert [error for error in errors if error[0] not in OPTIONAL] == []


@pytest.mark.parametrize(("module", "name"), LISTED)
def test_a_public_name_has_a_docstring(module: str, name: str) -> None:
    attribute = getattr(importlib.import_module(module), name)
    if inspect.isclass(attribute) or inspect.isfunction(attribute):
        assert (attribute.__doc__ or "").strip()
