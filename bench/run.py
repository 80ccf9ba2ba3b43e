"""Time the controller's solver and rigid-body algorithms beside their peers, in one run: `make bench`.

First the gate: both sides compute the same numbers from the same input, to the tolerances below. Then the two executables
alternate, A B A B, so that a drift of the machine's speed hits both. Times are processor times of one thread; every ratio is
peer / ours of the medians, and none is printed where the gate does not hold. The figures go to build/figures/bench.json.

Rows that end in .float are our solver and algorithms compiled in single precision (ENGRAM_SINGLE), beside the same peer, in
double precision, in the same rounds; their gates have tolerances of their own.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import heap
import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path[:0] = [str(ROOT / "bench" / "peers"), str(ROOT / "codegen")]

# The same formulas in another order of summation: what double precision leaves after one linearization or recursion.
DERIVATIVE_TOLERANCE = 1e-9
# Relative; both sides stop on an expected improvement below 1e-9, far inside this.
COST_TOLERANCE = 1e-8
# Single precision: the unit of rounding. A product or a recursion over a tree leaves some 30 of them; what is solved with M, as
# many as its condition, which is computed. Of a solve the cost is compared, a sum of some thousand squares, stationary there.
ROUNDING = 2.0**-24
RECURSION_SINGLE = 30 * ROUNDING
COST_SINGLE = 100 * ROUNDING
# The stopping criterion may cross its threshold one iteration apart.
ITERATION_TOLERANCE = 1


@dataclass(frozen=True)
class Anchor:
    """A problem that both sides state."""

    robot: str
    knots: int
    nu: int
    impacts: tuple[int, ...] = ()  # knots without control
    iterations: int = ITERATION_TOLERANCE
    derivatives: float = DERIVATIVE_TOLERANCE


PROBLEMS = {
    "arm30": Anchor("panda", 30, 7),
    "arm100": Anchor("panda", 100, 7),
    "talos30t": Anchor("talos", 30, 32, (22,)),
    "talos30": Anchor("talos", 30, 32, (22,)),
    "talos100": Anchor("talos", 100, 32, (22, 45, 68, 91), 3),  # a long way down: rounding decides some step lengths
    "anymal": Anchor("anymal", 56, 12, (27, 55), derivatives=1e-8),  # K: two point feet leave Quu ill-conditioned
    "quad33": Anchor("hector", 33, 4),
}
ROBOTS = ("panda", "talos")
PHASES = ("solve1", "calcdiff", "backward", "forward")
LINEARIZATION = ("cost", "gap", "Fx", "Fu", "Lx", "Lu", "Lxx", "Lxu", "Luu", "K", "k")
RIGID_BODY = ("fk", "rnea", "aba", "crba", "rnea_derivatives", "aba_derivatives")


def run_json(*command: object) -> dict:
    """What a benchmark program prints, on one thread."""
    done = subprocess.run([str(c) for c in command], capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    if done.returncode:
        raise SystemExit(f"error: {' '.join(map(str, command))}: {done.stderr.strip()}")
    return json.loads(done.stdout)


def build_peers(folder: Path) -> None:
    """Compile the peers against the wheels of this environment (a few minutes the first time)."""
    import pinocchio

    prefix = next(p for p in Path(pinocchio.__file__).parents if p.name == "cmeel.prefix")
    log = folder.parent / "logs" / "peers.log"
    log.parent.mkdir(parents=True, exist_ok=True)
    print("bench: building the peers (minutes the first time)", flush=True)
    with log.open("w") as out:
        for command in (
            ["cmake", "-G", "Ninja", "-S", ROOT / "bench/peers", "-B", folder, f"-DPEER_PREFIX={prefix}"],
            ["ninja", "-C", folder],
        ):
            if subprocess.run(command, stdout=out, stderr=out).returncode:
                raise SystemExit(f"error: the peers do not build, see {log}")


def export_models(folder: Path) -> None:
    from export_models import load, text

    for robot in sorted({anchor.robot for anchor in PROBLEMS.values()}):
        (folder / f"{robot}.txt").write_text(text(robot, *load(robot)))


# ---- the gate ------------------------------------------------------------------------------------------------------------


def difference(a: list[float], b: list[float]) -> float:
    """Largest difference, relative to the largest entry of b or 1; infinite if the sizes differ."""
    if len(a) != len(b):
        return np.inf
    a, b = np.asarray(a), np.asarray(b)
    return float(np.max(np.abs(a - b)) / max(1.0, np.max(np.abs(b))))


def gate(name: str, errors: dict[str, float], tolerance: float) -> bool:
    worst = max(errors, key=errors.__getitem__)
    holds = errors[worst] <= tolerance
    verdict = "holds" if holds else "FAILS"
    print(f"  gate {name:<28} {verdict}: largest error {errors[worst]:.1e} ({worst}), allowed {tolerance:.0e}")
    return holds


def gate_rigid_body_single(robot: str, single: dict, peer: dict, nv: int) -> bool:
    errors = {name: difference(single[name], peer[name]) for name in peer}
    condition = max(np.linalg.cond(M) for M in np.reshape(peer["crba"], (-1, nv, nv)))
    solved = {name: error for name, error in errors.items() if name.startswith("aba")}
    recursive = {name: error for name, error in errors.items() if name not in solved}
    holds = gate(f"{robot} single, recursions", recursive, RECURSION_SINGLE)
    return gate(f"{robot} single, solved with M", solved, condition * ROUNDING) and holds


def gate_problem_single(name: str, single: dict, double: dict) -> bool:
    """Costs, their derivatives, and the cost at the end of a solve, beside those of double precision."""
    errors = {
        "converged": abs(single["cost_converged"] / double["cost_converged"] - 1),
        "derivatives": max(difference(single[f], double[f]) for f in ("cost", "Lx", "Lu", "Lxx", "Luu")),
    }
    return gate(f"{name} single, costs", errors, COST_SINGLE)


def gate_problem(name: str, ours: dict, peer: dict) -> bool:
    errors = {f: difference(ours[f], peer[f]) for f in LINEARIZATION}
    same_model = gate(f"{name} derivatives, gains", errors, PROBLEMS[name].derivatives)
    cost = abs(ours["cost_converged"] - peer["cost_converged"]) / abs(peer["cost_converged"])
    same_cost = gate(f"{name} converged cost", {"cost": cost}, COST_TOLERANCE)
    a, b = ours["iterations"], peer["iterations"]
    same_path = gate(f"{name} iterations", {f"{a:g} and {b:g}": abs(a - b)}, PROBLEMS[name].iterations)
    return same_model and same_cost and same_path


# ---- times ---------------------------------------------------------------------------------------------------------------


@dataclass
class Samples:
    """Microseconds of processor time, pooled over the rounds."""

    us: np.ndarray

    @property
    def median(self) -> float:
        return float(np.median(self.us))

    def row(self) -> str:
        return f"{self.us.min():9.3f} {self.median:9.3f} {np.percentile(self.us, 99):9.3f} {self.us.max():9.3f}"


def alternate(rounds: int, *commands: list) -> tuple[dict[str, Samples], ...]:
    """Run the commands in turn; samples by name."""
    pooled: list[dict[str, list[float]]] = [{} for _ in commands]
    for _ in range(rounds):
        for side, command in zip(pooled, commands, strict=True):
            for name, samples in run_json(*command).items():
                if isinstance(samples, list):
                    side.setdefault(name, []).extend(samples)
    return tuple({name: Samples(np.array(us)) for name, us in side.items()} for side in pooled)


class Figures:
    """The table on the terminal, and the rows of bench.json."""

    def __init__(self) -> None:
        self.rows: list[dict] = []

    def title(self, text: str) -> None:
        print(
            f"\n{text}\n  {'us':<22}{'ours min':>11} {'median':>9} {'p99':>9} {'worst':>9}   "
            f"{'peer min':>9} {'median':>9} {'p99':>9} {'worst':>9}   {'ratio':>6}  {'GFLOP/s':>7}"
        )

    def add(self, group: str, name: str, ours: Samples, peer: Samples | None, holds: bool, flops: float | None) -> None:
        row = {"id": f"bench.{group}.{name}", "value": ours.median, "unit": "us", "n": len(ours.us), "gate": holds}
        if peer is not None:
            row["peer"] = peer.median
            if holds:
                row["ratio"] = peer.median / ours.median
        self.rows.append(row)
        ratio = f"{row['ratio']:6.2f}" if "ratio" in row else " " * 6
        rate = f"{flops / ours.median * 1e-3:7.1f}" if flops else ""
        print(f"  {name:<22}  {ours.row()}   {peer.row() if peer else ' ' * 39}   {ratio}  {rate}")

    def write(self, path: Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(self.rows, indent=1) + "\n")


class Bench:
    def __init__(self, build: Path, rounds: int, n: int) -> None:
        self.ours = build / "bench" / "engram_bench"
        self.single = build / "bench" / "engram_bench_single"
        self.peers = build / "peers"
        self.inputs = build / "bench" / "inputs"
        self.rounds, self.n = rounds, n
        self.figures = Figures()
        self.all_hold = True
        for program in (self.ours, self.single, self.ours.with_name("query_bench"), self.ours.with_name("libcount_heap.so")):
            if not program.exists():
                raise SystemExit(f"error: {program} is not built\n  mend: ninja -C {build} {program.stem.removeprefix('lib')}")
        self.inputs.mkdir(parents=True, exist_ok=True)

    def numbers(self, name: str, *arrays: np.ndarray) -> Path:
        path = self.inputs / f"{name}.txt"
        np.savetxt(path, np.concatenate([a.ravel() for a in arrays]), fmt="%.17g")
        return path

    def problem(self, name: str) -> None:
        anchor = PROBLEMS[name]
        robot, T = anchor.robot, anchor.knots
        model = self.inputs / f"{robot}.txt"
        peer_exe = self.peers / "crocoddyl_bench"
        # a fixed trajectory far from any optimum, with gaps everywhere: around the posture of the cold start
        from export_models import load

        pin_model, q_ref = load(robot)
        rng = np.random.default_rng(0)
        import pinocchio as pin

        nv = pin_model.nv
        dxs = 0.1 * rng.standard_normal((T + 1, 2 * nv))
        xs = np.array([np.r_[pin.integrate(pin_model, q_ref, dx[:nv]), dx[nv:]] for dx in dxs])
        us = rng.standard_normal((T - len(anchor.impacts), anchor.nu))
        trajectory = self.numbers(f"{name}_trajectory", xs, us)
        ours = run_json(self.ours, "compare", name, trajectory)
        holds = gate_problem(name, ours, run_json(peer_exe, model, "compare", name, trajectory))
        single_holds = gate_problem_single(name, run_json(self.single, "compare", name, trajectory), ours)
        self.all_hold &= holds and single_holds

        n = max(20, self.n * 30 * 14 // (T * 2 * nv))  # fewer samples of what takes longer
        mine, single, peer = alternate(
            self.rounds, [self.ours, "time", name, n], [self.single, "time", name, n], [peer_exe, model, "time", name, n]
        )
        self.figures.title(f"{name}: {T} knots, FDDP beside Crocoddyl 3.2.1 (wheel, SSE2), one thread")
        for phase in PHASES:
            self.figures.add(name, phase, mine[phase], peer[phase], holds, ours.get(f"flops_{phase}"))
        for phase in PHASES:
            self.figures.add(name, f"{phase}.float", single[phase], peer[phase], single_holds, ours.get(f"flops_{phase}"))
        print(f"  solve1 per knot: {mine['solve1'].median / T:.2f} us, peer {peer['solve1'].median / T:.2f} us")
        self.roofline(name, ours, mine)

    def roofline(self, name: str, ours: dict, times: dict[str, Samples]) -> None:
        """How far the machine's limits are: the time of the flops at the rate of a matrix product, and the traffic."""
        print(f"  up to 100 knots take {ours['memory'] / 1e6:.2f} MB; a matrix product, {self.gemm_rate:.0f} GFLOP/s")
        self.figures.rows.append(
            {"id": f"size.{name}.solver_bytes", "value": int(ours["memory"]), "unit": "B", "n": 1, "gate": True}
        )
        for phase in PHASES:
            flops, size, us = ours[f"flops_{phase}"], ours[f"bytes_{phase}"], times[phase].median
            limit = flops / self.gemm_rate * 1e-3
            work = f"{flops * 1e-6:8.3f} MFLOP = {limit:8.1f} us at that rate, {limit / us:4.0%} of our time"
            print(f"    {phase:<10} {work}; {size * 1e-6:7.3f} MB streamed, {size / us * 1e-3:5.1f} GB/s")
            self.figures.rows.append(
                {"id": f"bench.{name}.{phase}.of_limit", "value": limit / us, "unit": "1", "n": 1, "gate": True}
            )

    def rigid_body(self, robot: str) -> None:
        from export_models import load

        model, _ = load(robot)
        rng = np.random.default_rng(0)
        import pinocchio as pin

        pin.seed(0)
        samples = [
            np.r_[pin.randomConfiguration(model, -np.ones(model.nq), np.ones(model.nq)), rng.uniform(-1, 1, 3 * model.nv)]
            for _ in range(256)
        ]
        file = self.numbers(f"{robot}_samples", *samples)
        peer_exe = self.peers / "pinocchio_bench"
        text = self.inputs / f"{robot}.txt"
        ours, theirs = run_json(self.ours, "compare", robot, file), run_json(peer_exe, text, "compare", file)
        holds = gate(robot, {name: difference(ours[name], theirs[name]) for name in theirs}, DERIVATIVE_TOLERANCE)
        single = run_json(self.single, "compare", robot, file)
        single_holds = gate_rigid_body_single(robot, single, theirs, model.nv)
        self.all_hold &= holds and single_holds

        mine, single, peer = alternate(
            self.rounds,
            [self.ours, "time", robot, file, self.n],
            [self.single, "time", robot, file, self.n],
            [peer_exe, text, "time", file, self.n],
        )
        self.figures.title(
            f"{robot}: beside Pinocchio 4.0 (own build, -march=native), one state after the other, in lanes, both in single"
        )
        for name in RIGID_BODY:
            rivals = [peer[p] for p in (name, f"{name}_world") if p in peer]  # the convention that is faster here
            best = min(rivals, key=lambda s: s.median)
            flops = ours.get(f"flops_{name}")
            self.figures.add(robot, name, mine[name], best, holds, flops)
            self.figures.add(robot, f"{name}_lanes", mine[f"{name}_lanes"], best, holds, flops)
            self.figures.add(robot, f"{name}.float", single[name], best, single_holds, flops)
            self.figures.add(robot, f"{name}_lanes.float", single[f"{name}_lanes"], best, single_holds, flops)

    def queries(self) -> None:
        """The memory: its tables beside scikit-learn, and one whole query."""
        import queries
        from threadpoolctl import threadpool_limits

        from engram.paths import TABLES

        program = self.ours.with_name("query_bench")
        with threadpool_limits(1):
            peer = queries.Peer(TABLES / "panda_reach")
            near, between = peer.draw()
            file = self.numbers("queries", np.hstack([near, between]))
            holds = gate(
                "queries, in units of their own", queries.errors(peer, run_json(program, "compare", file), near, between), 1.0
            )
            self.all_hold &= holds
            found = run_json(program, "time", file, max(20, self.n // 10))
            mine = {name: Samples(np.array(us)) for name, us in found.items() if isinstance(us, list)}
            theirs = {
                "knn": Samples(queries.one_by_one(peer.knn, near)),
                "gpr": Samples(queries.one_by_one(peer.gpr, between)),
            }
        self.figures.title(
            "query: the Panda's tables beside scikit-learn, one query at a time, and one whole query of the memory"
        )
        for name, samples in mine.items():
            self.figures.add("query", name, samples, theirs.get(name), holds, None)
            if name in peer.work:
                size, operations, read = peer.work[name]
                self.facts(f"query.{name}", size, operations, samples, read)
            calls = found[f"allocations.{name}"] if found["allocations.planted"] == heap.PLANTED else None
            self.allocations(f"query.{name}", calls, len(samples.us) * len(near))

    def learners(self) -> None:
        """Kinds of tables that the Panda's memory does not ask for, or not alone."""
        import learners
        from queries import one_by_one
        from threadpoolctl import threadpool_limits

        from engram.engine import engine
        from engram.learn.contenders import table_bytes

        self.figures.title("query: mixture, network, distance at the Panda's sizes beside scikit-learn's single predict")
        with threadpool_limits(1):
            for rival in learners.rivals():
                x, table = learners.inputs(rival), engine.Table(rival.table)
                mine, peer, holds, count = [], [], True, heap.Count()
                if rival.peer:
                    holds = gate(f"query {rival.name}", {"difference": learners.error(rival, x)}, rival.tolerance)
                    self.all_hold &= holds
                for _ in range(self.rounds):
                    mine.append(table.time_us(x, rival.answers))
                    if rival.peer:
                        peer.append(one_by_one(rival.peer, x))
                theirs = Samples(np.concatenate(peer)) if peer else None
                ours = Samples(np.concatenate(mine))
                self.figures.add("query", rival.name, ours, theirs, holds, None)
                self.facts(f"query.{rival.name}", table_bytes(rival.table), rival.operations, ours)
                self.allocations(f"query.{rival.name}", count.calls, len(ours.us))

    def facts(self, name: str, size: int, operations: int, ours: Samples, read: int | None = None) -> None:
        """Bytes, multiply-adds of a query; how much of our time it takes to read as many bytes as it does (default: all)."""
        from engram.engine import engine

        read = size if read is None else read
        limit = float(np.median(engine.read_us(read, 50)))
        share = f"reading {read} bytes takes {limit:.2f} us, {limit / ours.median:.0%} of our time"
        print(f"    {size} bytes, {operations} multiply-adds, {2e-3 * operations / ours.median:.1f} GFLOP/s; {share}")
        self.figures.rows.append(
            {"id": f"bench.{name}.of_bandwidth", "value": limit / ours.median, "unit": "1", "n": len(ours.us), "gate": True}
        )

    def allocations(self, name: str, calls: float | None, n: int) -> None:
        """The gate of no allocation: calls of the allocators in n timed queries, None if nobody counted."""
        holds = calls == 0
        self.all_hold &= holds
        seen = "not counted" if calls is None else f"{calls:g}"
        print(f"    allocations in {n} queries: {seen}, {'holds' if holds else 'FAILS'}")
        if calls is not None:
            self.figures.rows.append({"id": f"bench.{name}.allocations", "value": calls, "unit": "1", "n": n, "gate": holds})

    def trains(self) -> None:
        """Tensor trains beside PyTorch and teneva, networks beside PyTorch."""
        from threadpoolctl import threadpool_limits

        from engram import pytorch

        with threadpool_limits(1), pytorch.optional() as worker:
            if worker:
                self.sampling(worker)
                self.networks(worker)
            else:
                print(f"\nbench: {pytorch.MISSING}; its rows are left out: sampling of trains, ensembles, density networks")
            self.crosses()

    def sampling(self, worker) -> None:
        """Samples of random positive trains (figure 7.18); the gate: the probability of what we draw."""
        import trains

        from engram.study.sampling import Sides, calls_of

        self.figures.title(
            "tt: samples of a train, alpha 0.9, beside PyTorch (algorithm 6 as printed; tuned) and teneva (alpha 0)"
        )
        for case, counts in trains.CASES:
            sides = Sides(case, worker)
            holds = gate(f"train d={case.d} n={case.n} r={case.r}", {"log probability": sides.error()}, case.tolerance)
            self.all_hold &= holds
            for count in counts:
                allocated = heap.Count()
                us = {name: Samples(values) for name, values in sides.times_us(count, self.rounds).items()}
                for name, key in (("pytorch", "sample"), ("tuned", "sample_tuned"), ("teneva", "sample_teneva")):
                    if name in us:
                        self.figures.add("tt", f"{key}.{case.name(count)}", us["ours"], us[name], holds, None)
                work = (sides.ours.bytes, case.operations(count), us["ours"], case.bytes_read(count))
                self.facts(f"tt.sample.{case.name(count)}", *work)
                self.allocations(f"tt.sample.{case.name(count)}", allocated.calls, calls_of(count) * len(us["ours"].us))

    def networks(self, worker) -> None:
        """Ensembles and mixture density networks."""
        import learners
        import trains

        from engram.engine import engine
        from engram.learn.contenders import table_bytes

        x, y, domain = learners.data()
        self.figures.title("query: networks at the Panda's sizes beside PyTorch, one query at a time")
        for name, network in trains.networks(x, y).items():
            table = trains.table(network, domain)
            ours, queries = engine.Table(table), x[: learners.QUERIES]
            holds = gate(f"query {name}", trains.error(network, ours, worker, x.min(0), x.max(0)), trains.TOLERANCE)
            self.all_hold &= holds
            mine, peer, count = [], [], heap.Count()
            for _ in range(self.rounds):
                mine.append(ours.time_us(queries, trains.answers(network)))
                peer.append(worker.ask("predict_one_by_one", x=queries)["us"])
            samples = Samples(np.concatenate(mine))
            self.figures.add("query", name, samples, Samples(np.concatenate(peer)), holds, None)
            self.facts(f"query.{name}", table_bytes(table), trains.operations(network), samples)
            self.allocations(f"query.{name}", count.calls, len(samples.us))

    def crosses(self) -> None:
        """Cross approximation of table 7.1's density; the gate: samples of our train succeed as often as teneva's."""
        import trains

        from engram.study.sampling import BEST_OF, crosses

        print(f"\ntt: cross approximation of table 7.1's density, the best of {BEST_OF} seeds on validation tasks,")
        print(f"    beside one of teneva's, same starts, same rank, {len(trains.SEEDS)} times by turns")
        found = list(crosses(trains.SEEDS, trains.TESTS))
        sides = {who: [cross for cross in found if cross.who == who] for who in ("ours", "teneva")}
        seconds = {who: Samples(np.array([1e6 * cross.seconds for cross in side])) for who, side in sides.items()}
        success = {who: float(np.mean([cross.success for cross in side])) for who, side in sides.items()}
        holds = gate("cross, success of one sample", {"below teneva's": max(0.0, success["teneva"] - success["ours"])}, 1e-12)
        self.all_hold &= holds
        self.figures.title(f"tt: rank {found[0].rank}")
        self.figures.add("tt", "cross", seconds["ours"], seconds["teneva"], holds, None)
        for who, side in sides.items():
            share = f"success of one sample {success[who]:.1%} of {trains.TESTS} tasks"
            print(f"    {who:<7} {share}; {side[0].values} values of the density")
        row = {"id": "bench.tt.cross_success", "value": success["ours"], "unit": "1", "n": trains.TESTS, "gate": holds}
        self.figures.rows.append({**row, "peer": success["teneva"]})

    def prepare(self) -> None:
        """The peers; and the limit of arithmetic: the best rate of a matrix product, under our flags and the machine's own."""
        build_peers(self.peers)
        export_models(self.inputs)
        mine, peer = alternate(1, [self.ours, "gemm", 50], [self.peers / "pinocchio_bench", "-", "gemm", 50])
        rate = {
            side: max(2 * int(name.removeprefix("gemm")) ** 3 / s.us.min() * 1e-3 for name, s in samples.items())
            for side, samples in (("ours", mine), ("native", peer))
        }
        self.figures.rows += [
            {"id": f"bench.gemm.{side}", "value": value, "unit": "GFLOP/s", "n": 50, "gate": True} for side, value in rate.items()
        ]
        self.gemm_rate, native = rate["ours"], rate["native"]
        print(f"matrix product (Eigen, double): {self.gemm_rate:.0f} GFLOP/s under our flags, {native:.0f} with -march=native")


def main() -> int:
    parts = [*PROBLEMS, *ROBOTS, "memory", "trains"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=Path, default=ROOT / "build", help="build folder (default: build)")
    parser.add_argument("--rounds", type=int, default=7, help="how often the two sides alternate (default: 7)")
    parser.add_argument("-n", type=int, default=300, help="samples per round of the smallest problem (default: 300)")
    parser.add_argument("--only", nargs="+", choices=parts, metavar="PART", help=f"of {', '.join(parts)}")
    args = parser.parse_args()
    heap.restart_counting(args.build.resolve() / "bench" / "libcount_heap.so")
    bench = Bench(args.build.resolve(), args.rounds, args.n)
    only = args.only or parts
    if {*PROBLEMS, *ROBOTS} & set(only):
        bench.prepare()
    for name in (name for name in PROBLEMS if name in only):
        bench.problem(name)
    for robot in (robot for robot in ROBOTS if robot in only):
        bench.rigid_body(robot)
    if "memory" in only:
        bench.queries()
        bench.learners()
    if "trains" in only:
        bench.trains()
    out = args.build / "figures" / "bench.json"
    bench.figures.write(out)
    print(f"\nwrote {out}")
    if not bench.all_hold:
        print("error: a gate does not hold; its ratios are left out", file=sys.stderr)
    return not bench.all_hold


if __name__ == "__main__":
    raise SystemExit(main())
