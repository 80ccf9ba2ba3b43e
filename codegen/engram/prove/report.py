"""What proofs have in common: figures with what they are held against, and the times of a control period."""

from dataclasses import dataclass, field

import numpy as np

from engram.learn.figures import write_figures
from engram.prove.trial import PHASES, Series, cycle_times

QUANTILES = {"p50": 50.0, "p99": 99.0, "p999": 99.9, "max": 100.0}


@dataclass
class Report:
    """Figures of one robot, printed as they come; `failed` counts those that miss what is asked."""

    robot: str
    figures: list[tuple[str, float, str, int]] = field(default_factory=list)
    failed: int = 0

    def add(self, what: str, value: float, unit: str, n: int, wanted: str = "", met: bool = True) -> None:
        """One figure `prove.<robot>.<what>`; `wanted` says what is asked for, `met` whether it holds."""
        self.quiet(what, value, unit, n, met)
        mark = "" if not wanted else f"   {'holds' if met else 'FAILS'}: {wanted}"
        print(f"  {what:28} {value:10.4g} {unit:5} n = {n}{mark}", flush=True)

    def quiet(self, what: str, value: float, unit: str, n: int, met: bool = True) -> None:
        """The same, without a line of its own."""
        self.figures.append((f"prove.{self.robot}.{what}", float(value), unit, n))
        self.failed += not met

    def add_varied(self, runs: list[Series]) -> None:
        """How many of the runs that were only drawn for their control periods stood to the end."""
        if runs:
            self.add("varied.stands", np.mean([run.stands for run in runs]), "1", len(runs))

    def add_times(self, runs: list[Series]) -> None:
        """CPU time per control period and phase, over all runs."""
        times = cycle_times(runs)
        n = len(times["total"])
        print(f"  CPU time of a control period [us], {n} periods:" + "".join(f"{name:>9}" for name in QUANTILES))
        for phase in PHASES:
            values = np.percentile(times[phase], list(QUANTILES.values()))
            print(f"    {phase:37}" + "".join(f"{value:9.0f}" for value in values))
            name = "cycle" if phase == "total" else phase
            for quantile, value in zip(QUANTILES, values):
                self.figures.append((f"prove.{self.robot}.{name}_us.{quantile}", float(value), "us", n))

    def write(self) -> None:
        """build/figures/prove_<robot>.json."""
        write_figures(self.file, self.figures)

    @property
    def file(self) -> str:
        """Name of the file of figures."""
        return f"prove_{self.robot.replace('.', '_')}"


def all_share(runs: list[Series]) -> float:
    """Largest torque of all runs, of its limit."""
    return max(run["torque"].max() for run in runs)
