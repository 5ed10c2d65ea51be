"""The stubs of the compiled core state what its modules have."""

import ast
import importlib
import inspect
from pathlib import Path
from types import ModuleType

import pytest

import observer_rt.core

CORE = Path(observer_rt.core.__file__).parent
STUBS = sorted(CORE.rglob("*.pyi"))


def module_of(stub: Path) -> ModuleType:
    parts = stub.relative_to(CORE).with_suffix("").parts
    return importlib.import_module(".".join(("observer_rt.core", *parts)))


def public(names: list[str]) -> set[str]:
    return {name for name in names if not name.startswith("_")}


def parameters_of(function: ast.FunctionDef) -> list[str]:
    return [argument.arg for argument in function.args.args if argument.arg != "self"]


def test_every_module_has_one() -> None:
    assert {stub.with_suffix(".pyx") for stub in STUBS} == set(CORE.rglob("*.pyx"))


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.stem)
def test_a_stub_names_what_there_is(stub: Path) -> None:
    module, tree = module_of(stub), ast.parse(stub.read_text())
    stated = [node for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)]
    constants = [
        node.target.id
        for node in tree.body
        if isinstance(node, ast.AnnAssign)
        if isinstance(node.target, ast.Name)
    ]
    there = {
        name
        for name, value in vars(module).items()
        if getattr(value, "__module__", None) == module.__name__
        or isinstance(value, int | float | tuple | dict)
    }
    assert public([node.name for node in stated] + constants) == public(list(there))
    assert ast.get_docstring(tree) == str(module.__doc__).splitlines()[0]


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.stem)
def test_functions_take_what_a_stub_states(stub: Path) -> None:
    module, tree = module_of(stub), ast.parse(stub.read_text())
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            function = getattr(module, node.name)
            assert list(inspect.signature(function).parameters) == parameters_of(node), node.name
            assert inspect.getdoc(function), node.name
        elif isinstance(node, ast.ClassDef):
            methods = [each.name for each in node.body if isinstance(each, ast.FunctionDef)]
            assert all(hasattr(getattr(module, node.name), name) for name in methods), node.name
