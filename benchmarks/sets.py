"""The sets: where they are published, their split, and the figures that are published for it.

Splits are those of the publishers' loader (nonlinear_benchmarks, commit 0f8f7ac), where it has the set.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.records import Array, Figure, PublicSet, Record, Split

_HUB = "https://www.nonlinearbenchmark.org/benchmarks/"
_BASELINES = "MDCHAMP/nonlinear_baselines, commit 73d8445: its result files"
_SYSIDENTPY = "SysIdentPy, chapter 10 of its book, commit 76b75e4"
_DYNONET = "forgi86/dynonet, doc/paper/ms.tex, commit 5669940; printed in mm, by its fit index in m"
_CITE = "none stated by the publisher: cited, not redistributed"


def _mat(path: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    return {name: np.ravel(value) for name, value in loadmat(path).items() if not name.startswith("_")}


def _record(name: str, step: float, u: Array, y: Array, *, warm_up: int = 0, lead_in: int = 0) -> Record:
    u, y = np.asarray(u, dtype=np.float64), np.asarray(y, dtype=np.float64)
    return Record(name=name, t=step * np.arange(u.size), u=u, y=y, warm_up=warm_up, lead_in=lead_in)


def tanks(files: Mapping[str, Path]) -> Split:
    """Return 1 024 rows of estimation and 1 024 of test, 4 s apart."""
    m = _mat(files["dataBenchmark.mat"])
    step = float(m["Ts"][0])
    return Split(
        train=(_record("estimation", step, m["uEst"], m["yEst"]),),
        test=(_record("test", step, m["uVal"], m["yVal"], warm_up=5),),
    )


def _thinned(u: Array, every: int) -> Array:
    """Return an input for every so many rows, whose straight lines between rows carry what the input did.

    A row that is picked carries only itself: of a controller's voltage it leaves a bias that an integrating
    plant adds up, 35 mm on the record with pulses by the published parameters.
    """
    weights = np.bartlett(2 * every + 1)
    return np.convolve(np.pad(u, every, mode="edge"), weights / weights.sum(), mode="valid")[::every]


def positioning(files: Mapping[str, Path]) -> Split:
    """Return the record without and the record with pulses; every eighth row of 1 kHz.

    The input is the drive's voltage, as in the publishers' loader; the pulses are not told to any model.
    """
    thin = slice(None, None, 8)
    parts = [_mat(files[name]) for name in ("DATA_EMPS.mat", "DATA_EMPS_PULSES.mat")]
    step = 8 * float(parts[0]["t"][1] - parts[0]["t"][0])
    train, test = (m["qm"][thin] for m in parts)
    return Split(
        train=(_record("estimation", step, _thinned(parts[0]["vir"], 8), train),),
        test=(_record("pulses", step, _thinned(parts[1]["vir"], 8), test, warm_up=3),),
    )


def drives(files: Mapping[str, Path]) -> Split:
    """Return two uniform records of 50 Hz: the first 400 rows of each are training, the last 100 the test."""
    m = _mat(files["DATAUNIF.MAT"])
    pairs = [(m["u11"], m["z11"]), (m["u12"], m["z12"])]
    return Split(
        train=tuple(_record(f"uniform{i}", 0.02, u[:400], y[:400]) for i, (u, y) in enumerate(pairs, 1)),
        test=tuple(
            _record(f"uniform{i}", 0.02, u, y, warm_up=4, lead_in=400) for i, (u, y) in enumerate(pairs, 1)
        ),
    )


def silverbox(files: Mapping[str, Path]) -> Split:
    """Return four runs of 1 250 rows out of the multisine's training part, its test part and the whole arrow.

    A run begins where the input rests between two realisations. The offsets are those of the training part,
    as the archive's README removes them.
    """
    m = _mat(files["SNLS80mV.mat"])
    train = slice(40650, 105712)
    u, y = m["V1"] - m["V1"][train].mean(), m["V2"] - m["V2"][train].mean()
    step = 1 / 610.35
    return Split(
        train=tuple(
            _record(f"multisine{i}", step, u[k : k + 1250], y[k : k + 1250])
            for i, k in enumerate((49240, 57935, 66625, 75315), 1)
        ),
        test=tuple(
            _record(name, step, u[part], y[part], warm_up=50)
            for name, part in (("multisine", slice(105712, 127400)), ("arrow", slice(100, 40575)))
        ),
    )


def bouc_wen(files: Mapping[str, Path]) -> Split:
    """Return two runs of 2 000 rows out of one period of dynoNet's multisine, and the publishers' test
    multisine.
    """
    import h5py

    step = 1 / 750
    with h5py.File(files["train.h5"]) as train, h5py.File(files["test.h5"]) as test:
        u, y = (np.ravel(train["multisine"][k]) for k in "uy")
        runs = tuple(
            _record(f"multisine{i}", step, u[k : k + 2000], y[k : k + 2000])
            for i, k in enumerate((8192, 12288), 1)
        )
        u, y = (np.ravel(test["multisine"][k]) for k in "uy")
        return Split(train=runs, test=(_record("multisine", step, u, y, warm_up=50),))


def exchanger(files: Mapping[str, Path]) -> Split:
    """Return four runs of 750 rows after the first 200, and the last 800 rows as the test; no split is
    official.
    """
    table = pd.read_csv(files["exchanger.csv"])
    q, outlet = table["q"].to_numpy(), table["th"].to_numpy()
    starts = range(200, 3200, 750)
    return Split(
        train=tuple(
            _record(f"flow{i}", 1.0, q[k : k + 750], outlet[k : k + 750]) for i, k in enumerate(starts, 1)
        ),
        test=(_record("flow", 1.0, q[3200:], outlet[3200:], warm_up=50),),
    )


SETS: tuple[PublicSet, ...] = (
    PublicSet(
        name="tanks", title="Cascaded tanks with overflow", published_at=_HUB + "cascaded-tanks",
        licence=_CITE,
        files={"dataBenchmark.mat": "cb2f88d4388be4d3f2a24c6402fba804976aac5f2e1f26cda59ea0a38d016eab"},
        unit="V", aims=(0.35,), missing=("overflow",), split=tanks,
        figures=(
            Figure(who="GRU", errors=(0.396,), source=_BASELINES),
            Figure(who="polynomial NARX", errors=(0.413,), source=_BASELINES),
        ),
    ),
    PublicSet(
        name="positioning", title="Electro-mechanical positioning system (EMPS)", published_at=_HUB + "emps",
        licence=_CITE,
        files={
            "DATA_EMPS.mat": "6cf6814ae14618795da0101aae2bb97ff0c6351b0501b5492751b02b07facf7e",
            "DATA_EMPS_PULSES.mat": "0eab75bb1f6b16228ee78791343a88bf9bfd9a51036ac9807d7b5fc11c0e1704",
        },
        unit="mm", scale=1000.0, aims=(7.0,), missing=("coulomb_friction",), split=positioning,
        figures=(
            Figure(who="dynoNet", errors=(2.64,), source=_DYNONET),
            Figure(who="LSTM", errors=(74.1,), source=_BASELINES),
        ),
    ),
    PublicSet(
        name="drives", title="Coupled electric drives, uniform input",
        published_at=_HUB + "coupled-electric-drives", licence=_CITE,
        files={"DATAUNIF.MAT": "102c8d8012d6e850d50c13227b8c2280fe69f8bc4a845177f8bc3d761d152c89"},
        unit="ticks/s", aims=(0.10, 0.09), missing=("rectification",), split=drives,
        figures=(
            Figure(who="RNN; Gaussian-process NARX", errors=(0.096, 0.0895), source=_BASELINES),
            Figure(who="polynomial NARX", errors=(0.1029, 0.1068), source=_SYSIDENTPY),
        ),
    ),
    PublicSet(
        name="silverbox", title="Silverbox", published_at=_HUB + "silverbox", licence=_CITE,
        files={"SNLS80mV.mat": "5c7413a52255af0cb4e2f93fb6903beb92b08965ba1e6ad0a6ffedfed8477ed4"},
        unit="mV", scale=1000.0, aims=(1.0, None), missing=("cubic_stiffness",), split=silverbox,
        figures=(
            Figure(who="GRU; LSTM of outputs", errors=(1.490, 2.385), source=_BASELINES),
            Figure(who="polynomial NARX", errors=(7.727, 4.148), source=_SYSIDENTPY),
        ),
    ),
    PublicSet(
        name="bouc_wen", title="Bouc-Wen hysteretic system (simulated by its publishers)",
        published_at=_HUB + "bouc-wen",
        licence="MIT for the copies in forgi86/dynonet (commit 5669940, examples/BW/data/Test signals)",
        files={
            "train.h5": "a4df68f6101a22f9fc5032e98b3e773fc108a291378ef9cf69d1b128c7ac44a4",
            "test.h5": "822fe88df38cf41bffbebedb06af8d6c5eb2f808de0e2eefe6d78b215de53016",
        },
        unit="um", scale=1e6, missing=("coulomb_friction", "hysteresis"), split=bouc_wen,
        figures=(Figure(who="dynoNet", errors=(45.2,), source=_DYNONET),),
    ),
    PublicSet(
        name="exchanger", title="Steam heat exchanger (DaISy)",
        published_at="https://homes.esat.kuleuven.be/~smc/daisy/daisydata.html", licence=_CITE,
        files={"exchanger.csv": "3dfbb1e1c2f789a3593b460373c5c0a649647ab5548478ed0992c68d5b2c5f34"},
        unit="K", split=exchanger,
    ),
)  # fmt: skip
