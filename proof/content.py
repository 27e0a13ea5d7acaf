"""What the proof says, as sentences and tables; how it looks is page.py's."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

HEADLINE = ("false names on nulls", "misnamed from outside", "right class from 2 sd up")


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One table of the proof."""

    title: str
    sentence: str
    head: tuple[str, ...]
    rows: list[list[str]]
    curve: str | None = None
    """The score's key of the power curve that stands beside it."""


def gap(row: dict[str, Any]) -> str:
    """Return a gap's median and quartiles in words."""
    if row["median"] is None:
        return "none observed"
    low, high = row["quartiles"]
    quartiles = f"quartiles {100 * low:.0f} to {100 * high:.0f}, {row['n']} cases"
    return f"median {100 * row['median']:.0f} % ({quartiles})"


def span(row: dict[str, Any]) -> str:
    """Return a bin's ends in words."""
    return f"{row['from']:g} and more" if math.isinf(row["to"]) else f"{row['from']:g} to {row['to']:g}"


def _rates(score: dict[str, Any]) -> list[list[str]]:
    rows = [[k, str(v)] for k, v in score["rates"].items()]
    rows += [
        ["intervals that cover", str(score["coverage"])],
        ["mismatch shown in the right output", str(score["located"])],
        ["gap closed, from refitted to oracle", gap(score["gap"])],
        ["the same where the answer is right", gap(score["gap where right"])],
        ["gap closed where what is missing has no name", gap(score["gap outside"])],
        ["gap closed, from declared to oracle", gap(score["gap from declared"])],
        ["misses above the size that the tool says it sees", str(score["misses above detectable"])],
    ]
    return rows


def _methods(score: dict[str, Any]) -> list[list[str]]:
    ours = ("toolkit diagnose", score["rates"] | {"gap": score["gap"]})
    return [
        [name, *(str(row[k]) for k in HEADLINE), gap(row["gap"])]
        for name, row in (ours, *score["baselines"].items())
    ]


def _put_in(score: dict[str, Any]) -> Table:
    never = score["never put in"]
    what = f"Never put in, so that this batch says nothing of them: {', '.join(never)}." if never else (
        "Every effect of the catalogue was put in."
    )  # fmt: skip
    return Table(
        title="What was put in",
        sentence="Families that can conceal it, alone or only as a class; its mean share of a batch as a"
        f" single effect; how often it was here, in all kinds of case. {what}",
        head=("effect", "families", "mean share", "times", "right where alone"),
        rows=[
            [
                k,
                ", ".join(v["families"]) or "none",
                f"{100 * v['share']:.1f} %",
                str(v["times"]),
                str(v["right"]),
            ]
            for k, v in score["put in"].items()
        ],
    )


def _from_outside(score: dict[str, Any]) -> Table:
    return Table(
        title="Outside the catalogue",
        sentence="Why each is outside, and the largest share of its energy here that one catalogue effect,"
        " with a size of its own in every run, could take; a draw with more than a third is not used.",
        head=("what", "why it is outside", "largest share", "called unknown", "misnamed"),
        rows=[
            [k.removeprefix("hidden_"), v["reason"], f"{100 * v['largest share']:.0f} %", str(v["unknown"]),
             str(v["misnamed"])]
            for k, v in score["outside"].items()
        ],
    )  # fmt: skip


def _classes(score: dict[str, Any]) -> Table:
    return Table(
        title="Deliberately confounded",
        sentence="The right answer is the class, and why no analysis of the recording can say more.",
        head=("class", "why", "the class", "one member alone", "a false name"),
        rows=[
            [k, v["reason"], str(v["right"]), str(v["one alone"]), str(v["false"])]
            for k, v in score["classes"].items()
        ],
    )


def _confusion(score: dict[str, Any]) -> list[list[str]]:
    def cells(row: dict[str, int]) -> str:
        return ", ".join(f"{name} {n}" for name, n in sorted(row.items(), key=lambda x: (-x[1], x[0])))

    return [[there, str(score["right by row"][there]), cells(row)] for there, row in score["matrix"].items()]


def _real(score: dict[str, Any]) -> Table:
    keys = ("title", "asked", "answered", "right", "error", "published")
    return Table(
        title="Real recordings",
        sentence="Public recordings whose left-out effect is known; the case does not name it.",
        head=("recording", "asked", "answered", "", "held-out error", "published, or measured elsewhere"),
        rows=[[str(row[k]) for k in keys] for row in score["real"]],
    )


def _log(score: dict[str, Any]) -> Table:
    return Table(
        title="Batches",
        sentence="Every batch that was opened; none is scored again after a change.",
        head=("drawn", "scored", "answers sealed as", "cases", "bars met", "changed since the one before"),
        rows=[
            [
                r["drawn"],
                r.get("scored", "not yet"),
                f"`{r['answers_sha256'][:16]}`",
                str(r["cases"]),
                r.get("bars", ""),
                r["changed"],
            ]
            for r in score["log"]
        ],
    )


