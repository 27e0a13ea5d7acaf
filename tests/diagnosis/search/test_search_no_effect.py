"""What looks like an effect and is none: a unit that only makes an error small, a size that nothing shows."""

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.case_text import case_text
from tests.diagnosis.cases import HEAD, TWO, write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.diagnose import diagnose
from toolkit.diagnosis.fit.fit import fit, replace_effects
from toolkit.diagnosis.fit.noise import fit_noise, layout
from toolkit.diagnosis.fit.problem import problem_of
from toolkit.diagnosis.search.forward_step import Step
from toolkit.diagnosis.search.search import _with_a_size
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

CASE = case_text("python", inputs={"SA": "deg", "FZ": "N"}, outputs={"FY": "N", "MZ": "N*m"}, axes="machine")
SIMULATOR = """
import numpy as np, pandas as pd
def simulate(inputs, p):
    side = np.tanh(inputs["SA"].to_numpy() / 3)
    FZ = inputs["FZ"].to_numpy()
    return pd.DataFrame({"FY": -0.9 * FZ * side, "MZ": 0.02 * FZ * side * np.exp(-side**2)})
"""


def test_a_simulator_that_knows_of_no_reversal_has_the_wrong_sign_there_and_no_other_unit(tmp_path):
    # Machine-fixed: FY(SA) = -FY_forward(SA) on the reversed drum, MZ(SA) = +MZ_forward(SA).
    t = np.arange(0, 40, 0.1)
    SA, FZ = 6 * np.sin(0.7 * t), 4000 + 1000 * np.sin(0.09 * t)
    side = np.tanh(SA / 3)
    frames, text = {}, CASE
    for i, rotation in enumerate(("forward", "reverse", "forward", "reverse")):
        rng = np.random.default_rng(i)
        turned = 1 if rotation == "forward" else -1
        FY = -0.9 * turned * FZ * side + rng.normal(0, 8, t.size)
        MZ = 0.02 * FZ * side * np.exp(-(side**2)) + rng.normal(0, 0.4, t.size)
        frames[f"r{i}__csv"] = pd.DataFrame({"t": t, "SA": SA, "FZ": FZ, "FY": FY, "MZ": MZ})
        text += f'[[recording.run]]\nfile = "r{i}.csv"\nrotation = "{rotation}"\n'
    made = diagnose(read_case(write_case(tmp_path, text, simulator=SIMULATOR, **frames)), None).diagnosis
    (one,) = made.effects
    assert (one.name, one.channel) == ("channel_sign", "FY")
    assert made.remaining == "nothing"
    assert made.fit.held_out[0].augmented_rmse == pytest.approx(8, rel=0.05)


def test_an_effect_that_nothing_shows_is_dropped_and_the_others_keep_their_covariance(tmp_path):
    case = read_case(write_case(tmp_path, HEAD + TWO))
    problem = problem_of(case, model_of(case, None))
    plain = fit(problem)
    shown, unseen = (
        AppliedEffect(effect=effects()["zero_offset"], channel="F", values={"offset": 5.0}),
        AppliedEffect(effect=effects()["sensitivity_error"], channel="F", values={"gain_error": 1e-12}),
    )
    both = replace_effects(problem, plain, (shown, unseen))
    steps = [Step(active=one, p_value=0.0, held_out_gain=9.0, gain=9.0, rivals=()) for one in (shown, unseen)]
    made, left = _with_a_size(problem, both, steps)
    assert [one.active.effect.name for one in left] == ["zero_offset"]
    assert [one.effect.name for one in made.active] == ["zero_offset"]
    # mass, damping, offset; the offset was not fitted
    assert made.covariance.shape == (3, 3)
    np.testing.assert_array_equal(made.covariance[:2, :2], plain.covariance)


@pytest.mark.parametrize(("stated", "white"), [(None, False), (0.5, False), (0.01, True)])
def test_a_smooth_error_far_beyond_the_stated_noise_is_not_taken_for_coloured_noise(stated, white):
    t = np.arange(400) * 0.01
    where = layout([t], [np.ones(t.size, dtype=bool)])
    wave = np.sin(5 * t) + np.random.default_rng(0).normal(0, 0.01, t.size)
    noise = fit_noise(wave, where, floor=1e-6, sd=stated)
    assert (noise.reflection == ()) is white
    if white:
        assert noise.sd == pytest.approx(np.sqrt(np.mean(wave**2)))


def test_an_interval_holds_what_two_ways_of_weighing_disagree_by(tmp_path):
    # The response is 1.0 to fast changes and 1.3 to slow ones, of which the simulation knows nothing.
    def run(seed):
        rng = np.random.default_rng(seed)
        t = np.arange(0, 120, 0.1)
        slow, fast = np.sin(0.11 * t + seed), np.sin(4.7 * t)
        force = 100 * (1.3 * slow + fast) + rng.normal(0, 0.5, t.size)
        return pd.DataFrame({"t": t, "v": slow + fast, "a": 0.0, "F": force})

    text = HEAD.replace("value = 210.0", "value = 100.0").replace("sd = 40.0", "sd = 400.0")
    case = read_case(write_case(tmp_path, text + TWO, r0__csv=run(1), r1__csv=run(2)))
    problem = problem_of(case, model_of(case, None))
    weighed, plain = fit(problem, plain=False), fit(problem, plain=True)
    apart = abs(weighed.p[1] - plain.p[1])
    assert apart > 8  # of 100: one follows the fast changes, the other the mean of both
    free = fit(problem)
    assert not free.plain
    assert free.covariance[1, 1] >= weighed.covariance[1, 1] + 0.9 * apart**2
