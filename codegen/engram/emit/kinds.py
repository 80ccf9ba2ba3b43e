"""The kinds of tables, as the learners hand them over; each knows its C struct. Mirrors controller/tab/tab_<kind>.h."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

import numpy as np

from engram.emit.arrays import TYPES, Array, array, blocks, pad, padded_rows, triangle

# TabKind of controller/tab/tab.h, and TAB_<KIND>_SCHEMA of the kind's header
KINDS = {
    "kTabKnn": (1, 1), "kTabGpr": (2, 1), "kTabPca": (3, 1), "kTabRbf": (4, 1), "kTabLogit": (5, 1), "kTabGmr": (6, 1),
    "kTabMlp": (7, 1), "kTabSdf": (8, 1), "kTabTt": (10, 1),
}  # fmt: skip


@dataclass(kw_only=True)
class Table(ABC):
    """What all kinds have in common (TabHead). `lo`, `hi`: domain; `inputs`: (name, unit) of each; `role`: what it is called."""

    inputs: list[tuple[str, str]]
    lo: np.ndarray
    hi: np.ndarray
    held_out_error: float
    held_out_text: str
    role: str = ""  # part of file and symbol names; the kind if empty
    kind: str = field(init=False, default="")  # "knn" for TabKnn
    constant: str = field(init=False, default="")  # its TabKind

    @property
    def number(self) -> int:
        """Its TabKind as a number."""
        return KINDS[self.constant][0]

    @property
    def schema(self) -> int:
        """The layout of its struct."""
        return KINDS[self.constant][1]

    @property
    @abstractmethod
    def outputs(self) -> int:
        """Number of outputs (nout)."""

    @abstractmethod
    def fields(self) -> dict[str, int | np.float32]:
        """Scalars of the C struct, in its order."""

    @abstractmethod
    def own_arrays(self) -> list[Array]:
        """Arrays of the C struct, in its order."""

    def arrays(self) -> list[Array]:
        """All arrays, domain first: the order of TabHead.array."""
        for name, bound in (("lo", self.lo), ("hi", self.hi)):
            if np.shape(bound) != (len(self.inputs),):
                raise ValueError(f"{self.kind}: '{name}' has shape {np.shape(bound)}, there are {len(self.inputs)} inputs")
        domain = [array("lo", "domain, lower bound of each input", self.lo), array("hi", "domain, upper bound", self.hi)]
        return domain + self.own_arrays()


@dataclass(kw_only=True)
class Knn(Table):
    """k nearest neighbours. x (n, d) natural units, scale (d,), value (n, m)."""

    x: np.ndarray
    scale: np.ndarray
    value: np.ndarray

    def __post_init__(self) -> None:
        self.kind, self.constant = "knn", "kTabKnn"

    @property
    def outputs(self) -> int:
        return self.value.shape[1]

    def fields(self) -> dict[str, int | np.float32]:
        return {"n": self.x.shape[0], "d": self.x.shape[1], "m": self.outputs}

    def own_arrays(self) -> list[Array]:
        scale = array("scale", "weight of each input", self.scale)
        # scaled in float32 exactly as the query is, so that a stored sample finds itself at distance 0
        scaled = np.asarray(self.x, np.float32) * scale.flat
        return [
            scale,
            array("x", "scaled inputs, blocks of (d, 8 samples)", blocks(scaled)),
            array("value", "(n, pad(m)) what a sample remembers", padded_rows(self.value)),
        ]


@dataclass(kw_only=True)
class Gpr(Table):
    """Gaussian process. x (n, d), length (d,), alpha (n, m), mean (m,), linv (n, n) lower, or None: the table knows no variance;
    kernel variance and noise."""

    x: np.ndarray
    length: np.ndarray
    variance: float
    noise: float
    alpha: np.ndarray
    mean: np.ndarray
    linv: np.ndarray | None

    def __post_init__(self) -> None:
        self.kind, self.constant = "gpr", "kTabGpr"

    @property
    def outputs(self) -> int:
        return self.alpha.shape[1]

    def fields(self) -> dict[str, int | np.float32]:
        n, d = self.x.shape
        return {"n": n, "d": d, "m": self.outputs, "variance": np.float32(self.variance), "noise": np.float32(self.noise)}

    def own_arrays(self) -> list[Array]:
        inverse = array("inv_length", "1 / length scale of each input", 1.0 / self.length)
        scaled = np.asarray(self.x, np.float32) * inverse.flat
        arrays = [
            inverse,
            array("x", "scaled inputs, blocks of (d, 8 samples)", blocks(scaled)),
            array("alpha", "(n, pad(m)) weights of the mean", padded_rows(self.alpha)),
            array("mean", "(pad(m)) prior mean", padded_rows(self.mean)),
        ]
        if self.linv is not None:
            about = "lower triangle of the inverse Cholesky factor, row i padded to pad(i + 1)"
            arrays.append(array("linv", about, triangle(self.linv)))
        return arrays


@dataclass(kw_only=True)
class Pca(Table):
    """PCA decoder: y = mean + basis' z. basis (m, n), mean (n,)."""

    mean: np.ndarray
    basis: np.ndarray

    def __post_init__(self) -> None:
        self.kind, self.constant = "pca", "kTabPca"

    @property
    def outputs(self) -> int:
        return self.basis.shape[1]

    def fields(self) -> dict[str, int | np.float32]:
        return {"m": self.basis.shape[0], "n": self.outputs}

    def own_arrays(self) -> list[Array]:
        return [
            array("mean", "(pad(n))", padded_rows(self.mean)),
            array("basis", "(m, pad(n)) components", padded_rows(self.basis)),
        ]


