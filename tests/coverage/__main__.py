"""`make coverage`: how often the intervals that the toolkit prints hold the truth, by simulation.

The tables are those of `docs/coverage.md`: calibration sessions, characteristics of whole virtual tests and
of tests that another made, single curves, parameters of the Magic Formula and of its combined slip, sound
rows that are left alone, and spreads of repeats. Nothing here asserts; a small seeded part runs with the
tests.
"""

from __future__ import annotations

import argparse
import sys
import time

from tests.coverage import (
    calibration,
    characteristics,
    combined_slip,
    foreign_tests,
    hubs,
    magic_formula,
    repeats,
    single_curves,
    sound_rows,
)
from tests.coverage.rows import as_table

TABLES = {
    "calibration": calibration.table,
    "hubs": hubs.table,
    "characteristics": characteristics.table,
    "foreign-tests": foreign_tests.table,
    "single-curves": single_curves.table,
    "magic-formula": magic_formula.table,
    "combined-slip": combined_slip.table,
    "sound-rows": sound_rows.table,
    "repeats": repeats.table,
}


def main() -> None:
    """Print the tables that are named, or all."""
    parser = argparse.ArgumentParser(prog="make coverage", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *TABLES], help="which; default: all")
    parser.add_argument("--repetitions", type=int, default=60, help="sessions or tests a row (default 60)")
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--workers", type=int, default=2)
    given = parser.parse_args()
    for name in given.names or TABLES:
        began = time.perf_counter()
        rows = TABLES[name](given.repetitions, given.seed, given.workers)
        took = time.perf_counter() - began
        sys.stdout.write(f"## {name}\n\n{as_table(rows)}\n\n")
        sys.stdout.flush()
        sys.stderr.write(f"{name}: {took:.0f} s\n")


if __name__ == "__main__":
    main()
