"""The score of an opened batch: each case judged, then the rates with their exact intervals."""

from __future__ import annotations

import itertools
import json
from collections import Counter
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from proof import baselines, oracle
from proof.draw import draw_case
from proof.intervals import Rate, rate
from proof.inventory import inventory, power_by_detectable
from proof.judge import Judgment, judge
from proof.proof_file import Case, Proof, judged_part
from proof.running import answer_of
from proof.seal import SealError, opened, verify

NAMED = ("single", "stirred single", "two", "three", "confounded")
SIZES = (0.1, 0.5, 1.0, 2.0, 4.0, 8.0, np.inf)
DISTANCES = (0.0, 5.0, 10.0, 20.0, 40.0, 80.0, np.inf)


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """One line of the proof: what was asked, what was observed."""

    title: str
    asked: str
    observed: str
    met: bool | None
    """None: too few cases to say."""


def _predictions(folder: Path, case: str, names: list[str]) -> list[pd.DataFrame] | None:
    base = folder / "runs" / case / "answer" / "predictions"
    try:
        return [pd.read_csv(base / name) for name in names]
    except (OSError, ValueError):
        return None


def _gaps(job: tuple[Path, str, int, dict[str, Any], list[dict[str, Any]]]) -> dict[str, Any]:
    """Return how much of the gap the tool and the baselines close in one case, and what the baselines say."""
    folder, case, seed, sealed, truth = job
    store = folder / "score" / f"{case}.json"
    if store.exists():
        done: dict[str, Any] = json.loads(store.read_text(encoding="utf-8"))
        return done
    drawn = draw_case(seed, sealed["index"], sealed["bucket"], compare=False)
    if drawn.answer["parameters"] != sealed["parameters"] or drawn.answer["size"] != sealed["size"]:
        raise SealError(f"{case} was drawn by another state of the generator; score it with that one")
    s = drawn.scenario
    params = oracle.refit(s, drawn.measured)
    verdicts = baselines.all_methods(s, drawn.measured, params)
    out: dict[str, Any] = {
        "case": case,
        "baselines": {k: {"verdict": v.verdict, "names": list(v.names)} for k, v in verdicts.items()},
    }
    if sealed["bucket"] in (*NAMED, "outside"):
        c = oracle.ceiling(s, drawn.measured, drawn.effects, truth)
        predicted = _predictions(folder, case, [run.name for run in s.predict])
        out["ceiling"] = asdict(c)
        out["gap"] = {
            k: oracle.gap_closed(e, c.refitted, c, s) for k, e in baselines.errors(s, verdicts, truth).items()
        }
        for which, reference in (("augmented", c.refitted), ("from declared", c.declared)):
            found = oracle.tool_rmse(s, predicted, truth, "augmented") if predicted else None
            # an answer without predictions has closed nothing
            closed = oracle.gap_closed(found or reference, reference, c, s)
            out["gap"]["tool" if which == "augmented" else "tool from declared"] = closed
    store.parent.mkdir(exist_ok=True)
    part = store.with_suffix(".part")
    part.write_text(json.dumps(out) + "\n", encoding="utf-8")
    part.replace(store)
    return out


def open_batch(folder: Path, *, workers: int, progress: Callable[[str], None] = lambda _: None) -> Proof:
    """Open a batch that was run and fit what its score needs; resumable."""
    answers, truth = opened(folder)
    seed = int(answers["seed"], 16)
    jobs = [(folder, case, seed, sealed, truth[case]) for case, sealed in answers["cases"].items()]
    cases = {}
    with ProcessPoolExecutor(max_workers=workers) as pool:
        for i, row in enumerate(pool.map(_gaps, jobs)):
            name = row["case"]
            log = folder / "runs" / name / "run.json"
            cases[name] = Case(
                run=json.loads(log.read_text(encoding="utf-8")) if log.exists() else {},
                answer=judged_part(answer_of(folder, name)), extra=row,
            )  # fmt: skip
            progress(f"{i + 1}/{len(jobs)} scored")
    text = (folder / "sealed" / "answers.json").read_text(encoding="utf-8")
    return Proof(batch=verify(folder), answers=text, cases=cases)


