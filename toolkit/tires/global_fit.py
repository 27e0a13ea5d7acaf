"""Fit a model over all loads to measured rows, channel by channel, without start values.

Each channel is reported with its errors, its slopes by the delta method, and what was fixed and why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import signs
from toolkit.errors import FitError, refuse_unknown
from toolkit.estimate import Estimate
from toolkit.findings import Finding
from toolkit.reduction.selection import Selection, of_one_condition
from toolkit.tires.between_loads import Between
from toolkit.tires.evaluate import stiffness
from toolkit.tires.global_data import CHANNELS, Measured, binned, cell, what_varies
from toolkit.tires.global_misfit import Task
from toolkit.tires.global_model import (
    GlobalFit,
    GlobalModel,
    LoadShare,
    ModelFit,
    Rows,
    Seeds,
    pooled_percent,
)
from toolkit.tires.global_seeds import LACKS, seeds_of, why_not_global
from toolkit.tires.global_stage import StageFit, refit, run
from toolkit.tires.model import LOSSES, Loss, Parameter
from toolkit.tires.quality import scatter_floor_percent

_NEAR = np.radians(3.0)  # rows must come as near to SA = 0 for a slope there
_SLIP = frozenset({"kappa", "both_kappas", "alpha_and_kappa"})
_UNIT = {"FX": "N", "FY": "N", "MZ": "N*m"}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """A finished fit of all stages: the rows as given and as the model takes them, curves in given axes.

    ``predicted`` are the rows of each load as predicted without it, empty where there are too few loads.
    """

    model: GlobalModel
    given: Measured
    data: Measured
    values: Array
    curves: dict[str, Array]
    predicted: dict[str, Array]
    loss: str
    weights: str

    def fit(self, channel: str, channels: tuple[str, ...], stage: StageFit) -> GlobalFit:
        """Return what a channel's stage found."""
        y, parameters = self.given[channel], self.model.parameters
        residual = self.curves[channel] - y
        joint = len(channels) > 1
        # Without longitudinal slip the rows are of pure side slip: the combined part is none of the model.
        no_slip = float(np.ptp(self.data.rows.KAPPA)) == 0.0
        own = [
            place
            for place, parameter in enumerate(parameters)
            if (parameter.stage == channel or (joint and parameter.stage in channels))
            and not (no_slip and _SLIP & set(parameter.needs))
        ]
        errors = dict(zip(stage.free, np.sqrt(np.maximum(np.diag(stage.covariance), 0.0)), strict=True))
        fixed = dict(stage.fixed)
        unknown = {*fixed, *stage.undetermined}
        loads = self._loads(channel, residual, stage)
        converged = stage.agreeing >= 2
        away = self.predicted.get(channel)
        floor = scatter_floor_percent(self.given.rows.SA, y, cell(self.given))
        free = [place for place in stage.free if place in own]
        index = [stage.free.index(place) for place in free]
        at_bound = tuple(parameters[p].name for p in stage.bound if p in own)
        return GlobalFit(
            model=self.model.name,
            channel=channel,
            axes=self.given.axes,
            parameter_axes=self.model.axes,
            n=len(y),
            dof=len(y) * len(channels) - len(stage.free),
            parameters=tuple(
                Parameter(
                    name=parameters[place].name,
                    value=float(self.values[place]),
                    unit=parameters[place].unit,
                    standard_error=None if place in unknown else float(errors[place]),
                )
                for place in own
            ),
            covariance=tuple(tuple(row) for row in stage.covariance[np.ix_(index, index)].tolist()),
            not_determined=tuple(parameters[place].name for place in own if place in unknown),
            fixed=tuple((parameters[p].name, why) for p, why in fixed.items() if p in own),
            at_bound=at_bound,
            error_percent=pooled_percent(residual, y),
            prediction_error_percent=(None if away is None else pooled_percent(away - y, y)),
            scatter_floor_percent=floor,
            slope_at_zero=self._slope(channel, self.data.rows.FNOMIN, stage),
            nominal_load_N=self.data.rows.FNOMIN,
            loads=loads,
            loss=self.loss,
            weights=self.weights,
            starts=stage.starts,
            starts_agreeing=stage.agreeing,
            converged=converged,
            message=self._message(channel, joint, stage, own, converged, at_bound),
            departure=Between(self.model, self.data, (channel,)).departure(self.values.tolist(), channel),
        )

    def _loads(self, channel: str, residual: Array, stage: StageFit) -> tuple[LoadShare, ...]:
        y, away, errors = self.given[channel], self.predicted.get(channel), []
        for block in np.unique(self.data.block):
            own = self.data.block == block
            load = float(self.data.loads[block])
            errors.append(
                LoadShare(
                    load_N=load,
                    n=int(own.sum()),
                    error_percent=pooled_percent(residual[own], y[own]),
                    stiffness=self._slope(channel, load, stage),
                    prediction_error_percent=(
                        None if away is None else pooled_percent(away[own] - y[own], y[own])
                    ),
                )
            )
        return tuple(errors)

    def _slope(self, channel: str, load: float, stage: StageFit) -> Estimate | None:
        # The slope at SA = 0, upright, free rolling, at nominal pressure and speed; delta method.
        if channel == "FX" or np.abs(self.data.rows.SA).min() > _NEAR:
            return None
        free = [*stage.free, *stage.held]
        size = np.array([self.model.parameters[place].size for place in free])
        step = 1e-4 * size
        copies: list[object] = []
        for place, value in enumerate(self.values):
            column = np.full((2 * len(free) + 1, 1), value)
            if place in free:
                i = free.index(place)
                column[1 + i, 0] += step[i]
                column[1 + len(free) + i, 0] -= step[i]
            copies.append(column)
        at_zero = stiffness(self.model, copies, load=load, like=self.data.rows, channel=channel)
        flip = signs(self.model.axes, self.given.axes)
        slopes = np.broadcast_to(at_zero, (2 * len(free) + 1,)) * flip["SA"] * flip[channel]
        gradient = (slopes[1 : len(free) + 1] - slopes[len(free) + 1 :]) / (2 * step)
        variance = float(gradient @ stage.spread @ gradient) if free else 0.0
        return Estimate(
            value=float(slopes[0]), u=float(np.sqrt(max(variance, 0.0))), unit=f"{_UNIT[channel]}/rad",
            dof=stage.dof,
        )  # fmt: skip

    def _message(
        self,
        channel: str,
        joint: bool,
        stage: StageFit,
        own: list[int],
        converged: bool,
        at_bound: tuple[str, ...],
    ) -> str:
        parts = [] if converged else ["only one start ended at the lowest cost: the minimum is not confirmed"]
        if self.given.axes != self.model.axes:
            parts.append(f"parameters are defined in {self.model.axes} axes")
        reasons: dict[str, list[str]] = {}
        for place, why in stage.fixed:
            if place in own:
                reasons.setdefault(why, []).append(self.model.parameters[place].name)
        parts += [f"{', '.join(names)}: {why}" for why, names in reasons.items()]
        if any(place in own for place in stage.held):
            parts.append(
                "standard errors contain what the parameters held at their default may be within their bounds"
            )
        if at_bound:
            parts.append(f"at its bound: {', '.join(at_bound)}")
        if stage.kept:
            parts.append(f"kept physical between the measured loads: {', '.join(stage.kept)}")
        if joint:
            parts.append("FY and MZ were fitted together")
        elif channel == "MZ" and not self.model.moment_alone:
            parts.append("the parameters of FY were held: standard errors do not contain theirs")
        if stage.bin_width:
            width = np.degrees(stage.bin_width)
            parts.append(f"fitted to the means of bins of {width:g} deg, judged on the rows")
        if stage.time > 1:
            parts.append(f"residuals are autocorrelated: standard errors times {np.sqrt(stage.time):.1f}")
        return "; ".join(parts)


