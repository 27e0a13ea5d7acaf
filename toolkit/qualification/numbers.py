"""The packaged numbers: one TOML file a certified set, the examples, and the digest of each file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from toolkit.errors import ConfigError, ToolkitError
from toolkit.files import is_number, read_toml, sha256_bytes, sha256_file
from toolkit.qualification.model import Check

if TYPE_CHECKING:
    from numpy.typing import NDArray

FOLDER = Path(__file__).with_name("data")
DIGESTS = "digests.toml"
SETS = (
    "norris", "pontius", "noint1", "noint2", "filip", "longley",
    "wampler1", "wampler2", "wampler3", "wampler4", "wampler5",
)  # fmt: skip
QUANTITIES = ("coefficients", "standard_errors", "residual_sd")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CertifiedSet:
    """A certified regression: ``estimates`` and ``errors`` in the order of ``terms``, the intercept last.

    ``required`` and ``public`` are correct digits by quantity, in the order of ``QUANTITIES``.
    """

    name: str
    title: str
    terms: tuple[str, ...]
    estimates: tuple[float, ...]
    errors: tuple[float, ...]
    residual_sd: float
    y: NDArray[np.float64]
    columns: dict[str, NDArray[np.float64]]
    required: tuple[float, ...]
    public: tuple[float, ...]


def read_set(name: str, folder: Path) -> CertifiedSet:
    """Read a certified set.

    Raises
    ------
    ConfigError
        the file is missing, no TOML, lacks an entry or holds no number where one belongs
    """
    path = folder / f"{name}.toml"
    stored = read_toml(path)
    try:
        certified = stored["certified"]
        terms: dict[str, Any] = certified["terms"]
        data = {key: numbers(values, path) for key, values in stored["data"].items()}
        pairs = [numbers(pair, path) for pair in terms.values()]
        return CertifiedSet(
            name=str(stored["name"]),
            title=str(stored["title"]),
            terms=tuple(terms),
            estimates=tuple(float(estimate) for estimate, _ in pairs),
            errors=tuple(float(error) for _, error in pairs),
            residual_sd=number(certified["residual_sd"], path),
            y=data.pop("y"),
            columns=data,
            required=tuple(number(stored["required"][quantity], path) for quantity in QUANTITIES),
            public=tuple(number(stored["public_qr"][quantity], path) for quantity in QUANTITIES),
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise damaged(path, f"{type(error).__name__}: {error}") from error


def number(value: Any, where: Path) -> float:
    """Return a finite number, or refuse what stands in its place."""
    if not is_number(value):
        raise damaged(where, repr(value))
    return float(value)


def numbers(values: Any, where: Path) -> NDArray[np.float64]:
    """Return a list of finite numbers as an array (n,)."""
    if not isinstance(values, list) or not values:
        raise damaged(where, repr(values))
    return np.array([number(value, where) for value in values])


def damaged(where: Path, actual: str) -> ConfigError:
    """Return the error of packaged numbers that cannot be used."""
    return ConfigError(
        "the packaged numbers cannot be used", where=where.name, got=actual,
        expected="the file as it was packaged",
        next_step="install the package again", rule="wrong-value",
    )  # fmt: skip


def check_whole(folder: Path) -> Check:
    """Check every packaged file against its digest: a changed requirement shows nowhere else."""
    try:
        listed: dict[str, str] = read_toml(folder / DIGESTS)["sha256"]
        present = {path.name for path in folder.glob("*.toml")} - {DIGESTS}
        changed = [n for n in sorted(present & listed.keys()) if sha256_file(folder / n) != listed[n]]
        differences = [f"{n} is changed" for n in changed]
        differences += [f"{n} is missing" for n in sorted(listed.keys() - present)]
        differences += [f"{n} is not listed" for n in sorted(present - listed.keys())]
    except (ToolkitError, KeyError, AttributeError) as error:
        differences = [f"{DIGESTS} cannot be used: {error}".splitlines()[0]]
    return Check(
        group="packaged numbers", name="files", quantity="sha256", measure="text", required="as listed",
        reached="; ".join(differences) or "as listed", passed=not differences,
    )  # fmt: skip


def identity(folder: Path) -> str:
    """Return one hash of all packaged numbers, as they are."""
    lines = [f"{path.name} {sha256_file(path)}" for path in sorted(folder.glob("*.toml"))]
    return sha256_bytes("\n".join(lines).encode())
