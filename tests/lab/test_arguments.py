"""Arguments of public names: what is of another kind is refused, by each name and before anything is done."""

from __future__ import annotations

import datetime as dt
import inspect
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import toolkit
from toolkit.errors import ToolkitError
from toolkit.lab.arguments import KINDS
from toolkit.lab.records.record import Loads

_FREE = ("Columns", "Mapping", "Callable", "Processed |")
"""Kinds with a gate of their own: columns of data, units beside them, a test in place of a table."""


def public() -> Iterator[tuple[str, Callable[..., Any]]]:
    for name in (*toolkit.__all__, "Loads"):
        offered = Loads if name == "Loads" else getattr(toolkit, name)
        if not isinstance(offered, type):
            yield name, offered
        elif not issubclass(offered, Exception) and name != "Estimate":
            for cls in offered.__mro__[:-1]:
                for method, function in vars(cls).items():
                    if inspect.isfunction(function) and not method.startswith("_"):
                        yield f"{name}.{method}", function


CALLS = [
    pytest.param(function, parameter, id=f"{name} {parameter}")
    for name, function in public()
    for parameter, declared in inspect.signature(function).parameters.items()
    if parameter != "self" and declared.kind is not inspect.Parameter.VAR_KEYWORD
    and not declared.annotation.startswith(_FREE)
]  # fmt: skip


@pytest.mark.parametrize(("function", "parameter"), CALLS)
def test_every_argument_of_another_kind_is_refused_by_its_name(
    function: Callable[..., Any], parameter: str
) -> None:
    signature = inspect.signature(function)
    assert signature.parameters[parameter].annotation in KINDS
    others: dict[str, Any] = {
        name: type("ProcessedTest", (), {})() if name == "test" else "x"
        for name, declared in signature.parameters.items()
        if declared.default is inspect.Parameter.empty and "VAR" not in declared.kind.name
    }
    if signature.parameters[parameter].kind is inspect.Parameter.VAR_POSITIONAL:
        call = (*others.values(), object())
        others = {}
    else:
        call, others = (), others | {parameter: object()}
    with pytest.raises(ToolkitError) as caught:
        function(*call, **others)
    error = caught.value
    assert error.rule == "wrong-argument"
    assert parameter in error.what
    assert all((error.where, error.got, error.expected, error.next_step))


@pytest.fixture(scope="module")
def laboratory() -> toolkit.Laboratory:
    return toolkit.open_laboratory(toolkit.example("home"))


@pytest.mark.parametrize(
    "day",
    [
        "2026-03-17",
        dt.date(2026, 3, 17),
        dt.datetime(2026, 3, 17, 14, 5),  # noqa: DTZ001
        pd.Timestamp("2026-03-17 14:05"),
        np.datetime64("2026-03-17"),
    ],
)
def test_a_day_is_read_as_people_and_programs_write_it(laboratory: toolkit.Laboratory, day: Any) -> None:
    record = laboratory.in_force("m15-virtual", on=day, known_at=day)
    assert (record.on, type(record.on)) == (dt.date(2026, 3, 17), dt.date)
    assert laboratory.record("m15-virtual-r1", on=day).on == dt.date(2026, 3, 17)


@pytest.mark.parametrize(
    "day",
    [
        "17.3.2026",
        "2026-13-01",
        "x",
        20260317,
        dt.datetime(2026, 3, 17, tzinfo=dt.UTC),
        pd.Timestamp("2026-03-17", tz="Europe/Berlin"),
        pd.NaT,
        np.datetime64("NaT"),
    ],
)
def test_a_day_that_is_none_or_depends_on_a_time_zone_is_refused(
    laboratory: toolkit.Laboratory, day: Any
) -> None:
    for call in (laboratory.in_force, laboratory.record):
        with pytest.raises(ToolkitError) as caught:
            call("m15-virtual-r1", on=day)
        assert caught.value.rule == "wrong-argument"


def test_a_word_for_yes_is_no_switch(laboratory: toolkit.Laboratory) -> None:
    record = laboratory.record("m15-virtual-r1")
    with pytest.raises(ToolkitError, match="draft"):
        record.apply({}, draft="no")  # type: ignore[arg-type]


def test_a_text_in_place_of_a_list_is_no_list_of_letters(tmp_path: Path) -> None:
    with pytest.raises(ToolkitError, match="effects"):
        toolkit.simulate(toolkit.example("test_plan"), tmp_path / "x", effects="relaxation=0.5m")


def test_a_load_that_a_record_has_not_is_refused(laboratory: toolkit.Laboratory) -> None:
    data = {f"{name} [mV/V]": [0.1] for name in ("D51", "D52", "E5")}
    loads = laboratory.record("m15-virtual-r1").apply(data, uncertainty=False)
    with pytest.raises(ToolkitError) as caught:
        loads.quantity("FX")
    assert caught.value.rule == "wrong-argument"


def test_what_python_itself_says_of_a_call_stays(laboratory: toolkit.Laboratory) -> None:
    with pytest.raises(TypeError, match="in_force"):
        laboratory.in_force()  # type: ignore[call-arg]
