import numpy as np

from tests.audit.audit_factory import FY, changed, columns
from toolkit.audit.estimate import coefficient_intervals, interval_bounds
from toolkit.audit.model import columns_of
from toolkit.examples import packaged_fig4_4
from toolkit.machine import load_machine
from toolkit.recording.read import read_recording


def test_figure_4_4_proves_the_negative_E5():
    file = columns_of(read_recording(packaged_fig4_4()[0], load_machine("m15")))
    E5 = {load: coefficient_intervals(file, load)[file.names.index("E5")] for load in ("FY", "MZ")}
    # The laboratory's notes have [-1.0256, -1.0189] and [-0.00286, -0.00244] with each value's own digits as
    # they stand in the figure; the finest place of each decade proves a little more. Both hold the published
    # magnitude with the other sign.
    assert -1.0256 < E5["FY"].low < -1.0228 < E5["FY"].high < -1.0189
    assert -0.00286 < E5["MZ"].low < -0.0026666 < E5["MZ"].high < -0.00244
    assert {one.sign for one in E5.values()} == {-1}


def test_figure_4_4_by_the_digits_as_they_stand():
    file = columns_of(read_recording(packaged_fig4_4()[0], load_machine("m15")))

    def half(values):
        return np.vectorize(lambda v: 0.5 * 10.0 ** -len(f"{v!r}".split(".")[1]))(values)

    ends = {
        load: interval_bounds(file.x, file.y[load], half_x=half(file.x), half_y=half(file.y[load]))
        for load in ("FY", "MZ")
    }
    at = file.names.index("E5")
    np.testing.assert_allclose(ends["FY"][at], [-1.0256, -1.0189], atol=2e-4)
    np.testing.assert_allclose(ends["MZ"][at], [-0.00286, -0.00244], atol=4e-5)


def test_the_true_coefficient_always_lies_inside():
    for seed in range(4):
        found = coefficient_intervals(columns(rows=25, seed=seed, decimals=1), "FY")
        for one, true in zip(found, FY, strict=True):
            assert one.low <= true <= one.high
            assert one.high - one.low < 0.5


def test_more_digits_narrow_the_interval():
    coarse, fine = (coefficient_intervals(columns(rows=25, decimals=d), "FY")[2] for d in (1, 3))
    assert (fine.high - fine.low) < (coarse.high - coarse.low)


def test_no_equation_no_interval():
    file = columns(rows=25)
    file.y["FY"][:] = np.random.default_rng(1).uniform(-500, 500, 25)
    assert coefficient_intervals(file, "FY") == ()


def test_numbers_without_a_square_leave_every_coefficient_open():
    x = np.random.default_rng(2).uniform(-1e303, 1e303, (20, 1))
    bounds = interval_bounds(x, 0.5 * x[:, 0], half_x=x * 0 + 1e295, half_y=x[:, 0] * 0 + 1e295)
    assert np.isinf(bounds).all()


def test_the_rows_of_a_long_file_are_not_all_needed_but_all_held(monkeypatch):
    from toolkit.audit import estimate as module

    solved = []
    bounds_of = module._bounds_of

    def counted(x, *others, **halves):
        solved.append(len(x))
        return bounds_of(x, *others, **halves)

    for seed, decimals in ((1, 1), (2, 3), (3, 0)):
        file = columns(rows=3000, seed=seed, decimals=decimals)
        whole = np.array([(i.low, i.high) for i in coefficient_intervals(file, "FY")])
        with monkeypatch.context() as patch:
            patch.setattr(module, "_MANY", 500)
            patch.setattr(module, "_SPREAD", 40)
            patch.setattr(module, "_bounds_of", counted)
            parted = np.array([(i.low, i.high) for i in coefficient_intervals(file, "FY")])
        np.testing.assert_allclose(parted, whole, rtol=1e-5)
    assert max(solved) < 500


def test_one_row_of_a_long_file_that_no_equation_gives_is_not_passed_over(monkeypatch):
    from toolkit.audit import estimate as module

    file = changed(columns(rows=3000, decimals=2), "FY", 1234, 1.0)
    monkeypatch.setattr(module, "_MANY", 500)
    monkeypatch.setattr(module, "_SPREAD", 40)
    assert coefficient_intervals(file, "FY") == ()
    assert coefficient_intervals(file, "MZ") != ()
