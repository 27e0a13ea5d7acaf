"""The noise of a stage of a global fit, and what it leaves of the parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from toolkit.arrays import Array
from toolkit.tires.colour import autocorrelation_time
from toolkit.tires.global_misfit import Misfit
from toolkit.tires.global_solver import linearise
from toolkit.tires.unlike import Unlike, unlike_rows


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Noise:
    """The noise of a stage's rows: autocorrelation ``time``, mean ``variance`` of a row with it, ``dof``.

    ``unlike`` says what makes rows scatter unlike, None where they are taken alike; ``mean`` is its mean
    variance of a row, without the time.
    """

    time: float
    variance: float
    dof: float
    unlike: Unlike | None
    mean: float

    def of(self, misfit: Misfit, x: Array) -> Array:
        """Return what each part gives the rows (parts, rows x channels), of the mean variance of a row."""
        if self.unlike is None:
            return np.ones((1, len(misfit.y)))
        return np.asarray(self.unlike.variances[0][:, None] * misfit.parts(x) / self.mean)


def noise_of(rows: Misfit, x: Array, *, alike: bool) -> Noise:
    """Return the noise of rows about a model with free parameters (1, p); ``alike`` takes them as alike."""
    if rows.free:
        residual, J = linearise(rows, x, rows.box())
        r, columns = residual[0, : len(rows.y)], J[0, :, : len(rows.y)]
    else:
        r, columns = rows(x)[0, : len(rows.y)], np.zeros((0, len(rows.y)))
    effective_rows = float(np.count_nonzero(rows.weight > 1e-3 * rows.weight.max()))  # outliers are no rows
    freedom = max(effective_rows - len(rows.free), 1.0)
    unlike, mean, sd, remaining = None, 1.0, np.ones(len(r)), freedom
    if not alike and float(r @ r) > 1e-26 * len(r):
        parts = rows.parts(x)
        unlike = unlike_rows(r[None], columns[None], parts[None], own=len(rows.channels))
        each = unlike.rows(parts[None])[0]
        mean = float(each.mean())
        sd = np.sqrt(each / mean)
        # tr(M V) for the mean variance of V.
        basis = np.linalg.qr(columns.T)[0]
        remaining = max(effective_rows - float(np.sum((basis * sd[:, None]) ** 2)), 1.0)
    over = np.where(sd > 1e-6, 1.0 / np.maximum(sd, 1e-6), 0.0)
    channels = len(rows.channels)
    time = max(
        autocorrelation_time(part, own)
        for part, own in zip(
            np.split(r * over, channels), np.split(columns * over, channels, axis=1), strict=True
        )
    )
    variance = max(float(r @ r) / remaining, 1e-26) * time
    return Noise(
        time=time, variance=variance, dof=max(effective_rows / time - len(rows.free), 1.0), unlike=unlike,
        mean=mean,
    )  # fmt: skip


class Covariance:
    """Of the free parameters: ``covariance``, their ``errors`` and ``dof``; ``alike`` that of rows alike.

    ``largest`` is the variance along the worst direction of parameters, of that of rows alike.
    """

    def __init__(self, misfit: Misfit, x: Array, noise: Noise) -> None:
        self.covariance = self.alike = np.zeros((0, 0))
        self.errors, self.dof, self.largest = np.zeros(0), noise.dof, 1.0
        if not len(misfit.free):
            return
        # By sizes for the inverse; what the bounds alone say keeps it finite.
        box = misfit.box()
        _, J = linearise(misfit, x, box, fine=True)
        J = J[0, :, : len(misfit.y)]  # a bound is no measurement
        bounds = np.diag(12.0 * (box.size / (box.high - box.low)) ** 2)
        normal = J @ J.T / noise.variance
        information = normal + bounds
        unit = 1.0 / np.sqrt(np.diag(information))
        inverse = np.linalg.inv(information * np.outer(unit, unit)) * np.outer(unit, unit)
        by_size = np.outer(box.size, box.size)
        self.alike = covariance = inverse * by_size
        if noise.unlike is not None:
            moved = np.einsum("pn,kn,qn->kpq", J, noise.of(misfit, x), J) / noise.variance
            covariance = inverse @ (moved.sum(axis=0) + bounds) @ inverse * by_size
            own = np.einsum("ip,kpq,qi->ki", inverse, moved, inverse)
            self.dof = min(noise.dof, _dof(own, noise))
            values, vectors = np.linalg.eigh(normal * np.outer(unit, unit))
            root = vectors / np.sqrt(np.maximum(values, 1e-10 * values.max()))
            whole = moved.sum(axis=0) * np.outer(unit, unit)
            self.largest = max(float(np.linalg.eigvalsh(root.T @ whole @ root)[-1]), 1.0)
        self.covariance = covariance
        self.errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _dof(own: Array, noise: Noise) -> float:
    # Satterthwaite's, of the mean relative variance of the parameters' variances (parts, parameters).
    if noise.unlike is None:
        return noise.dof
    theta = noise.unlike.variances[0]
    share = own / np.where(theta > 0, theta, 1.0)[:, None]
    square = np.einsum("ki,kl,li->i", share, noise.unlike.covariance[0], share)
    relative = float(np.mean(square / np.maximum(own.sum(axis=0) ** 2, 1e-300)))
    return max(2.0 / relative / noise.time, 1.0) if relative > 0 else noise.dof
