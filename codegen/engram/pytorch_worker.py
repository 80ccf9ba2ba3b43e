"""PyTorch's side of engram.pytorch: run by the system's Python, which has PyTorch but not this package.

Reads questions from stdin, each an .npz behind its length (8 bytes, little-endian) whose array `question` names a function below,
and writes the answers to stdout in the same form. Everything in double precision, on one thread.
"""

import io
import itertools
import math
import sys
import time

import numpy as np
import torch


class Train:
    """A tensor train, sampled as algorithm 6 of the thesis says, all samples at once. cores: (r_k-1, n_k, r_k).

    tuned: the marginals are kept from one call to the next, and the slices of a core lie one behind the other.
    """

    def __init__(self, cores):
        self.cores = cores
        self.slices = [core.permute(1, 0, 2).contiguous() for core in cores]
        self.kept = self.marginals()

    def marginals(self):
        """Lines 2 to 4 and 7: W_k = P^k pi_k+1 (r_k-1, n)."""
        pi, weights = torch.ones(1), []
        for core in reversed(self.cores):
            weights.append(core @ pi)
            pi = weights[-1].sum(1)
            pi = pi / pi.abs().max()
        return weights[::-1]

    def probabilities(self, row, W, alpha):
        """Of one variable's points (count, n), up to a factor."""
        p = (row @ W).abs()
        return (p / p.max(1, keepdim=True).values) ** (1 / (1 - alpha))

    def step(self, row, k, point, tuned):
        """The rows (count, r_k) behind the chosen points."""
        if tuned:
            row = torch.bmm(row[:, None, :], self.slices[k][point])[:, 0]
        else:
            row = torch.einsum("lr,rls->ls", row, self.cores[k][:, point, :])
        return row / row.abs().max(1, keepdim=True).values

    def sample(self, alpha, count, tuned):
        """Points (count, d): lines 5 to 16."""
        row, points = torch.ones(count, 1), []
        for k, W in enumerate(self.kept if tuned else self.marginals()):
            points.append(torch.multinomial(self.probabilities(row, W, alpha), 1)[:, 0])
            row = self.step(row, k, points[-1], tuned)
        return torch.stack(points, 1)

    def log_probability(self, alpha, points):
        """Of points (count, d): what `sample` draws them with."""
        row, total = torch.ones(len(points), 1), torch.zeros(len(points))
        for k, W in enumerate(self.kept):
            p = self.probabilities(row, W, alpha)
            total = total + torch.log(p.gather(1, points[:, k : k + 1])[:, 0] / p.sum(1))
            row = self.step(row, k, points[:, k], tuned=True)
        return total


class Networks:
    """An ensemble of networks, standardized inputs to raw outputs; with modes > 0 a mixture density head."""

    def __init__(self, weights, biases, center, width, modes):
        self.members, self.modes = [], modes
        for member_weights, member_biases in zip(weights, biases):
            layers = []
            for w, b in zip(member_weights, member_biases):
                layer = torch.nn.Linear(*w.shape)
                layer.weight.data, layer.bias.data = w.T.contiguous(), b.clone()
                layers += [layer, torch.nn.ReLU()]
            self.members.append(torch.nn.Sequential(*layers[:-1]))
        self.center, self.width = center, width

    def predict(self, x):
        """Probabilities (n, parts), means and variances (n, parts, m): of members, or of their modes."""
        z = (x - self.center) / self.width
        out = torch.stack([net(z) for net in self.members], 1)  # (n, members, outputs)
        n, members = out.shape[:2]
        if not self.modes:
            return torch.full((n, members), 1 / members), out, torch.full_like(out, math.inf)
        p = torch.softmax(out[..., : self.modes], 2) / members
        rest = out[..., self.modes :].reshape(n, members, 2, self.modes, -1)
        m = rest.shape[-1]
        return p.reshape(n, -1), rest[:, :, 0].reshape(n, -1, m), torch.exp(2 * rest[:, :, 1]).reshape(n, -1, m)


def nested(question, name):
    """Arrays name_<member>_<layer>, as lists of lists."""
    members = []
    while f"{name}_{len(members)}_0" in question:
        layers = []
        while f"{name}_{len(members)}_{len(layers)}" in question:
            layers.append(torch.from_numpy(question[f"{name}_{len(members)}_{len(layers)}"]))
        members.append(layers)
    return members


def clocked(call, repeats):
    """Processor time of each of some calls [us]."""
    times = np.empty(repeats)
    for i in range(repeats):
        clock = time.process_time_ns()
        call(i)
        times[i] = 1e-3 * (time.process_time_ns() - clock)
    return times


state = {}


