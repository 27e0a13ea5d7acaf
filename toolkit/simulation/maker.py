"""A maker's flat-surface table: what the plan's tire does on a flat road, as TABLE.csv has it, SAE axes.

No machine is involved: no drum, no carriage, no cells, no noise. The plan's effects of road and tire that
need no time are in it.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from toolkit.files import write_atomic
from toolkit.simulation.plan import Plan
from toolkit.simulation.steady import settled

TABLE = "table_simulated.csv"  # CSV has no place for a remark: the name carries it
HEADER = "SA [deg],FZ [N],FY [N],MZ [N*m]"


def table_csv(plan: Plan) -> str:
    """Return the table: every load of the plan, at each of its slip angles in rising order."""
    answer = settled(plan, {})
    lines = [HEADER]
    for load in sorted(set(plan.loads_N)):
        for SA in sorted(set(plan.slip_angles_rad)):
            FY, MZ = answer(SA, load, "forward")  # machine axes are SAE with the drum forward
            lines.append(f"{np.degrees(SA):.6g},{load:.6g},{FY:.6g},{MZ:.6g}")
    return "\n".join(lines) + "\n"


def write_table(plan: Plan, folder: Path) -> Path:
    """Write the table into a folder; return the file."""
    path = folder / TABLE
    write_atomic(path, table_csv(plan))
    return path
