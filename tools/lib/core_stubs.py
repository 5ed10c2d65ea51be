"""Writes stubs (.pyi) of the compiled core's modules, for type checks, from each .pyx and the files it includes.

usage: core_stubs.py [SOURCE.pyx STUB.pyi]...
"""

import re
import sys
from pathlib import Path

HEAD = """from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

{imports}

"""
RECORDS = "RECORDS: Mapping[str, tuple[memoryview, Mapping[str, Any]]]"
NUMBERS = {"double": "float", "int": "int", "int64_t": "int", "uint64_t": "int", "bint": "bool", "": "Any"}
ELEMENTS = {
    "double": "np.float64",
    "int64_t": "np.int64",
    "int8_t": "np.int8",
    "uint8_t": "np.uint8",
    "unsigned char": "np.bool_",
}
INCLUDE = re.compile(r'^include "(.+)"$', re.MULTILINE)
CIMPORT = re.compile(r"^from (\S+) cimport ([^()\n]+$|\([^)]+\))", re.MULTILINE)
EXPORTED = re.compile(r"^globals\(\)\.update\((.+?)\)$", re.MULTILINE | re.DOTALL)
DOUBLE = re.compile(r"^cdef double(\[\w+\])? (\w+) =", re.MULTILINE)
DECLARED = re.compile(
    r"^cdef class (?P<name>\w+)(?P<base>\(\w+\))?:$"
    r"|^(?P<indent>    |)def (?P<function>__init__|[a-z]\w*)\((?P<parameters>.*?)\) -> (?P<result>.+?):$",
    re.MULTILINE | re.DOTALL,
)
PARAMETER = re.compile(r"(?:const )?(?:(unsigned char|\w+)(\[.+\])? )?(\w+)(?:=(.+))?", re.DOTALL)


def stub_of(source: Path) -> str:
    """Text of the stub of a module."""
    text = INCLUDE.sub(lambda part: (source.parent / part[1]).read_text(), source.read_text())
    lines = _constants(text, source.parent)
    lines += [RECORDS] if "\nRECORDS = {" in text else []
    is_public = True
    for match in DECLARED.finditer(text):
        if match["name"]:
            is_public = not match["name"].startswith("_")
            if is_public:
                lines.append(f'class {match["name"]}{match["base"] or ""}:\n    """Compiled."""')
        elif is_public or not match["indent"]:
            declared = re.split(r",\s+(?=[A-Za-z])", match["parameters"].strip(" \n,"))
            parameters = ", ".join(map(_parameter, declared))
            lines.append(f"{match['indent']}def {match['function']}({parameters}) -> {match['result']}: ...")
    header = source.with_suffix(".pxd")
    classes = {
        f"from {module} import {name}"
        for module, names in CIMPORT.findall(text + (header.read_text() if header.is_file() else ""))
        for name in re.findall(r"\w+", names)
        if any(re.search(rf"(: |\(){name}\b", line) for line in lines)
    }
    return HEAD.format(imports="\n".join(sorted(classes))) + "\n".join(lines) + "\n"


def _constants(text: str, folder: Path) -> list[str]:
    """Constants that a module exports by `globals().update`: a `double`, an array of them, or else a whole number."""
    sources = "".join(path.read_text() for path in folder.glob("*.p*"))
    kinds = {name: "tuple[float, ...]" if array else "float" for array, name in DOUBLE.findall(sources)}
    arguments = re.findall(r"\b([A-Z]\w*)=(?:tuple\(|\()?(\w+)", "".join(EXPORTED.findall(text)))
    return [f"{name}: {kinds.get(value, 'int')}" for name, value in arguments]


def _parameter(declared: str) -> str:
    """A parameter of a Cython function as Python declares it."""
    match = PARAMETER.fullmatch(declared)
    assert match, declared
    kind, array, name, default = match.groups()
    if name == "self":
        return name
    kind = f"NDArray[{ELEMENTS.get(kind, 'np.void')}]" if array else NUMBERS.get(kind or "", kind)
    if default == "None" and kind != "Any":
        kind += " | None"
    return f"{name}: {kind}{' = ...' if default else ''}"


if __name__ == "__main__":
    for module, stub in zip(sys.argv[1::2], sys.argv[2::2], strict=True):
        Path(stub).write_text(stub_of(Path(module)))
