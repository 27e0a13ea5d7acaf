"""What a global fit says of each channel: errors, slopes by the delta method, what was fixed and why."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from toolkit.channels import signs
from toolkit.estimate import Estimate
from toolkit.tires.global_data import Measured, cell
from toolkit.tires.global_model import GlobalFit, GlobalModel, LoadShare, make_rows, pooled_percent
from toolkit.tires.global_stage import Found
from toolkit.tires.model import Parameter
from toolkit.tires.quality import scatter_floor_percent

if TYPE_CHECKING:
    from toolkit.tires.global_model import Array

_H = 5e-4  # rad: half the step of a stiffness
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

    def fit(self, channel: str, channels: tuple[str, ...], stage: Found) -> GlobalFit:
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
        errors = dict(zip(stage.left, np.sqrt(np.maximum(np.diag(stage.covariance), 0.0)), strict=True))
        fixed = dict(stage.fixed)
        unknown = {*fixed, *stage.undetermined}
        loads = self._loads(channel, residual, stage)
        converged = stage.agreeing >= 2
        away = self.predicted.get(channel)
        floor = scatter_floor_percent(self.given.rows.SA, y, cell(self.given))
        free = [place for place in stage.left if place in own]
        index = [stage.left.index(place) for place in free]
        at_bound = tuple(parameters[p].name for p in stage.bound if p in own)
        return GlobalFit(
            model=self.model.name,
            channel=channel,
            axes=self.given.axes,
            parameter_axes=self.model.axes,
            n=len(y),
            dof=len(y) * len(channels) - len(stage.left),
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
        )

    def _loads(self, channel: str, residual: Array, stage: Found) -> tuple[LoadShare, ...]:
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

    def _slope(self, channel: str, load: float, stage: Found) -> Estimate | None:
        # The slope at SA = 0, upright, free rolling, at nominal pressure and speed; delta method.
        if channel == "FX" or np.abs(self.data.rows.SA).min() > _NEAR:
            return None
        r = self.data.rows
        rows = make_rows(
            [-_H, _H], load, FNOMIN=r.FNOMIN, NOMPRES=r.NOMPRES, LONGVL=r.LONGVL,
            UNLOADED_RADIUS=r.UNLOADED_RADIUS,
        )  # fmt: skip
        free = [*stage.left, *stage.held]
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
        with np.errstate(all="ignore"):
            predicted = self.model.forces(copies, rows)[channel]
        y = np.broadcast_to(predicted, (2 * len(free) + 1, 2))
        flip = signs(self.model.axes, self.given.axes)
        slopes = (y[:, 1] - y[:, 0]) / (2 * _H) * flip["SA"] * flip[channel]
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
        stage: Found,
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
                "standard errors of the others are with these held; that of a stiffness contains their spread"
            )
        if at_bound:
            parts.append(f"at its bound: {', '.join(at_bound)}")
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
