"""`make bench`: medians and ratios, each against a named peer in the same run.

Machines are shared and noisy: a peer is timed in turn with ours, pair by pair, and the ratio of a pair is
what counts. Nothing here asserts.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

from tests.benchmarks import (
    apply_rows,
    audit_kills,
    audit_rate,
    diagnose_equations,
    diagnose_nulls,
    diagnose_time,
    diagnose_worker,
    fit_rows,
    help_time,
    issue_time,
    ledger_time,
    monte_carlo,
    process_time,
    registry_growth,
    report_batch,
    report_time,
    seal_time,
    tire_fits,
    unknown_rows,
    verify_records,
    workbench_paint,
)

BENCHES: dict[str, Callable[[Path, int], list[dict[str, object]]]] = {
    "help": help_time.run,
    "process": process_time.run,
    "report": report_time.run,
    "reports": report_batch.run,
    "fit": fit_rows.run,
    "apply": apply_rows.run,
    "verify": verify_records.run,
    "registry": registry_growth.run,
    "seal": seal_time.run,
    "issue": issue_time.run,
    "ledger": ledger_time.run,
    "monte-carlo": monte_carlo.run,
    "audit": audit_rate.run,
    "audit-kills": audit_kills.run,
    "unknown": unknown_rows.run,
    "tires": tire_fits.run,
    "diagnose": diagnose_time.run,
    "diagnose-equations": diagnose_equations.run,
    "diagnose-nulls": diagnose_nulls.run,
    "diagnose-worker": diagnose_worker.run,
    "workbench": workbench_paint.run,
}


def main() -> None:
    """Run the benchmarks that are named, or all."""
    parser = argparse.ArgumentParser(prog="make bench", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *BENCHES], help="which; default: all")
    parser.add_argument("--pairs", type=int, default=7, help="pairs of runs (default 7)")
    parser.add_argument("--json", action="store_true")
    given = parser.parse_args()
    rows: list[dict[str, object]] = []
    with tempfile.TemporaryDirectory() as folder:
        for name in given.names or BENCHES:
            rows += BENCHES[name](Path(folder), given.pairs)
    if given.json:
        json.dump({"schema": 1, "benchmarks": rows}, sys.stdout, indent=2)
        return
    print(f"{'what':<58}{'ours':>12}{'peer':>12}{'ratio':>8}{'aim':>8}   peer")  # noqa: T201
    for row in rows:
        unit = f"{row.get('unit', 's'):<2}"
        peer = "" if row["peer_s"] is None else f"{row['peer_s']:.3f} {unit}"
        ratio = "" if row["ratio"] is None else f"{row['ratio']:.2f}"
        print(  # noqa: T201
            f"{row['what']:<58}{row['ours_s']:>9.3f} {unit}{peer:>12}{ratio:>8}{row['aim']:>8}  {row['peer']}"
        )


if __name__ == "__main__":
    main()
