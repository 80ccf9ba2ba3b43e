"""More kinds of tables: mixtures, networks, signed distances. Mirrors controller/tab/tab_{gmr,mlp,sdf}.h."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from engram.emit.arrays import LANES, TYPES, Array, array, blocks, pad, padded_rows, stored
from engram.emit.kinds import Table


@dataclass(kw_only=True)
class Gmr(Table):
    """Mixture regression: log_norm (k,), freedom (k,) (0: Gaussian), mean_x (k, d), linv (k, d, d) lower, mean_y (k, m),
    slope (k, m, d) stored as `type`, var (k, m)."""

    log_norm: np.ndarray
    freedom: np.ndarray
    mean_x: np.ndarray
    linv: np.ndarray
    mean_y: np.ndarray
    slope: np.ndarray
    var: np.ndarray
    type: str = "float32"

    def __post_init__(self) -> None:
        self.kind, self.constant = "gmr", "kTabGmr"

    @property
    def outputs(self) -> int:
        return self.mean_y.shape[1]

    def fields(self) -> dict[str, int | np.float32]:
        k, d = self.mean_x.shape
        return {"k": k, "d": d, "m": self.outputs, "slope_type": TYPES[self.type]}

    def own_arrays(self) -> list[Array]:
        k, d = self.mean_x.shape

        def padded(values: np.ndarray) -> np.ndarray:
            return np.pad(values, (0, pad(k) - k))

        columns = self.linv.transpose(0, 2, 1).reshape(k * d, d)
        slope = self.slope.transpose(0, 2, 1).reshape(k * d, self.outputs)
        return [
            array("log_norm", "(pad(k)) what the log probability of a component does not owe to x", padded(self.log_norm)),
            array("freedom", "(pad(k)) degrees of freedom; 0: Gaussian", padded(self.freedom)),
            array("mean_x", "(k, pad(d))", padded_rows(self.mean_x)),
            array("linv", "(k, d, pad(d)) inverse Cholesky factors of S_xx, by columns", padded_rows(columns)),
            array("mean_y", "(k, pad(m))", padded_rows(self.mean_y)),
            *stored("slope", "(k, d, pad(m)) S_yx S_xx^-1, by columns", slope, self.type),
            array("var", "(k, pad(m)) conditional variances", padded_rows(self.var)),
        ]


@dataclass(kw_only=True)
class Mlp(Table):
    """Networks of one shape: weights[member][layer] (inputs, outputs) stored as `type`, biases[member][layer] (outputs,).

    center, width (d,): the first layer sees (x - center) / width. modes: Gaussians of a mixture density head, whose last layer
    puts out modes logits, (modes, m) means and (modes, m) log standard deviations.
    """

    center: np.ndarray
    width: np.ndarray
    weights: list[list[np.ndarray]]
    biases: list[list[np.ndarray]]
    modes: int = 0
    type: str = "float32"

    def __post_init__(self) -> None:
        self.kind, self.constant = "mlp", "kTabMlp"

    @property
    def outputs(self) -> int:
        last = self.weights[0][-1].shape[1]
        return (last // self.modes - 1) // 2 if self.modes else last

    def fields(self) -> dict[str, int | np.float32]:
        shapes = [[layer.shape for layer in member] for member in self.weights]
        hidden = self.weights[0][0].shape[1]
        inner = [(hidden, hidden)] * (len(shapes[0]) - 2)
        last = self.modes * (1 + 2 * self.outputs) if self.modes else self.outputs
        if any(member != [(len(self.inputs), hidden), *inner, (hidden, last)] for member in shapes):
            raise ValueError("mlp: hidden layers must have one width, and members one shape")
        return {
            "d": len(self.inputs), "m": self.outputs, "depth": len(shapes[0]) - 1, "hidden": hidden, "members": len(shapes),
            "modes": self.modes, "weight_type": TYPES[self.type],
        }  # fmt: skip

    def own_arrays(self) -> list[Array]:
        layers = [stored("weight", "", layer, self.type) for member in self.weights for layer in member]
        rows = np.concatenate([matrix.rows.reshape(-1, LANES) for matrix, _ in layers])
        scales = np.concatenate([scale.flat for _, scale in layers])
        biases = np.concatenate([padded_rows(layer)[0] for member in self.biases for layer in member])
        return [
            array("center", "(d) subtracted from the input", self.center),
            array("inv_width", "(d) then multiplied with it", 1.0 / self.width),
            Array("weight", "members, layers: (inputs, pad(outputs))", rows),
            array("weight_scale", "members, layers: (pad(outputs)) scale of each column of weight", scales),
            array("bias", "members, layers: (pad(outputs))", biases),
        ]


@dataclass(kw_only=True)
class Sdf(Table):
    """Signed distances. boxes: (centre (3,), R_WB (3, 3), half extents (3,)); spheres (n, 4): centre, radius;
    grid (nx, ny, nz) [m] of `spacing` m from the node `origin`, stored as `type`."""

    boxes: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = field(default_factory=list)
    spheres: np.ndarray = field(default_factory=lambda: np.zeros((0, 4)))
    grid: np.ndarray | None = None
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))
    spacing: float = 1.0
    type: str = "float32"

    def __post_init__(self) -> None:
        self.kind, self.constant = "sdf", "kTabSdf"

    @property
    def outputs(self) -> int:
        return 1

    def stored_grid(self) -> tuple[Array, np.float32]:
        """Distances (nz, ny, pad(nx)) and the scale of all of them."""
        if self.grid is None:
            return array("grid", "no grid", np.zeros(LANES)), np.float32(1)
        rows = padded_rows(self.grid.transpose(2, 1, 0).reshape(-1, self.grid.shape[0]))
        matrix, scale = stored("grid", "(nz, ny, pad(nx)) distances at the nodes", rows.reshape(-1, 1), self.type)
        flat = matrix.rows[:, 0].reshape(rows.shape)  # one column, so one scale
        return Array(matrix.name, matrix.about, np.ascontiguousarray(flat)), scale.flat[0]

    def fields(self) -> dict[str, int | np.float32]:
        nx, ny, nz = (0, 0, 0) if self.grid is None else self.grid.shape
        x0, y0, z0 = np.float32(self.origin)
        return {
            "nbox": len(self.boxes), "nsphere": len(self.spheres), "nx": nx, "ny": ny, "nz": nz,
            "grid_type": TYPES[self.type] if nx else 0,
            "x0": x0, "y0": y0, "z0": z0, "spacing": np.float32(self.spacing), "grid_scale": self.stored_grid()[1],
        }  # fmt: skip

    def own_arrays(self) -> list[Array]:
        boxes = np.array([np.concatenate([np.ravel(part) for part in box]) for box in self.boxes]).reshape(-1, 15)
        return [
            array("box", "blocks of (15, 8 boxes): centre, rotation, half extents",
                  blocks(boxes) if len(boxes) else np.zeros((15, 8))),
            array("sphere", "blocks of (4, 8 spheres): centre, radius",
                  blocks(self.spheres) if len(self.spheres) else np.zeros((4, 8))),
            self.stored_grid()[0],
        ]  # fmt: skip
