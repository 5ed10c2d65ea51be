"""Functions without an entry from Python, and those that are compiled apart from their callers."""

import ast
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from numba import njit

from observer_rt.foundation.compiled import separate

ROOT = Path(__file__).parents[2]
WITHOUT_ENTRY = ("inner", "inner_inlined", "inner_separate", "addressed")
SEPARATE = ("separate", "inner_separate")
HANDED_ON = ("bind", "OwnStep")  # they take functions that compiled code calls
COMPILED = (
    "njit",
    "compiled",
    "inlined",
    *WITHOUT_ENTRY,
    *SEPARATE,
    "overload",
    "intrinsic",
    "register_jitable",
)
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
    if isinstance(node, ast.FunctionDef) and is_decorated(node, WITHOUT_ENTRY)
}
CALLED_AND_CALLER = """
from numba import njit
from observer_rt.foundation.compiled import inner, inner_separate, separate

@inner_separate
def total(values, first):
    if first < 0:
        raise ValueError("first must not be negative")
    result = 0.0
    for value in values[first:]:
        result += value
    return result

@separate
def twice(values, first):
    return 2.0 * total(values, first)

@inner
def held(values, first):
    return twice(values, first) + 1.0

@njit(cache=True)
def more(values, first):
    return held(values, first)

@njit(cache=True)
def most(values, first):
    return held(values, first) + 1.0
"""
USER = """
import sys
import numpy as np
import observer_rt
import called_and_caller as code

for name in sys.argv[1:]:
    function = getattr(code, name)
    print(name, function(np.arange(5.0), 2), sum(function.stats.cache_misses.values()))
    try:
        function(np.arange(5.0), -1)
    except ValueError as error:
        print(error)
"""


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
        if is_decorated(node, COMPILED) or (
            isinstance(node, ast.Call) and ast.unparse(node.func) in HANDED_ON
        ):
            continue
        waiting += ast.iter_child_nodes(node)
        if isinstance(node, ast.Name):
            yield imported.get(node.id, f"{module_of(path)}.{node.id}")
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            yield f"{imported.get(node.value.id, node.value.id)}.{node.attr}"


@pytest.mark.slow
def test_code_that_was_kept_finds_what_it_calls(tmp_path: Path) -> None:
    (tmp_path / "called_and_caller.py").write_text(CALLED_AND_CALLER)
    (tmp_path / "user.py").write_text(USER)
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": f"{ROOT}:{tmp_path}"}
    for name in ("NUMBA_CACHE_DIR", "NUMBA_CACHE_LOCATOR_CLASSES"):
        environment.pop(name, None)

    def said(*names: str) -> list[str]:
        command = [sys.executable, str(tmp_path / "user.py"), *names]
        return subprocess.check_output(command, env=environment, text=True).splitlines()

    raised = "first must not be negative"
    assert said("more") == ["more 19.0 1", raised]
    assert said("most") == ["most 20.0 1", raised]  # holds what was kept, which calls what is apart
    assert said("most", "twice") == ["most 20.0 0", raised, "twice 18.0 0", raised]
    assert said("more") == ["more 19.0 0", raised]


@pytest.mark.parametrize(("decorator", "is_held"), [(njit, True), (separate, False)])
def test_a_caller_does_not_hold_what_is_compiled_apart(decorator: Callable[..., Any], is_held: bool) -> None:
    @decorator
    def called(value: float) -> float:
        return math.sin(value)

    @njit
    def caller(value: float) -> float:
        return float(called(value))

    assert caller(0.5) == math.sin(0.5)
    (code,) = caller.inspect_llvm().values()
    assert ("@llvm.sin" in code or "@sin(" in code) == is_held


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