def _missed(score: dict[str, Any]) -> list[Table]:
    """Return the bars that this batch does not meet, what every batch reached, and the stated reason."""
    log = score.get("log") or []
    reasons = {k: v for row in log for k, v in row.get("reasons", {}).items() if row is log[-1]}
    rows = [
        [
            b.title,
            "; ".join(
                f"{row['figures'][b.title]} (`{row['answers_sha256'][:8]}`)"
                for row in log
                if b.title in row.get("figures", {})
            ),
            reasons.get(b.title, "not stated"),
        ]
        for b in score["bars"]
        if b.met is False
    ]
    if not rows:
        return []
    return [
        Table(
            title="Bars that are not met",
            sentence="What each batch of the log reached, the last one being this, and why it is not more.",
            head=("what", "reached, by batch", "reason"),
            rows=rows,
        )
    ]


def tables(score: dict[str, Any]) -> list[Table]:
    """Return the proof's tables in order."""
    state = {True: "met", False: "**not met**", None: "too few"}
    sizes = zip(score["power by size"], score["noticed by size"], strict=True)
    out = [
        Table(
            title="The bars",
            sentence="Each is an observed rate with its exact (Clopper-Pearson) 95 % interval.",
            head=("what", "asked", "observed", ""),
            rows=[[b.title, b.asked, b.observed, state[b.met]] for b in score["bars"]],
        ),
        *_missed(score),
        Table(
            title="All rates",
            sentence="A false name is any name that is not there, alone or beside a true one.",
            head=("what", "observed"),
            rows=_rates(score),
        ),
        Table(
            title="Power by size",
            sentence="Single effects; RMS over noise sd after the nominal parameters took their part.",
            head=("size", "right name or class", "noticed at all"),
            rows=[[span(a), str(a["rate"]), str(b["rate"])] for a, b in sizes],
            curve="power by size",
        ),
        Table(
            title="Power by distance",
            sentence="Single effects. Distance over the whole recording in noise sd, corrected for colour.",
            head=("distance", "right name or class"),
            rows=[[span(a), str(a["rate"])] for a in score["power by distance"]],
            curve="power by distance",
        ),
        Table(
            title="Power by predicted size",
            sentence="Single effects whose parameter the contract fixes: size over what the tool says it sees"
            " with 80 % power (median of its statements for this effect in the family's other cases).",
            head=("size over detectable", "right name or class"),
            rows=[[span(a), str(a["rate"])] for a in score["power by detectable"]],
            curve="power by detectable",
        ),
        Table(
            title="Beside simpler methods",
            sentence="The same cases and judge; a baseline's names are those of its terms.",
            head=("", *HEADLINE, "gap closed"),
            rows=_methods(score),
        ),
        Table(
            title="Coverage by parameter",
            sentence="Of the effects that were named, where the contract fixes the parameter's meaning.",
            head=("parameter", "covered"),
            rows=[[k, str(v)] for k, v in score["coverage by parameter"].items()],
        ),
        Table(
            title="Confusion",
            sentence="Left what was there, right what was answered and how often: a name alone, a name of"
            " a class, or the verdict where nothing is named.",
            head=("there", "right", "answers"),
            rows=_confusion(score),
        ),
        _put_in(score),
        _from_outside(score),
        _classes(score),
    ]
    if score.get("real"):
        out.append(_real(score))
    if score.get("log"):
        out.append(_log(score))
    return out


def intro(score: dict[str, Any], batch: dict[str, Any]) -> list[str]:
    """Return the sentences at the head."""
    count = ", ".join(f"{n} {k}" for k, n in sorted(score["buckets"].items(), key=lambda x: -x[1]))
    total = score["seconds"]["total"]
    pace = f"{60 * score['cases'] / total:.1f} cases a minute of one process" if total else "not timed"
    failed = f"No answer: {', '.join(score['failed'])}" if score["failed"] else "Every case was answered"
    return [
        f"{score['cases']} cases ({count}), drawn by a generator that shares no code with `toolkit/`, sealed,"
        " run once through `toolkit diagnose`, opened and scored.",
        f"Sealed before the run: answers `{batch['answers_sha256']}`, data `{batch['data_sha256']}`.",
        f"{failed}; {pace}.",
    ]


def closing() -> list[str]:
    """Return what is not covered."""
    return [
        "The Gaussian process names nothing by its nature. The sparse regression is the algorithm of pysindy,"
        " written here. Localisation is asked of outputs, and of the place of a law. Parameters whose meaning"
        " the contract leaves open (phases, quadratic terms, heat and wear rates) are not asked to be"
        " covered.",
        "A gap below 0.1 noise sd is not asked to be closed; without predictions nothing is closed.",
    ]
