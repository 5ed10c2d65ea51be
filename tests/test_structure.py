"""A class name stands for one thing, and no modules import each other: a reader who searches finds one place."""

import ast
from collections import Counter
from pathlib import Path

import grimp

PACKAGE = Path(__file__).parents[1] / "observer_rt"


def test_every_class_name_exists_once() -> None:
    names = Counter(
        node.name
        for path in PACKAGE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text("utf-8")))
        if isinstance(node, ast.ClassDef)
    )
    assert [name for name, count in names.items() if count > 1] == []


def test_no_modules_import_each_other_not_even_for_type_checkers() -> None:
    graph = grimp.build_graph(PACKAGE.name, exclude_type_checking_imports=False, cache_dir=None)
    assert not {package: found for package in graph.modules if (found := graph.nominate_cycle_breakers(package))}
    for module in graph.find_modules_that_directly_import(PACKAGE.name):  # compiled ones are taken for it
        for statement in graph.get_import_details(importer=module, imported=PACKAGE.name):
            assert not statement["line_contents"].startswith(f"from {PACKAGE.name} import")
