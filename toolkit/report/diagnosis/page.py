"""A diagnosis as one HTML file that opens without a network; the chart of ten seconds comes first."""

from __future__ import annotations

import base64
import math
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.files import write_atomic
from toolkit.report.diagnosis import figures
from toolkit.report.diagnosis.maps import size_maps
from toolkit.report.diagnosis.numbers import chance, few, over

if TYPE_CHECKING:
    from collections.abc import Sequence

    from toolkit.calibration.records.use import CalibrationUse
    from toolkit.diagnosis.answer.answer import Diagnosis, FoundEffect, Mismatch
    from toolkit.diagnosis.diagnose import Result

HEADLINES = {
    "named": "The missing physics has a name.",
    "equivalent": "A class of effects explains the mismatch; this recording cannot tell them apart.",
    "unknown": "Something is missing that no known effect explains.",
    "nothing": "Nothing is missing that this recording could show.",
    "untestable": "This recording cannot tell.",
}
_COLOURS = {
    "named": "#1565c0", "equivalent": "#6a4fb3", "unknown": "#c77700", "nothing": "#2e7d32",
    "untestable": "#6b6b6b",
}  # fmt: skip
_STYLE = """
body{font:15px/1.5 Carlito,Calibri,"Liberation Sans",sans-serif;color:#222;background:#fff;max-width:60rem;
  margin:2rem auto;padding:0 1rem}
h1{font-size:1.5rem;margin:0}h2{font-size:1.15rem;margin:2rem 0 .4rem;border-bottom:1px solid #ddd}
.verdict{border-left:.5rem solid VAR;padding:.6rem 1rem;background:#f6f6f6;margin:1rem 0}
.mark{border:1px solid #b00000;color:#b00000;font-weight:bold;padding:.3rem .6rem;position:sticky;top:0;
  background:#fff}
.verdict b{font-size:1.2rem}table{border-collapse:collapse;margin:.5rem 0}
th,td{padding:.2rem .7rem;text-align:left;border-bottom:1px solid #e4e4e4}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums}img{max-width:100%}
code{background:#f0f0f0;padding:.1rem .3rem}
small{color:#666}details{margin:.5rem 0}.wide,code{overflow-x:auto;max-width:100%}
code{display:inline-block;vertical-align:bottom}
@media print{body{max-width:none;margin:0}h2,img,tr{break-inside:avoid}h2{break-after:avoid}}
"""


def headline(made: Diagnosis) -> str:
    """Return the verdict as a sentence; a search that was cut off has not tried every effect."""
    from toolkit.diagnosis.answer.answer import cut_short

    if made.verdict == "unknown" and cut_short(made.skipped):
        return "Something is missing; the budget was spent before every known effect was tried."
    if made.effects and made.remaining == "unknown":
        # Who reads the first line alone must not take a name for the whole of it.
        return f"{HEADLINES[made.verdict]} More is left that no known effect explains."
    return HEADLINES[made.verdict]


def write_page(path: Path, result: Result) -> None:
    """Write the page, whole or not at all.

    Raises
    ------
    OutputError
        the file cannot be written
    """
    write_atomic(path, page(result))


def page(result: Result, use: CalibrationUse | None = None) -> str:
    """Return the page's HTML; ``use`` is the calibration that the case names."""
    made = result.diagnosis
    mark = None if use is None else use.mark
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width">',
        f"<title>Diagnosis: {escape(made.title)}</title>",
        f"<style>{_STYLE.replace('VAR', _COLOURS[made.verdict])}</style></head><body>",
        *([f'<p class="mark">{escape(mark)}</p>'] if mark else []),
        f"<h1>{escape(made.title)}</h1>",
        f'<div class="verdict"><b>{escape(headline(made))}</b><br>{_sentence(made)}</div>',
        *(
            [_picture(figures.error_bars(made), "error before and after, over the noise")]
            if result.search is not None
            else []
        ),
        *_effects(result),
        *_where(result),
        *_held_out(made),
        *_parameters(made),
        *_remaining(made),
        *_power(made),
        *_next(made),
        *_findings(made),
        f"<p><small>Case {escape(made.case_sha256[:16])}; held out by {escape(made.held_out_by)}"
        f"{'' if made.complete else '; incomplete: ' + escape(', '.join(made.skipped))}.</small></p>",
        "</body></html>",
    ]
    return "\n".join(parts)


