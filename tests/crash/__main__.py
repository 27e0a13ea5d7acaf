"""`make crash`: every writing command, killed and failed at its calls; prints the table of the docs.

    python -m tests.crash [--most N] [NAME ...]

For each command the calls that change its folder are counted: create, write, fsync, rename, unlink, mkdir. At
up to N of them, for each kind of fault, the process is killed, or the call fails. Then: are results of two
runs beside each other, or a manifest beside files that it does not describe (mixed)? Does the next run end
otherwise than it did without a fault, is a result missing, or a file left over (lost)?
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
from pathlib import Path

from tests.crash.bench import Bench
from tests.crash.commands import QUICK, SIGNED, SIGNED_SLOW, SLOW, office, signed_folder, whole_folder
from tests.faults import Runner


def main() -> int:
    """Run the bench; 1 where something is lost or mixed."""
    parser = argparse.ArgumentParser(prog="python -m tests.crash", description=__doc__)
    parser.add_argument("names", nargs="*", help="only commands whose names begin so")
    parser.add_argument("--most", type=int, default=8, help="points of each command and fault")
    wanted = parser.parse_args()
    failed: list[str] = []
    say("| command | calls | points | lost | mixed | recovered |\n|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory(prefix="toolkit-crash-") as place:
        os.environ["TOOLKIT_SOFFICE"] = str(office(Path(place)))
        for folder in ("all", "signed"):
            (Path(place) / folder).mkdir()
        with Runner() as runner:
            bench, signed = (
                Bench(prepare, Path(place) / folder, runner)
                for prepare, folder in ((whole_folder, "all"), (signed_folder, "signed"))
            )
            for command in (*QUICK, *SLOW, *SIGNED, *SIGNED_SLOW):
                if wanted.names and not command.name.startswith(tuple(wanted.names)):
                    continue
                judging = signed if command in (*SIGNED, *SIGNED_SLOW) else bench
                count = judging.judge(command, most=wanted.most)
                row = (
                    command.name,
                    count.calls,
                    count.points,
                    len(count.lost),
                    len(count.mixed),
                    count.recovered,
                )
                say(f"| {' | '.join(map(str, row))} |")
                failed += count.lost + count.mixed
    for line in failed:
        say(line)
    return 1 if failed else 0


def say(line: str) -> None:
    """Print a line at once: the bench takes minutes."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


raise SystemExit(main())
