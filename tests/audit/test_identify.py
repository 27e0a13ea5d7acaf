import datetime as dt

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.audit.audit_factory import (
    FY,
    MZ,
    R1,
    R2,
    changed,
    columns,
    from_arrays,
    joined,
    negative,
    record,
    seven_digits,
)
from toolkit.audit.candidates import group_of, shared
from toolkit.audit.identify import identify_columns, recompute, repair
from toolkit.audit.model import columns_of
from toolkit.examples import packaged_fig4_4
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording

DAY = dt.date(2019, 6, 4)
BOTH = (R1, R2)


def judged(file, records=BOTH, *, on=DAY, in_force=R2, void=()):
    return identify_columns(file, records, on=on, in_force=in_force, void=void)


@pytest.fixture(scope="module")
def figure():
    return columns_of(read_recording(packaged_fig4_4()[0], load_machine("m15")))


class TestFigure44:
    """The ten printed rows of the source document (Figure 4.4): the accident itself."""

    def test_old_record_is_found_and_stale_because_it_is_void_on_every_day(self, figure):
        found = identify_columns(figure, BOTH, on=None, in_force=None, void={"m15-r1"})
        assert (found.grade, found.record, found.variant) == ("stale", "m15-r1", None)
        assert found.repair is None
        assert [(s.first_row, s.last_row) for s in found.segments] == [(1, 10)]

    def test_published_record_alone_explains_it_with_negative_E5(self, figure):
        found = identify_columns(figure, (R2,), on=None, in_force=None)
        assert (found.grade, found.record, found.variant) == (
            "sign_variant",
            "m15-r2",
            "E5 negative in FY, MZ",
        )

    def test_repair_by_the_published_record(self, figure):
        found = identify_columns(figure, BOTH, on=DAY, in_force=R2)
        # By hand from the last rows: 2 x 1.0228 x 497.591 lbf and 2 x 0.0026666 x 497.591 lbf·ft.
        assert found.repair.FY_max_abs_N == pytest.approx(2 * 1.0228 * 497.591 * 4.4482216152605, rel=1e-5)
        assert found.repair.MZ_max_abs_Nm == pytest.approx(
            2 * 0.0026666 * 497.591 * 1.3558179483314, rel=1e-4
        )
        assert found.grade == "stale"

    def test_corrected_first_row(self, figure):
        FY_N = recompute(figure, R2)["FY"]
        # 0.99719 x 98.59261 + 0.99718 x 86.06072 - 1.0228 x 182.415 + 0.6473, to two decimals
        assert round(float(FY_N[0]) / 4.4482216152605, 2) == -1.79


GRADES = [
    ("exact", columns(), None),
    ("rounding", columns((0.997192, 0.99718, 1.0228, 0.6473)), None),
    ("stale", columns(negative(FY), negative(MZ)), None),
    ("sign_variant", columns(FY, negative(MZ)), "E5 negative in MZ"),
    ("sign_variant", columns(negative(FY, 0), MZ), "D51 negative in FY"),
    ("sign_variant", columns(FY, negative(MZ, 0)), "D51 positive in MZ"),
    ("sign_variant", columns(negative(FY, 3), negative(MZ, 3)), "constant negative in FY, MZ"),
    ("column_swap", columns(order=("D52", "D51", "E5")), "D51<->D52"),
    ("column_swap", columns(order=("D52", "E5", "D51")), "D51->D52->E5->D51"),
    ("unknown", columns((0.9, 0.9, 0.9, 0.1)), None),
]


@pytest.mark.parametrize(("grade", "file", "variant"), GRADES, ids=[f"{g}-{v}" for g, _, v in GRADES])
def test_each_grade(grade, file, variant):
    found = judged(file)
    assert (found.grade, found.variant) == (grade, variant)
    assert found.repair is not None


def test_sign_and_swap_together_are_told_in_full():
    found = judged(columns(negative(FY), negative(MZ), order=("D52", "D51", "E5")), (R2,))
    assert found.grade == "column_swap"
    assert found.variant == "E5 negative in FY, MZ; D51<->D52"


def test_without_a_date_a_sound_record_is_undated():
    found = judged(columns(), on=None, in_force=None)
    assert (found.grade, found.record, found.repair) == ("undated", "m15-r2", None)


def test_a_date_before_every_record_is_stale_without_repair():
    found = judged(columns(), in_force=None)
    assert (found.grade, found.record, found.in_force, found.repair) == ("stale", "m15-r2", None, None)


def test_issued_digits_and_full_coefficients_are_one_candidate():
    more = (0.9971934, 0.9971812, 1.0228123, 0.6473), (-0.1568812, 0.1619743, 0.00266663, 0.68759)
    full = record("m15-r3", *more, issued=(FY, MZ))
    for coefficients in (more, (FY, MZ)):
        found = judged(columns(*coefficients), (full,), in_force=full)
        assert (found.grade, found.record) == ("exact", "m15-r3")
    assert found.issued is True


