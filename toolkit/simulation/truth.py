"""Truth: what a report on a virtual test is judged against, computed from the tire itself.

No recording, no calibration and no fit is involved: stiffness and pull are those of the virtual tire at a
load, in SI, in SAE axes that follow the travel.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from toolkit.arrays import Array
from toolkit.channels import Rotation
from toolkit.simulation.cells import CELLS, LOADS, true_coefficients
from toolkit.simulation.plan import Plan
from toolkit.simulation.run import VirtualTest
from toolkit.simulation.steady import Answer, settled
from toolkit.simulation.steps import Motion
from toolkit.simulation.tire import TireTruth, forces, pseudo_camber
from toolkit.tires.evaluate import limit_slope


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueStiffness:
    """Cornering -dFY/dSA [N/rad] and aligning +dMZ/dSA [N·m/rad]: slope at 0, secant through +-1 deg."""

    rotation: Rotation
    slope_cornering: float
    slope_aligning: float
    secant_cornering: float
    secant_aligning: float


@dataclass(frozen=True, slots=True, kw_only=True)
class TruePull:
    """Pull of the tire at one load [N, N·m] by symmetry; forces of the forward direction in SAE axes.

    ``PRAT`` is MZ at SA = 0, ``PRAT_at_FY_zero`` the mean of MZ at each direction's own FY = 0.
    """

    conicity: float
    plysteer: float
    CRAT: float
    PRAT: float
    PRAT_at_FY_zero: float


def true_stiffness(tire: TireTruth | Answer, *, load_N: float, rotation: Rotation) -> TrueStiffness:
    """Return the stiffness of a tire at a load [N]: the published one's, or that of an answer."""
    one_degree = math.radians(1.0)
    answer = _answer(tire)

    def curves(SA: Array) -> Array:
        return np.array([_sae(answer, float(angle), load_N, rotation) for angle in SA]).T

    slope_FY, slope_MZ = (float(slope) for slope in limit_slope(curves))
    low, high = curves(np.array([-one_degree, one_degree])).T
    secant_FY, secant_MZ = ((high - low) / (2 * one_degree)).tolist()
    return TrueStiffness(
        rotation=rotation,
        slope_cornering=-slope_FY,
        slope_aligning=slope_MZ,
        secant_cornering=-secant_FY,
        secant_aligning=secant_MZ,
    )


def true_pull(tire: TireTruth | Answer, *, load_N: float) -> TruePull:
    """Return the pull characteristics of the virtual tire at a load [N].

    From the machine's axes at SA = 0, F forward and R reversed: conicity (F + R)/2 and plysteer (F - R)/2
    of FY; CRAT (F - R)/2 and PRAT (F + R)/2 of MZ.
    """
    answer = _answer(tire)
    forward, reverse = answer(0.0, load_N, "forward"), answer(0.0, load_N, "reverse")
    free = [
        answer(_angle_of_no_force(answer, load_N, rotation), load_N, rotation)[1]
        for rotation in ("forward", "reverse")
    ]
    return TruePull(
        conicity=(forward[0] + reverse[0]) / 2,
        plysteer=(forward[0] - reverse[0]) / 2,
        CRAT=(forward[1] - reverse[1]) / 2,
        PRAT=(forward[1] + reverse[1]) / 2,
        PRAT_at_FY_zero=sum(free) / 2,
    )


