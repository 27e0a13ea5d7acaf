"""One answer of the tool against one sealed answer."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from proof.laws import judged_law

NULLS = ("null", "stirred null")


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgment:
    """What one case adds to the score."""

    case: str
    bucket: str
    truth: tuple[str, ...]
    verdict: str
    """The tool's; "failed" where it gave no answer that can be read."""
    reported: tuple[frozenset[str], ...]
    """One set per effect of the answer: its name and those that it calls equivalent."""
    right: bool
    """The verdict that the case asks for: the effect or a class with it, all of two, nothing, unknown, the
    class."""
    false_name: bool
    """Something was named that is not there: on a null, from outside the catalogue, or beside the truth."""
    partly: bool = False
    """All of several effects but one were found, and nothing else named."""
    excused: bool = False
    """What was named is not there, but this recording cannot tell it from what is."""
    overconfident: bool = False
    """One member of a class that cannot be told apart was named alone."""
    column: str = ""
    """The confusion matrix's column."""
    covered: dict[str, bool] = field(default_factory=dict)
    """Parameter -> whether its 95 % interval holds the true value."""
    located: bool | None = None
    """The output that shows most of the mismatch is the one that truly does; None: not asked."""
    size: float = 0.0
    distance: float = 0.0
    minimum_detectable: float | None = None
    """What the tool says that it would have seen, over what was there (missed effects only)."""
    law: dict[str, bool] | None = None
    """Of an effect from outside: whether its law was learned, and is right; None: not asked."""


def sets_of(answer: dict[str, Any]) -> tuple[frozenset[str], ...]:
    """Return each reported effect as the set of names that it may be."""
    return tuple(
        frozenset({str(e["name"]), *map(str, e.get("equivalent_to") or [])})
        for e in answer.get("effects", [])
    )


def _right(sealed: dict[str, Any], verdict: str, reported: tuple[frozenset[str], ...]) -> tuple[bool, bool]:
    """Return whether the answer is right, and whether it names what is not there."""
    truth = [e["name"] for e in sealed["effects"]]
    bucket = sealed["bucket"]
    stray = [r for r in reported if not any(t in r for t in truth)]
    if bucket in NULLS:
        return verdict == "nothing", bool(reported)
    if bucket in ("outside", "control"):
        wanted = ("unknown",) if bucket == "outside" else ("unknown", "nothing")
        return verdict in wanted and not reported, bool(reported)
    found = [any(t in r for r in reported) for t in truth]
    if bucket == "confounded":
        members = set(sealed["class"])
        whole = [r for r in reported if truth[0] in r and len(r & members) > 1]
        return verdict == "equivalent" and bool(whole) and not stray, bool(stray)
    return all(found) and not stray, bool(stray)


def _column(verdict: str, reported: tuple[frozenset[str], ...], truth: list[str]) -> str:
    if not reported:
        return verdict
    for r in reported:
        hit = [t for t in truth if t in r]
        if hit:
            return hit[0] if len(r) == 1 else f"{hit[0]} (class)"
    return sorted(reported[0])[0] if len(reported[0]) == 1 else "another class"


def _coverage(sealed: dict[str, Any], answer: dict[str, Any]) -> dict[str, bool]:
    out = {}
    for truth in sealed["effects"]:
        for effect in answer.get("effects", []):
            if effect["name"] != truth["name"] or not truth["parameters"]:
                continue
            here, there = effect.get("channel"), truth.get("channel")
            if here and there and here != there:
                continue  # the same name on another channel has a parameter in another unit
            for p in effect.get("parameters", []):
                wanted, interval = truth["parameters"].get(p["name"]), p.get("ci95")
                if wanted is None or not interval or None in interval or p.get("runs"):
                    continue
                low, high = sorted(map(float, interval))
                hit = low <= wanted <= high
                if truth["either_sign"]:
                    hit = hit or low <= -wanted <= high
                out[f"{truth['name']}.{p['name']}"] = hit
    return out


def _located(sealed: dict[str, Any], answer: dict[str, Any]) -> bool | None:
    by_output = sealed.get("by_output") or {}
    rows = answer.get("mismatch") or []
    if not sealed["effects"] or len(by_output) < 2 or not rows:
        return None
    first, second = sorted(by_output.values(), reverse=True)[:2]
    if first < 1.5 * second:
        return None
    most = max(rows, key=lambda row: float(row.get("share_of_variance") or 0.0))
    return bool(by_output[most["channel"]] == first) if most["channel"] in by_output else None


def _detectable(sealed: dict[str, Any], answer: dict[str, Any]) -> float | None:
    """Return minimum detectable over true size for a single effect that was missed."""
    if sealed["bucket"] != "single" or not sealed["effects"][0]["parameters"]:
        return None
    truth = sealed["effects"][0]
    value = abs(next(iter(truth["parameters"].values())))
    for row in answer.get("not_found", []):
        if (
            row["name"] == truth["name"]
            and row.get("minimum_detectable")
            and row.get("observable", True)
            and value
        ):
            return abs(float(row["minimum_detectable"])) / value
    return None


def judge(case: str, sealed: dict[str, Any], answer: dict[str, Any] | None) -> Judgment:
    """Return the judgment of one case; None: the tool gave no answer."""
    truth = [e["name"] for e in sealed["effects"]]
    common = {
        "case": case, "bucket": sealed["bucket"], "truth": tuple(truth), "size": sealed["size"],
        "distance": sealed["distance"],
    }  # fmt: skip
    if answer is None:
        return Judgment(
            **common, verdict="failed", reported=(), right=False, false_name=False, column="failed"
        )
    verdict, reported = str(answer["verdict"]), sets_of(answer)
    right, false_name = _right(sealed, verdict, reported)
    alike = set(sealed.get("alike") or {})
    stray = [r for r in reported if not any(t in r for t in truth)]
    found = [t for t in truth if any(t in r for r in reported)]
    return Judgment(
        **common, verdict=verdict, reported=reported, right=right, false_name=false_name,
        partly=len(truth) > 1 and len(found) == len(truth) - 1 and not stray,
        excused=bool(stray) and all(r & alike for r in stray),
        overconfident=sealed["bucket"] == "confounded" and not right and bool(found),
        column=_column(verdict, reported, truth), covered=_coverage(sealed, answer),
        located=_located(sealed, answer), law=judged_law(sealed, answer),
        minimum_detectable=None if found else _detectable(sealed, answer),
    )  # fmt: skip