def test_equal_coefficients_are_one_candidate_named_after_the_record_in_force():
    again = record("m15-r7")
    assert judged(columns(), (R1, R2, again), in_force=again).record == "m15-r7"
    assert judged(columns(), (R1, R2, again), in_force=R2).grade == "exact"


def test_records_that_coarse_digits_cannot_tell_apart_are_ambiguous():
    near = record("m15-r5", (0.99722, 0.99718, 1.0228, 0.6473))
    found = judged(columns(decimals=1), (R2, near))
    assert (found.grade, found.record, found.candidates) == ("ambiguous", None, ("m15-r2", "m15-r5"))
    assert judged(columns(), (R2, near)).grade == "exact"


def test_what_all_candidates_of_an_ambiguous_file_share_is_told():
    near = record("m15-r5", (0.99722, 0.99718, 1.0228, 0.6473))
    found = judged(columns((*FY[:2], -FY[2], FY[3]), decimals=1), (R2, near))
    assert (found.grade, found.record, found.candidates) == ("ambiguous", None, ("m15-r2", "m15-r5"))
    assert found.variant == found.segments[0].variant == "E5 negative in FY"


def test_what_ambiguous_candidates_share_is_told_where_another_sign_is_open():
    x = columns().x.copy()
    x[:, 1] = 0.0  # D52 is dead: of its sign nothing is known, of that of E5 everything
    y = {load: seven_digits(x @ np.array([*c[:2], -c[2]]) + c[3]) for load, c in (("FY", FY), ("MZ", MZ))}
    found = judged(from_arrays(x, y), (R2,))
    assert (found.grade, found.candidates) == ("ambiguous", ("m15-r2",))
    assert found.variant == found.segments[0].variant == "E5 negative in FY, MZ"


@pytest.mark.parametrize(
    ("variants", "common"),
    [
        (("E5 negative in FY, MZ", "D52 positive in FY; E5 negative in FY, MZ"), "E5 negative in FY, MZ"),
        (("E5 negative in FY, MZ", "E5 negative in MZ; D51<->D52"), "E5 negative in MZ"),
        (("E5 negative in FY; D51<->D52", "E5 positive in FY; D51<->D52"), "D51<->D52"),
        (("E5 negative in FY", "D52 negative in FY"), None),
        (("E5 negative in FY", None), None),
        ((None,), None),
    ],
)
def test_what_variants_share(variants, common):
    assert shared(variants) == shared(variants[::-1]) == common


def test_a_dead_channel_leaves_its_sign_open():
    file = columns()
    x = file.x.copy()
    x[:, 2] = 0.0
    y = {
        "FY": seven_digits(x @ np.array(FY[:3]) + FY[3]),
        "MZ": seven_digits(x @ np.array(MZ[:3]) + MZ[3]),
    }
    assert judged(from_arrays(x, y)).grade == "ambiguous"


def test_a_constant_below_the_rounding_has_no_sign():
    tared = record("m15-r8", (*FY[:3], 1e-9), (*MZ[:3], -1e-10))
    assert judged(columns((*FY[:3], 0.0), (*MZ[:3], 0.0)), (tared,), in_force=tared).grade == "exact"


def test_a_constant_whose_sign_the_issued_digits_hide_has_none():
    # At 400 lbf the digits that the certificate leaves out are as much as the constant's two signs differ by.
    issued = (*FY[:3], 1e-3), (*MZ[:3], 0.0)
    full = record("m15-r8", (FY[0] + 5e-6, *FY[1:3], 1e-3), issued[1], issued=issued)
    x = seven_digits(np.random.default_rng(1).uniform(380.0, 420.0, (60, 3)))
    y = {load: seven_digits(x @ np.array(c[:3]) + c[3]) for load, c in zip(("FY", "MZ"), issued, strict=True)}
    found = judged(from_arrays(x, y), (full,), in_force=full)
    assert (found.grade, found.record, found.candidates) == ("exact", "m15-r8", ())
    # Where the file can tell, the sign is told.
    y["FY"] = seven_digits(x @ np.array(FY[:3]) - 5e-3)
    bold = record("m15-r9", (*FY[:3], 5e-3), issued[1])
    assert judged(from_arrays(x, y), (bold,), in_force=bold).variant == "constant negative in FY"


def test_a_change_in_the_middle_gives_two_segments():
    found = judged(joined(columns(rows=40), columns(negative(FY), negative(MZ), rows=25, seed=5)))
    assert [(s.first_row, s.last_row, s.record, s.grade) for s in found.segments] == [
        (1, 40, "m15-r2", "exact"),
        (41, 65, "m15-r1", "stale"),
    ]
    assert (found.grade, found.record) == ("stale", "m15-r1")


def test_a_single_deviating_row_is_its_own_segment():
    found = judged(changed(columns(rows=40), "MZ", 16, 0.37))
    assert [(s.first_row, s.last_row, s.grade) for s in found.segments] == [
        (1, 16, "exact"),
        (17, 17, "unknown"),
        (18, 40, "exact"),
    ]
    assert (found.grade, found.record) == ("unknown", None)


