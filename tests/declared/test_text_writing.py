"""Writing: what is written reads back equal, with floats exact and units kept; answers are JSON."""

from __future__ import annotations

import dataclasses
import datetime as dt
import enum
import json
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.declared.sample import MINIMAL, WHOLE, Cell, Channel, Check, Constant, Sample, Sweep
from toolkit.declared import Entry, Quantity, answer, json_value, plain, read_text, toml_text
from toolkit.findings import Finding
from toolkit.printable import unprintable
from toolkit.units import unit


def again(instance: Sample) -> Sample:
    return read_text(Sample, toml_text(instance).encode(), where="written.toml")


def test_units_are_kept() -> None:
    sample_file = read_text(Sample, WHOLE.encode(), where="sample.toml")
    written, source = plain(sample_file), tomllib.loads(WHOLE)
    for key in ("speed", "angles", "check", "cells", "bounds", "signs", "extra", "rate"):
        assert written[key] == source[key], key
    assert written["channel"][0] == {"symbol": "D51", "unit": "lbf", "role": "load"}
    assert (written["schema"], written["day"], written["pitch"]) == (
        2,
        dt.date(2026, 3, 31),
        {"value": 200, "unit": "mm"},
    )
    assert again(sample_file) == sample_file
    assert toml_text(again(sample_file)) == toml_text(sample_file)


def quantities(low: float, high: float, *units: str) -> st.SearchStrategy[float]:
    """Floats in SI, half of them as they were read in one of the units."""
    numbers = st.floats(low, high, allow_subnormal=False)

    def read(value: float, text: str) -> Quantity:
        return Quantity(value * unit(text).factor + unit(text).offset, value=value, unit=text)

    return numbers | st.builds(read, numbers, st.sampled_from(units))


CHARACTERS = (st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]) | st.sampled_from("\t\n")).filter(
    lambda character: unprintable(character) is None
)
TEXTS = st.text(CHARACTERS, min_size=1).filter(lambda text: bool(text.strip()))
CHANNELS = st.builds(
    Channel, symbol=st.from_regex("[A-Z]+[0-9]*", fullmatch=True),
    unit=st.sampled_from(["N", "lbf", "deg", "rad"]),
    role=st.sampled_from(["load", "angle"]),
)  # fmt: skip
ANGLES = quantities(-1.5, 1.5, "rad", "deg")
FREQUENCIES = quantities(0, 1e6, "Hz", "kHz", "1/min")


@st.composite
def samples(draw: st.DrawFn) -> Sample:
    loads = tuple(draw(st.lists(TEXTS, min_size=1, max_size=3, unique=True)))
    channels = tuple(
        draw(st.lists(CHANNELS, min_size=1, max_size=3, unique_by=lambda channel: channel.symbol))
    )
    cells = [channel.symbol for channel in channels if channel.role == "load"]
    bounds = sorted(draw(st.lists(st.floats(-1e100, 1e100), min_size=2, max_size=2, unique=True)))
    forces = quantities(1e-3, 1e9, "N", "lbf", "kN", "N*m")
    return Sample(
        title=draw(TEXTS),
        loads=loads,
        day=draw(st.dates()),
        speed_m_s=draw(quantities(1e-6, 1e6, "km/h", "m/s", "mph")),
        channels=channels,
        angles_rad=tuple(draw(st.lists(ANGLES, min_size=1, max_size=4, unique=True))),
        number=draw(TEXTS).strip(),
        switched=draw(st.booleans()),
        share=draw(st.floats(0, 1)),
        count=draw(st.integers(1, 10**12)),
        since=draw(st.none() | st.dates().map(dt.date.isoformat)),
        pitch_m=draw(st.none() | quantities(-1e3, 1e3, "mm", "m")),
        folder=draw(st.none() | st.sampled_from([Path("a"), Path("a b/c.csv")])),
        bounds=draw(st.none() | st.just((bounds[0], bounds[1]))),
        signs=draw(st.none() | st.dictionaries(st.sampled_from(loads), st.sampled_from([1, -1]))),
        cells=tuple(
            Cell(name=name, gain=draw(st.floats(1e-9, 1e9)), u=draw(quantities(0, 1e6, "N", "lbf", "N*m")))
            for name in cells
        ),
        rate=draw(
            st.none()
            | st.builds(Constant, kind=st.just("constant"), rate=FREQUENCIES)
            | st.builds(
                Sweep, kind=st.sampled_from(["sweep", "chirp"]), limits=st.tuples(FREQUENCIES, FREQUENCIES)
            )
        ),
        check=draw(
            st.none()
            | st.just(Path("check.csv"))
            | st.builds(
                Check, file=st.just(Path("c.csv")),
                tolerance=st.tuples(st.tuples(st.just(loads[0]), forces)) | st.just(()),
            )
        ),
        extra=draw(st.none() | st.lists(st.integers(-9, 9))),
        note=draw(st.text(CHARACTERS)),
        country=draw(st.sampled_from(["US", "DE"])),
    )  # fmt: skip


@given(samples())
def test_what_is_written_reads_back_equal(instance: Sample) -> None:
    assert again(instance) == instance


class Colour(enum.Enum):
    RED = "red"


@dataclass(frozen=True)
class Repair:
    FY_max: Annotated[float, Entry(key="FY_max_abs_N")]
    path: Path
    day: dt.date | None
    colour: Colour
    finding: Finding
    rows: Any
    pairs: tuple[tuple[str, float], ...] = ()
    cache: Annotated[Any, Entry(output=False)] = None


def test_an_answer_is_json() -> None:
    instance = Repair(
        FY_max=np.float64(0.1), path=Path("a/b"), day=dt.date(2026, 3, 1), colour=Colour.RED,
        finding=Finding(rule="r", where="w", message="m"),
        rows={"x": np.array([[1.5, math.nan]]), "n": np.int64(3), "flag": np.bool_(True)},
        pairs=(("FY", math.inf), ("MZ", Quantity(2.0, value=2, unit="N*m"))), cache=object(),
    )  # fmt: skip
    document = answer(instance)
    assert json.loads(json.dumps(document, allow_nan=False)) == {
        "schema": 1,
        "FY_max_abs_N": 0.1,
        "path": "a/b",
        "day": "2026-03-01",
        "colour": "red",
        "finding": {"rule": "r", "where": "w", "message": "m", "level": "warning"},
        "rows": {"x": [[1.5, None]], "n": 3, "flag": True},
        "pairs": [["FY", None], ["MZ", 2.0]],
    }
    assert next(iter(document)) == "schema"
    assert answer(dataclasses.replace(instance, day=None))["day"] is None


def test_a_declared_format_as_an_answer() -> None:
    document = answer(read_text(Sample, MINIMAL.encode(), where=""))
    assert (document["speed"], document["day"], document["since"]) == (20.0, "2026-03-31", None)
    assert list(document)[:3] == ["schema", "title", "loads"]


@pytest.mark.parametrize("value", [object(), 1j, b"bytes"])
def test_what_json_and_toml_cannot_hold_is_an_error_of_the_program(value: object) -> None:
    with pytest.raises(TypeError):
        json_value(value)
    with pytest.raises(TypeError):
        toml_text({"a": value})
