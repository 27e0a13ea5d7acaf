"""The FMU of a tire as one file: description, sources, and the binary of this system where it is compiled.

The same tire gives the same bytes by the same compiler: its identity is a digest of the equations, and
nothing in the file knows when or where it was made.
"""

from __future__ import annotations

import hashlib
import io
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
from toolkit.tires.fmu.c_source import equations_text, header_text
from toolkit.tires.fmu.description import VERSIONS, FmiVersion, build_text, description_text

if TYPE_CHECKING:
    from toolkit.tires.fmu.equations import TireEquations

_COMPILERS = ("cc", "gcc", "clang")
_FLAGS = (
    "-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off", "-fvisibility=hidden", "-w",
    "-Wl,--build-id=none",
)  # fmt: skip
_SECONDS = 120
_DAY = (1980, 1, 1, 0, 0, 0)


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