def test_both_loads_are_judged_together():
    # FY by the record in force, MZ by the other's: a variant, never one of the two.
    found = judged(columns(FY, negative(MZ)), BOTH)
    assert found.grade == "sign_variant"


def test_a_record_of_another_unit_is_no_candidate():
    other = record("m15-r4", unit="mV/V")
    found = judged(columns(), (other, R2))
    assert found.grade == "exact"
    assert [s.id for s in found.skipped] == ["m15-r4"]
    assert "mV/V" in found.skipped[0].reason


def test_units_of_the_record_do_not_matter():
    N = 4.4482216152605
    metric = record("m15-r6", (*FY[:3], FY[3] * N), tuple(v * 0.3048 for v in (*MZ[:3], MZ[3] * N)),
                    unit="N", loads=("N", "N*m"))  # fmt: skip
    assert judged(columns(), (metric,), in_force=metric).grade == "exact"
    one, other = recompute(columns(), metric), recompute(columns(), R2)
    np.testing.assert_allclose(one["MZ"], other["MZ"], rtol=1e-12, atol=1e-9)


def test_repair_of_an_exact_file_is_rounding():
    most = repair(columns(), R2)
    assert 0 < most.FY_max_abs_N < 1e-3


@settings(max_examples=25, deadline=None)
@given(st.permutations(range(3)), st.tuples(*[st.sampled_from((1, -1))] * 8), st.integers(0, 99))
def test_every_variant_of_a_record_is_recognised_as_itself(order, turned, seed):
    names = ("D51", "D52", "E5")
    file = columns(
        tuple(c * s for c, s in zip(FY, turned[:4], strict=True)),
        tuple(c * s for c, s in zip(MZ, turned[4:], strict=True)),
        order=tuple(names[i] for i in order), seed=seed, rows=30,
    )  # fmt: skip
    found = judged(file, (R2,))
    plain, own = all(s > 0 for s in turned), tuple(order) == (0, 1, 2)
    assert found.grade == ("exact" if plain and own else "sign_variant" if own else "column_swap")
    assert found.record == "m15-r2"
    assert (found.variant is None) == (plain and own)


@pytest.mark.parametrize("size", [1, 7, 64])
def test_a_file_says_the_same_in_whatever_parts_it_is_taken(monkeypatch, size):
    from toolkit.audit import identify as module

    unknown = columns((0.9, 0.9, 0.9, 0.1), rows=150, decimals=1)
    files = (
        columns(rows=90),
        columns(rows=90, decimals=0),
        joined(columns(rows=40), columns(negative(FY), negative(MZ), rows=25, seed=5)),
        changed(changed(columns(rows=70), "FY", 63, 0.5), "MZ", 64, 0.37),
        joined(unknown, columns(order=("D52", "D51", "E5"), rows=9, seed=4)),
        unknown,
    )
    near = record("m15-r5", (0.99722, 0.99718, 1.0228, 0.6473))
    answers = [judged(file, (R1, R2, near)) for file in files]
    assert {answer.grade for answer in answers} >= {"exact", "ambiguous", "stale", "unknown"}
    monkeypatch.setattr(module, "ROWS", size)
    monkeypatch.setattr(module, "_FIRST_ROWS", size)
    assert [judged(file, (R1, R2, near)) for file in files] == answers


def evaluated(monkeypatch, file):
    """Rows on which any group is evaluated in full while a file is judged."""
    from toolkit.audit import identify as module

    rows = []

    def counted(record, part, **how):
        rows.append(part.rows)
        return group_of(record, part, **how)

    monkeypatch.setattr(module, "group_of", counted)
    judged(file)
    return sum(rows), max(rows)


def in_turn(rows):
    first, second = columns(rows=rows), columns(negative(FY), negative(MZ), rows=rows)
    odd = np.arange(rows) % 2 == 1
    return from_arrays(first.x, {load: np.where(odd, second.y[load], first.y[load]) for load in first.y})


UNKNOWN = (0.9, 0.9, 0.9, 0.1), (-0.1, 0.2, 0.3, 0.4)
MANY = {
    "unknown": lambda rows: columns(*UNKNOWN, rows=rows),
    "unknown in few digits": lambda rows: columns(*UNKNOWN, rows=rows, decimals=0),
    "two calibrations in turn": in_turn,
}


@pytest.mark.parametrize("name", MANY)
def test_what_a_file_of_any_origin_takes_is_linear_in_its_rows(monkeypatch, name):
    from toolkit.audit import identify as module

    monkeypatch.setattr(module, "ROWS", 256)
    monkeypatch.setattr(module, "_FIRST_ROWS", 256)
    few, of_few = evaluated(monkeypatch, MANY[name](1500))
    many, of_many = evaluated(monkeypatch, MANY[name](6000))
    assert many < 4.5 * few + 256
    assert max(of_few, of_many) <= 256
