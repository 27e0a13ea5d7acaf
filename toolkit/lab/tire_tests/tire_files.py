"""Tire files: the model over all loads that one holds, of a table or of a test, and what it does not know."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.errors import ConfigError, FitError
from toolkit.files import same_file
from toolkit.findings import Finding

if TYPE_CHECKING:
    from toolkit.arrays import Array
    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.channels import Rotation
    from toolkit.characteristics.groups import Group
    from toolkit.machine.definition import Drum
    from toolkit.reduction.model import ReducedTest
    from toolkit.tires.global_data import Measured
    from toolkit.tires.global_model import ModelFit

STAND_IN_RADIUS = 0.3  # m; the forces of a tire file do not depend on it, only how QDZ is written


def check_tir(tir: Path, source: Path, names: Sequence[str]) -> str:
    """Return which of the models goes into the file; refuse what it cannot hold, before anything is fitted.

    Raises
    ------
    ConfigError
        none of the models has a tire file, or more than one; the file would replace the table
    """
    from toolkit.tires.tir_write import FITTYP

    fitting = [name for name in names if name in FITTYP]
    if len(fitting) != 1:
        raise ConfigError(
            "a tire file holds one Magic Formula over all loads",
            where="--tir",
            got=", ".join(names),
            expected=f"one of {', '.join(FITTYP)}: a .tir file has no place for other models or single loads",
            next_step=f"give --model {fitting[0] if fitting else 'mf61'}, and no second of them",
            rule="tir-needs-global",
        )
    if same_file(tir, source):
        raise ConfigError(
            "the tire file would replace the table", where="--tir", got=tir, expected="another name",
            next_step="choose another name", rule="original",
        )  # fmt: skip
    return fitting[0]


def write_fit(
    tir: Path,
    fit: ModelFit,
    data: Measured,
    *,
    source: Path,
    side: str,
    radius_m: float | None,
    use: CalibrationUse | None = None,
    road: Drum | None = None,
) -> tuple[Finding, ...]:
    """Write the tire file and return what should be known about it; ``road`` is what the tire rolled on.

    Raises
    ------
    FitError
        the data have one load: its change would be invented
    """
    from toolkit.tires.global_data import what_varies
    from toolkit.tires.global_model import GlobalModel
    from toolkit.tires.models import find
    from toolkit.tires.tir_write import tire_fit, write_tir

    data = data.take(fit.selection.rows)
    varies = what_varies(data)
    if "two_loads" not in varies:
        raise FitError(
            "a tire file needs two loads or more", where=source, got=f"one load, {data.loads[0]:.0f} N",
            expected="two loads or more, five for a load sensitivity to trust",
            next_step="measure more loads; without --tir the model is fitted at this load", rule="one-load",
        )  # fmt: skip
    model = find(fit.model)
    assert isinstance(model, GlobalModel)  # noqa: S101  only such a model reaches here
    write_tir(
        tir, tire_fit(model, fit, data, side=side),
        comments=[
            f"{model.title} fitted to {source.name}", f"{len(data)} rows, {len(data.loads)} loads",
            *([f"calibration {use.id} {use.sha256}"] if use else []),
            *([use.mark] if use and use.mark else []),
            *([f"as measured on the road of the test: {road.text}"] if road and road.curvature_per_m else []),
        ],
    )  # fmt: skip
    notes = []
    if radius_m is None:
        notes.append((
            "tir-radius",
            f"no tire size is known: UNLOADED_RADIUS is set to {STAND_IN_RADIUS} m; FX, FY, MZ of the tire "
            "file do not depend on it, a vehicle model's geometry does",
        ))  # fmt: skip
    if fixed := [
        word
        for word in ("camber", "pressure")
        if word not in varies and (word, fit.model) != ("pressure", "mf52")
    ]:
        notes.append((
            "tir-conditions",
            f"{' and '.join(fixed)} did not vary: the coefficients that say what they change are zero in the "
            "tire file, which means not known, not without effect",
        ))  # fmt: skip
    if road is not None and road.curvature_per_m:
        notes.append(("tir-road", _road_note(road, radius_m)))
    if side == "UNKNOWN":
        notes.append(("tir-side", "TYRESIDE is UNKNOWN: say --side LEFT, RIGHT or SYMMETRIC as tested"))
    return tuple(Finding(rule=rule, where=str(tir), message=message, level="note") for rule, message in notes)


def _road_note(road: Drum, radius_m: float | None) -> str:
    """Say what a drum's curvature does to slopes at small angles, and how much of it a flat road may undo.

    At one deflection the contact patch has k times the length that it has on a flat road. Bristles alone make
    the cornering stiffness go with its square and the aligning stiffness with its cube; at one load the tire
    deflects a little more, and a soft carcass answers less: both are bounds (Pacejka, 3rd ed. 2012, ch. 3).
    """
    note = f"the file holds what the tire did on {road.text}; nothing is corrected for a flat road"
    if radius_m is None or 1 + road.curvature_per_m * radius_m <= 0:
        return note
    k = road.contact_length_factor(radius_m)
    return (
        f"{note}: its contact patch is {k:.3f} of a flat road's at one deflection, so that there cornering "
        f"stiffness lies between 1 and {k**-2:.2f} times that of the file, aligning stiffness between 1 and "
        f"{k**-3:.2f} times; peaks do not depend on it"
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class HandedTire:
    """MF 6.1 over all loads of a test's first direction, and the rows that it was fitted to."""

    fit: ModelFit
    data: Measured
    rotation: Rotation

    def write(self, path: Path, comments: Sequence[str]) -> None:
        """Write the tire file."""
        from toolkit.tires.models.mf61 import MODEL
        from toolkit.tires.tir_write import tire_fit, write_tir

        write_tir(path, tire_fit(MODEL, self.fit, self.data), comments=[*comments, f"drum {self.rotation}"])

    def findings(self) -> tuple[Finding, ...]:
        """Return what should be known of the fit by those who are given the file."""
        from toolkit.tires.global_fit import global_findings

        return tuple(
            replace(finding, where=f"tire file, {finding.where}") for finding in global_findings(self.fit)
        )


