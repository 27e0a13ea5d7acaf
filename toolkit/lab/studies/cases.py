"""A simulation, and why it differs from a recording, as a notebook uses them."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from toolkit.lab.answers import counted
from toolkit.lab.arguments import checked
from toolkit.lab.faces import Face, Facts, as_path

if TYPE_CHECKING:
    import pandas as pd

    from toolkit.diagnosis.answer import answer
    from toolkit.findings import Finding
    from toolkit.lab.studies.diagnosis import Diagnosed
    from toolkit.lab.studies.simulate import PlanForms
    from toolkit.report.content import Plot
    from toolkit.simulation.plan import Plan


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Diagnosis(Face):
    """Why a simulation and its recordings differ."""

    result: Diagnosed

    @property
    def answer(self) -> answer.Diagnosis:
        """The whole answer: places of mismatch, effects, errors on held-out rows, next measurements."""
        return self.result.result.diagnosis

    @property
    def verdict(self) -> str:
        """``named``, ``equivalent``, ``unknown``, ``nothing`` or ``untestable``."""
        return self.answer.verdict

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What should be known about the case and the search."""
        return tuple(self.answer.findings)

    def to_dataframe(self) -> pd.DataFrame:
        """Return one parameter of an effect a row: effect, channel, value, unit, 95 % interval."""
        import pandas as pd

        return pd.DataFrame(
            [
                {"effect": effect.name, "channel": effect.channel, "stage": effect.stage,
                 "parameter": parameter.name, "value": parameter.value, "unit": parameter.unit,
                 "low": parameter.ci95[0] if parameter.ci95 else None,
                 "high": parameter.ci95[1] if parameter.ci95 else None}
                for effect in self.answer.effects
                for parameter in effect.parameters
            ],
            columns=["effect", "channel", "stage", "parameter", "value", "unit", "low", "high"],
        )  # fmt: skip

    @checked
    def save(self, out: str | Path) -> Path:
        """Write the answer, its page, predictions and model file into a folder; return the folder.

        Raises
        ------
        OutputError
            the folder cannot be written, or the model would replace the one that it starts from
        """
        from toolkit.lab.studies.diagnosis import check_folder, write_diagnosis

        folder, started = Path(out), time.perf_counter()
        check_folder(folder, self.result.case.model)
        write_diagnosis(self.result, folder, timing=lambda: {"seconds": time.perf_counter() - started})
        return folder

    def _facts(self) -> Facts:
        effects = [
            f"{effect.name} on {effect.channel}" if effect.channel else effect.name
            for effect in self.answer.effects
        ]
        return {
            "case": self.answer.title,
            "verdict": self.verdict,
            "effects": ", ".join(effects) or None,
            "findings": counted(len(self.findings), "finding") if self.findings else None,
        }

    def _plots(self) -> Mapping[str, Plot]:
        from toolkit.report.diagnosis.content import diagnosis_plots
        from toolkit.report.style import Style

        return diagnosis_plots(self.result.result, Style())


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class Simulation(Face):
    """What a plan made, in ``folder``; ``answer`` as `toolkit simulate --json` gives it. All is simulated."""

    plan: Plan
    folder: Path
    answer: PlanForms

    def to_dataframe(self) -> pd.DataFrame:
        """Return one file a row: its name and its size in bytes."""
        import pandas as pd

        names = self.answer["files"]
        return pd.DataFrame({"file": names, "bytes": [(self.folder / name).stat().st_size for name in names]})

    def _facts(self) -> Facts:
        return {
            "kind": self.answer["kind"],
            "machine": self.answer["machine"],
            "files": f"{len(self.answer['files'])} files in {self.folder}",
            "effects": ", ".join(effect["name"] for effect in self.answer["effects"]) or None,
            "simulated": "SIMULATED",
        }


@checked
def diagnose(
    case: str | Path,
    *,
    model: str | Path | None = None,
    calibrations: str | Path | None = None,
    home: str | Path | None = None,
    budget_s: float = 600.0,
    isolated: bool = False,
    in_process: bool = False,
) -> Diagnosis:
    """Tell why a simulation and its recordings differ: where, by what, and how sure that is.

    Parameters
    ----------
    case : CASE.toml
    model : model file of an earlier answer in place of the case's simulation
    calibrations, home : the registry, or the laboratory, where the simulation is the machine
    budget_s : seconds after which a partial answer is given
    isolated : run the case's own code without network and with a read-only view of the files
    in_process : run the case's own code in this process, with all that it may do to it, for a debugger

    Raises
    ------
    ToolkitError
        the case cannot be read, or its simulation not run
    """
    from toolkit.errors import ConfigError
    from toolkit.lab.studies.diagnosis import diagnose_case, worker_limits

    if isolated and in_process:
        raise ConfigError(
            "code in this process cannot be isolated", where="diagnose", got="isolated and in_process",
            expected="one of them", next_step="leave in_process out", rule="wrong-value",
        )  # fmt: skip
    diagnosed = diagnose_case(
        Path(case), model=as_path(model), calibrations=as_path(calibrations), home=as_path(home),
        budget_s=budget_s, limits=None if in_process else worker_limits(isolated=isolated),
    )  # fmt: skip
    return Diagnosis(result=diagnosed)


@checked
def simulate(
    plan: str | Path,
    out: str | Path,
    *,
    seed: int | None = None,
    effects: Sequence[str] = (),
    case: str | Path | None = None,
    calibrations: str | Path | None = None,
    home: str | Path | None = None,
) -> Simulation:
    """Run a plan of the virtual machine: a test, a calibration session, or a maker's table.

    Parameters
    ----------
    plan : PLAN.toml
    out : folder for the files, new or empty
    seed : in place of the plan's
    effects : switched on beside the plan's own, as ``relaxation=0.5m`` or ``zero_offset.D51=0.002mV/V``
    case : folder for a case that `diagnose` reads
    calibrations, home : the registry whose record the virtual acquisition program computes by

    Raises
    ------
    ToolkitError
        the plan or a folder cannot be used
    """
    from toolkit.lab.studies.simulate import simulate_plan
    from toolkit.simulation.plan import read_plan, with_effects

    planned = with_effects(read_plan(Path(plan), seed=seed), list(effects))
    payload, _, _ = simulate_plan(
        planned, Path(out), case=as_path(case), calibrations=as_path(calibrations), home=as_path(home)
    )
    return Simulation(plan=planned, folder=Path(out), answer=payload)
