"""`python -m tests.golden freeze --out DIR | check | list`: golden files, written and read."""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

for _threads in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_threads, "1")

from tests.golden.arithmetic import (  # noqa: E402
    OTHER_ARITHMETIC,
    fingerprint,
    read_fingerprint,
    write_fingerprint,
)
from tests.golden.compare import differences  # noqa: E402
from tests.golden.entries import (  # noqa: E402
    FROZEN,
    Entry,
    ask,
    entries,
    read_frozen,
    write_frozen,
)
from tests.golden.surface import package_folder  # noqa: E402
from tests.golden.workplace import workplace  # noqa: E402


def _freeze(chosen: list[Entry], options: argparse.Namespace) -> int:
    """Ask every chosen entry and write the files; answers of entries not chosen stay."""
    _say(f"what {package_folder()} answers is frozen in {options.out}")
    with workplace() as place:
        for entry in chosen:
            started = time.perf_counter()
            answers = read_frozen(options.out, entry.area)
            answers[entry.name] = ask(entry, place)
            write_frozen(options.out, entry.area, answers)
            _say(f"{time.perf_counter() - started:6.1f} s  {entry.name}")
    write_fingerprint(options.out)
    return 0


def _check(chosen: list[Entry], options: argparse.Namespace) -> int:
    """Ask every chosen entry and print what is not as it was frozen."""
    if read_fingerprint(options.frozen) != fingerprint():
        _say(OTHER_ARITHMETIC)
        return 2
    changed, harmless = 0, 0
    with workplace() as place:
        for entry in chosen:
            started = time.perf_counter()
            frozen = read_frozen(options.frozen, entry.area)
            if entry.name not in frozen:
                _say(f"{entry.name}: not frozen")
                changed += 1
                continue
            try:
                today = ask(entry, place)
            except Exception as error:  # noqa: BLE001  an entry that cannot be asked is a difference
                _say(f"{entry.name}: cannot be asked: {type(error).__name__}: {error}")
                changed += 1
                continue
            found = differences(frozen[entry.name], today, entry.area)
            results = [row for row in found if row.kind == "result"]
            changed += bool(results)
            harmless += len(found) - len(results)
            shown = found if options.wording else results
            verdict = "differs" if results else "same"
            _say(f"{time.perf_counter() - started:6.1f} s  {verdict:<8}{entry.name}")
            for row in shown[: options.most]:
                _say(f"  {row}")
            if len(shown) > options.most:
                _say(f"  and {len(shown) - options.most} more (--most)")
    _say(f"{len(chosen)} entries asked of {package_folder()}: {changed} differ")
    if harmless:
        _say(f"{harmless} sentences are reworded or tags added (--wording shows them)")
    return 1 if changed else 0


def _say(text: str) -> None:
    print(text, flush=True)  # noqa: T201


def main(arguments: list[str] | None = None) -> int:
    """Freeze, check or list; exit code 1 where something differs, 2 where nothing can be compared."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    steps = parser.add_subparsers(dest="step", required=True)
    for name, text in (
        ("freeze", "write what the code answers today"),
        ("check", "compare what the code answers today with the frozen files"),
        ("list", "print the entries"),
    ):
        step = steps.add_parser(name, help=text)
        step.add_argument("--quick", action="store_true", help="what the test suite reads")
        step.add_argument("--only", action="append", default=[], help="beginning of names; repeatable")
        if name == "freeze":
            step.add_argument("--out", type=Path, required=True, help="folder of the frozen files")
        if name == "check":
            step.add_argument("--frozen", type=Path, default=FROZEN, help="folder of the frozen files")
            step.add_argument("--most", type=int, default=20, help="differences printed of one entry")
            step.add_argument(
                "--wording", action="store_true", help="print reworded sentences and added tags too"
            )
    options = parser.parse_args(arguments)
    chosen = entries(quick=options.quick, only=options.only)
    if options.step == "list":
        for entry in chosen:
            _say(f"{'quick' if entry.quick else 'long ':<6}{entry.name}")
        return 0
    return (_freeze if options.step == "freeze" else _check)(chosen, options)


if __name__ == "__main__":
    sys.exit(main())
