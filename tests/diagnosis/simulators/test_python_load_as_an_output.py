"""A simulator of its own that takes the commanded load and tells the one that came: it saw no recording."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from tests.diagnosis.cases import write_case
from toolkit.diagnosis.case.reader import read_case
from toolkit.diagnosis.simulators.build_simulator import model_of
from toolkit.effects.applied import AppliedEffect
from toolkit.effects.catalogue import effects

SIMULATOR = """
import numpy as np
import pandas as pd
def simulate(inputs, p):
    slip, FZ = np.tan(np.deg2rad(inputs["SA"])), inputs["FZ_CMD"]
    return pd.DataFrame({"FZ": FZ, "FY": -FZ * np.tanh(12 * slip), "MZ": 0.03 * FZ * np.tanh(12 * slip)})
"""
CHANNELS = """
[recording]
time = "t"
axes = "SAE"
[recording.channels]
t = { unit = "s", role = "time" }
SA = { unit = "deg", role = "input" }
FZ_CMD = { unit = "N", role = "input" }
FZ = { unit = "N", role = "output" }
FY = { unit = "N", role = "output" }
MZ = { unit = "N*m", role = "output" }
[[recording.run]]
file = "r0.csv"
"""
KINDS = {
    "python": 'schema = 1\n[simulation]\nkind = "python"\npath = "sim.py"\n',
    "columns": 'schema = 1\n[simulation]\nkind = "columns"\n'
    'simulated = { FZ = "FZ_sim", FY = "FY_sim", MZ = "MZ_sim" }\n',
}
RISE, TAU = 300.0, 2.0  # N/s, s


@pytest.fixture(params=KINDS)
def model_and_run(request, tmp_path):
    t = np.arange(0, 12, 0.1)
    command = 2000 + RISE * t
    slip = np.tan(np.deg2rad(np.linspace(-6, 6, len(t))))
    made = {"FZ": command, "FY": -command * np.tanh(12 * slip), "MZ": 0.03 * command * np.tanh(12 * slip)}
    # What was recorded is far from the command, so that a simulation that takes it is seen.
    frame = pd.DataFrame({"t": t, "SA": np.rad2deg(np.arctan(slip)), "FZ_CMD": command})
    for name, values in made.items():
        frame[name], frame[f"{name}_sim"] = 0.5 * values, values
    case = read_case(
        write_case(tmp_path, KINDS[request.param] + CHANNELS, simulator=SIMULATOR, r0__csv=frame)
    )
    return model_of(case, None), case.runs[0], command


@pytest.mark.parametrize("name", ["load_lag", "relaxation", "drum_curvature", "surface_friction"])
def test_an_effect_of_no_size_leaves_the_simulation_as_declared(model_and_run, name):
    model, run, _ = model_and_run
    parameters = effects()[name].parameters
    off = {one.name: one.off if one.off is not None else one.typical[0] for one in parameters}
    plain = model.simulate(run, {}, ())
    with_it = model.simulate(run, {}, (AppliedEffect(effect=effects()[name], values=off),))
    for output, values in plain.items():
        np.testing.assert_allclose(with_it[output], values, rtol=1e-6, atol=1e-6 * np.abs(values).max())


def test_the_load_that_comes_late_is_late_in_the_load_itself(model_and_run):
    model, run, command = model_and_run
    late = AppliedEffect(effect=effects()["load_lag"], values={"time_constant": TAU})
    FZ = model.simulate(run, {}, (late,))["FZ"]
    # tau F' + F = F0 + r t from F(0) = F0: behind the ramp by r tau (1 - exp(-t/tau))
    np.testing.assert_allclose(FZ, command - RISE * TAU * (1 - np.exp(-run.t / TAU)), rtol=1e-4)
