"""``make benchmarks DATA=DIR``: published sets beside peers of the same run and published figures.

Every model is fitted on the training part; the test part is opened once, to score. A set whose files are
not in the folder, and a peer whose package is not installed (``pip install -e .[benchmarks]``), is reported
as not run.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.peers import PEERS, Peer, evaluate
from benchmarks.records import AbsentError, PublicSet, Split
from benchmarks.sets import SETS
from benchmarks.table import Report, Row, page
from benchmarks.textbook import STAGES, diagnose
from toolkit.errors import ToolkitError

_STAGE_NAMES = {
    "nominal": "text-book model as declared",
    "refitted": "text-book model, refitted",
    "augmented": "with what the diagnosis named",
}


def diagnosis_rows(public: PublicSet, split: Split, folder: Path, budget_s: float) -> list[Row]:
    """Return the rows of a diagnosis's three simulations; without a budget one that says so."""
    if not budget_s:
        return [Row(method=_STAGE_NAMES["augmented"], why_not="no budget was allowed for the diagnosis")]
    answer = diagnose(public, split, folder, budget_s=budget_s)
    verdict = ", ".join([answer.verdict, *answer.effects]) + f"; remaining: {answer.remaining}"
    if not answer.complete:
        verdict += "; budget spent"
    if public.missing and not answer.names(public.missing):
        verdict += f"; missed: {' or '.join(public.missing)}"
    if not answer.refitted:
        why = "the budget was spent before the parameters were fitted"
        declared = Row(method=_STAGE_NAMES["nominal"], errors=answer.errors["nominal"])
        return [declared, *(Row(method=_STAGE_NAMES[stage], why_not=why) for stage in STAGES[1:])]
    return [
        Row(
            method=_STAGE_NAMES[stage], errors=answer.errors[stage],
            remark=verdict if stage == "augmented" else "",
            processor_s=answer.processor_s if stage == "augmented" else None,
        )
        for stage in STAGES
    ]  # fmt: skip


def peer_row(peer: Peer, public: PublicSet, split: Split) -> Row:
    """Return the row of a peer, or why it was not run."""
    if importlib.util.find_spec(peer.package) is None:
        return Row(method=peer.name, why_not=f"{peer.package} is not installed")
    before = time.process_time()
    errors, choice = evaluate(peer, split.train, split.test)
    return Row(
        method=f"{peer.name} ({peer.package})", errors=tuple(public.scale * error for error in errors),
        remark=", ".join(f"{key} {value}" for key, value in choice.items()),
        processor_s=time.process_time() - before,
    )  # fmt: skip


def report(public: PublicSet, data: Path, *, budget_s: float) -> Report:
    """Return the rows of a set; one row that says so where its files are not in the folder.

    Raises
    ------
    HashError : where a file is not the published one
    """
    try:
        split = public.read(data)
    except AbsentError as error:
        absent = Path(str(error.where)).name
        return Report(public=public, rows=(Row(method="all", why_not=f"{absent} is not in the data folder"),))
    except ImportError as error:
        return Report(public=public, rows=(Row(method="all", why_not=f"{error.name} is not installed"),))
    with tempfile.TemporaryDirectory() as folder:
        rows = diagnosis_rows(public, split, Path(folder), budget_s)
    return Report(public=public, rows=(*rows, *(peer_row(peer, public, split) for peer in PEERS)))


def main(arguments: list[str] | None = None) -> int:
    """Run the sets that are named, or all; print the tables or one JSON document; return the exit code."""
    parser = argparse.ArgumentParser(prog="make benchmarks", description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the publishers' files")
    parser.add_argument(
        "names", nargs="*", metavar="SET", help=f"of {', '.join(s.name for s in SETS)}; default: all"
    )
    parser.add_argument(
        "--budget", type=float, default=600.0, help="seconds of each diagnosis, 0: peers alone (default 600)"
    )
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(arguments)
    unknown = sorted(set(options.names) - {public.name for public in SETS})
    if unknown:
        parser.error(f"no such set: {', '.join(unknown)}")
    reports = []
    for public in SETS:
        if options.names and public.name not in options.names:
            continue
        print(public.name, file=sys.stderr, flush=True)  # noqa: T201
        try:
            reports.append(report(public, options.data, budget_s=options.budget))
        except ToolkitError as error:
            print(error, file=sys.stderr)  # noqa: T201
            return 2
    if options.json:
        json.dump({"schema": 1, "benchmarks": [r.document() for r in reports]}, sys.stdout, indent=2)
    else:
        print(page(reports))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
