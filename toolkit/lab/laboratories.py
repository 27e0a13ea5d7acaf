"""`toolkit compare --laboratories`: an interlaboratory comparison's answer and figures."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from toolkit.errors import ConfigError
from toolkit.lab.answers import findings_text, one_line, refuse_unwritable, table

if TYPE_CHECKING:
    from pathlib import Path

    from toolkit.comparison.laboratories import LaboratoryComparison, Measurand
    from toolkit.findings import Finding


def laboratories_answer(
    path: Path, *, reference: str | None, sigma: float | None, figures: Path | None
) -> tuple[dict[str, Any], str, list[Finding]]:
    """Return the comparison of a file's laboratories as JSON and as text, with its findings.

    Raises
    ------
    ToolkitError
        the file, the reference or sigma_pt cannot be used; nothing is written
    """
    from toolkit.comparison.laboratories import compare_laboratories
    from toolkit.comparison.laboratory_file import read_laboratories
    from toolkit.declared import answer

    refuse_unwritable(figures)
    if sigma is not None and not (math.isfinite(sigma) and sigma > 0):
        raise ConfigError(
            "sigma_pt cannot be used", where="--sigma", got=sigma, expected="a finite number above 0",
            next_step="state it in the unit of the results", rule="laboratories",
        )  # fmt: skip
    reported, unit = read_laboratories(path)
    comparison = compare_laboratories(reported, unit=unit, reference=reference, sigma=sigma)
    drawn = {} if figures is None else _figures(comparison, figures)
    payload = answer(comparison) | {"mode": "laboratories", "source": str(path), "figures": drawn}
    lines = [line for measurand in comparison.measurands for line in _lines(measurand)]
    lines += [f"written: {one_line(file)}" for file in drawn.values()]
    found = findings_text(comparison.findings)
    return payload, "\n".join([*lines, *([found] if found else [])]), list(comparison.findings)


def _figures(comparison: LaboratoryComparison, folder: Path) -> dict[str, Path]:
    from toolkit.publication import publication
    from toolkit.report.comparison.laboratories import laboratory_plots
    from toolkit.report.figures import draw

    with publication(folder) as stage:
        plots = laboratory_plots(comparison)
        for name, plot in plots.items():
            (stage / f"{name}.png").write_bytes(draw(plot).png)
    return {name: folder / f"{name}.png" for name in plots}


def _lines(measurand: Measurand) -> list[str]:
    from toolkit.estimate import plus_minus

    unit, sigma = measurand.unit, measurand.sigma_pt
    told = "" if sigma is None else f" = {sigma:.4g}"
    return [
        f"{measurand.name}: {measurand.assigned:.6g} {unit}, u = {measurand.u_assigned:.3g}, "
        f"{measurand.assigned_by}; sigma_pt{told}, {measurand.sigma_by}",
        "",
        table(
            ["laboratory", "n", f"mean [{unit}]", "z'", "zeta", "E_n", ""],
            [
                [score.laboratory, str(score.n),
                 f"{score.mean:.6g}" if score.U is None else plus_minus(score.mean, score.U),
                 _ratio(score.z_prime), _ratio(score.zeta), _ratio(score.En),
                 ", ".join(filter(None, [score.signal, "E_n" if score.En_signal else None]))]
                for score in measurand.scores
            ],
            align="<>>>>><",
        ),
        "",
        *_precision_lines(measurand),
    ]  # fmt: skip


def _precision_lines(measurand: Measurand) -> list[str]:
    p = measurand.precision
    if p is None:
        return []
    within = (
        "no repeats: no repeatability"
        if p.s_r is None
        else f"s_r = {p.s_r.value:.4g} ({p.s_r.low:.4g} to {p.s_r.high:.4g}), r = {p.r:.4g}"
    )
    return [
        f"ISO 5725-2, {p.laboratories} laboratories, {p.n} results, mean {p.mean:.6g} {measurand.unit}: "
        f"{within}, s_R = {p.s_R:.4g}, R = {p.R:.4g}",
        "",
    ]


def _ratio(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"
