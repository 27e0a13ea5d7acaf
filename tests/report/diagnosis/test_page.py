"""The page of a diagnosis: what is read in ten seconds stands first, and is true of this search."""

import dataclasses
import re
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import carriage, write_case
from toolkit.diagnosis.answer.answer import Dependence, DiagnosedLaw, LawEvidence, LawPlace, RejectedEffect
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.sensor_noise import ChannelNoise
from toolkit.findings import Finding
from toolkit.lab.studies.diagnosis import diagnosis_text
from toolkit.report.diagnosis import figures
from toolkit.report.diagnosis.answer import Told, rejected
from toolkit.report.diagnosis.figures import size_maps, variables
from toolkit.report.diagnosis.numbers import chance, few, over
from toolkit.report.diagnosis.page import HEADLINES, cause, condition, headline, page
from toolkit.report.style import Style


@pytest.fixture(scope="module")
def dragged(tmp_path_factory):
    files = {f"r{i}__csv": carriage(seed=i, coulomb=0.0, drag=800.0) for i in range(2)}
    return diagnose(read_case(write_case(tmp_path_factory.mktemp("case"), **files)), None, limits=None)


def words_of(result):
    """Return the page for its words alone: its figures, which take most of its time, are not drawn."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figures, "draw_svg", lambda _size, _draw: b'<svg xmlns="http://www.w3.org/2000/svg"/>')
        return page(result)


def test_the_chart_comes_before_every_table_and_heading(dragged):
    html = page(dragged)
    assert html.index('<div class="verdict') < html.index("<img") < html.index("<h2>") < html.index("<table")


def test_a_table_scrolls_by_itself_and_a_narrow_window_is_as_wide_as_it_is(dragged):
    html = words_of(dragged)
    assert html.count('<div class="wide"><table>') == html.count("<table>") > 0
    assert 'name="viewport"' in html
    assert ".wide { overflow-x: auto;" in html
    # Figures are drawn in dark ink: in the dark they keep their white paper.
    assert re.search(r"img \{[^}]*background: #ffffff", html)
    assert "@media print" in html


def test_the_map_of_runs_is_over_the_noise_of_the_first_chart(dragged, monkeypatch):
    seen = []
    monkeypatch.setattr(figures, "_write_cells", lambda _axes, values, _most: seen.append(values))
    figures.run_map(dragged.search, dragged.diagnosis, after=False)
    (row,) = seen[0]
    (one,) = dragged.diagnosis.fit.held_out
    residual = dragged.search.refitted.residual["F"]
    # Runs of equal length: their mean square over the noise is that of all rows.
    assert np.sqrt(np.mean(row**2)) == pytest.approx(
        np.sqrt(np.mean(residual**2)) / one.noise_floor, rel=0.02
    )


def test_a_search_that_was_cut_off_does_not_say_that_no_effect_explains(dragged):
    screening = ("step 2: screening 150 candidates",)
    cut = dataclasses.replace(
        dragged.diagnosis, verdict="unknown", effects=(), complete=False, skipped=screening
    )
    assert "before every known effect was tried" in headline(cut)
    assert "no known effect explains" in headline(dataclasses.replace(cut, skipped=("predictions",)))
    whole = headline(dataclasses.replace(cut, complete=True, skipped=()))
    assert whole.startswith(HEADLINES["unknown"].removesuffix("."))


@pytest.mark.parametrize(("step", "is_said"), [("laws", True), ("swaps", True), ("predictions", False)])
def test_a_name_whose_last_test_was_skipped_is_provisional_in_the_first_line(dragged, step, is_said):
    cut = dataclasses.replace(dragged.diagnosis, complete=False, skipped=(step,))
    html = words_of(dataclasses.replace(dragged, diagnosis=cut))
    console = diagnosis_text(cut, "out").splitlines()[0]
    for first in (html.split('<div class="verdict')[1], headline(cut), console.split(": ", 1)[1]):
        assert ("Provisional: the budget was spent" in first) is is_said
    assert headline(cut).startswith("Provisional") is is_said


def test_the_noise_of_the_sensor_stands_beside_what_is_left(dragged):
    (fit,) = dragged.diagnosis.fit.held_out
    assert f"{fit.noise.sensor_sd:.4g}" in words_of(dragged)
    lines = diagnosis_text(dragged.diagnosis, "out").splitlines()
    (titles,) = [line for line in lines if line.startswith("output ")]
    (row,) = [line for line in lines if line.startswith("F ") and " N " in line]
    assert titles.split()[-2:] == ["noise", "sensor"]
    assert row.split()[-1] == f"{fit.noise.sensor_sd:.4g}"


def test_a_rest_that_is_slower_than_its_sensor_is_not_called_its_noise(dragged):
    (fit,) = dragged.diagnosis.fit.held_out
    slow = dataclasses.replace(fit, noise=ChannelNoise(sensor_sd=1.0, process_sd=4.9, how="differences"))
    clean = dataclasses.replace(
        dragged.diagnosis, verdict="nothing", remaining="nothing", effects=(), mismatch=(),
        fit=dataclasses.replace(dragged.diagnosis.fit, held_out=(slow,)),
    )  # fmt: skip
    html = words_of(dataclasses.replace(dragged, diagnosis=clean))
    assert "F is 5 times its sensor" in html
    assert "larger than the sensor has from row to row" in html


def test_what_is_left_says_no_variable_that_is_none(dragged):
    large = Dependence(channel="F", variables=(), reason="a floor above a tenth of the output's spread")
    left = (large, *(Dependence(channel="F", variables=names) for names in (("F",), ("v", "F"))))
    unknown = dataclasses.replace(dragged.diagnosis, verdict="unknown", effects=(), depends_on=left)
    for text in (words_of(dataclasses.replace(dragged, diagnosis=unknown)), diagnosis_text(unknown, "out")):
        assert "F leaves a floor above a tenth" in text
        assert "F over its own size" in text
        assert "F over v and its own size" in text


def test_a_rest_that_no_test_tells_from_noise_has_no_probability(dragged):
    untested = dataclasses.replace(
        dragged.diagnosis.mismatch[0], p_value=1.0, share_of_variance=0.0, where=()
    )
    made = dataclasses.replace(dragged.diagnosis, verdict="unknown", effects=(), mismatch=(untested,))
    html = words_of(dataclasses.replace(dragged, diagnosis=made))
    assert "F: the residual is too large to be taken for noise, and no test tells it from noise." in html
    assert "p = 1" not in html


def test_a_size_below_what_the_rows_resolve_is_printed_as_that(dragged):
    effect = dragged.diagnosis.effects[0]
    small = dataclasses.replace(
        effect.parameters[0], name="reach", value=1.28e-17, unit="m", ci95=(0.0, 3.1e-5)
    )
    made = dataclasses.replace(
        dragged.diagnosis, effects=(dataclasses.replace(effect, parameters=(*effect.parameters, small)),)
    )
    assert "reach: not resolved, below 3.1e-05 m" in diagnosis_text(made, "out")
    for text in (words_of(dataclasses.replace(dragged, diagnosis=made)), diagnosis_text(made, "out")):
        assert "not resolved" in text
        assert "below 3.1e-05" in text
        assert "e-17" not in text


def test_a_class_says_first_what_it_may_be_and_where(dragged):
    effect = dataclasses.replace(
        dragged.diagnosis.effects[0], channel="F", equivalent_to=("creep", "backlash")
    )
    classed = dataclasses.replace(dragged.diagnosis, verdict="equivalent", effects=(effect,))
    assert cause(classed).startswith("quadratic_drag on F (or creep, backlash), drag ")


def test_a_name_whose_sizes_may_be_none_is_told_as_no_more(dragged):
    effect = dragged.diagnosis.effects[0]
    (drag, *_) = effect.parameters
    unsure = dataclasses.replace(effect, parameters=(dataclasses.replace(drag, ci95=(-0.1, 0.9)),))
    named = dataclasses.replace(dragged.diagnosis, effects=(unsure,))
    assert headline(named, with_cause=True).startswith("Perhaps quadratic_drag on F")
    for text in (headline(named), diagnosis_text(named, "out")):
        assert "none of its sizes is told from none" in text
        assert "has a name" not in text


def test_what_is_there_or_not_has_no_smallest_size_and_says_so(dragged):
    absent = {each.name: each for each in dragged.diagnosis.not_found}
    for each in absent.values():
        assert each.minimum_detectable is not None or each.why
    assert "it has no size" in words_of(dragged)


def test_no_chance_is_zero(dragged):
    assert chance(0.0) == "p < 1e-300"
    assert chance(float("nan")) == "p unknown"
    assert chance(0.0312) == "p = 0.031"
    assert not re.search(r"(p =|is) 0[.)]", words_of(dragged))


def test_a_mean_over_loads_that_repeat_has_no_point_where_none_was_recorded():
    # Five loads, ten rows each: quantiles between them hold no row, and a bin of none has no mean.
    loads = np.repeat([250.0, 567.0, 833.0, 1101.0, 1372.0], [4, 10, 3, 17, 6])
    at, mean = figures.binned(loads, 3.0 + 2.0 * loads)
    assert all(250 <= one <= 1372 for one in at)
    np.testing.assert_allclose(mean, 3.0 + 2.0 * at, rtol=1e-12)
    spread = np.sort(np.random.default_rng(0).uniform(0, 1, 500))
    assert all(0 < one < 1 for one in figures.binned(spread, spread)[0])


def test_the_noise_is_no_larger_than_an_error_that_was_reached(dragged):
    for one in dragged.diagnosis.fit.held_out:
        assert one.noise_floor <= one.augmented_rmse


def test_the_page_says_on_which_condition_an_effect_acts(dragged):
    runs = [
        SimpleNamespace(name=name, conditions={"surface": surface, "order": str(i), "lab": "A"})
        for i, (name, surface) in enumerate([("a", "steel"), ("b", "sandpaper"), ("c", "steel")])
    ]
    result = SimpleNamespace(search=SimpleNamespace(problem=SimpleNamespace(runs=runs)))
    assert condition(result, ("a", "c")) == " (surface steel)"
    assert condition(result, ("b",)) == " (surface sandpaper, order 1)"
    assert condition(result, ("a", "b")) == ""


def test_an_effect_that_has_no_place_takes_no_row(dragged):
    html = words_of(dragged)
    hidden = [one.name for one in dragged.diagnosis.not_found if not one.observable]
    shown = [one.name for one in dragged.diagnosis.not_found if one.observable]
    assert hidden
    assert all(f"<td>{name}</td>" not in html for name in hidden)
    assert all(name in html for name in hidden)
    assert all(f"<td>{name}</td>" in html for name in shown)


def test_time_is_told_in_the_unit_of_the_case(tmp_path):
    # A resistor that drifts over 100 days: in seconds its place would end at 8553600.
    days = np.arange(100.0)
    y = 10.0 + 0.01 * days + np.random.default_rng(1).normal(0, 1e-3, 100)
    toml = case_text("python", time="day", outputs={"y": "ohm"}, runs=1)
    simulator = """
