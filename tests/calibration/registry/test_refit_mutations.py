"""The mutation test: a coefficient that is not the fit's is refused, however well hash and ledger agree."""

from __future__ import annotations

import dataclasses
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from toolkit.calibration.records.record import CalibrationRecord, Golden, LoadFit, sealed, to_bytes
from toolkit.calibration.registry.candidate import calibrate, entering
from toolkit.calibration.registry.ledger import head_bytes, next_line
from toolkit.calibration.registry.refit import polarity
from toolkit.calibration.registry.registry import Registry
from toolkit.errors import RecordError

PROJECT = Path(__file__).resolve().parents[3] / "calibrations"
FIELDS = ("coefficients", "issued")


def forge(registry: Registry, record: CalibrationRecord) -> None:
    """Write a record as one would who can compute every hash: record, ledger and head agree."""
    folder = registry.folder / record.instrument
    record = sealed(record)
    (folder / f"{record.id}.json").write_bytes(to_bytes(record))
    event = entering(record, {}, by=record.entered_by).event
    line, digest = next_line(1, "0" * 64, event)
    (folder / "ledger.jsonl").write_bytes(line)
    (folder / "head.json").write_bytes(head_bytes(1, digest))


def mutations(one: LoadFit, field: str) -> Iterator[tuple[str, tuple[float, ...]]]:
    values = getattr(one, field)
    for i, term in enumerate(one.terms):
        for name, value in (
            ("flipped", -values[i]),
            ("scaled", values[i] * 1.0001),
            ("dropped", 0.0),
            ("rounded", float(f"{values[i]:.3g}")),
        ):
            if value != values[i]:
                yield f"{one.load} {term} {name}", (*values[:i], value, *values[i + 1 :])
        j = (i + 1) % len(values)
        swapped = list(values)
        swapped[i], swapped[j] = swapped[j], swapped[i]
        if tuple(swapped) != values:
            yield f"{one.load} {term} swapped with {one.terms[j]}", tuple(swapped)


def refuse_all(registry: Registry, record: CalibrationRecord) -> int:
    tried = 0
    for at, one in enumerate(record.loads):
        for field in FIELDS:
            for name, values in mutations(one, field):
                changed = dataclasses.replace(one, **{field: values})
                changed = dataclasses.replace(changed, polarity=polarity(changed.coefficients))
                loads = (*record.loads[:at], changed, *record.loads[at + 1 :])
                forge(registry, dataclasses.replace(record, loads=loads))
                with pytest.raises(RecordError) as caught:
                    registry.load(record.id)
                assert caught.value.rule in ("refit", "golden"), name
                tried += 1
    return tried


def test_every_mutated_coefficient_of_a_fit_is_refused(registry: Registry) -> None:
    record = registry.load("hub-r1")
    forge(registry, record)
    registry.load("hub-r1")  # the forger's unchanged record passes: it is the mutation that is refused
    assert refuse_all(registry, record) > 3 * 4 * 4


@pytest.mark.parametrize("record_id", sorted(path.stem for path in PROJECT.glob("*/*-r*.json")))
def test_every_mutated_coefficient_of_the_projects_records_is_refused(tmp_path: Path, record_id: str) -> None:
    # A legacy import cannot be refitted: what refuses it is the source text that lies beside it.
    instrument = record_id.rsplit("-r", 1)[0]
    shutil.copytree(PROJECT / instrument, tmp_path / instrument)
    registry = Registry(tmp_path)
    assert refuse_all(registry, registry.load(record_id)) > 0


OTHER = pytest.mark.campaign(
    "twice the coefficients: those of weights, and of every record, are mutated in every run"
)


@pytest.mark.parametrize("model", [pytest.param("polynomial", marks=OTHER), "wls"])
def test_mutations_of_other_models(tmp_path: Path, model: str, make_session: Callable[..., Path]) -> None:
    path = make_session(name=model, model='"polynomial"', degree="2") if model == "polynomial" else (
        make_session(name=model, method='"wls"', loads='["FY"]')
    )  # fmt: skip
    if model == "wls":
        for name, keep in (("loads.csv", "run,direction,u_FY [N]"), ("check.csv", "")):
            lines = (path.parent / name).read_text().splitlines()
            rows = [line.split(",")[:4] + (line.split(",")[6:] if keep else []) for line in lines]
            if keep:
                rows = [[*row, "u_FY [N]" if i == 0 else str(0.1 + i % 3)] for i, row in enumerate(rows)]
            (path.parent / name).write_text("\n".join(",".join(row) for row in rows) + "\n")
    registry = Registry(tmp_path / "cal")
    assert refuse_all(registry, calibrate(path, registry).record) > 10


def test_covariance_golden_and_range_belong_to_the_data_too(registry: Registry) -> None:
    record = registry.load("hub-r1")
    one = record.loads[0]
    golden = (
        (record.golden.outputs[0][0] * 1.000001, *record.golden.outputs[0][1:]),
        *record.golden.outputs[1:],
    )
    sd = one.residual_sd or 0.0
    changed = [
        dataclasses.replace(record, golden=Golden(inputs=record.golden.inputs, outputs=golden)),
        dataclasses.replace(
            record, cells=(dataclasses.replace(record.cells[0], maximum=9.0), *record.cells[1:])
        ),
        dataclasses.replace(
            record, cells=(dataclasses.replace(record.cells[0], unit="V/V"), *record.cells[1:])
        ),
        *(
            dataclasses.replace(record, loads=(dataclasses.replace(one, **change), *record.loads[1:]))
            for change in (
                {"residual_sd": sd * 1.001},
                {"covariance": tuple(tuple(v * 1.001 for v in row) for row in one.covariance)},
                {"dof": 57},
                {"unit": "N"},
                {"polarity": (1, 1, 1, 1)},
                {"maximum": 1e9},
            )
        ),
    ]
    for candidate in changed:
        forge(registry, candidate)
        with pytest.raises(RecordError) as caught:
            registry.load("hub-r1")
        assert caught.value.rule in ("refit", "golden")


@pytest.mark.parametrize(
    "golden",
    [
        Golden(),
        Golden(inputs=((0.0, 0.0, 0.0),), outputs=((0.0,), (0.0,), (0.0,))),
        Golden(inputs=((0.0, 0.0),) * 5, outputs=((0.0,) * 5,) * 3),
        Golden(inputs=((0.0,) * 3,) * 5, outputs=((0.0,) * 5,) * 2),
    ],
)
def test_golden_vectors_that_are_missing_or_of_another_shape(registry: Registry, golden: Golden) -> None:
    forge(registry, dataclasses.replace(registry.load("hub-r1"), golden=golden))
    with pytest.raises(RecordError) as caught:
        registry.load("hub-r1")
    assert caught.value.rule == "golden"