def score_of(proof: Proof) -> dict[str, Any]:
    """Return the whole score of a batch that was opened, from its data or from its small file."""
    sealed = proof.sealed
    judged = [judge(name, sealed[name], case.answer) for name, case in proof.cases.items()]
    extra = {name: case.extra for name, case in proof.cases.items()}
    runs = [case.run for case in proof.cases.values() if case.run]
    return summary(judged, extra, sealed, runs) | inventory(judged, sealed) | {
        "power by detectable": power_by_detectable(
            judged, sealed, {name: case.answer for name, case in proof.cases.items()}
        )
    }  # fmt: skip


def _row(j: Judgment) -> str:
    """Return the confusion matrix's row of a case."""
    return "+".join(j.truth) if j.bucket == "single" else f"[{j.bucket}]"


def _binned(rows: list[tuple[float, bool]], edges: tuple[float, ...]) -> list[dict[str, Any]]:
    out = []
    for low, high in itertools.pairwise(edges):
        inside = [hit for x, hit in rows if low <= x < high]
        out.append({"from": low, "to": high, "rate": rate(inside)})
    return out


def _of_baseline(
    name: str, judged: list[Judgment], extra: dict[str, Any], sealed: dict[str, Any]
) -> dict[str, Any]:
    """Return a baseline's figures by the judge that the tool has."""
    rows = []
    common = Counter(t for j in judged if j.bucket == "single" for t in j.truth).most_common(1)
    for j in judged:
        if name == "commonest effect":
            said = {"verdict": "named", "names": [common[0][0]] if common else []}
        else:
            said = extra.get(j.case, {}).get("baselines", {}).get(name, {"verdict": "nothing", "names": []})
        answer = {"verdict": said["verdict"], "effects": [{"name": n} for n in said["names"]]}
        rows.append(judge(j.case, sealed[j.case], answer))
    gaps = [extra[j.case].get("gap", {}).get(name) for j in judged if j.case in extra and j.bucket in NAMED]
    return _rates(rows) | {"gap": _median([g for g in gaps if g is not None])}


def _median(x: list[float]) -> dict[str, Any]:
    if not x:
        return {"n": 0, "median": None, "quartiles": None}
    return {
        "n": len(x), "median": float(np.median(x)), "quartiles": [float(q) for q in np.percentile(x, [25,
            75])],
    }  # fmt: skip


def _gap_of(extra: dict[str, Any], case: str, key: str = "tool") -> float | None:
    """Return how much of the gap was closed; None where none is to be closed."""
    closed: float | None = extra.get(case, {}).get("gap", {}).get(key)
    return closed


def _rates(rows: list[Judgment]) -> dict[str, Any]:
    """Return the rates that the bars ask for."""
    of = lambda bucket: [j for j in rows if j.bucket == bucket]  # noqa: E731
    large = [j for j in of("single") if j.size >= 2]
    return {
        "false names on nulls": rate([j.false_name for j in of("null")]),
        "nulls called nothing": rate([j.right for j in of("null")]),
        "misnamed from outside": rate([j.false_name for j in of("outside")]),
        "outside called unknown": rate([j.right for j in of("outside")]),
        "controls named": rate([j.false_name for j in of("control")]),
        "right class from 2 sd up": rate([j.right for j in large]),
        "right class, singles": rate([j.right for j in of("single")]),
        "stirred nulls named": rate([j.false_name for j in of("stirred null")]),
        "right class, stirred": rate([j.right for j in of("stirred single")]),
        "both of two": rate([j.right for j in of("two")]),
        "all of three": rate([j.right for j in of("three")]),
        "at least two of three": rate([j.right or j.partly for j in of("three")]),
        "at least one of two": rate([j.right or j.partly for j in of("two")]),
        "confounded: the class": rate([j.right for j in of("confounded")]),
        "confounded: one alone": rate([j.overconfident for j in of("confounded")]),
        **{
            f"law: {what}": rate([j.law[key] for j in rows if j.law is not None])
            for what, key in (
                ("learned", "learned"),
                ("place", "place"),
                ("form and variables", "variables"),
                ("memory", "memory"),
            )
        },
        "law: place, form and variables": rate(
            [j.law["place"] and j.law["variables"] for j in rows if j.law is not None]
        ),
        "false names beside a true effect": rate([j.false_name for j in rows if j.bucket in NAMED]),
        "of these, alike in this recording": rate(
            [j.excused for j in rows if j.bucket in NAMED and j.false_name]
        ),
    }


