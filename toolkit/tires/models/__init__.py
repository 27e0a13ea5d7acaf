"""The tire models: every model by its name, one file of this folder each, found and never listed by hand."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from importlib import import_module
from pkgutil import iter_modules
from typing import cast

from toolkit.errors import FitError
from toolkit.tires.global_model import GlobalModel
from toolkit.tires.model import Curve, CurveFit, Loss, TireModel


@cache
def model_names() -> tuple[str, ...]:
    """Return the names of all models.

    >>> "magic_formula" in model_names()
    True
    """
    return tuple(sorted(module.name for module in iter_modules(__path__)))


@cache
def find(name: str) -> TireModel | GlobalModel:
    """Return a model by name, of one load or of all.

    Raises
    ------
    FitError
        no model of that name is built
    """
    if name not in model_names():
        raise FitError(
            f"the tire model {name!r} is not available",
            where="--model",
            got=name,
            expected=", ".join(model_names()),
            next_step="name one of those expected",
            rule="unknown-model",
        )
    return cast("TireModel | GlobalModel", import_module(f"{__name__}.{name}").MODEL)


def model(name: str) -> TireModel:
    """Return a model of one load by name.

    Raises
    ------
    FitError
        no model of that name is built, or it is one over all loads
    """
    tire_model = find(name)
    if isinstance(tire_model, GlobalModel):
        raise FitError(
            f"{name} is a model over all loads", where=name, got=name, expected="a model of one load",
            next_step="fit it by toolkit.tires.global_fit", rule="unknown-model",
        )  # fmt: skip
    return tire_model


def fit_model(
    tire_model: TireModel, curves: Sequence[Curve], *, loss: Loss = "linear"
) -> tuple[CurveFit, ...]:
    """Return one fit a curve, without start values, by the model's own fitter.

    Raises
    ------
    FitError
        a curve cannot be fitted
    """
    return cast("tuple[CurveFit, ...]", import_module(tire_model.fitter).fit_curves(curves, loss=loss))
