"""modelDescription.xml of a tire: FMI 2 and FMI 3, its variables, units and what depends on what."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

if TYPE_CHECKING:
    from toolkit.tires.fmu.equations import TireEquations, Variable

FmiVersion = Literal["2", "3"]
VERSIONS: tuple[FmiVersion, ...] = ("2", "3")

# Exponents of SI; what is not here is named without them.
_BASE: Mapping[str, Mapping[str, str]] = {
    "1": {},
    "rad": {"rad": "1"},
    "m": {"m": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "s/m": {"m": "-1", "s": "1"},
    "1/rad": {"rad": "-1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "N*m": {"kg": "1", "m": "2", "s": "-2"},
    "Pa": {"kg": "1", "m": "-1", "s": "-2"},
}
_DEGREES = "57.29577951308232"


def description_text(
    equations: TireEquations,
    *,
    fmi: FmiVersion,
    identifier: str,
    token: str,
    notes: str,
    sources: tuple[str, ...],
) -> str:
    """Return modelDescription.xml; ``token`` is the identity that the binary knows too.

    FMI 2.0.4, 2.2; FMI 3.0, 2.4.
    """
    two = fmi == "2"
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0" if two else "3.0",
            "modelName": identifier,
            ("guid" if two else "instantiationToken"): token,
            "description": f"{equations.title}; ISO-W axes, SI. {notes}".strip(),
            "generationTool": "toolkit",
            "variableNamingConvention": "flat",
            **({"numberOfEventIndicators": "0"} if two else {}),
        },
    )
    for kind in ("ModelExchange", "CoSimulation"):
        _interface(root, kind, identifier, sources, two=two)
    _units(root, equations)
    categories = SubElement(root, "LogCategories")
    SubElement(categories, "Category", {"name": "logStatusError"})
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": "1", "stepSize": "0.01"})
    variables = SubElement(root, "ModelVariables")
    for reference, variable in enumerate(equations.variables):
        (_variable_2 if two else _variable_3)(variables, reference, variable, equations)
    if not two:
        attributes = {
            "name": "time", "valueReference": str(len(equations.variables)), "causality": "independent",
            "variability": "continuous", "description": "time; no force depends on it",
        }  # fmt: skip
        SubElement(variables, "Float64", attributes)
    _structure(root, equations, two=two)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def build_text(identifier: str, sources: tuple[str, ...]) -> str:
    """Return buildDescription.xml of FMI 3: how the sources are compiled."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    build = SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier})
    files = SubElement(build, "SourceFileSet", {"language": "C99"})
    for name in sources:
        SubElement(files, "SourceFile", {"name": name})
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _interface(root: Element, kind: str, identifier: str, sources: tuple[str, ...], *, two: bool) -> None:
    state, serial = (
        ("canGetAndSetFMUstate", "canSerializeFMUstate")
        if two
        else ("canGetAndSetFMUState", "canSerializeFMUState")
    )
    attributes = {"modelIdentifier": identifier, state: "true", serial: "true"}
    if kind == "CoSimulation":
        attributes["canHandleVariableCommunicationStepSize"] = "true"
    interface = SubElement(root, kind, attributes)
    if two:
        files = SubElement(interface, "SourceFiles")
        for name in sources:
            SubElement(files, "File", {"name": name})


def _units(root: Element, equations: TireEquations) -> None:
    units = SubElement(root, "UnitDefinitions")
    for name in sorted({variable.unit for variable in equations.variables}):
        unit = SubElement(units, "Unit", {"name": name})
        if name in _BASE:
            SubElement(unit, "BaseUnit", dict(_BASE[name]))
        if name == "rad":
            SubElement(unit, "DisplayUnit", {"name": "deg", "factor": _DEGREES})


def _numbers(variable: Variable) -> dict[str, str]:
    numbers = {"unit": variable.unit}
    if variable.unit == "rad":
        numbers["displayUnit"] = "deg"
    if variable.start is not None:
        numbers["start"] = repr(float(variable.start))
    return numbers


def _role(variable: Variable, equations: TireEquations) -> dict[str, str]:
    if variable in equations.inputs:
        return {"causality": "input", "variability": "continuous"}
    if variable in equations.outputs:
        return {"causality": "output", "variability": "continuous"}
    return {"causality": "parameter", "variability": "fixed"}


def _variable_2(parent: Element, reference: int, variable: Variable, equations: TireEquations) -> None:
    attributes = {
        "name": variable.name, "valueReference": str(reference), "description": variable.text,
        **_role(variable, equations),
    }  # fmt: skip
    SubElement(SubElement(parent, "ScalarVariable", attributes), "Real", _numbers(variable))


def _variable_3(parent: Element, reference: int, variable: Variable, equations: TireEquations) -> None:
    attributes = {
        "name": variable.name, "valueReference": str(reference), "description": variable.text,
        **_role(variable, equations), **_numbers(variable),
    }  # fmt: skip
    SubElement(parent, "Float64", attributes)


def _structure(root: Element, equations: TireEquations, *, two: bool) -> None:
    structure = SubElement(root, "ModelStructure")
    # FMI 2 counts variables from one, FMI 3 names them by their reference.
    places = {variable.name: place + two for place, variable in enumerate(equations.variables)}
    rows = []
    for output in equations.outputs:
        needed = equations.program.needed(output.name)
        dependencies = [str(places[entry.name]) for entry in equations.inputs if entry.name in needed]
        key = "index" if two else "valueReference"
        rows.append({key: str(places[output.name]), "dependencies": " ".join(dependencies)})
    if two:
        outputs = SubElement(structure, "Outputs")
        for row in rows:
            SubElement(outputs, "Unknown", row)
        unknowns = SubElement(structure, "InitialUnknowns")
        for row in rows:
            SubElement(unknowns, "Unknown", {"index": row["index"]})
        return
    for row in rows:
        SubElement(structure, "Output", row)
    for row in rows:
        SubElement(structure, "InitialUnknown", {"valueReference": row["valueReference"]})
