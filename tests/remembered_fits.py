"""Fits that the registry has asked for before: hundreds of tests enter and approve the same few sessions."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

from tests.remembered import once, remembered
from toolkit.calibration.fit import readings_findings
from toolkit.calibration.fit.findings import session_findings
from toolkit.calibration.fit.session_fit import SessionFit, fit_session
from toolkit.calibration.registry import candidate, judgement, plausible
from toolkit.calibration.session.read import Session
from toolkit.calibration.uncertainty import budget, components, monte_carlo
from toolkit.calibration.uncertainty.scatter import scatter_of


def remember_fits() -> None:
    """Have the registry fit and judge a session once, wherever a copy of it lies; a refusal is found anew.

    What the rows of a record tell of their scatter is asked by every budget and certificate of it.

    Their own tests ask `fit_session`, `session_findings` and `scatter_of` themselves, which remember nothing.
    """
    for module in (candidate, judgement):
        module.fit_session = _fitted  # type: ignore[attr-defined]
    for room in (candidate, readings_findings):
        room.session_findings = _judged  # type: ignore[attr-defined]
    for asker in (budget, components, monte_carlo, plausible):
        asker.scatter_of = remembered(scatter_of)  # type: ignore[attr-defined]


def _fitted(session: Session) -> SessionFit:
    # The place of a session is in what refuses it alone.
    fit: SessionFit = _once(fit_session, session, None)
    return dataclasses.replace(fit, session=dataclasses.replace(fit.session, path=session.path))


def _judged(fit: SessionFit) -> Any:
    return _once(session_findings, fit, fit.session.path.name)


def _once(ask: Callable[[Any], Any], given: Session | SessionFit, place: object) -> Any:
    """Return a copy of what is answered to the same content under the same name."""
    return once((ask.__name__, place, _without_path(given)), lambda: ask(given))


def _without_path(given: Session | SessionFit) -> tuple[object, ...]:
    session = given if isinstance(given, Session) else given.session
    rest = () if given is session else (given.loads,)  # type: ignore[union-attr]
    fields = [field.name for field in dataclasses.fields(session) if field.name != "path"]
    return (*(getattr(session, name) for name in fields), *rest)
