"""The FMU of a tire as one file: description, C sources, and the binary of this system where it is compiled.

Recorded equations become C with one line a step, doubles throughout, nothing but the C library's
mathematics. The same tire gives the same bytes by the same compiler: its identity is a digest of the
equations, and nothing in the file knows when or where it was made.
"""

from __future__ import annotations

import hashlib
import io
import math
import platform
import re
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError, OutputError
from toolkit.tires.fmu.description import VERSIONS, FmiVersion, build_text, description_text
from toolkit.tires.recorded import CONSTANT, QUANTITY, Program, Step

if TYPE_CHECKING:
    from toolkit.tires.fmu.equations import TireEquations


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
_COMPILERS = ("cc", "gcc", "clang")
_FLAGS = (
    "-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden", "-w",
    "-Wl,--build-id=none",
)  # fmt: skip
_SECONDS = 120
_DAY = (1980, 1, 1, 0, 0, 0)


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
            expected=", ".join(sorted(_OPERATIONS)), next_step="add it to toolkit/tires/fmu/archive.py",
            rule="fmu-equations",
        )  # fmt: skip
    return pattern.format(*names)


@dataclass(frozen=True, slots=True, kw_only=True)
class Fmu:
    """The bytes of an FMU; ``binary`` is the platform that it runs on as it is, None for sources alone."""

    content: bytes
    binary: str | None


def fmu_of(equations: TireEquations, *, name: str, fmi: str = "2", notes: str = "") -> Fmu:
    """Return the FMU of a tire.

    Parameters
    ----------
    name : of the model, such as the file's; what C cannot name becomes ``_``
    notes : stand in its description, such as the record that measured it

    Raises
    ------
    ConfigError
        ``fmi-version``: not 2 or 3; ``fmu-equations``: an operation that C does not have
    OutputError
        ``fmu-compiler``: the compiler of this system refuses the sources
    """
    version = next((known for known in VERSIONS if known == fmi), None)
    if version is None:
        raise ConfigError(
            f"unknown version of FMI {fmi!r}", where="--fmi", got=fmi, expected=" or ".join(VERSIONS),
            next_step="name one of those expected", rule="fmi-version",
        )  # fmt: skip
    identifier = _identifier(name)
    files = {"tire.c": equations_text(equations)}
    for source in ("instance.c", f"fmi{version}.c"):
        files[source] = (resources.files(__package__) / source).read_text(encoding="utf-8")
    # The identity is that of the sources and all that the description says.
    named = header_text(equations, identifier=identifier, token="")
    digest = hashlib.sha256("\0".join([*files.values(), named, notes, version]).encode()).hexdigest()
    token = f"{{{digest[:8]}-{digest[8:12]}-{digest[12:16]}-{digest[16:20]}-{digest[20:32]}}}"
    files["tire.h"] = header_text(equations, identifier=identifier, token=token)
    compiled = (f"fmi{version}.c", "tire.c")
    description = description_text(
        equations, fmi=version, identifier=identifier, token=token, notes=notes, sources=compiled
    )
    members: dict[str, bytes] = {"modelDescription.xml": description.encode()}
    place = _platform(version)
    compiler = next(filter(None, map(shutil.which, _COMPILERS)), None)
    if place is not None and compiler is not None:
        members[f"binaries/{place}/{identifier}.so"] = _compiled(compiler, files, compiled)
    members |= {f"sources/{source}": text.encode() for source, text in sorted(files.items())}
    if version == "3":
        members["sources/buildDescription.xml"] = build_text(identifier, compiled).encode()
    return Fmu(content=_zipped(members), binary=place if compiler is not None else None)


def _identifier(name: str) -> str:
    plain = re.sub(r"\W", "_", name, flags=re.ASCII) or "tire"
    return f"tire_{plain}" if plain[0].isdigit() else plain


def _platform(version: FmiVersion) -> str | None:
    # FMI 2 has one name for Linux of 64 bits, which is x86.
    machine = platform.machine()
    if not sys.platform.startswith("linux"):
        return None
    if version == "2":
        return "linux64" if machine == "x86_64" else None
    return f"{machine}-linux"


def _compiled(compiler: str, files: Mapping[str, str], compiled: tuple[str, ...]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        words = [compiler, *_FLAGS, "-o", "tire.so", *compiled, "-lm"]
        try:
            done = subprocess.run(words, cwd=folder, capture_output=True, timeout=_SECONDS, check=False)
        except (OSError, subprocess.TimeoutExpired) as error:
            raise _refused(compiler, str(error)) from error
        if done.returncode:
            raise _refused(compiler, done.stderr.decode(errors="replace").strip()[:400])
        return (Path(folder) / "tire.so").read_bytes()


def _refused(compiler: str, got: str) -> OutputError:
    return OutputError(
        "the compiler refuses the sources of the FMU", where=compiler, got=got, expected="a C99 compiler",
        next_step="mend the compiler, or take it out of PATH: the FMU then holds its sources alone",
        rule="fmu-compiler",
    )  # fmt: skip


def _zipped(members: Mapping[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            member = zipfile.ZipInfo(name, date_time=_DAY)
            member.compress_type = zipfile.ZIP_DEFLATED
            member.external_attr = 0o644 << 16
            archive.writestr(member, content)
    return buffer.getvalue()