def summary(
    judged: list[Judgment], extra: dict[str, Any], sealed: dict[str, Any], runs: list[dict[str, Any]]
) -> dict[str, Any]:
    """Return the score as one dictionary of rates, tables and bars."""
    covered = [hit for j in judged for hit in j.covered.values()]
    located = [j.located for j in judged if j.located is not None]
    named = [j.case for j in judged if j.bucket in NAMED]
    gaps = [_gap_of(extra, case) for case in named]
    declared = [_gap_of(extra, case, "tool from declared") for case in named]
    gap = _median([g for g in gaps if g is not None])
    unnamed = [_gap_of(extra, j.case) for j in judged if j.bucket == "outside"]
    gap_outside = _median([g for g in unnamed if g is not None])
    right = {j.case for j in judged if j.right}
    known = [_gap_of(extra, case) for case in named if case in right]
    singles = [j for j in judged if j.bucket == "single"]
    missed = [j.minimum_detectable for j in singles if j.minimum_detectable is not None]
    matrix: dict[str, Counter[str]] = {}
    for j in judged:
        matrix.setdefault(_row(j), Counter())[j.column] += 1
    rates = _rates(judged)
    seconds = [float(r["seconds"]) for r in runs]
    return {
        "cases": len(judged),
        "buckets": dict(Counter(j.bucket for j in judged)),
        "rates": rates,
        "coverage": rate(covered),
        "coverage by parameter": {
            k: rate([j.covered[k] for j in judged if k in j.covered])
            for k in sorted({k for j in judged for k in j.covered})
        },
        "located": rate([bool(x) for x in located]),
        "gap": gap,
        "gap outside": gap_outside,
        "gap where right": _median([g for g in known if g is not None]),
        "gap from declared": _median([g for g in declared if g is not None]),
        "power by size": _binned([(j.size, j.right) for j in singles], SIZES),
        "noticed by size": _binned(
            [(j.size, j.verdict not in ("nothing", "failed")) for j in singles], SIZES
        ),
        "power by distance": _binned([(j.distance, j.right) for j in singles], DISTANCES),
        "misses above detectable": rate([x < 1.0 for x in missed]),
        "matrix": {k: dict(v) for k, v in sorted(matrix.items())},
        "right by row": {
            k: rate([j.right for j in judged if _row(j) == k]) for k in sorted({_row(j) for j in judged})
        },
        "failed": sorted(j.case for j in judged if j.verdict == "failed"),
        "baselines": {
            k: _of_baseline(k, judged, extra, sealed) for k in (*baselines.METHODS, "commonest effect")
        },
        "seconds": {"total": sum(seconds), "median": float(np.median(seconds)) if seconds else None},
        "bars": bars(rates, rate(covered), gap, gap_outside),
    }


def bars(
    rates: dict[str, Rate], coverage: Rate, gap: dict[str, Any], gap_outside: dict[str, Any]
) -> list[Bar]:
    """Return the bars of the contract against what was observed; none is moved here."""

    def line(title: str, asked: str, observed: Rate, met: bool) -> Bar:
        return Bar(title=title, asked=asked, observed=str(observed), met=met if observed.of else None)

    null, outside = rates["false names on nulls"], rates["misnamed from outside"]
    both, law = rates["both of two"], rates["law: place, form and variables"]
    right = rates["right class from 2 sd up"]

    def median(title: str, row: dict[str, Any], least: float) -> Bar:
        closed = row["median"]
        return Bar(
            title=title, asked=f"at least {100 * least:.0f} %",
            observed="none observed" if closed is None else f"{100 * closed:.0f} % over {row['n']} cases",
            met=None if closed is None else closed >= least,
        )  # fmt: skip

    return [
        line("false names on nulls", "at most 2 %", null, null.value <= 0.02),
        line("misnamed from outside the catalogue", "at most 5 %", outside, outside.value <= 0.05),
        line("right class from twice the noise floor up", "at least 95 %", right, right.value >= 0.95),
        line("both of two", "at least 95 %", both, both.value >= 0.95),
        line("place, form and variables of the law from outside", "at least 80 %", law, law.value >= 0.80),
        median("median of the gap closed on untouched conditions", gap, 0.80),
        median("the same where what is missing has no name", gap_outside, 0.50),
        line("95 % intervals that cover", "93 to 97 %", coverage, 0.93 <= coverage.value <= 0.97),
    ]  # fmt: skip
