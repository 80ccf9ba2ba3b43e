"""Networks from inputs to outputs: ensembles trained by scikit-learn, mixture density networks by gradient descent; or both by
PyTorch, an optional extra (engram.pytorch).

All put out what controller/tab/tab_mlp.h evaluates. Inputs and outputs are standardized for the training; the scale of the
outputs is folded into the last layer.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor

from engram.pytorch import PyTorch

SMALLEST_STD = 1e-3  # of a density's standardized outputs: a sample met exactly must not let the likelihood grow without bound


@dataclass(frozen=True)
class Network:
    """Members of one shape: weights[member][layer] (inputs, outputs), biases[member][layer]; modes 0: no mixture density head."""

    center: np.ndarray
    width: np.ndarray
    weights: list[list[np.ndarray]]
    biases: list[list[np.ndarray]]
    modes: int = 0

    def raw(self, x: np.ndarray) -> np.ndarray:
        """What leaves the last layers: (members, n, outputs)."""
        z = (x - self.center) / self.width
        return np.array([forward(z, w, b)[-1] for w, b in zip(self.weights, self.biases, strict=True)])

    def predict(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Probabilities (n, parts), means and variances (n, parts, m) of all modes of all members; without a head infinite."""
        raw = self.raw(x)
        members, n, last = raw.shape
        if self.modes == 0:
            y = raw.transpose(1, 0, 2)
            return np.full((n, members), 1 / members), y, np.full_like(y, np.inf)
        p, y, log_std = split_head(raw.reshape(members * n, last), self.modes)

        def parts(a: np.ndarray) -> np.ndarray:
            return a.reshape(members, n, self.modes, -1).transpose(1, 0, 2, 3).reshape(n, members * self.modes, -1)

        return parts(p)[:, :, 0] / members, parts(y), np.exp(2 * parts(log_std))


def forward(z: np.ndarray, weights: list[np.ndarray], biases: list[np.ndarray]) -> list[np.ndarray]:
    """Outputs of every layer, the input first: ReLU between the layers, linear at the end."""
    layers = [z]
    for i, (w, b) in enumerate(zip(weights, biases, strict=True)):
        y = layers[-1] @ w + b
        layers.append(np.maximum(y, 0) if i + 1 < len(weights) else y)
    return layers