def _sentence(made: Diagnosis) -> str:
    if made.effects:
        told = []
        for one in made.effects:
            where = f" on {one.channel}" if one.channel else ""
            also = f" (or {', '.join(one.equivalent_to)})" if one.equivalent_to else ""
            told.append(f"<b>{escape(one.name + where + also)}</b>: {escape(one.statement)}")
        return "<br>".join(told)
    if made.verdict == "unknown":
        told = [over(channel, names) for channel, names in made.depends_on[:3]]
        return escape(f"What remains: {'; '.join(told)}.")
    if made.skipped and made.verdict == "untestable":
        return escape(f"The budget was spent at: {made.skipped[0]}. Nothing can be said yet.")
    if made.verdict == "untestable":
        return "The outputs do not vary, or the parameters take up everything; see below."
    return "What is left is noise; the list below says how large each effect would have had to be."


def _effects(result: Result) -> list[str]:
    parts = []
    for one in result.diagnosis.effects:
        parts.append(f"<h2>{escape(one.name)}{' on ' + escape(one.channel) if one.channel else ''}</h2>")
        parts.append(
            f"<p>{escape(one.statement)} <small>Stage: {escape(one.stage.replace('_', ' '))}.</small></p>"
        )
        parts.append(f"<p><code>{escape(one.equation)}</code> <small>{escape(one.reference)}</small></p>")
        rows = [
            (each.name, each.value if isinstance(each.value, str) else f"{each.value:.4g}", each.unit,
             "" if each.ci95 is None else f"{each.ci95[0]:.4g} to {each.ci95[1]:.4g}",
             "all runs" if each.runs is None else ", ".join(each.runs) + condition(result, each.runs))
            for each in one.parameters
        ]  # fmt: skip
        if rows:
            parts.append(_table(("parameter", "value", "unit", "95 % interval", "in"), rows, numbers=(1,)))
        parts.append(f"<p>{_why(one)}</p>")
    return parts


def condition(result: Result, runs: Sequence[str]) -> str:
    """Return the conditions that these runs have and no other: people know a surface, not a file's name."""
    if result.search is None:
        return ""
    recorded = result.search.problem.runs
    inside = [run.conditions for run in recorded if run.name in runs]
    outside = [run.conditions for run in recorded if run.name not in runs]
    told = [
        f"{key} {level}"
        for key, level in (inside[0].items() if inside else ())
        if all(one.get(key) == level for one in inside) and all(one.get(key) != level for one in outside)
    ]
    return f" ({', '.join(told)})" if told else ""


def _why(one: FoundEffect) -> str:
    text = (
        f"On rows that no fit had seen the log score rose by {one.held_out_log_score_gain:.1f}; the chance "
        f"that a search of this size finds as much in noise: {chance(one.p_value)}."
    )
    if one.equivalent_to:
        text += f" {', '.join(one.equivalent_to)} would explain the same: they are one class here."
    if one.rejected:
        told = ", ".join(f"{name} (by {-less:.1f})" for name, less in one.rejected[:5])
        text += f" Rejected, as they explain the recordings worse (log-likelihood less): {told}."
    elif not one.equivalent_to and one.name != "quantisation":
        text += " No other effect came near enough in the screening to be tried in its place."
    return escape(text)


def _where(result: Result) -> list[str]:
    made, found = result.diagnosis, result.search
    if not made.mismatch or found is None:
        return []
    after = bool(made.effects)
    parts = ["<h2>Where</h2>"]
    for one in made.mismatch:
        parts.append(f"<p>{_place(one)}</p>")
        for place in one.where:
            drawn = figures.mismatch_map(found, one.channel, place, after=after)
            if drawn is not None:
                parts.append(_picture(drawn, f"residual of {one.channel} over {place.variable}"))
                break
        sizes = size_maps(found, made, one.channel, after=after)
        if sizes is not None:
            parts.append(_picture(sizes, f"size of the residual of {one.channel} over each variable"))
        parts.append(
            _picture(figures.run_in_time(found, one.channel, after=after), f"{one.channel} in one run")
        )
    if len(found.problem.runs) > 1:
        parts.append("<p>Root mean square residual over the noise, by run:</p>")
        parts.append(_picture(figures.run_map(found, made, after=after), "residual by run and output"))
    return parts


def _place(one: Mismatch) -> str:
    share = 100 * one.share_of_variance
    text = f"{one.channel}: {share:.0f} % of the refitted residual's variance is structure"
    if share < 0.5:
        text = f"{one.channel}: the refitted residual is more than noise, and no variable alone explains it"
    for at in one.where[:1]:
        ends = at.ends(lambda value: few(value, 4))
        much = f"over all of {at.variable}," if at.whole else f"most of it where {at.variable} is"
        text += f", {much} {ends} {at.unit}".rstrip()
    return escape(f"{text} ({chance(one.p_value)}).")