WEIGHTS = ("equal", "noise")
_INNER, _LEAST = 20_000, 120  # rows x inner points of a search, and rows that it has at least
_ASKED_FOR = (0.25, 0.5)  # rows ask for a swing whose want costs such a share of the error, and so many %
_PREDICT_FROM = 3  # load blocks, so that two are left


def fit_global(
    model: GlobalModel,
    data: Measured,
    *,
    loss: Loss = "linear",
    weights: str = "equal",
    seeds: Seeds | None = None,
    predict: bool = True,
) -> ModelFit:
    """Fit every measured channel that the model has, to the rows alike in all that it does not read.

    Parameters
    ----------
    data : rows in any axes
    loss : ``linear`` is least squares; ``robust`` bounds the influence of outliers (Tukey's biweight)
    weights : ``equal``, or ``noise``: each load block over its own residual's size in a first fit
    seeds : of these rows, where they are known already
    predict : leave every load out in turn, where there are three or more

    Raises
    ------
    FitError
        what `why_not_global` says, an unknown loss or weighting
    """
    for name, choice, choices in (("loss", loss, LOSSES), ("weights", weights, WEIGHTS)):
        refuse_unknown(name, choice, choices, where=f"--{name}", rule=f"unknown-{name}", error=FitError)
    selection = selection_of(data, model)
    data = data.take(selection.rows)
    if (problem := why_not_global(data, model)) is not None:
        raise problem
    if seeds is None:
        seeds = seeds_of(data).seeds
    return _Fitter(model, data, selection, loss, weights, seeds).result(predict=predict)