@dataclass(kw_only=True)
class Rbf(Table):
    """Normalised Gaussians over time. center (k,) [s], width [s], number of channels."""

    center: np.ndarray
    width: float
    channels: int

    def __post_init__(self) -> None:
        self.kind, self.constant = "rbf", "kTabRbf"

    @property
    def outputs(self) -> int:
        return self.channels

    def fields(self) -> dict[str, int | np.float32]:
        return {"k": len(self.center), "nchannel": self.channels, "width": np.float32(self.width)}

    def own_arrays(self) -> list[Array]:
        return [array("center", "(pad(k)) centres [s]", np.pad(self.center, (0, pad(len(self.center)) - len(self.center))))]


@dataclass(kw_only=True)
class Logit(Table):
    """Logistic regression. weight (d,), bias."""

    weight: np.ndarray
    bias: float

    def __post_init__(self) -> None:
        self.kind, self.constant = "logit", "kTabLogit"

    @property
    def outputs(self) -> int:
        return 1

    def fields(self) -> dict[str, int | np.float32]:
        return {"d": len(self.weight), "bias": np.float32(self.bias)}

    def own_arrays(self) -> list[Array]:
        return [array("weight", "(d) per unit of the input", self.weight)]


@dataclass(kw_only=True)
class Tt(Table):
    """Tensor train. cores: d arrays (r_k-1, n_k, r_k) over uniform grids lo .. hi; stored as float32 or int8."""

    cores: list[np.ndarray]
    type: str = "float32"

    def __post_init__(self) -> None:
        self.kind, self.constant = "tt", "kTabTt"
        ranks = [core.shape[0] for core in self.cores] + [self.cores[-1].shape[2]]
        if ranks[0] != 1 or ranks[-1] != 1 or any(c.shape[2] != r for c, r in zip(self.cores, ranks[1:], strict=True)):
            raise ValueError(f"tt: the ranks of the cores do not fit each other: {[core.shape for core in self.cores]}")

    @property
    def outputs(self) -> int:
        return 1

    def fields(self) -> dict[str, int | np.float32]:
        return {"d": len(self.cores), "type": TYPES[self.type]}

    def own_arrays(self) -> list[Array]:
        points = [core.shape[1] for core in self.cores]
        ranks = [1] + [core.shape[2] for core in self.cores]
        scale = np.ones(len(self.cores))
        if self.type == "int8":
            scale = np.array([max(float(np.abs(core).max()), 1e-30) / 127 for core in self.cores], np.float32)
        slices = [np.moveaxis(core, 1, 0) / s for core, s in zip(self.cores, scale, strict=True)]
        slices = [s if s.shape[2] == 1 else np.pad(s, ((0, 0), (0, 0), (0, pad(s.shape[2]) - s.shape[2]))) for s in slices]
        flat = np.concatenate([s.reshape(-1) for s in slices])
        about = "cores 1 .. d, slices (n_k, r_k-1, r_k padded)"
        if self.type == "int8":
            codes = np.rint(flat).astype(np.int8)
            core = Array("core", about, np.pad(codes, (0, -len(codes) % 4)).reshape(1, -1))
        else:
            core = array("core", about, flat)
        return [
            array("shape", "points n_1 .. n_d, then ranks r_0 .. r_d", np.array(points + ranks)),
            array("scale", "(d) a core is scale times what is stored", scale),
            core,
        ]