def simulate(inputs, p):
    return (10.0 + 0 * inputs["t"]).to_frame("y")
"""
    read = read_case(
        write_case(tmp_path, toml, simulator=simulator, r0__csv=pd.DataFrame({"t": days, "y": y}))
    )
    result = diagnose(read, None, limits=None)
    places = [at for one in result.diagnosis.mismatch for at in one.where if at.variable == "time"]
    assert places
    assert all(at.unit == "day" and 0 <= at.start < at.end <= 99 for at in places)
    assert "day" in words_of(result)


def test_a_residual_is_mapped_over_every_kind_of_variable():
    n = 60
    t = np.linspace(0, 6, n)
    columns = {"SA": np.sin(t), "FZ": 3000 + 500 * np.cos(t), "TIRE_ANGLE": np.rad2deg(7 * t), "IA": 0 * t}
    units = {"SA": "deg", "FZ": "N", "TIRE_ANGLE": "deg", "IA": "deg"}
    runs = [
        SimpleNamespace(
            columns=columns, t=t, rows=n, name=name, conditions={"rotation": way, "mounting": "normal"}
        )
        for name, way in (("a", "forward"), ("b", "reverse"))
    ]
    case = SimpleNamespace(
        drivers=[SimpleNamespace(name=name, unit=unit) for name, unit in units.items()],
        channels=[SimpleNamespace(role="time", unit="s")], has_time=True,
    )  # fmt: skip
    fit = SimpleNamespace(residual={"FY": np.random.default_rng(2).normal(0, 2.0, 2 * n)})
    found = SimpleNamespace(
        problem=SimpleNamespace(
            case=case, runs=runs, judged=lambda _, values: values, judged_at=lambda _: np.arange(2 * n)
        ),
        refitted=fit,
        augmented=fit,
    )
    mapped = {label: (values, levels) for label, values, levels in variables(found)}
    # An inclination that never varies tells nothing, nor does a mounting that is one and the same.
    assert list(mapped) == ["SA [deg]", "FZ [N]", "rotation", "TIRE_ANGLE in one turn [deg]", "time [s]"]
    assert mapped["rotation"][1] == ("forward", "reverse")
    turned = mapped["TIRE_ANGLE in one turn [deg]"][0]
    assert turned.min() >= 0
    assert turned.max() < 360
    np.testing.assert_allclose(np.exp(1j * np.deg2rad(turned[:n])), np.exp(7j * t), atol=1e-9)
    made = SimpleNamespace(fit=SimpleNamespace(held_out=[SimpleNamespace(channel="FY", noise_floor=2.0)]))
    drawn = size_maps(found, made, "FY", after=True)
    assert drawn is not None
    assert drawn.startswith(b"<?xml")


def test_the_first_line_says_that_a_name_is_not_the_whole(dragged):
    whole = dataclasses.replace(dragged.diagnosis, remaining="nothing")
    part = dataclasses.replace(dragged.diagnosis, remaining="unknown")
    assert headline(whole) == HEADLINES[whole.verdict]
    assert headline(part).startswith(
        f"{HEADLINES[part.verdict]} More is left that no known effect explains: F is off by "
    )


def test_the_first_line_does_not_call_a_fifth_the_missing_physics(dragged):
    """A servo's lag took 21 % of what was off: 0.125 rad without, 0.111 rad with it, 0.0014 rad of noise."""
    answer = dragged.diagnosis
    (fit,) = answer.fit.held_out
    errors = dataclasses.replace(fit, refitted_rmse=0.12492, augmented_rmse=0.11084, noise_floor=0.00138)
    of_rows = dataclasses.replace(answer.fit, held_out=(errors,))
    servo = dataclasses.replace(answer, remaining="unknown", fit=of_rows)
    assert "explains 21 % of the mean square" in (cause(servo) or "")
    assert headline(servo).startswith(
        "A part of what is missing has a name. Most is left that no known effect"
    )