def selection_of(data: Measured, model: GlobalModel) -> Selection:
    """Return the rows that a fit of the model takes.

    Raises
    ------
    FitError
        ``no-pure-slip``
    """
    reads = model.variables(what_varies(data))
    return of_one_condition(data.recorded, reads, rows=len(data))


def global_findings(fit: ModelFit) -> list[Finding]:
    """Return what stands against each channel: a minimum that is not confirmed, a swing between the loads.

    Notes tell what the data do not determine, and what ended at a bound.
    """
    findings = []
    for channel_fit in fit.fits:
        where = f"{channel_fit.model} {channel_fit.channel} over all loads"
        if not channel_fit.converged:
            findings.append(Finding(rule="not-converged", where=where, message=channel_fit.message))
        if channel_fit.converged and (open_ := undetermined(channel_fit)):
            text = f"not determined by these data: {', '.join(open_)}"
            findings.append(Finding(rule="not-determined", where=where, message=text, level="note"))
        if (at := channel_fit.departure) is not None and at.too_large:
            text = (
                f"at {at.load_N:.0f} N, between the measured loads of {at.low_N:.0f} and {at.high_N:.0f} N, "
                f"{at.channel} departs by {100 * at.share:.0f} % of its largest value from what the measured "
                "loads suggest"
            )
            findings.append(Finding(rule="between-loads", where=where, message=text))
        if channel_fit.at_bound:
            text = f"{', '.join(channel_fit.at_bound)}: the search ended at the bound"
            findings.append(Finding(rule="at-bound", where=where, message=text, level="note"))
    return findings


def undetermined(fit: GlobalFit) -> tuple[str, ...]:
    """Return the parameters that the data do not determine, though what they describe varies in them."""
    fixed, lacking = dict(fit.fixed), tuple(LACKS.values())
    open_ = [name for name, why in fixed.items() if not why.startswith(lacking)]
    return (*open_, *(name for name in fit.not_determined if name not in fixed))


def not_varied(fits: Sequence[ModelFit], where: str) -> list[Finding]:
    """Return one note on what did not vary in the data, though the models ask for it."""
    reasons: dict[str, list[str]] = {}
    for fit in fits:
        for fitted in fit.fits:
            for _, why in fitted.fixed:
                text = next((lack for lack in LACKS.values() if why.startswith(lack)), None)
                if text is not None and fit.model not in reasons.setdefault(text, []):
                    reasons[text].append(fit.model)
    if not reasons:
        return []
    parts = [f"{why} ({', '.join(models)})" for why, models in reasons.items()]
    message = f"{'; '.join(parts)}: parameters that say what it changes are fixed, see 'fixed' of each fit"
    return [Finding(rule="not-varied", where=where, message=message, level="note")]