def columns_of_run(run: Sequence[Group]) -> dict[str, Array]:
    """Return the conditions of a run as columns of a table, each load at its common value."""
    import numpy as np

    return {
        "SA": np.concatenate([block.SA for block in run]),
        "FZ": np.concatenate([np.full(len(block.SA), block.load_N) for block in run]),
        **{name: np.concatenate([block.values(name) for block in run]) for name in ("FY", "MZ")},
    }


def fit_test_tire(reduced: ReducedTest) -> HandedTire:
    """Return MF 6.1 over all loads of a test's first direction.

    The radius is that of the tire's size.

    Raises
    ------
    FitError
        the test states no tire size, or has one load
    """
    from toolkit.characteristics.groups import group
    from toolkit.reduction.averaging import free_radius_m
    from toolkit.tires.global_data import measured, what_varies
    from toolkit.tires.global_fit import fit_global
    from toolkit.tires.models.mf61 import MODEL

    groups = group(reduced)
    run = [block for block in groups if block.rotation == groups[0].rotation]
    radius = free_radius_m(reduced.info.tire_size)
    data = measured(
        columns_of_run(run),
        axes="SAE",
        rated_load_N=reduced.info.rated_load_N,
        unloaded_radius_m=radius or STAND_IN_RADIUS,
    )
    if radius is None or "two_loads" not in what_varies(data):
        raise FitError(
            "a tire file needs the tire's size and two loads or more",
            where=reduced.info.name,
            got=f"size {reduced.info.tire_size or 'unknown'}, {len(data.loads)} loads",
            expected="a size such as 205/55 R16 in [tire] of test.toml, and several loads",
            next_step="leave out --tir, or complete the test",
            rule="one-load",
        )
    fit = fit_global(MODEL, data, predict=False)
    return HandedTire(fit=fit, data=data, rotation=run[0].rotation)
