"""Descriptions in an FMU: its variables, what they are and how they begin; files to be compiled."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from observer_rt import __version__
from observer_rt.desk.export.frozen import Frozen

UNITS: Mapping[str, Mapping[str, str]] = {
    "s": {"s": "1"},
    "m": {"m": "1"},
    "Pa": {"kg": "1", "m": "-1", "s": "-2"},
    "m3/s": {"m": "3", "s": "-1"},
}


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU; its place in the list is its value reference, behind the time. unit: "": 0 or 1."""

    name: str
    unit: str
    causality: str
    meaning: str


def _state(name: str, of: str) -> Iterator[FmuVariable]:
    yield FmuVariable(f"{name}_line_pressure", "Pa", "output", f"line pressure of {of}")
    yield FmuVariable(f"{name}_line_flow", "m3/s", "output", f"flow into the line's closed end, of {of}")
    yield FmuVariable(f"{name}_sac_pressure", "Pa", "output", f"sac pressure of {of}")


CONTENTS: Mapping[str, Sequence[FmuVariable]] = {
    "observer": (
        FmuVariable("rail_pressure", "Pa", "input", "measured rail pressure"),
        FmuVariable("needle_lift", "m", "input", "measured needle lift"),
        FmuVariable("line_pressure", "Pa", "input", "measured line pressure; not a number: none"),
        FmuVariable("lift_zero", "m", "parameter", "lift that is measured of a shut needle"),
        FmuVariable("injection_rate", "m3/s", "output", "injection rate, 0 while it is not valid"),
        FmuVariable("innovation", "Pa", "output", "measured line pressure less that of the observer"),
        *_state("observed", "the observer"),
        *_state("followed", "the identification system"),
        FmuVariable("is_valid", "", "output", "the observer has settled"),
        FmuVariable("is_open", "", "output", "the needle is open"),
    ),
    "injector": (
        FmuVariable("rail_pressure", "Pa", "input", "true rail pressure"),
        FmuVariable("needle_lift", "m", "input", "true needle lift"),
        FmuVariable("injection_rate", "m3/s", "output", "injection rate"),
        FmuVariable("line_pressure", "Pa", "output", "line pressure at the closed end"),
        FmuVariable("line_flow", "m3/s", "output", "flow into the line's closed end"),
        FmuVariable("sac_pressure", "Pa", "output", "sac pressure"),
        FmuVariable("recorded_line_pressure", "Pa", "output", "line pressure as its sensor shows it"),
    ),
}


def model_description(
    frozen: Frozen, content: str, version: int, token: str, compiled: Sequence[str]
) -> bytes:
    """`modelDescription.xml` of FMI 2.0 or 3.0; compiled: names of the sources."""
    return _xml(
        _version_2(frozen, content, token, compiled) if version == 2 else _version_3(frozen, content, token)
    )


def build_description(content: str, compiled: Sequence[str]) -> bytes:
    """`buildDescription.xml` of FMI 3.0."""
    return _xml(_build(content, compiled))


def _xml(root: Element) -> bytes:
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, "utf-8", xml_declaration=True))


def _root(frozen: Frozen, content: str, version: str, token: str) -> Element:
    attributes = {
        "fmiVersion": version,
        "modelName": f"{content} of {frozen.name}",
        "guid" if version == "2.0" else "instantiationToken": token,
        "generationTool": f"observer-rt {__version__}",
    }
    return Element("fmiModelDescription", attributes)


def _add_units(root: Element, frozen: Frozen) -> None:
    units = SubElement(root, "UnitDefinitions")
    for name, powers in UNITS.items():
        SubElement(SubElement(units, "Unit", name=name), "BaseUnit", dict(powers))
    SubElement(root, "DefaultExperiment", startTime="0", stepSize=repr(frozen.constants.interval))


def _start(variable: FmuVariable, frozen: Frozen) -> str:
    """Where it begins: pressures at that of the chamber."""
    return repr(frozen.constants.coefficients.chamber_pressure) if variable.unit == "Pa" else "0.0"


def _variability(variable: FmuVariable) -> str:
    if variable.causality == "parameter":
        return "tunable"
    return "continuous" if variable.unit else "discrete"


def _described(one: FmuVariable, reference: int) -> dict[str, str]:
    """Attributes of a variable, the same in both versions."""
    return {
        "name": one.name,
        "valueReference": str(reference),
        "causality": one.causality,
        "variability": _variability(one),
        "description": one.meaning,
    }


def _version_2(frozen: Frozen, content: str, token: str, compiled: Sequence[str]) -> Element:
    root = _root(frozen, content, "2.0", token)
    kind = SubElement(
        root, "CoSimulation", modelIdentifier=content, canHandleVariableCommunicationStepSize="true"
    )
    files = SubElement(kind, "SourceFiles")
    for name in compiled:
        SubElement(files, "File", name=name)
    _add_units(root, frozen)
    variables, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    outputs, unknowns = SubElement(structure, "Outputs"), SubElement(structure, "InitialUnknowns")
    for reference, one in enumerate(CONTENTS[content], 1):
        entry = SubElement(variables, "ScalarVariable", _described(one, reference))
        value = SubElement(entry, "Real", unit=one.unit) if one.unit else SubElement(entry, "Boolean")
        if one.causality != "output":
            value.set("start", _start(one, frozen))
        else:
            SubElement(outputs, "Unknown", index=str(reference))
            SubElement(unknowns, "Unknown", index=str(reference))
    return root


def _version_3(frozen: Frozen, content: str, token: str) -> Element:
    root = _root(frozen, content, "3.0", token)
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=content,
        canHandleVariableCommunicationStepSize="true",
        fixedInternalStepSize=repr(frozen.constants.interval),
    )
    _add_units(root, frozen)
    variables, structure = SubElement(root, "ModelVariables"), SubElement(root, "ModelStructure")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    SubElement(variables, "Float64", time, unit="s")
    for reference, one in enumerate(CONTENTS[content], 1):
        entry = SubElement(variables, "Float64" if one.unit else "Boolean", _described(one, reference))
        if one.unit:
            entry.set("unit", one.unit)
        if one.causality != "output":
            entry.set("start", _start(one, frozen))
    for kind in ("Output", "InitialUnknown"):
        for number, one in enumerate(CONTENTS[content], 1):
            if one.causality == "output":
                SubElement(structure, kind, valueReference=str(number))
    return root


def _build(content: str, compiled: Sequence[str]) -> Element:
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    files = SubElement(
        SubElement(root, "BuildConfiguration", modelIdentifier=content), "SourceFileSet", language="C99"
    )
    for name in compiled:
        SubElement(files, "SourceFile", name=name)
    return root
