"""A writing command, killed or failed at one of its calls, and what is then on the disk."""

from __future__ import annotations

import errno
import json
import shutil
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from tests.crash.calls import contents
from tests.faults import KILL, Outcome, Runner
from toolkit.files import sha256_bytes

FAULTS = {"kill": KILL, "no space": errno.ENOSPC, "I/O error": errno.EIO}
_HIDDEN, _PART = ".toolkit-", ".part"
# What an audit keeps as it goes: lines that are used again, each with its own checksum.
_GOES_ON = ("results.jsonl", "sums.jsonl")
_ENDS = {0, 1, 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """A command line whose ``{work}`` is its folder.

    Attributes
    ----------
    first : makes the earlier results that ``words`` replace; None: there are none
    sets : folders or files, each of which belongs together
    others : files of somebody else beside the results
    registry : results are the registry's, which its own reader completes
    home : where below its folder the registry's home is
    then : the next entry, with which a registry's remnant goes; None: the command itself is one
    once : a result is never written over: the next run refuses where one is in place
    proved : files that, wherever they are there, `verify` proves by the ledger of the home: no document
        without its entry, and none with half a seal
    """

    name: str
    words: str
    first: str | None = None
    sets: tuple[str, ...] = ("out",)
    others: tuple[str, ...] = ()
    registry: bool = False
    home: str = "."
    then: str | None = None
    once: bool = False
    proved: tuple[str, ...] = ()


@dataclass(slots=True)
class Count:
    """What was seen at the points of one command."""

    calls: int = 0
    points: int = 0
    lost: list[str] = field(default_factory=list)
    mixed: list[str] = field(default_factory=list)
    recovered: int = 0


class Bench:
    """Commands on one prepared folder, always under the same path."""

    def __init__(self, prepare: Callable[[Path, Runner], object], place: Path, runner: Runner) -> None:
        self.runner, self.base, self.work = runner, place / "base", place / "work"
        self.base.mkdir()
        prepare(self.base, runner)

    def judge(self, command: Command, *, most: int, faults: Sequence[str] = tuple(FAULTS)) -> Count:
        """Kill and fail a command at up to ``most`` of its calls for each kind of fault."""
        with tempfile.TemporaryDirectory() as place:
            before = self._before(command, Path(place))
            old = self._results(command)
            reference = self._run(command.words)
            assert reference.code in (0, 1), reference.err
            new = self._results(command)
            self._restore(before)
            self._run(command.words)
            # A date or a time in a file makes its bytes those of one run only.
            same = {name for name, data in self._results(command).items() if new.get(name) == data}
            count = Count(calls=len(reference.calls))
            for fault in faults:
                for at in chosen(reference.calls, most):
                    self._restore(before)
                    where = f"{command.name}, {fault} at {at} {reference.calls[at - 1]}"
                    ended = self._run(command.words, at=at, fault=FAULTS[fault])
                    if ended.code == reference.code:
                        ended_well = True  # it did not need that call
                    else:
                        ended_well = ended.code == (-9 if fault == "kill" else 2)
                    seen = self._results(command)
                    if not ended_well or self._mixed(command, seen, old, new):
                        count.mixed.append(f"{where}: exit {ended.code}")
                    elif "nothing was changed" in ended.err and seen != old:
                        count.mixed.append(f"{where}: changed")
                    again = self._run(command.words)
                    after = self._results(command)
                    if command.then is not None:
                        self._run(command.then)
                    whole = {*after} == {*new} and all(after[name] == new[name] for name in same)
                    expected = 2 if command.once and {*seen} == {*new} else reference.code
                    if again.code != expected and not command.registry:
                        count.lost.append(f"{where}: then exit {again.code}: {again.err[:200]}")
                    elif not whole and not command.registry:
                        count.lost.append(f"{where}: then {sorted({*after} ^ {*new})}")
                    elif remnants := list(self._remnants()):
                        count.lost.append(f"{where}: left {remnants}")
                    elif command.registry and self._asked(command, "verify") not in (0, 1):
                        count.lost.append(f"{where}: then verify fails")
                    else:
                        count.recovered += 1
                    count.points += 1
            return count

    def _before(self, command: Command, place: Path) -> Path:
        shutil.rmtree(self.work, ignore_errors=True)
        shutil.copytree(self.base, self.work, symlinks=True)
        if command.first is not None:
            made = self._run(command.first)
            assert made.code in (0, 1), made.err
        for name in command.others:
            (self.work / name).parent.mkdir(parents=True, exist_ok=True)
            (self.work / name).write_text("somebody else's")
        shutil.copytree(self.work, place / "before", symlinks=True)
        return place / "before"

    def _restore(self, before: Path) -> None:
        shutil.rmtree(self.work)
        shutil.copytree(before, self.work, symlinks=True)

    def _run(self, words: str, *, at: int = 0, fault: int = KILL) -> Outcome:
        line = [word.replace("{work}", str(self.work)) for word in words.split()]
        return self.runner.run(line, root=self.work, at=at, fault=fault)

    def _results(self, command: Command) -> dict[str, bytes]:
        """Return every file that is no folder of the toolkit's on its way, by its path."""
        results: dict[str, bytes] = {}
        for place in command.sets:
            path = self.work / place
            files = {place: path.read_bytes()} if path.is_file() else {}
            if path.is_dir():
                files = {f"{place}/{name}": data for name, data in contents(path).items()}
            results |= {name: data for name, data in files.items() if not passing(name)}
        return results

    def _mixed(
        self, command: Command, seen: dict[str, bytes], old: dict[str, bytes], new: dict[str, bytes]
    ) -> bool:
        if command.registry:
            present = [name for name in command.proved if (self.work / name).exists()]
            proving = f"verify {' '.join(f'{{work}}/{n}' for n in present)} --home {{work}}/{command.home}"
            if present and self._run(proving).code != 0:
                return True
            return self._asked(command, "verify") not in (0, 1) or self._asked(command, "list") != 0
        for place in command.sets:
            ages = {
                "old" if seen[name] == old.get(name) else "new"
                for name in seen
                if name.startswith(place) and old.get(name) != new.get(name)
            }
            if len(ages) > 1:
                return True
        return not all(
            agrees(data, Path(name).parent, seen)
            for name, data in seen.items()
            if name.endswith("manifest.json")
        )

    def _asked(self, command: Command, question: str) -> int:
        """Return how the registry's own reader ends."""
        return self._run(
            f"calibration {question} --calibrations {{work}}/{command.home}/calibrations --quiet"
        ).code

    def _remnants(self) -> Iterator[str]:
        for path in self.work.rglob("*"):
            if path.name.startswith(_HIDDEN) or path.name.endswith(_PART):
                yield str(path.relative_to(self.work))


def passing(name: str) -> bool:
    """Tell whether a path is none of a result: staged, or lines that an audit goes on with."""
    parts = Path(name).parts
    return (
        parts[-1] in _GOES_ON or parts[-1].endswith(_PART) or any(part.startswith(_HIDDEN) for part in parts)
    )


def agrees(manifest: bytes, folder: Path, seen: dict[str, bytes]) -> bool:
    """Tell whether every output that a manifest names is there as it says."""
    return all(
        sha256_bytes(seen.get(str(folder / output["name"]), b"")) == output["sha256"]
        for output in json.loads(manifest)["outputs"]
    )


def chosen(calls: Sequence[str], most: int) -> list[int]:
    """Return which calls to fail, from 1: where another kind of call begins, and spread evenly over these."""
    kinds = [call.split()[1] for call in calls]
    turns = [
        i for i, kind in enumerate(kinds, 1) if i == 1 or kind != kinds[i - 2] or kind.startswith("rename")
    ]
    if len(turns) <= most:
        return turns
    return sorted({turns[round(i * (len(turns) - 1) / (most - 1))] for i in range(most)})
