"""``make recordings DATA=DIR``: the diagnosis of real recordings, one after the other, failures first.

Each answer is written to the results file as soon as it is there; a recording whose files are not in the
folder is reported as not run.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path

from benchmarks.recordings.answer import Answer, diagnose
from benchmarks.recordings.catalogue import RECORDINGS
from benchmarks.recordings.page import table
from benchmarks.recordings.recording import Recording
from benchmarks.records import AbsentError, HashError
from toolkit.errors import ToolkitError


def answer(recording: Recording, data: Path, *, budget_s: float) -> Answer:
    """Return the answer on a recording; a diagnosis that ends with an error is an outcome too.

    Raises
    ------
    HashError : where a file is not the published one
    """
    try:
        runs = recording.read(data)
        with tempfile.TemporaryDirectory() as folder:
            return diagnose(recording, runs, Path(folder), budget_s=budget_s)
    except AbsentError as error:
        absent = Path(str(error.where)).name
        return Answer(
            recording=recording.name,
            outcome="not run",
            verdict="",
            remark=f"{absent} is not in the data folder",
        )
    except HashError:
        raise
    except ToolkitError as error:
        return Answer(
            recording=recording.name, outcome="failed", verdict="", remark=str(error).splitlines()[0]
        )


def main(arguments: list[str] | None = None) -> int:
    """Run the recordings that are named, or all; print the table; return the exit code."""
    parser = argparse.ArgumentParser(prog="make recordings", description=__doc__)
    parser.add_argument("data", type=Path, help="folder of the publishers' files")
    parser.add_argument("names", nargs="*", metavar="RECORDING", help="default: all")
    parser.add_argument("--budget", type=float, default=120.0, help="seconds of each diagnosis (default 120)")
    parser.add_argument("--results", type=Path, help="JSON lines, one for each answer, as they come")
    options = parser.parse_args(arguments)
    if unknown := sorted(set(options.names) - {recording.name for recording in RECORDINGS}):
        parser.error(f"no such recording: {', '.join(unknown)}")
    answers = []
    for recording in RECORDINGS:
        if options.names and recording.name not in options.names:
            continue
        try:
            answers.append(answer(recording, options.data, budget_s=options.budget))
        except ToolkitError as error:
            print(error, file=sys.stderr)  # noqa: T201
            return 2
        print(f"{recording.name}: {answers[-1].outcome}", file=sys.stderr, flush=True)  # noqa: T201
        if options.results:
            with options.results.open("a", encoding="utf-8") as results:
                results.write(json.dumps(answers[-1].document()) + "\n")
    print(table(answers))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
