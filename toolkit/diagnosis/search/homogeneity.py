"""Whether noise is the same in all runs and at all times: what only some of them leave is no noise.

Coloured noise takes up whatever happened once, and its own memory is then estimated from it. What most runs
leave, each about its own zero and gain, says how large the noise is and how long it remembers; by as many
independent values as that leaves, the others may not be much louder.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from toolkit.diagnosis.fit.noise import Autoregression, Layout, fit_noise
from toolkit.diagnosis.fit.sensor_noise import robust_sd, spread
from toolkit.diagnosis.policy import EVEN, LOCATION
from toolkit.diagnosis.search.unexplained import StructureFound

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from toolkit.arrays import Array
    from toolkit.diagnosis.fit.fit import Fit
    from toolkit.diagnosis.fit.problem import Problem


def uneven(problem: Problem, base: Fit, name: str) -> StructureFound | None:
    """Return where an output's rest is louder than elsewhere, None where it is one noise.

    ``noise_sd`` of what is found is that of the quiet rest. Asked of whole runs, then of stretches of them.
    """
    runs = [rows for rows in problem.slices if problem.kept[name][rows].sum() > EVEN.rows]
    for pieces, least in ((runs, EVEN.runs), (list(_stretches(problem, name, runs)), EVEN.stretches)):
        found = _louder(problem, base, name, pieces, least)
        if found is not None:
            return found
    return None


def _stretches(problem: Problem, name: str, runs: Sequence[slice]) -> Iterator[slice]:
    """Give stretches of runs as long as a colour can be told of."""
    for rows in runs:
        at = rows.start + np.flatnonzero(problem.kept[name][rows])
        for part in np.array_split(at, min(EVEN.parts, max(1, len(at) // EVEN.rows))):
            yield slice(int(part[0]), int(part[-1]) + 1)


def _louder(
    problem: Problem, base: Fit, name: str, pieces: Sequence[slice], least: float
) -> StructureFound | None:
    """Return the pieces that are louder than the quiet ones, most of all; the likeliest of all divisions."""
    from scipy.special import gammaln
    from scipy.stats import f

    if len(pieces) < 2:
        return None
    kept = problem.kept[name]
    about = about_own(problem, base, name, base.residual[name][:, None], turns=EVEN.turns)[:, 0]
    # Single values far off are the sensor's, and not a run's: none counts for more than a few of the others.
    usual = robust_sd(about[kept])
    about = np.clip(about, -EVEN.clipped * usual, EVEN.clipped * usual)
    rows = np.array([int(kept[piece].sum()) for piece in pieces])
    squares = np.array([float(np.mean(about[piece][kept[piece]] ** 2)) for piece in pieces])
    # A noise may be in proportion to the signal.
    levels = np.array([float(np.mean(base.simulated[name][piece][kept[piece]] ** 2)) for piece in pieces])
    order = np.argsort(squares / np.maximum(levels, 1e-300))
    best: tuple[float, float, float, list[slice]] | None = None
    for count in range((len(pieces) + 1) // 2, len(pieces)):
        quiet, loud = order[:count], order[count:]
        there, usual_square = (np.average(squares[part], weights=rows[part]) for part in (loud, quiet))
        louder, calmer = (np.average(levels[part], weights=rows[part]) for part in (loud, quiet))
        ratio = float(there / max(usual_square, 1e-300) / max(1.0, louder / max(calmer, 1e-300)))
        if ratio < least or math.sqrt(there) < EVEN.matters * spread(problem, name):
            continue
        noise = _of_pieces([about[pieces[i]][kept[pieces[i]]] for i in sorted(quiet)], problem.floor[name])
        worth_loud, worth = (
            float(rows[part].sum()) / (EVEN.cautious * noise.correlation_rows) for part in (loud, quiet)
        )
        if min(worth_loud, worth) < EVEN.worth:
            continue
        divisions = gammaln(len(pieces) + 1) - gammaln(count + 1) - gammaln(len(pieces) - count + 1)
        log_p = float(divisions + f.logsf(ratio, worth_loud, worth))
        if log_p < math.log(EVEN.alpha) and (best is None or log_p < best[0]):
            best = (log_p, worth_loud * math.log(ratio), math.sqrt(usual_square), [pieces[i] for i in loud])
    if best is None:
        return None
    log_p, gain, sd, there_rows = best
    text = f"louder in {_told(problem, there_rows)}"
    return StructureFound(
        output=name, variables=("time",), reason=text, gain=gain, rest=True, noise_sd=sd,
        p_value=math.exp(max(log_p, -690.0)),
    )  # fmt: skip


def about_own(problem: Problem, base: Fit, name: str, values: Array, *, turns: int = 1) -> Array:
    """Return columns about the zero and the gain of every run, (rows, k); rows that do not count stay.

    Parameters
    ----------
    turns : of one column, more than one weigh what is far off by less (Huber): an event moves no zero
    """
    about = np.array(values)
    for rows in problem.slices:
        at = rows.start + np.flatnonzero(problem.kept[name][rows])
        if not len(at):
            continue
        design = np.column_stack([np.ones(len(at)), base.simulated[name][at]])
        there, weights = about[at], np.ones((len(at), 1))
        for turn in range(turns):
            if turn:
                away = np.abs(about[at])
                weights = np.sqrt(np.minimum(1.0, robust_sd(away) / np.maximum(away, 1e-300)))
            about[at] = there - design @ np.linalg.lstsq(weights * design, weights * there, rcond=None)[0]
    return about


def _of_pieces(values: Sequence[Array], floor: float) -> Autoregression:
    """Return the noise of pieces of series."""
    ends = np.cumsum([len(piece) for piece in values]).tolist()
    segments = tuple(slice(end - len(piece), end) for end, piece in zip(ends, values, strict=True))
    where = Layout(np.arange(ends[-1]), segments, len(segments))
    return fit_noise(np.concatenate(values), where, floor=floor)


def _told(problem: Problem, pieces: Sequence[slice]) -> str:
    """Return in which runs pieces are, and at which times of them."""
    texts = []
    for run, rows in zip(problem.runs, problem.slices, strict=True):
        inside = [piece for piece in pieces if rows.start <= piece.start < rows.stop]
        if not inside:
            continue
        first, last = min(piece.start for piece in inside), max(piece.stop for piece in inside) - 1
        text = run.name
        if problem.case.has_time and last - first + 1 < LOCATION.whole * run.rows:
            text += f" from {run.t[first - rows.start]:.4g} to {run.t[last - rows.start]:.4g} s"
        texts.append(text)
    return " and ".join(texts)
