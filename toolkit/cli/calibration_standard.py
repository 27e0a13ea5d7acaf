"""`toolkit calibration standard ID`: ASTM E74 or ISO 376 on the rows that a record was fitted to."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from toolkit.cli.console import Calibrations, Home, Json, Quiet, answer, table
from toolkit.cli.home import calibrations_folder
from toolkit.errors import ConfigError

if TYPE_CHECKING:
    from toolkit.calibration.standards.e74 import E74Result
    from toolkit.calibration.standards.evaluation import Evaluation
    from toolkit.calibration.standards.iso376 import Iso376Result


def command(
    record_id: Annotated[str, typer.Argument(help="Record id, such as m15-r2.")],
    standard: Annotated[str, typer.Option("--standard", help="e74 or iso376.")],
    load: Annotated[str | None, typer.Option("--load", help="One load; needed where there are more.")] = None,
    indication: Annotated[
        str | None, typer.Option("--indication", help="One indication; needed where there are more.")
    ] = None,
    degree: Annotated[
        int | None, typer.Option("--degree", help="Of the curve; E74: by its annex, ISO 376: 3.")
    ] = None,
    preloads: Annotated[
        int | None,
        typer.Option(
            "--preloads",
            help="Preloads to the largest force (ISO 376); default: [standard] preloads of the session.",
        ),
    ] = None,
    calibrations: Calibrations = None,
    home: Home = None,
    as_json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Evaluate one indication under one load by a standard: figures, class, reasons.

    Example: toolkit calibration standard cell-r1 --standard iso376 --preloads 3
    """
    from toolkit.calibration.control.standard import evaluate_record
    from toolkit.calibration.registry.registry import Registry

    if standard not in ("e74", "iso376"):
        raise ConfigError(
            "no such standard", where="--standard", got=standard, expected="e74 or iso376",
            next_step="name one of them", rule="usage",
        )  # fmt: skip
    found = evaluate_record(
        Registry(calibrations_folder(calibrations, home)), record_id,
        standard="e74" if standard == "e74" else "iso376",
        load=load, indication=indication, degree=degree, preloads=preloads,
    )  # fmt: skip
    payload = {"id": record_id, "standard": standard, "evaluations": [one.as_dict() for one in found]}
    answer(payload, "\n\n".join(map(_text, found)), as_json=as_json, quiet=quiet)
    return 0


def _text(one: Evaluation) -> str:
    from toolkit.calibration.standards.e74 import E74Result

    title = "ASTM E74" if one.standard == "e74" else "ISO 376"
    sense = {"up": ", increasing", "down": ", decreasing"}.get(one.direction or "", "")
    lines = [
        f"{title}: {one.indication} [{one.indication_unit}] under {one.load} [{one.load_unit}], "
        f"{one.sense} force{sense}",
        f"class {one.class_name}" if one.class_name else "no class",
    ]
    if isinstance(one.result, E74Result):
        lines += _e74(one.result, one.load_unit, one.indication_unit or "")
    elif one.result is not None:
        lines += _iso376(one.result, one.load_unit, one.indication_unit or "")
    if one.all_reasons:
        lines += ["not better because", *(f"  {reason}" for reason in one.all_reasons)]
    if one.left_out:
        lines.append(f"{one.left_out} rows are left out: another load acts")
    return "\n".join(lines)


def _e74(found: E74Result, force: str, reading: str) -> list[str]:
    rows = [
        [str(c.degree) + (" *" if c.degree == found.degree else ""),
         f"{c.s_m:.6g}", f"{c.llf:.6g}", str(c.dof),
         "-" if c.lack_of_fit is None else f"{c.lack_of_fit.F:.4g}",
         "-" if c.lack_of_fit is None else f"{c.lack_of_fit.p:.3g}"]
        for c in found.curves
    ]  # fmt: skip
    chosen = "as asked for" if found.requested else "by the annex"
    return [
        f"{found.points} points at {found.levels} forces in {found.runs} runs; "
        f"degree {found.degree} {chosen}",
        table(["degree", f"s_m [{reading}]", f"LLF [{force}]", "dof", "lack of fit F", "p"], rows),
        f"lower limit factor {found.llf:.6g} {force}",
        *(
            f"class {c.name}: {c.lower_limit:.6g} to {c.upper_limit:.6g} {force}"
            + ("" if c.granted else "  (not granted)")
            for c in found.classes
        ),
    ]


def _iso376(found: Iso376Result, force: str, reading: str) -> list[str]:
    rows = [
        [f"{r.force:g}", f"{r.deflection:.6g}", _percent(r.b), _percent(r.b_same), _percent(r.fc),
         _percent(r.v), (r.class_name or "none") if not found.procedure else "-"]
        for r in found.forces
    ]  # fmt: skip
    return [
        table([f"force [{force}]", f"deflection [{reading}]", "b %", "b' %", "fc %", "v %", "class"], rows,
              align=">>>>>>>"),
        f"zero f0 {_percent(found.f0)} %, creep c {_percent(found.c)} %",
        *(f"class {r.class_name}: {r.lower:g} to {r.upper:g} {force}" for r in found.ranges),
    ]  # fmt: skip


def _percent(value: float | None) -> str:
    return "-" if value is None else f"{value:.4f}"