def _held_out(made: Diagnosis) -> list[str]:
    if not made.held_out:
        return []
    rows = []
    for one in made.held_out:
        errors = (one.nominal_rmse, one.refitted_rmse, one.augmented_rmse, one.noise_floor)
        told = [f"{value:.4g}" if math.isfinite(value) else "–" for value in errors]
        # Without an effect there is no error with it.
        rows.append((one.channel, one.unit, *(told if made.effects else (*told[:2], told[3]))))
    head = (
        "output",
        "unit",
        "as declared",
        "refitted",
        *(["with the effects"] if made.effects else []),
        "noise",
    )
    title = "Error on held-out rows" if made.complete or made.effects else "Error as far as it was reached"
    return [f"<h2>{title}</h2>", _table(head, rows, numbers=(2, 3, 4, 5))]


def _parameters(made: Diagnosis) -> list[str]:
    rows = [
        (one.name, one.unit, f"{one.before:.6g}", f"{one.after:.6g}",
         "known exactly" if one.prior_sd is None else f"{one.prior_sd:.3g}",
         "" if one.shift_in_sd is None else f"{one.shift_in_sd:+.2f}")
        for one in made.nominal_parameters
    ]  # fmt: skip
    if not rows:
        return []
    head = ("parameter", "unit", "before", "after", "prior sd", "shift/sd")
    return ["<h2>Parameters of the simulation</h2>", _table(head, rows, numbers=(2, 3, 4, 5))]


def _remaining(made: Diagnosis) -> list[str]:
    if made.remaining == "unknown" and not made.depends_on:
        return ["<h2>What remains</h2>", "<p>Not judged: no search was made, or none to its end.</p>"]
    if not made.depends_on:
        return ["<h2>What remains</h2>", "<p>Nothing that stands out of the noise.</p>"]
    rows = [(channel, " and ".join(names)) for channel, names in made.depends_on[:8]]
    return [
        "<h2>What remains</h2>",
        "<p>Structure that no named effect explains. It is a description, not physics:</p>",
        _table(("output", "depends on"), rows),
    ]


def _power(made: Diagnosis) -> list[str]:
    seen = [one for one in made.not_found if one.observable]
    rows = [
        (one.name, "–" if one.minimum_detectable is None else f"{one.minimum_detectable:.3g}", one.unit)
        for one in seen
    ]
    why: dict[str, list[str]] = {}
    for one in made.not_found:
        if not one.observable:
            why.setdefault(one.why or "not told by these recordings", []).append(one.name)
    parts = ["<h2>What was not found</h2>"]
    if rows:
        parts += [
            "<p>“Nothing missing” means no more than this list: below these sizes an effect could be there."
            "</p><details open><summary>effects</summary>",
            _table(("effect", "smallest size seen with 80 % power", "unit"), rows, numbers=(1,)),
            "</details>",
        ]
    # One sentence for each reason: a row for each of thirty effects that have no place here hides the rest.
    if why:
        parts.append("<p>Of these the recordings can tell nothing:</p>")
        items = "".join(
            f"<li>{escape(reason)}: {escape(', '.join(names))}</li>" for reason, names in why.items()
        )
        parts.append(f"<ul>{items}</ul>")
    return parts


def _next(made: Diagnosis) -> list[str]:
    if not made.next_measurements:
        return []
    items = "".join(f"<li>{escape(one)}</li>" for one in made.next_measurements)
    return ["<h2>What to measure next</h2>", f"<ul>{items}</ul>"]


def _findings(made: Diagnosis) -> list[str]:
    if not made.findings:
        return []
    rows = [(one.rule, one.where, one.message) for one in made.findings]
    return ["<h2>Findings</h2>", _table(("rule", "where", "what"), rows)]


def _table(head: Sequence[str], rows: Sequence[Sequence[object]], *, numbers: Sequence[int] = ()) -> str:
    def cell(tag: str, i: int, text: object) -> str:
        return f"<{tag}{' class=n' if i in numbers else ''}>{escape(str(text))}</{tag}>"

    top = "".join(cell("th", i, one) for i, one in enumerate(head))
    body = "".join(
        "<tr>" + "".join(cell("td", i, one) for i, one in enumerate(row)) + "</tr>" for row in rows
    )
    return f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>'


def _picture(svg: bytes, alt: str) -> str:
    data = base64.b64encode(svg).decode()
    return f'<p><img alt="{escape(alt, quote=True)}" src="data:image/svg+xml;base64,{data}"></p>'
