"""Recorded equations as C: one line a step, doubles throughout, nothing but the C library's mathematics."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError
from toolkit.tires.recorded import CONSTANT, QUANTITY

if TYPE_CHECKING:
    from toolkit.tires.fmu.equations import TireEquations
    from toolkit.tires.recorded import Program, Step

_LARGEST_PRODUCT = 4  # a power that is written as a product

# {0}, {1}, {2} are names of earlier steps. A condition is 1.0 or 0.0.
_OPERATIONS = {
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "{0} / {1}",
    "negative": "-{0}",
    "positive": "{0}",
    "square": "{0} * {0}",
    "absolute": "fabs({0})",
    "sign": "(double)(({0} > 0.0) - ({0} < 0.0))",
    "minimum": "({0} < {1} || isnan({0})) ? {0} : {1}",
    "maximum": "({0} > {1} || isnan({0})) ? {0} : {1}",
    "less": "(double)({0} < {1})",
    "less_equal": "(double)({0} <= {1})",
    "greater": "(double)({0} > {1})",
    "greater_equal": "(double)({0} >= {1})",
    "equal": "(double)({0} == {1})",
    "not_equal": "(double)({0} != {1})",
    "bitwise_and": "(double)({0} != 0.0 && {1} != 0.0)",
    "bitwise_or": "(double)({0} != 0.0 || {1} != 0.0)",
    "where": "({0} != 0.0) ? {1} : {2}",
    "degrees": f"{{0}} * {180.0 / math.pi!r}",
    "radians": f"{{0}} * {math.pi / 180.0!r}",
    "arctan": "atan({0})",
    "power": "pow({0}, {1})",
    **{
        name: f"{name}({{0}})"
        for name in ("sin", "cos", "tan", "sinh", "cosh", "tanh", "exp", "expm1", "log", "log1p", "sqrt")
    },
    **{name: f"{name}({{0}}, {{1}})" for name in ("hypot", "copysign")},
}


def equations_text(equations: TireEquations) -> str:
    """Return tire.c: ``tire_forces(v, y)`` of the inputs and parameters v to the outputs y.

    Raises
    ------
    ConfigError
        ``fmu-equations``: an operation that has no line of C
    """
    program = equations.program
    places = {variable.name: place for place, variable in enumerate(equations.variables)}
    lines = [
        f"    const double t{number} = {_line(program, step, places)};"
        for number, step in enumerate(program.steps)
    ]
    results = dict(program.results)
    outputs = [
        f"    y[{place}] = t{results[output.name]};  /* {output.name} [{output.unit}] */"
        for place, output in enumerate(equations.outputs)
    ]
    return "\n".join(
        [
            f"/* {equations.title}: {equations.reference}. ISO-W axes, SI.",
            "   Recorded from the equations of toolkit; one line a step. */",
            '#include "tire.h"',
            "#include <math.h>",
            "",
            "void tire_forces(const double *v, double *y)",
            "{",
            *lines,
            *outputs,
            "}",
            "",
        ]
    )


def header_text(equations: TireEquations, *, identifier: str, token: str) -> str:
    """Return tire.h: sizes, names, starts and the identity of the model."""
    variables = equations.variables
    starts = ", ".join(repr(float(variable.start or 0.0)) for variable in variables)
    names = ", ".join(f'"{variable.name}"' for variable in variables)
    return "\n".join(
        [
            "#ifndef TIRE_H",
            "#define TIRE_H",
            f'#define MODEL_NAME "{identifier}"',
            f'#define MODEL_TOKEN "{token}"',
            f"#define VARIABLES {len(variables)}",
            f"#define FIRST_OUTPUT {len(variables) - len(equations.outputs)}",
            f"#define VARIABLE_NAMES {{{names}}}",
            f"#define VARIABLE_STARTS {{{starts}}}",
            "void tire_forces(const double *v, double *y);",
            "#endif",
            "",
        ]
    )


def _line(program: Program, step: Step, places: dict[str, int]) -> str:
    if step.operation == CONSTANT:
        return repr(float(step.number))
    if step.operation == QUANTITY:
        return f"v[{places[step.name]}]"
    names = [f"t{argument}" for argument in step.arguments]
    if step.operation == "power":
        exponent = program.steps[step.arguments[1]]
        if exponent.operation == CONSTANT and exponent.number in range(1, _LARGEST_PRODUCT + 1):
            return " * ".join([names[0]] * int(exponent.number))
    pattern = _OPERATIONS.get(step.operation)
    if pattern is None:
        raise ConfigError(
            "an operation has no line of C", where="the model's equations", got=step.operation,
            expected=", ".join(sorted(_OPERATIONS)), next_step="add it to toolkit/tires/fmu/c_source.py",
            rule="fmu-equations",
        )  # fmt: skip
    return pattern.format(*names)
