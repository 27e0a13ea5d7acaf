"""How long a search may take: a spent budget ends it between two steps, and a call where it stands."""

from __future__ import annotations

import contextlib
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar

from toolkit.diagnosis.policy import BUDGET
from toolkit.worker.worker import LateError

T = TypeVar("T")


class BudgetSpentError(BaseException):
    """The budget is spent; no simulator's own ``except Exception`` holds it up."""


class TimeBudget:
    """How long a search may take, what it is at, and how long the last simulation took [s].

    Without an ``alarm`` the calls end by themselves in time: a worker is not waited for any longer.
    """

    def __init__(self, budget_s: float, tell: Callable[[str], None], *, alarm: bool = True) -> None:
        self._whole_s = budget_s
        self.until = time.monotonic() + budget_s
        self.step = "the simulation as declared"
        self.last_s = 0.0
        self._tell, self._alarm, self._set = tell, alarm, False

    def tell(self, step: str) -> None:
        """Note the step that begins, and tell it on."""
        self.step = step
        self._tell(step)

    def check(self, step: str, *, reserve: float = 0.0) -> None:
        """Tell the step that comes next; BudgetSpentError where the time is over.

        A step that others wait for leaves them a ``reserve`` of the whole time [1].
        """
        if time.monotonic() > self.until - reserve * self._whole_s:
            raise BudgetSpentError(step)
        self.tell(step)

    def guarded(self, function: Callable[..., T]) -> Callable[..., T]:
        """Return a function whose calls end with the budget.

        A call in the main thread is interrupted where it stands, so that a simulator which waits or
        computes in Python never outlives the budget; elsewhere the call that is running is the last.
        """

        def call(*arguments: Any, **keywords: Any) -> T:
            started = time.monotonic()
            if self.until <= started:
                raise BudgetSpentError(self.step)
            try:
                with self.limited() if self._alarm else contextlib.nullcontext():
                    return function(*arguments, **keywords)
            except LateError:
                raise BudgetSpentError(self.step) from None
            finally:
                self.last_s = time.monotonic() - started

        return call

    @contextlib.contextmanager
    def limited(self) -> Iterator[None]:
        """End with the budget what is done meanwhile, whatever it is: a fit as well as a simulation.

        Nothing where an alarm is set already, or where the system or the thread knows none.
        """
        main = threading.current_thread() is threading.main_thread()
        if self._set or not main or not hasattr(signal, "setitimer"):
            yield
            return

        def ring(*_: object) -> None:
            raise BudgetSpentError(self.step)

        before = signal.signal(signal.SIGALRM, ring)
        self._set = True
        signal.setitimer(signal.ITIMER_REAL, max(self.until - time.monotonic(), 0.0) + BUDGET.alarm_s)
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
            self._set = False
