"""An archive whose grades were decided when it was made: every grade, variant and segment is found again."""

from __future__ import annotations

import datetime as dt

import pytest

from tests.audit.archive_made import factory
from toolkit.audit.archive import audit_archive
from toolkit.calibration.registry.registry import Registry


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    # Every kind of file several times, more of the rare ones than in the benchmark.
    return factory.make_archive(tmp_path_factory.mktemp("made"), files=130, rows=100, seed=11)


@pytest.fixture(scope="module")
def audited(made):
    return audit_archive(made.folder, Registry(made.calibrations), known_at=factory.KNOWN_AT)


def test_every_file_has_the_grade_that_it_was_made_with(made, audited):
    assert set(made.grades) >= {"exact", "stale", "sign_variant", "column_swap", "unknown", "undated"}
    assert factory.compare(made.truth, {"files": list(audited.files.plain())}) == []


def test_no_file_is_exact_that_is_not(made, audited):
    exact = {one["path"] for one in audited.files.plain() if one["grade"] == "exact"}
    assert exact == {path for path, one in made.truth.items() if one.grade == "exact"}


def test_what_was_known_on_another_day_changes_the_grade(made):
    # Before 2005 nobody knew of the first record's sign: the second was in force all the same, so a file of
    # 1991 by the second stays exact, and the first is stale because it was not the one in force.
    then = audit_archive(made.folder, Registry(made.calibrations), known_at=dt.date(2004, 12, 31))
    assert then.known_at < factory.KNOWN_AT
    assert {one.record for one in then.files} >= {
        "m15-r2",
        "m15-r3",
    }


def test_a_file_without_a_record_has_its_own_equation_and_the_true_one_lies_inside(made, audited):
    unknown = [one for one in audited.files if one.grade == "unknown" and len(one.segments) == 1]
    assert unknown
    for one in unknown:
        on = max(i for i, (since, _, _) in enumerate(factory.EDITIONS) if since <= one.date)
        true = dict(zip(("FY", "MZ"), factory.unknown(*factory.EDITIONS[on][1:]), strict=True))
        for load, equation in one.estimate.equations:
            assert equation.linear
            expected = dict(zip((*factory.CELLS, "constant"), true[load], strict=True))
            for name, one_of in equation.coefficients:
                assert one_of.low <= expected[name] <= one_of.high
        assert one.estimate.nearest.record in {f"m15-r{n + 1}" for n in range(len(factory.EDITIONS))}