def version(question):
    """PyTorch's version."""
    return {"text": np.array(torch.__version__)}


def load_train(question):
    """Keeps the train that `sample` and `log_probability` are about."""
    state["train"] = Train(nested(question, "core")[0])
    return {}


def sample(question):
    """Processor time of each of `repeats` calls [us]."""
    alpha, count, tuned = float(question["alpha"]), int(question["count"]), bool(question["tuned"])
    torch.manual_seed(1)
    return {"us": clocked(lambda i: state["train"].sample(alpha, count, tuned), int(question["repeats"]))}


def log_probability(question):
    """Of points (count, d)."""
    found = state["train"].log_probability(float(question["alpha"]), torch.from_numpy(question["points"]))
    return {"log_probability": found.numpy()}


def load_networks(question):
    """Keeps the networks that the predictions are about."""
    center, width = torch.from_numpy(question["center"]), torch.from_numpy(question["width"])
    state["networks"] = Networks(nested(question, "weight"), nested(question, "bias"), center, width, int(question["modes"]))
    return {}


def predict(question):
    """Probabilities, means, variances of all rows of x."""
    p, mean, variance = state["networks"].predict(torch.from_numpy(question["x"]))
    return {"p": p.numpy(), "mean": mean.numpy(), "variance": variance.numpy()}


def predict_one_by_one(question):
    """Processor time of each row of x on its own [us]."""
    x = torch.from_numpy(question["x"])
    return {"us": clocked(lambda i: state["networks"].predict(x[i : i + 1]), len(x))}


def mixture_loss(out, y, modes, smallest_std):
    """Mean negative log likelihood of y (n, m) under the mixtures of a head's numbers, up to a constant."""
    logits, rest = out[:, :modes], out[:, modes:].reshape(len(out), 2, modes, -1)
    log_std = rest[:, 1].clamp(min=math.log(smallest_std))
    z = (y[:, None, :] - rest[:, 0]) * torch.exp(-log_std)
    return -torch.logsumexp(torch.log_softmax(logits, 1) - (0.5 * z**2 + log_std).sum(2), 1).mean()


def fit(question):
    """Networks (members) from x (n, d) to y (n, m), both standardized, as engram.learn.network.fit_by_pytorch says."""
    x, y = torch.from_numpy(question["x"]), torch.from_numpy(question["y"])
    modes, hidden, depth, batch, seed = (int(question[name]) for name in ("modes", "hidden", "depth", "batch", "seed"))
    smallest_std, m = float(question["smallest_std"]), y.shape[1]
    steps, found = int(question["epochs"]) * max(1, len(x) // batch), {}
    for member in range(int(question["members"])):
        torch.manual_seed(seed + member)
        sizes = [x.shape[1]] + [hidden] * depth + [modes * (1 + 2 * m) if modes else m]
        layers = [torch.nn.Linear(a, b) for a, b in itertools.pairwise(sizes)]
        if modes:  # every mode starts at a sample
            layers[-1].bias.data[modes : modes * (1 + m)] = y[torch.randperm(len(y))[:modes]].flatten()
        net = torch.nn.Sequential(*[part for layer in layers for part in (layer, torch.nn.ReLU())][:-1])
        with torch.enable_grad():
            adam = torch.optim.Adam(net.parameters(), lr=float(question["rate"]))
            pace = torch.optim.lr_scheduler.LambdaLR(adam, lambda step: 1 - step / steps)
            for _ in range(steps):
                chosen = torch.randint(len(x), (batch,))
                out = net(x[chosen])
                loss = mixture_loss(out, y[chosen], modes, smallest_std) if modes else ((out - y[chosen]) ** 2).mean()
                adam.zero_grad()
                loss.backward()
                adam.step()
                pace.step()
        for k, layer in enumerate(layers):
            found[f"weight_{member}_{k}"], found[f"bias_{member}_{k}"] = layer.weight.data.T.numpy(), layer.bias.data.numpy()
    return found


def main():
    """Answers until stdin ends."""
    torch.set_default_dtype(torch.float64)
    torch.set_num_threads(1)
    torch.set_grad_enabled(False)
    questions, answers = sys.stdin.buffer, sys.stdout.buffer
    while True:
        length = questions.read(8)
        if not length:
            return
        with np.load(io.BytesIO(questions.read(int.from_bytes(length, "little")))) as arrays:
            question = dict(arrays)
        found, packed = globals()[str(question["question"])](question), io.BytesIO()
        np.savez(packed, **found)
        answers.write(packed.tell().to_bytes(8, "little") + packed.getvalue())
        answers.flush()


if __name__ == "__main__":
    main()
