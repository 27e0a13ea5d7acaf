"""The screen leaves out nothing that could be accepted: against every candidate, evaluated in full."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.audit.audit_factory import FY, MZ, R1, R2, columns, negative, record
from toolkit.audit.candidates import group_of, orders
from toolkit.audit.screen import screen_of

NEAR = record("m15-r5", (0.99722, 0.99718, 1.0228, 0.6473))
METRIC = record("m15-r6", FY, MZ, issued=((0.997, 0.997, 1.023, 0.647), MZ))
RECORDS = (R1, R2, NEAR, METRIC)
FILES = {
    "exact": columns(),
    "coarse": columns(decimals=1),
    "rounded": columns((0.997192, 0.99718, 1.0228, 0.6473)),
    "negative": columns(negative(FY), MZ),
    "swapped": columns(order=("D52", "D51", "E5")),
    "unknown": columns((0.9, 0.9, 0.9, 0.1)),
    "one row": columns(rows=1),
}


def every(file):
    for index, one in enumerate(RECORDS):
        for issued in (False, True) if one is METRIC else (False,):
            for order in orders(3):
                yield (index, issued, order), group_of(one, file, order=order, issued=issued)


def fits(group, file, rows):
    return [
        np.abs(f.predicted - file.y[load])[:, rows] <= (f.bound + f.slack)[rows]
        for load, f in group.families.items()
    ]


@pytest.mark.parametrize("name", FILES)
def test_whatever_explains_every_row_passes(name):
    file = FILES[name]
    passed = set(screen_of(RECORDS, file).for_all_rows(file))
    for key, group in every(file):
        if all(fit.all(axis=1).any() for fit in fits(group, file, slice(None))):
            assert key in passed


@pytest.mark.parametrize("name", FILES)
def test_whatever_explains_a_row_passes_at_that_row(name):
    file = FILES[name]
    passed = {key: set(rows.tolist()) for key, rows in screen_of(RECORDS, file).anywhere(file)}
    for key, group in every(file):
        FY_fits, MZ_fits = fits(group, file, slice(None))
        assert passed.get(key, set()) >= set(
            np.flatnonzero(FY_fits.any(axis=0) & MZ_fits.any(axis=0)).tolist()
        )


def test_hardly_any_row_of_an_unknown_file_passes():
    file = columns((0.9, 0.9, 0.9, 0.1), (-0.1, 0.2, 0.3, 0.4), rows=2000)
    assert sum(len(rows) for _, rows in screen_of(RECORDS, file).anywhere(file)) < 20


@pytest.mark.parametrize("name", ["exact", "coarse", "negative"])
def test_whatever_the_file_cannot_tell_from_an_accepted_candidate_passes(name):
    file = FILES[name]
    screen = screen_of(RECORDS, file)
    key = (0 if name == "negative" else 1, False, (0, 1, 2))
    accepted = screen.group(key, file)
    passed = set(screen.close_to(accepted, file, {"FY": 0, "MZ": 0}))
    assert key in passed
    for other, group in every(file):
        close = [
            bool(
                (np.abs(f.predicted - accepted.families[load].predicted[0])
                 <= f.bound + accepted.families[load].bound).all(axis=1).any()
            )
            for load, f in group.families.items()
        ]  # fmt: skip
        if all(close):
            assert other in passed


def test_long_files_are_taken_in_parts(monkeypatch):
    from toolkit.audit import screen as module

    file = columns(rows=400)
    whole = [(key, rows.tolist()) for key, rows in screen_of(RECORDS, file).anywhere(file)]
    monkeypatch.setattr(module, "_CELLS", 5000)
    assert [(key, rows.tolist()) for key, rows in screen_of(RECORDS, file).anywhere(file)] == whole


def test_equations_with_higher_terms_always_pass():
    import dataclasses

    from toolkit.calibration.records.record import LoadFit, sealed

    terms = ("D51", "D52", "E5", "D51^2", "intercept")
    loads = tuple(
        LoadFit(load=load, unit=unit, terms=terms, coefficients=(*c[:3], 1e-5, c[3]),
                issued=(*c[:3], 1e-5, c[3]), polarity=(1,) * 5)
        for load, unit, c in (("FY", "lbf", FY), ("MZ", "lbf*ft", MZ))
    )  # fmt: skip
    curved = sealed(dataclasses.replace(R2, id="m15-r9", loads=loads))
    file = columns()
    assert len(screen_of((curved,), file).for_all_rows(file)) == len(list(itertools.permutations(range(3))))