class _Fitter:
    def __init__(
        self, model: GlobalModel, data: Measured, selection: Selection, loss: Loss, weights: str, seeds: Seeds
    ) -> None:
        self.model, self.given, self.loss, self.weights = model, data, loss, weights
        self.selection = selection
        self.data = data.turned(model.axes)
        self.flip = signs(model.axes, data.axes)
        self.varies = what_varies(data)
        self.starts = np.stack([self._start(start) for start in model.starts(seeds)])
        self.values = self.starts[0].copy()
        self.sigma: dict[str, Array] = {}

    def _start(self, stated: object) -> Array:
        low = np.array([parameter.low for parameter in self.model.parameters])
        high = np.array([parameter.high for parameter in self.model.parameters])
        return np.clip(self.model.values(stated), low, high)  # type: ignore[arg-type]

    def stages(self) -> list[tuple[str, ...]]:
        """Return the channels of each stage."""
        have = [name for name in CHANNELS if name in self.data.channels and name in self.model.channels]
        if "FX" in have and "kappa" not in self.varies:
            have.remove("FX")
        if self.model.joint and {"FY", "MZ"} <= set(have):
            return [*(("FX",) if "FX" in have else ()), ("FY", "MZ")]
        return [(name,) for name in have]

    def result(self, *, predict: bool) -> ModelFit:
        stages: dict[tuple[str, ...], StageFit] = {}
        for channels in self.stages():
            free, fixed = self._free(channels)
            stage = self._run(channels, free, self.data)
            if self.weights == "noise":
                self._weigh(channels, stage.values)
                stage = self._run(channels, free, self.data, (stage.values,))
            stage = replace(stage, fixed=(*fixed, *stage.fixed))
            self.values = stage.values
            stages[channels] = stage
        curves = self._curves(self.values, self.data)
        report = Report(
            model=self.model, given=self.given, data=self.data, values=self.values, curves=curves,
            predicted=self._predict(stages) if predict else {}, loss=self.loss, weights=self.weights,
        )  # fmt: skip
        fits = [report.fit(name, channels, stage) for channels, stage in stages.items() for name in channels]
        return ModelFit(
            model=self.model.name,
            values=self.values,
            fits=tuple(fits),
            curves=tuple(curves.items()),
            selection=self.selection,
        )

    def _free(self, channels: tuple[str, ...]) -> tuple[tuple[int, ...], tuple[tuple[int, str], ...]]:
        # What a stage searches, and what it cannot, with the reason.
        free, fixed = [], []
        for place, parameter in enumerate(self.model.parameters):
            if parameter.stage not in channels and not (self.model.joint and parameter.stage in ("FY", "MZ")):
                continue
            if self.model.joint and channels == ("FX",) and parameter.stage != "FX":
                continue
            lacks = [need for need in parameter.needs if need not in self.varies]
            if lacks:
                self.values[place] = parameter.default
                self.starts[:, place] = parameter.default
                fixed.append((place, f"{LACKS[lacks[0]]}: fixed at {parameter.default:g}"))
            else:
                free.append(place)
        limit = len(self.data) * len(channels) - 2
        while len(free) > limit:
            place = next((p for p in reversed(free) if self.model.parameters[p].needs), free[-1])
            free.remove(place)
            fixed.append((place, f"fewer rows than parameters: fixed at {self.values[place]:.4g}"))
        return tuple(free), tuple(fixed)

    def _run(
        self, channels: tuple[str, ...], free: tuple[int, ...], data: Measured, more: tuple[Array, ...] = ()
    ) -> StageFit:
        robust = self.loss == "robust"
        coarse, count, width = self._bins(data)
        task = Task(
            model=self.model, data=data, channels=channels, values=self.values, free=free,
            starts=np.concatenate([np.array(more).reshape(-1, len(self.values)), self.starts]),
            sigma=self.sigma.get(channels[0]), robust=robust,
        )  # fmt: skip
        fit = run(task, coarse, count, width)
        # Most fits are physical between the rows of themselves; the others are searched again, kept so.
        between = self._between(channels)
        if not (left := between.left(fit.values.tolist())) or self.model.grid > 1:
            return fit
        again = run(replace(task, between=between), coarse, count, width)
        # What physics does not forbid, rows may ask for.
        before, after = self._error(channels, fit), self._error(channels, again)
        if set(left) <= set(channels) and after - before > max(_ASKED_FOR[0] * before, _ASKED_FOR[1]):
            return fit
        return replace(again, kept=left)

    def _error(self, channels: tuple[str, ...], fit: StageFit) -> float:
        """Return the root mean square of the residuals over that of the rows [%], of the worst channel."""
        curves = self._curves(fit.values, self.data)
        return max(pooled_percent(curves[name] - self.given[name], self.given[name]) for name in channels)

    def _between(self, channels: tuple[str, ...]) -> Between:
        return Between(self.model, self.data, channels)

    def _bins(self, data: Measured) -> tuple[Measured, Array, float]:
        # A model with many inner points is searched on fewer bins.
        limit = None if self.model.grid == 1 else max(_INNER // self.model.grid, _LEAST)
        return binned(data, robust=self.loss == "robust", most=limit)

    def _weigh(self, channels: tuple[str, ...], values: Array) -> None:
        # Every load block by the size of its own residuals; none counts more than nine times another.
        curves = self._curves(values, self.data)
        size = np.zeros(len(self.data.loads))
        for channel in channels:
            square = (curves[channel] - self.given[channel]) ** 2 / np.mean(self.given[channel] ** 2)
            rows = np.bincount(self.data.block, minlength=len(size))
            size += np.bincount(self.data.block, square, len(size)) / np.maximum(rows, 1)
        size = np.sqrt(size)
        middle = np.median(size[size > 0]) if np.any(size > 0) else 1.0
        self.sigma[channels[0]] = np.clip(size, middle / 3, middle * 3)[self.data.block]

    def _curves(self, values: Array, data: Measured) -> dict[str, Array]:
        responses = self._forces(list(values), data.rows)
        return {
            name: np.broadcast_to(self.flip.get(name, 1) * responses[name], len(data)).astype(np.float64)
            for stage in self.stages()
            for name in stage
        }

    def _forces(self, values: list[object], rows: Rows) -> dict[str, Array]:
        with np.errstate(all="ignore"):
            responses = self.model.forces(values, rows)
        return {name: responses[name] for name in self.model.channels if getattr(responses, name) is not None}

    def _predict(self, stages: dict[tuple[str, ...], StageFit]) -> dict[str, Array]:
        # Every block predicted by a fit that never saw it, from where the whole fit ended.
        blocks = np.unique(self.data.block)
        if len(blocks) < _PREDICT_FROM:
            return {}
        predicted = {name: np.zeros(len(self.data)) for channels in stages for name in channels}
        kept_values, kept_starts, kept_sigma = self.values.copy(), self.starts, dict(self.sigma)
        for block in blocks:
            in_block = self.data.block == block
            remaining = self.data.take(~in_block)
            self.values = kept_values.copy()
            self.sigma = {name: values[~in_block] for name, values in kept_sigma.items()}
            for channels, stage in stages.items():
                self.starts = self.values[None]
                self.values = self._refit(channels, stage.free, remaining)
            curves = self._curves(self.values, self.data.take(in_block))
            for name, column in predicted.items():
                column[in_block] = curves[name]
        self.values, self.starts, self.sigma = kept_values, kept_starts, kept_sigma
        return predicted

    def _refit(self, channels: tuple[str, ...], free: tuple[int, ...], data: Measured) -> Array:
        coarse, count, _ = self._bins(data)
        task = Task(
            model=self.model, data=data, channels=channels, values=self.values, free=free,
            starts=self.starts, sigma=self.sigma.get(channels[0]), robust=self.loss == "robust",
        )  # fmt: skip
        values = refit(task, coarse, count)
        between = self._between(channels)
        if self.model.grid == 1 and between.left(values.tolist()):
            return refit(replace(task, between=between), coarse, count)
        return values