@pytest.mark.parametrize("skipped", [(), ("step 2: screening 150 candidates",)])
def test_the_first_line_says_how_large_is_what_has_no_name(dragged, skipped):
    """A house: 0.21 K of a temperature that varies by 4.7 K is 4.5 %; an answer of old does not know it."""
    (fit,) = dragged.diagnosis.fit.held_out
    assert fit.spread == pytest.approx(np.std(dragged.search.problem.observed["F"]))
    house = dataclasses.replace(fit, channel="T", unit="K", augmented_rmse=0.2099, spread=4.7)
    quiet = dataclasses.replace(fit, channel="P", unit="W", augmented_rmse=9.0, spread=9.0)
    answer = dataclasses.replace(
        dragged.diagnosis, verdict="unknown", effects=(), skipped=skipped,
        depends_on=(Dependence(channel="T", variables=("sun",)),),
        fit=dataclasses.replace(dragged.diagnosis.fit, held_out=(quiet, house)),
    )  # fmt: skip
    assert ": T is off by 0.21 K, 4.5 % of its spread" in headline(answer)
    old = dataclasses.replace(house, spread=None)
    answer = dataclasses.replace(answer, fit=dataclasses.replace(answer.fit, held_out=(old,)))
    assert "off by" not in headline(answer)


