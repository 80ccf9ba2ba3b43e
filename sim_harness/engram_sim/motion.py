"""What a log says about the motion: hand errors over the time since a jump, torques, candidates."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin

from engram.robots.tree import Tree
from engram_sim import eventlog
from engram_sim.results import Run


@dataclass
class Motion:
    """Arrays of one run's log, read once."""

    run: Run
    tree: Tree
    frame: str  # of the robot, that is judged

    @cached_property
    def messages(self) -> dict[str, np.ndarray]:
        return eventlog.read(self.run.log, ["ENGRAM_STATE", "ENGRAM_TASK", "ENGRAM_CYCLE", "ENGRAM_COMMAND"])

    @cached_property
    def cycles(self) -> np.ndarray:
        """cycle_t of the run (empty without a controller that sends them)."""
        return self.messages["ENGRAM_CYCLE"]

    def jump_cycles(self) -> np.ndarray:
        """The first cycle of each jump."""
        return self.cycles[self._jumped()]

    def later_cycles(self) -> np.ndarray:
        """All others."""
        return self.cycles[~self._jumped()]

    def _jumped(self) -> np.ndarray:
        return np.diff(self.cycles["jump"], prepend=0) > 0

    def error_over_time(self, times: np.ndarray) -> np.ndarray:
        """Distance of hand and target (m) at `times` (s) after each jump: (jumps, times); NaN after the jump has ended."""
        states, tasks = self.messages["ENGRAM_STATE"], self.messages["ENGRAM_TASK"]
        model, data = self.tree.model, self.tree.model.createData()
        f = self.tree.frame_name.index(self.frame)
        joint = int(self.tree.frame_joint[f]) + 1
        p_JF = self.tree.R_turn[joint - 1] @ self.tree.p_JF[f]
        errors = np.full((len(self.run.finished()), len(times)), np.nan)
        for row, jump in enumerate(self.run.finished()):
            task = tasks[np.searchsorted(tasks["utime"], round(1e6 * jump["t_start_s"]) - 1, side="right")]
            p_WT = task["value"][:3]
            wanted = jump["t_start_s"] + times
            at = np.searchsorted(states["utime"], np.round(1e6 * wanted)).clip(0, len(states) - 1)
            for column in np.flatnonzero(wanted <= jump["t_end_s"]):
                pin.forwardKinematics(model, data, states["q"][at[column], : self.tree.nq].astype(float))
                errors[row, column] = np.linalg.norm(data.oMi[joint].act(p_JF) - p_WT)
        return errors

    def torque_shares(self) -> np.ndarray:
        """|tau| / limit of every logged command: (commands, nu)."""
        limits = np.asarray(self.tree.u_max)
        return np.abs(self.messages["ENGRAM_COMMAND"]["tau"][:, : len(limits)].astype(float)) / limits
