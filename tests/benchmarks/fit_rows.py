"""The fit of 100 000 rows, three indications and two loads, with every diagnostic; the peer solves alone.

Ours is `fit_session` on a session as read: exact carrying back of the terms, refinement, covariance,
leverage, deletion residuals, replicates, tests of scatter. The peer is one `numpy.linalg.lstsq` on the
finished term matrix for both loads: coefficients, and nothing that tells whether they are good.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.benchmarks.timing import pairs, row
from tests.benchmarks.verify_records import SESSION, data_table

ROWS = 100_000
CHECK_ROWS = 9


def run(folder: Path, count: int) -> list[dict[str, object]]:
    """Time the fit and the bare solution of the same data, imports and reading excluded."""
    from toolkit.calibration.fit.session_fit import SessionFit, fit_session
    from toolkit.calibration.session.read import read_session
    from toolkit.calibration.terms import term_matrix

    work = folder / "fit-rows"
    work.mkdir()
    rng = np.random.default_rng(100)
    (work / "loads.csv").write_text(data_table(rng, ROWS, True))
    (work / "check.csv").write_text(data_table(rng, CHECK_ROWS, False))
    (work / "SESSION.toml").write_text(SESSION.format(number=1))
    session = read_session(work / "SESSION.toml")
    design = term_matrix(session.terms, session.table.columns(session.indications))
    loads = session.table.matrix([setting.name for setting in session.loads])

    def ours() -> SessionFit:
        return fit_session(session)

    def peer() -> object:
        return np.linalg.lstsq(design, loads, rcond=None)[0]

    found = np.array([one.fit.coefficients for one in ours().loads]).T
    if not np.allclose(found, np.linalg.lstsq(design, loads, rcond=None)[0], rtol=1e-8, atol=0):
        raise RuntimeError("the fit and its peer solve different problems")
    times = pairs(ours, peer, 3 * count)
    what = f"fit of {ROWS} rows, {len(session.cells)} cells, {len(session.loads)} loads"
    return [row(what, times[0], "numpy.linalg.lstsq, no diagnostics", times[1], "5")]