def test_the_first_line_says_where_a_law_of_several_equations_is(dragged):
    """A rod that gives heat to the room does so along all of its length; the second law is another."""
    together = LawEvidence(held_out_log_score_gain=229.0, p_value=1e-9, share_of_gap=0.97)
    place = LawPlace(kind="state", channel="T2")
    law = DiagnosedLaw(
        place=place, form="static", acts="adds", variables=("T2", "Troom"), memory_s=None,
        formula="a*(T2 - Troom)",
        parameters=(), curve=None, ranges=(), resembles=(), confounded_with=(), evidence=together,
    )  # fmt: skip
    other = dataclasses.replace(together, share_of_gap=0.5)
    laws = (
        law,
        *(dataclasses.replace(law, place=LawPlace(kind="state", channel=name)) for name in ("T3", "T4")),
        dataclasses.replace(law, place=LawPlace(kind="state", channel="T6"), evidence=other),
    )
    answer = dataclasses.replace(dragged.diagnosis, verdict="unknown", effects=(), laws=laws)
    told = "in the equation of T2: dT2/dt = ... + a*(T2 - Troom); with it laws in the equations of T3, T4."
    assert headline(answer).endswith(f"Its law was learned: {told}")
    answer = dataclasses.replace(answer, laws=laws[::3])
    assert headline(answer).endswith(f"Its law was learned: {told.partition(';')[0]}.")


