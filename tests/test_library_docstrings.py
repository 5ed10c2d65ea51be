"""Public names of docs/library.md explain themselves: sentence, parameters, errors, shapes of arrays."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest
from numpydoc.validate import validate

OPTIONAL = ("ES01", "SA01", "EX01")  # further text, see also, examples
ROOT = Path(__file__).parents[1]
SHAPE = re.compile(r"\(\w+,( ?\w+(, ?\w+)*)?\)")  # (n,) or (n, 3)
ROW = re.compile(r"^\| [^|]+ \| `(observer_rt[\w.]*)` \| ([^|]+) \|$", re.MULTILINE)
LISTED = [
    (module, name)
    for module, names in ROW.findall((ROOT / "docs" / "library.md").read_text())
    for name in re.findall(r"`(\w+)`", names)
]


class Found(NamedTuple):
    """A definition and the module that has it."""

    module: str
    node: ast.stmt


@cache
def parsed(module: str) -> ast.Module:
    """Syntax tree of a module of the package."""
    path = ROOT.joinpath(*module.split("."))
    file = path.with_suffix(".py")
    return ast.parse((file if file.exists() else path / "__init__.py").read_text())


def definition(module: str, name: str) -> Found | None:
    """The function or class that a module means by a name, its own or imported from the package; None: neither."""
    for node in ast.walk(parsed(module)):
        match node:
            case ast.FunctionDef() | ast.ClassDef() if node.name == name and node in parsed(module).body:
                return Found(module, node)
            case ast.ImportFrom(module=str(source), names=names) if source.startswith("observer_rt."):
                for each in names:
                    if (each.asname or each.name) == name and not source.startswith("observer_rt.core"):
                        return definition(source, each.name)
    return None


def sentence(node: ast.stmt) -> str:
    """The docstring of a definition, empty where it has none."""
    return ast.get_docstring(node) or "" if isinstance(node, ast.FunctionDef | ast.ClassDef) else ""


def names_of(annotation: ast.expr | None) -> set[str]:
    """Names in an annotation, also in one that is a string."""
    if annotation is None:
        return set()
    if isinstance(annotation, ast.Constant) and isinstance(annotation.value, str):
        annotation = ast.parse(annotation.value, mode="eval").body
    return {each.id for each in ast.walk(annotation) if isinstance(each, ast.Name)}


def explains_itself(module: str, annotation: ast.expr | None) -> bool:
    """Whether a type is a path, or names a class of the package that has a docstring."""
    found = (definition(module, name) for name in names_of(annotation))
    return "Path" in names_of(annotation) or any(
        each is not None and isinstance(each.node, ast.ClassDef) and sentence(each.node) for each in found
    )


def is_mentioned(name: str, text: str) -> bool:
    """Whether a text names a parameter, or its words."""
    return re.search(rf"\b{name}\b|\b{name.replace('_', '[ -]')}\b", text) is not None


def objections(found: Found, about: str = "") -> Iterator[str]:
    """Objections to the docstrings of a definition. about: docstring of the class around it."""
    match found.node:
        case ast.ClassDef() as node:
            yield from _of_class(found.module, node)
        case ast.FunctionDef() as node:
            yield from _of_function(found.module, node, about)


def _first_sentence(name: str, text: str) -> Iterator[str]:
    first = text.split("\n\n")[0]
    if not re.match(r"[A-Z0-9`'(]", first) or first.rstrip()[-1] not in ".:":
        yield f"{name}: its docstring does not begin with a sentence: {first!r}"


def _of_class(module: str, node: ast.ClassDef) -> Iterator[str]:
    text = sentence(node)
    if not text:
        yield f"{node.name}: no docstring"
        return
    yield from _first_sentence(node.name, text)
    for each, after in zip(node.body, [*node.body[1:], None], strict=True):
        match each:
            case ast.AnnAssign(target=ast.Name(id=name)) if not name.startswith("_"):
                is_described = isinstance(after, ast.Expr)
                if not (is_described or is_mentioned(name, text) or explains_itself(module, each.annotation)):
                    yield f"{node.name}.{name}: not in the docstring"
            case ast.FunctionDef(name=name) if name == "__init__" or not name.startswith("_"):
                for one in objections(Found(module, each), text):
                    yield f"{node.name}.{one}"


def _of_function(module: str, node: ast.FunctionDef, about: str) -> Iterator[str]:
    text = sentence(node)
    if not text and node.name != "__init__":
        yield f"{node.name}: no docstring"
        return
    if node.name == "__init__":
        text += about
    else:
        yield from _first_sentence(node.name, text)
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]
    for each in arguments:
        known = each.arg in ("self", "cls") or is_mentioned(each.arg, text)
        if not known and not explains_itself(module, each.annotation):
            yield f"{node.name}: {each.arg} is not explained"
    raised = {ast.unparse(each.exc) for each in ast.walk(node) if isinstance(each, ast.Raise) and each.exc}
    says = re.search(r"[Rr]aises?(?:\s+-+)?\s+`?UserError", text)
    if any(each.startswith("UserError") for each in raised) and not says:
        yield f"{node.name}: does not say that it raises UserError"
    annotations = [*(each.annotation for each in arguments), node.returns]
    if any("NDArray" in names_of(each) for each in annotations) and not SHAPE.search(text):
        yield f"{node.name}: no shape of its arrays"


CALLS = (
    "Injector.load",
    "Injector.fit",
    "Injector.evaluate",
    "Injector.discover",
    "Observer",
    "Observer.feed",
)


@pytest.mark.parametrize("name", [*CALLS, "read", "to_frame", "in_si", "simulate"])
def test_a_call_of_the_library_has_its_sections(name: str) -> None:
    """Parameters, results and errors as numpydoc has them, for notebooks and the site."""
    found = validate(f"observer_rt.{name}")["errors"]
    assert [error for error in found if error[0] not in OPTIONAL] == []


@pytest.mark.parametrize(("module", "name"), LISTED)
def test_a_public_name_explains_itself(module: str, name: str) -> None:
    found = definition(module, name)
    assert found is not None, f"{module} has no {name}"
    assert list(objections(found)) == []


def test_every_row_of_the_table_is_read() -> None:
    rows = (ROOT / "docs" / "library.md").read_text().count("| `observer_rt")
    assert len({module for module, _ in LISTED}) == rows > 0
