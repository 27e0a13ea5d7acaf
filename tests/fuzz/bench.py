"""Running mutated inputs: in this process, or in workers that a hang or a crash cannot take down."""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import multiprocessing as mp
import os
import random
import re
import resource
import signal
import sys
import tempfile
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import FrameType

from tests.fuzz.corpus import TARGETS, Target
from tests.fuzz.draws import draw
from tests.fuzz.mutations import UNKNOWN, Mutation, apply
from toolkit.errors import ToolkitError

TIME_S = 20.0
MEMORY_BYTES = 3 << 30
CODES = (0, 1, 2)
_OURS = re.compile(r'File "[^"]*/(toolkit/[^"]+)", line (\d+)')


class HangError(BaseException):
    """An input took longer than its time; no handler of the program may take it for its own."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What became of an input: ``fault`` is empty where it was read or refused as it should be."""

    code: int | None
    fault: str = ""
    text: str = ""


def target_of(name: str) -> Target:
    """Return the target of a name."""
    return next(target for target in TARGETS if target.name == name)


def drawn(target: Target, seed: int, number: int) -> list[Mutation]:
    """Return the recipe of an input: the same for the same seed and number."""
    return draw(target.data(), target.kind, random.Random(f"{seed}/{target.name}/{number}"))


def outcome(target: Target, recipe: Sequence[Mutation], *, time_s: float = TIME_S) -> Outcome:
    """Carry out a recipe on a target's file and run what reads it."""
    data = apply(target.data(), recipe)
    with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
        root = Path(folder)
        for name, content in {**target.files(), target.file: data}.items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        before = _state(root)
        code, text = _run(target, root, time_s)
        fault = _fault(target, recipe, code, text)
        if not fault and code == 2 and _state(root) != before:
            fault = f"half written: {', '.join(sorted(set(_state(root)) ^ set(before))) or target.file}"
    return Outcome(code=code, fault=fault, text=text)


def _state(root: Path) -> dict[str, str]:
    # The lock of a registry may stay; nothing else may.
    files = (path for path in root.rglob("*") if path.is_file())
    return {p.relative_to(root).as_posix(): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


def _run(target: Target, root: Path, time_s: float) -> tuple[int | None, str]:
    from toolkit.cli.main import run

    said, here = io.StringIO(), Path.cwd()
    old = signal.signal(signal.SIGALRM, _hang)
    signal.setitimer(signal.ITIMER_REAL, time_s)
    try:
        os.chdir(root)
        with (
            contextlib.redirect_stderr(said),
            contextlib.redirect_stdout(io.StringIO()),
            warnings.catch_warnings(),
        ):
            if callable(target.command):
                target.command(root)
                return 0, ""
            run(list(target.command))
    except ToolkitError as error:
        return 2, f"error: {error}"
    except SystemExit as ended:
        return int(ended.code or 0), said.getvalue()
    except HangError:
        return None, "hang"
    except Exception as error:  # noqa: BLE001  what is sought
        import traceback

        return 101, "".join(traceback.format_exception(error))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, old)
        os.chdir(here)


@contextlib.contextmanager
def _unwarned() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield


def _hang(_signal: int, _frame: FrameType | None) -> None:
    raise HangError


def _fault(target: Target, recipe: Sequence[Mutation], code: int | None, text: str) -> str:
    if code is None:
        return f"hang: over {TIME_S:g} s"
    if code not in CODES:
        places = _OURS.findall(text)
        last = text.strip().splitlines() if "Traceback" in text else [""]
        lines = [line for line in last if line and not line.startswith((" ", "toolkit ")) and ":" in line]
        kind = lines[-1].split(":")[0] if lines else f"code {code}"
        return f"{kind} at {':'.join(places[-1]) if places else '?'}"
    parts = ("got", "expected", "next")
    if code == 2 and "error:" in text and not all(f"\n  {part}:" in text for part in parts):
        return f"an error without its parts: {text.splitlines()[0][:100]}"
    if code == 0 and target.sealed and apply(target.data(), recipe) != target.data():
        return "silence: a sealed file was changed"
    if code in (0, 1) and (key := _unknown_key(target, recipe)):
        return f"silence: an unknown key passed, {key}"
    return ""


def _unknown_key(target: Target, recipe: Sequence[Mutation]) -> str:
    """Return a key that no declaration has and that a recipe of this one mutation left in a tree."""
    if target.kind != "tree" or target.sealed or len(recipe) != 1:
        return ""
    name, *words = recipe[0]
    if name not in ("misspell", "add") or apply(target.data(), recipe) == target.data():
        return ""
    path = [*words[0], UNKNOWN] if name == "add" else [*words[0][:-1], f"{words[0][-1]}e"]
    is_free = "" in target.free or any(key in target.free for key in path[:-1])
    return "" if is_free else ".".join(map(str, path))


def minimal(target: Target, recipe: Sequence[Mutation], fault: str) -> list[Mutation]:
    """Return the fewest mutations of a recipe that still make the same fault."""
    kept = list(recipe)
    for mutation in recipe:
        fewer = [other for other in kept if other is not mutation]
        if fewer and outcome(target, fewer).fault == fault:
            kept = fewer
    return kept


# Workers: one a target at a time; where it dies or hangs in C, its input is told and the next one goes on.


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """An input that failed, as a recipe."""

    target: str
    fault: str
    recipe: list[Mutation]
    text: str = ""

    def line(self) -> str:
        """Return the failure as a case of `tests/fuzz/recipes.py`."""
        return f"({self.target!r}, {json.dumps(list(self.recipe))!r}),  # {self.fault}"


def run_target(
    name: str, *, seed: int, numbers: range, until: float = float("inf")
) -> Iterator[tuple[int, int | None, Failure | None]]:
    """Yield number, exit code and failure of each input of a target, run in workers."""
    context = mp.get_context("fork")
    number = numbers.start
    while number < numbers.stop and time.monotonic() < until:
        ours, theirs = context.Pipe()
        process = context.Process(
            # No daemon: an audit has workers of its own.
            target=_serve,
            args=(name, seed, range(number, numbers.stop), until, theirs),
        )
        process.start()
        theirs.close()
        while True:
            alive = ours.poll(3 * TIME_S)
            try:
                message = ours.recv() if alive else None
            except EOFError:
                message = None
            if message == "end":
                process.join()
                return
            if message is None:
                process.kill()
                process.join()
                how = f"the interpreter ended with {process.exitcode}" if alive else "hang: no signal ends it"
                recipe = drawn(target_of(name), seed, number)
                yield number, None, Failure(target=name, fault=how, recipe=recipe)
                number += 1
                break
            yield message
            number = message[0] + 1


def _serve(name: str, seed: int, numbers: range, until: float, pipe: mp.connection.Connection) -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    sys.stdin = Path(os.devnull).open()  # noqa: SIM115
    target = target_of(name)
    for number in numbers:
        if time.monotonic() > until:
            break
        recipe = drawn(target, seed, number)
        result = outcome(target, recipe)
        failure = None
        if result.fault:
            few = minimal(target, recipe, result.fault)
            failure = Failure(target=name, fault=result.fault, recipe=few, text=result.text[-3000:])
        pipe.send((number, result.code, failure))
    pipe.send("end")