@pytest.mark.parametrize(
    ("value", "digits", "told"),
    [(1112.4, 3, "1112"), (2.5e6, 4, "2500000"), (0.012345, 3, "0.0123"), (-469.68, 4, "-469.7"),
     (0.0, 3, "0"), (float("nan"), 3, "nan")],
)  # fmt: skip
def test_a_load_in_newton_is_no_power_of_ten(value, digits, told):
    assert few(value, digits) == told


def test_a_residual_that_is_only_too_large_depends_on_nothing(dragged):
    cause = "more than its stated noise"
    large = dataclasses.replace(dragged.diagnosis.mismatch[0], share_of_variance=0.0, where=())
    made = dataclasses.replace(
        dragged.diagnosis,
        verdict="unknown",
        effects=(),
        mismatch=(large,),
        depends_on=(Dependence(channel="F", variables=(), reason=cause),),
    )
    html = words_of(dataclasses.replace(dragged, diagnosis=made))
    assert "F is off by more than its stated noise" in html
    assert "over more than" not in html
    assert ": 0 %" not in html
    assert over("F", ("v", "dv/dt")) == "F over v and dv/dt"


@pytest.mark.parametrize(
    ("runs", "said"),
    [(None, "on F,"), (("r1.csv",), "on F in r1.csv alone,"), (("a", "b"), "in 2 runs alone,")],
)
def test_the_first_line_says_in_which_runs_an_effect_is(dragged, runs, said):
    """The same effect in all runs and once more in one of them had two sizes there and no difference."""
    (effect,) = dragged.diagnosis.effects
    parameters = tuple(dataclasses.replace(each, runs=runs) for each in effect.parameters)
    confined = dataclasses.replace(effect, parameters=parameters)
    line = cause(dataclasses.replace(dragged.diagnosis, effects=(confined,)))
    assert said in line
    assert ("alone" in line) is (runs is not None)