def split_head(out: np.ndarray, modes: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Probabilities (n, K), means and log standard deviations (n, K, m) from the numbers of a mixture density head."""
    logits, rest = out[:, :modes], out[:, modes:].reshape(len(out), 2, modes, -1)
    p = np.exp(logits - logits.max(axis=1, keepdims=True))
    return p / p.sum(axis=1, keepdims=True), rest[:, 0], rest[:, 1]


def spread(values: np.ndarray) -> np.ndarray:
    """Standard deviations of the columns, 1 where a column is constant."""
    std = values.std(axis=0)
    return np.where(std > 1e-9, std, 1.0)


def in_units(weights: list, biases: list, y_mean: np.ndarray, y_std: np.ndarray, modes: int = 0) -> tuple[list, list]:
    """The layers of a network that was trained on standardized outputs, with their mean and spread in the last of them."""
    if not modes:
        return [*weights[:-1], weights[-1] * y_std], [*biases[:-1], biases[-1] * y_std + y_mean]
    m = len(y_std)
    scale, shift = np.ones(modes * (1 + 2 * m)), np.zeros(modes * (1 + 2 * m))
    scale[modes : modes * (1 + m)], shift[modes : modes * (1 + m)] = np.tile(y_std, modes), np.tile(y_mean, modes)
    shift[modes * (1 + m) :] = np.tile(np.log(y_std), modes)
    return [*weights[:-1], weights[-1] * scale], [*biases[:-1], biases[-1] * scale + shift]


def fit_ensemble(
    x: np.ndarray, y: np.ndarray, *, hidden: int = 64, depth: int = 2, members: int = 1, epochs: int = 300, seed: int = 0
) -> Network:
    """Least squares, one member per seed, by Adam with early stopping."""
    center, width, y_mean, y_std = x.mean(axis=0), spread(x), y.mean(axis=0), spread(y)
    weights, biases = [], []
    for member in range(members):
        model = MLPRegressor(
            hidden_layer_sizes=(hidden,) * depth, max_iter=epochs, early_stopping=True, n_iter_no_change=20,
            random_state=seed + member,
        )  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            model.fit((x - center) / width, (y - y_mean) / y_std)
        layers = [*model.coefs_[:-1], model.coefs_[-1].reshape(hidden, -1)]
        for made, all_of_them in zip(in_units(layers, model.intercepts_, y_mean, y_std), (weights, biases), strict=True):
            all_of_them.append(made)
    return Network(center, width, weights, biases)


def density_gradient(out: np.ndarray, y: np.ndarray, modes: int) -> tuple[float, np.ndarray]:
    """Mean negative log likelihood of y (n, m) under the head's mixtures, and its gradient to out (n, modes (1 + 2 m))."""
    p, mean, log_std = split_head(out, modes)
    inside = log_std > np.log(SMALLEST_STD)
    log_std = np.where(inside, log_std, np.log(SMALLEST_STD))
    z = (y[:, None, :] - mean) * np.exp(-log_std)
    log_part = np.log(p + 1e-300) - np.sum(0.5 * z**2 + log_std, axis=2)
    largest = log_part.max(axis=1, keepdims=True)
    total = np.log(np.exp(log_part - largest).sum(axis=1, keepdims=True)) + largest
    share = np.exp(log_part - total)[:, :, None]  # which mode the sample belongs to
    to_mean, to_log_std = -share * z * np.exp(-log_std), share * (1 - z**2) * inside
    gradient = np.hstack([p - share[:, :, 0], to_mean.reshape(len(y), -1), to_log_std.reshape(len(y), -1)])
    return float(-total.mean() + 0.5 * y.shape[1] * np.log(2 * np.pi)), gradient / len(y)


def fit_density(
    x: np.ndarray, y: np.ndarray, *, modes: int = 4, hidden: int = 64, depth: int = 2, epochs: int = 300, batch: int = 64,
    rate: float = 1e-3, seed: int = 0,
) -> Network:  # fmt: skip
    """Mixture density network of the largest likelihood, by Adam with a step that falls to zero."""
    rng = np.random.default_rng(seed)
    center, width, y_mean, y_std = x.mean(axis=0), spread(x), y.mean(axis=0), spread(y)
    z, target, m = (x - center) / width, (y - y_mean) / y_std, y.shape[1]
    sizes = [x.shape[1], *[hidden] * depth, modes * (1 + 2 * m)]
    weights = [rng.normal(size=(a, b)) * np.sqrt(2 / a) for a, b in pairwise(sizes)]
    weights[-1] *= 0.1
    biases = [np.zeros(b) for b in sizes[1:]]
    biases[-1][modes : modes * (1 + m)] = target[rng.permutation(len(target))[:modes]].ravel()  # every mode starts at a sample
    parameters = [*weights, *biases]
    first, second = [np.zeros_like(a) for a in parameters], [np.zeros_like(a) for a in parameters]
    steps = epochs * (len(x) // batch or 1)
    for step in range(1, steps + 1):
        chosen = rng.integers(len(x), size=batch)
        layers = forward(z[chosen], weights, biases)
        _, delta = density_gradient(layers[-1], target[chosen], modes)
        gradients = []
        for i in reversed(range(len(weights))):
            gradients[:0] = [(layers[i].T @ delta, delta.sum(axis=0))]
            delta = (delta @ weights[i].T) * (layers[i] > 0)
        flat = [g for g, _ in gradients] + [g for _, g in gradients]
        for a, g, u, v in zip(parameters, flat, first, second, strict=True):
            u += 0.1 * (g - u)
            v += 0.001 * (g * g - v)
            a -= rate * (1 - step / steps) * (u / (1 - 0.9**step)) / (np.sqrt(v / (1 - 0.999**step)) + 1e-8)
    weights, biases = in_units(weights, biases, y_mean, y_std, modes)
    return Network(center, width, [weights], [biases], modes)


def fit_by_pytorch(
    x: np.ndarray, y: np.ndarray, *, modes: int = 0, hidden: int = 64, depth: int = 2, members: int = 1, epochs: int = 300,
    batch: int = 64, rate: float = 1e-3, seed: int = 0,
) -> Network:  # fmt: skip
    """The same by PyTorch: least squares, with modes > 0 the largest likelihood of a mixture, by Adam with a step that falls to
    zero. Raises InputError if PyTorch is missing."""
    center, width, y_mean, y_std = x.mean(axis=0), spread(x), y.mean(axis=0), spread(y)
    with PyTorch() as worker:
        found = worker.ask(
            "fit", x=(x - center) / width, y=(y - y_mean) / y_std, modes=modes, hidden=hidden, depth=depth, members=members,
            epochs=epochs, batch=batch, rate=rate, seed=seed, smallest_std=SMALLEST_STD,
        )  # fmt: skip
    made = [
        in_units(*([found[f"{name}_{i}_{k}"] for k in range(depth + 1)] for name in ("weight", "bias")), y_mean, y_std, modes)
        for i in range(members)
    ]
    return Network(center, width, [weights for weights, _ in made], [biases for _, biases in made], modes)
