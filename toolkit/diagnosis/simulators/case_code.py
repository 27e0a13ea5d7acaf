"""A case's own code in a worker: begun when it is asked, and anew where a set of parameters kills it."""

from __future__ import annotations

import contextlib
import dataclasses
import importlib
import math
import pickle
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

from toolkit.diagnosis.policy import WORKER
from toolkit.diagnosis.simulators.user_code import kept_apart
from toolkit.errors import ConfigError, FitError
from toolkit.findings import Finding
from toolkit.worker.frames import RaisedError
from toolkit.worker.posix import Limits
from toolkit.worker.worker import DiedError, Worker

if TYPE_CHECKING:
    from toolkit.arrays import Arrays
    from toolkit.diagnosis.case.case import Case, Run
    from toolkit.worker.serve import Handlers

    Shapes = Mapping[str, tuple[int, ...]]


def limits_of(
    *,
    memory_GB: float = WORKER.memory_GB,
    processes: int = WORKER.processes,
    isolated: bool = False,
) -> Limits:
    """Return the limits of a worker: those of the policy where nothing else is asked for."""
    return Limits(
        memory_bytes=int(memory_GB * 1e9),
        processes=processes,
        scratch_bytes=WORKER.scratch_MB * 1_000_000,
        isolated=isolated,
    )


WORKER_LIMITS = limits_of()


class CaseCode:
    """What a case's simulator answers, asked in a worker; ``until`` is when waiting for it ends.

    Where the process dies at a set of parameters, that set alone has failed, as one that raises has; the code
    is loaded anew for the next. A case whose code dies too often ends.
    """

    def __init__(self, case: Case, limits: Limits) -> None:
        self._case, self._limits = case, limits
        self._runs = _numbers(case)
        self._make: Callable[..., Handlers] | None = None
        self._worker: Worker | None = None
        self._dead: dict[bytes, FitError] = {}
        self._deaths: list[str] = []
        self.until = math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def end(self) -> None:
        """End the worker; the next question begins another."""
        if self._worker is not None:
            self._worker.close()
            self._worker = None

    def begin(self, make: Callable[..., Handlers], *, both_need: tuple[str, ...] = ()) -> None:
        """Load the code; ``make`` of a module takes the case, without effects, and returns the handlers.

        ``both_need`` are modules that this process will load as well: loaded before, they are shared.

        Raises
        ------
        ConfigError, FitError
            it cannot be loaded; LateError: not in time
        """
        for name in both_need:
            importlib.import_module(name)
        self._make = make
        self._asked("", None, {}, lambda worker: worker)

    def value(self, name: str, *arguments: object) -> Any:
        """Return the JSON value that a handler answers; FitError where the process dies of it."""
        until = self.until
        return self._asked(name, None, {}, lambda worker: worker.value(name, arguments, until), *arguments)

    def arrays(
        self, name: str, run: Run, p: Mapping[str, float], shapes: Shapes, *arguments: object
    ) -> Arrays:
        """Return the arrays that a handler answers for a run and parameters.

        Raises
        ------
        FitError
            the simulator refuses them, or its process dies of them; ConfigError: it has died too often;
            LateError: it does not answer in time
        """
        question = (self._runs[run], dict(p), *arguments)
        until = self.until
        arrays: Arrays = self._asked(
            name, run, p, lambda worker: worker.arrays(name, question, until, shapes), *question
        )
        return arrays

    def learn(self, runs: Sequence[Run]) -> None:
        """Take further runs than those of the case; the next question begins a worker that knows them."""
        fresh = dict.fromkeys(run for run in runs if run not in self._runs)
        if fresh:
            self._case = dataclasses.replace(self._case, predict=(*self._case.predict, *fresh))
            self._runs = _numbers(self._case)
            self.end()

    def number(self, run: Run) -> int:
        """Return the number by which a run is known in the worker."""
        return self._runs[run]

    def findings(self) -> tuple[Finding, ...]:
        """Return what is to be told of deaths that the diagnosis went on after."""
        if not self._deaths:
            return ()
        times = "once" if len(self._deaths) == 1 else f"{len(self._deaths)} times"
        return (
            Finding(
                rule="simulator-died",
                where=f"{self._case.path.name}: simulation",
                message=f"the simulator's process died {times} and was begun anew, first {self._deaths[0]}",
            ),
        )

    def _asked(
        self,
        name: str,
        run: Run | None,
        p: Mapping[str, float],
        ask: Callable[[Worker], Any],
        *question: object,
    ) -> Any:
        key = pickle.dumps((name, question)) if self._dead else b""
        if key in self._dead:
            raise self._dead[key]
        try:
            if self._worker is None:
                self._worker = self._begun()
            return ask(self._worker)
        except DiedError as error:
            self._worker = None
            failure = self._failure(run, p, str(error))
            self._dead[key or pickle.dumps((name, question))] = failure
            raise failure from error
        except RaisedError as error:
            raise self._unusable(run, str(error), "simulator") from error
        except (ConfigError, FitError):
            raise
        except BaseException:
            self._worker = None  # it is late or interrupted, and was ended
            raise

    def _begun(self) -> Worker:
        assert self._make is not None  # noqa: S101  nobody asks before
        plain = dataclasses.replace(self._case, effects=())
        return Worker(self._make, (plain,), self._limits, self.until)

    def _failure(self, run: Run | None, p: Mapping[str, float], text: str) -> FitError:
        values = ", ".join(f"{name} = {value:.6g}" for name, value in p.items())
        place = "" if run is None else f"{run.name}, {values}: " if values else f"{run.name}: "
        self._deaths.append(place + text)
        if len(self._deaths) > WORKER.deaths:
            raise ConfigError(
                f"the simulator's process died {len(self._deaths)} times", where=self._case.file(),
                got=place + text, expected="a simulator that answers at every value within bounds, or raises",
                next_step="run the simulator at the named parameters by itself and mend it",
                rule="simulator-died",
            )  # fmt: skip
        return self._unusable(run, f"{text} (at {values})" if values else text, "simulator-died")

    def _unusable(self, run: Run | None, got: str, rule: str) -> FitError:
        where = f"{self._case.simulation.path}" + ("" if run is None else f", {run.name}")
        return FitError(
            "the simulation gives no usable output", where=where, got=got,
            expected="a simulator that answers or raises, within the limits of memory and processes",
            next_step="run the simulator on that file by itself and mend it; --memory and --processes "
            "allow more",
            rule=rule,
        )  # fmt: skip


def _numbers(case: Case) -> dict[Run, int]:
    """Return the numbers by which a worker knows the runs of a case: their places in it."""
    return {run: number for number, run in enumerate((*case.runs, *case.predict))}


@contextlib.contextmanager
def running(case: Case, limits: Limits | None) -> Iterator[CaseCode | None]:
    """Yield the worker of a case's own code, and end it; None for a case without.

    Without ``limits`` the code runs in this process, whose standard streams and folder are kept from it.
    """
    if limits is None:
        with kept_apart():
            yield None
    elif case.simulation.path is None:
        yield None
    else:
        with CaseCode(case, limits) as code:
            yield code
