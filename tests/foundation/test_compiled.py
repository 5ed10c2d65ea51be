"""Functions without an entry from Python are named by compiled code only: called from Python they would crash."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
COMPILED = ("njit", "inner", "overload", "intrinsic", "register_jitable")
SOURCES = {
    path: ast.parse(path.read_text("utf-8"))
    for folder in ("observer_rt", "tests", "tools")
    for path in (ROOT / folder).rglob("*.py")
}


def module_of(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts)


def is_decorated(node: ast.AST, names: tuple[str, ...]) -> bool:
    return isinstance(node, ast.FunctionDef) and any(
        ast.unparse(one).split("(")[0] in names for one in node.decorator_list
    )


INNER = {
    f"{module_of(path)}.{node.name}"
    for path, tree in SOURCES.items()
    for node in tree.body
    if isinstance(node, ast.FunctionDef) and is_decorated(node, ("inner",))
}


def names_in_python(path: Path, tree: ast.Module) -> Iterator[str]:
    """Full names of what a module names outside compiled functions."""
    imported = {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if is_decorated(node, COMPILED):
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Name):
            yield imported.get(node.id, f"{module_of(path)}.{node.id}")
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield f"{imported.get(node.value.id, node.value.id)}.{node.attr}"


def test_there_are_such_functions() -> None:
    assert len(INNER) > 100


@pytest.mark.parametrize("folder", ["observer_rt", "tests", "tools"])
def test_python_names_none_of_them(folder: str) -> None:
    found = {
        str(path.relative_to(ROOT)): sorted(INNER.intersection(names_in_python(path, tree)))
        for path, tree in SOURCES.items()
        if path.is_relative_to(ROOT / folder)
    }
    assert {path: names for path, names in found.items() if names} == {}