def truth_document(test: VirtualTest) -> dict[str, Any]:
    """Return the whole truth of a virtual test as JSON values, marked as the toolkit's own output.

    ``per_load`` stands at the median of the true loads of all files at each step, where a reduced test
    compares them, and at the nominal step too; effects on road and tire are in it, those on carriage, cells
    and acquisition, and those of single runs, are not.
    """
    plan = test.plan
    blocks = [block for file in test.files for block in file.truth]
    per_load = []
    for step in dict.fromkeys(load for run in plan.recordings for load in run.loads_N):
        loads = sorted(block.FZ_N for block in blocks if block.step_FZ_N == step)
        middle = len(loads) // 2
        median = loads[middle] if len(loads) % 2 else (loads[middle - 1] + loads[middle]) / 2
        per_load.append({"step_load_N": step, "at_median": _at(test, median), "at_step": _at(test, step)})
    return {
        "schema": 1,
        "generator": "toolkit",
        "content": "truth of a virtual test",
        "simulated": True,
        "title": plan.title,
        "machine": plan.machine.name,
        "date": plan.date,
        "seed": plan.seed,
        "effects": [effect.as_dict() for effect in plan.effects],
        "axes": {"conditions": "machine", "per_load": "SAE"},
        "stages": {
            "tire": {**dataclasses.asdict(plan.tire), "pseudo_camber_rad": pseudo_camber(plan.tire)},
            "road": dataclasses.asdict(plan.road),
            "carriage": dataclasses.asdict(plan.carriage),
            "cells": dataclasses.asdict(plan.cells),
            "acquisition": dataclasses.asdict(plan.acquisition),
        }
        | _further(plan),
        "true_coefficients": {
            "units": {"indications": "V/V", "FY": "N", "MZ": "N*m", "MX": "N*m"},
            **{load: dict(zip(CELLS, true_coefficients(plan.cells)[load], strict=True)) for load in LOADS},
        },
        "acquisition_program": {
            "record": test.program.record,
            "negated": list(plan.acquisition.negated),
            "FY": [*test.program.FY, test.program.FY_constant],
            "MZ": [*test.program.MZ, test.program.MZ_constant],
        },
        "tare": {"unit": test.tare_unit, "values": dict(test.tare)},
        "conditions": [dataclasses.asdict(block) for block in blocks],
        "per_load": per_load,
    }


def _further(plan: Plan) -> dict[str, Any]:
    # Named only where they are not the default, so that a plain test's truth is what it always was.
    content: dict[str, Any] = {}
    if plan.record != "dwell":
        content["record"] = plan.record
    if plan.motion != Motion():
        content["motion"] = dataclasses.asdict(plan.motion)
    if plan.tire_file is not None:
        content["tire_file"] = plan.tire_file.path.name
    return content


def _at(test: VirtualTest, load_N: float) -> dict[str, Any]:
    plan = test.plan
    # The road's and the tire's effects belong to the truth; a tire that no effect touches is its own.
    touched = plan.tire_file is not None or any(
        effect.effect.stage in ("road", "tire") and effect.condition is None for effect in plan.effects
    )
    general = dataclasses.replace(
        plan, effects=tuple(effect for effect in plan.effects if effect.condition is None)
    )
    tire = settled(general, {}) if touched else plan.tire
    return {
        "load_N": load_N,
        "stiffness": [
            dataclasses.asdict(true_stiffness(tire, load_N=load_N, rotation=rotation))
            for rotation in plan.rotations
        ],
        "pull": dataclasses.asdict(true_pull(tire, load_N=load_N)),
    }


def _answer(tire: TireTruth | Answer) -> Answer:
    if not isinstance(tire, TireTruth):
        return tire
    truth = tire

    def answer(SA: float, FZ: float, rotation: Rotation) -> tuple[float, float]:
        responses = forces(truth, SA=SA, FZ=FZ, rotation=rotation)
        return float(responses.FY), float(responses.MZ)

    return answer


def _sae(answer: Answer, SA: float, load: float, rotation: Rotation) -> tuple[float, float]:
    FY, MZ = answer(SA, load, rotation)
    return (1.0 if rotation == "forward" else -1.0) * FY, MZ


def _angle_of_no_force(answer: Answer, load: float, rotation: Rotation) -> float:
    low, high = math.radians(-3.0), math.radians(3.0)  # FY falls with SA in SAE axes
    for _ in range(80):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _sae(answer, middle, load, rotation)[0] > 0 else (low, middle)
    return 0.5 * (low + high)