def test_the_first_line_has_the_cause_its_size_and_what_it_explains(dragged):
    line = cause(dragged.diagnosis)
    (effect,), (fit,) = dragged.diagnosis.effects, dragged.diagnosis.fit.held_out
    assert line is not None
    assert line.startswith(effect.name)
    # of the mean square above the noise
    above = fit.refitted_rmse**2 - min(fit.noise_floor, fit.augmented_rmse) ** 2
    share = 100 * (fit.refitted_rmse**2 - fit.augmented_rmse**2) / above
    assert f"explains {share:.0f} % of the mean square by which F" in line
    assert cause(dataclasses.replace(dragged.diagnosis, effects=())) is None
    assert line.split("(")[0] in words_of(dragged)


def test_a_ratio_has_no_unit_and_keeps_its_last_digit(dragged):
    (effect,) = dragged.diagnosis.effects
    size = dataclasses.replace(effect.parameters[0], value=0.11, unit="1", ci95=None)
    bare = dataclasses.replace(effect, parameters=(size,))
    line = cause(dataclasses.replace(dragged.diagnosis, effects=(bare,)))
    assert re.search(rf"{size.name} 0\.110*(?!\d| 1)", line)


def test_a_spent_budget_is_not_the_recordings_fault(dragged):
    late = dataclasses.replace(
        dragged.diagnosis, verdict="untestable", effects=(), complete=False, skipped=("refit",)
    )
    assert "budget was spent" in headline(late)
    assert "cannot tell" not in headline(late)


def test_nothing_is_shown_beside_the_recording(dragged):
    clean = dataclasses.replace(dragged.diagnosis, verdict="nothing", effects=(), mismatch=())
    assert "nothing stands out of the noise" in words_of(dataclasses.replace(dragged, diagnosis=clean))


def test_what_has_no_name_has_a_list_of_what_it_is_not(dragged):
    unknown = dataclasses.replace(dragged.diagnosis, verdict="unknown", effects=())
    assert "why it is not named" in words_of(dataclasses.replace(dragged, diagnosis=unknown))
    assert "why it is not named" not in words_of(dragged)


def test_the_rivals_that_are_listed_are_the_nearest(dragged):
    """Ten rivals, as older answers have them: the farthest first."""
    rivals = tuple(RejectedEffect(name=f"rival{k}", log_likelihood_less=10.0 * k) for k in range(10, 0, -1))
    (effect,) = dragged.diagnosis.effects
    answer = dataclasses.replace(dragged.diagnosis, effects=(dataclasses.replace(effect, rejected=rivals),))
    assert "(log-likelihood less): rival1 (by 10.0), rival2 (by 20.0), rival3" in words_of(
        dataclasses.replace(dragged, diagnosis=answer)
    )
    listed = [name for _, name, _ in rejected.build(Told(answer=answer), Style())]
    assert listed == [f"rival{k}" for k in range(1, 7)]


def test_a_long_curve_keeps_its_extremes():
    t = np.arange(100_000.0)
    y = np.sin(t / 5_000)
    y[[31_415, 77_777]] = 7.0, -9.0
    y[50_000:50_100] = np.nan
    at, values = figures.drawn(t, y)
    assert len(at) < 1500
    assert (np.diff(at) > 0).all()
    assert values.max() == 7.0
    assert values.min() == -9.0
    assert len(figures.drawn(t[:900], y[:900])[0]) == 900


def test_simulated_recordings_are_marked_on_the_page_and_the_console(dragged, tmp_path):
    note = Finding(rule="case-simulated", where="CASE.toml", level="note", message="simulated")
    marked = dataclasses.replace(dragged.diagnosis, findings=(note,))
    assert "SIMULATED DATA" in words_of(dataclasses.replace(dragged, diagnosis=marked))
    assert diagnosis_text(marked, tmp_path).startswith("SIMULATED DATA")
    assert "SIMULATED" not in words_of(dragged) + diagnosis_text(dragged.diagnosis, tmp_path)
