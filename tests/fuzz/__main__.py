"""Fuzz every input format: ``python -m tests.fuzz --seconds 120``; what fails is printed as a recipe."""

from __future__ import annotations

import argparse
import secrets
import sys
import time
from collections import Counter

from tests.fuzz.bench import Failure, run_target
from tests.fuzz.corpus import TARGETS


def main() -> int:
    """Run the bench and print its table; 1 where something failed."""
    names = [target.name for target in TARGETS]
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--format", action="append", choices=names, help="only this one; may be given again")
    parser.add_argument("--count", type=int, default=200, help="inputs of each format")
    parser.add_argument("--seconds", type=float, default=300.0, help="for all formats together")
    parser.add_argument("--seed", type=int, default=None, help="default: a new one, which is printed")
    parser.add_argument("--show", action="store_true", help="print what each failure said")
    options = parser.parse_args()
    seed = secrets.randbelow(10**6) if options.seed is None else options.seed
    chosen = options.format or names
    print(f"seed {seed}, {options.count} inputs of each of {len(chosen)} formats, {options.seconds:g} s")  # noqa: T201
    print(f"{'format':<18}{'inputs':>8}{'accepted':>10}{'refused':>9}{'failed':>8}{'s':>7}")  # noqa: T201
    failures: dict[tuple[str, str], Failure] = {}
    ends = time.monotonic() + options.seconds
    for position, name in enumerate(chosen):
        began = time.monotonic()
        share = (ends - began) / (len(chosen) - position)
        codes: Counter[str] = Counter()
        for _, code, failure in run_target(
            name, seed=seed, numbers=range(options.count), until=began + share
        ):
            codes["failed" if failure else "refused" if code == 2 else "accepted"] += 1
            if failure is not None:
                failures.setdefault((name, failure.fault), failure)
        row = f"{codes['accepted']:>10}{codes['refused']:>9}{codes['failed']:>8}"
        print(f"{name:<18}{codes.total():>8}{row}{time.monotonic() - began:>7.1f}", flush=True)  # noqa: T201
    for failure in failures.values():
        print(failure.line())  # noqa: T201
        if options.show:
            print(failure.text)  # noqa: T201
    return int(bool(failures))


if __name__ == "__main__":
    sys.exit(main())
