"""`engram fit talos step`: the memory of steps, its held-out figures, its tables."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from engram.data.step_set import NAME, StepData, load
from engram.data.steps import WALK, WALKS
from engram.emit import write_tables
from engram.engine import engine
from engram.inputs import InputError
from engram.learn.figures import write_figures
from engram.learn.steps import Settings, StepTables, fit
from engram.paths import relative

HELD_OUT = 20  # every twentieth step
FEWEST = 500  # steps of a foot below which a fit is refused
LIMIT = 1_000_000  # bytes of the tables
QUERIES = 5000


def split(steps: StepData) -> tuple[StepData, StepData]:
    """Steps to learn from and held-out ones."""
    held = np.arange(len(steps)) % HELD_OUT == HELD_OUT - 1
    return steps.part(~held), steps.part(held)


def steps_in(sets: list[StepData]) -> int:
    """Steps of both feet and of the walks."""
    return sum(map(len, sets[:WALKS])) + WALK * len(sets[WALKS])


def nbytes(tables: StepTables) -> int:
    """Bytes of all arrays."""
    return sum(4 * item.words.size for table in tables.all for item in table.arrays())


def fit_and_write(data: Path, out: Path) -> None:
    """Fit on all but the held-out steps, write tables/talos_step/, print and record the figures. Raises InputError."""
    sets, digest, made_from = load(data)
    if min(map(len, sets[:WALKS])) < FEWEST:
        raise InputError(f"{relative(data)}: holds {min(map(len, sets[:WALKS]))} steps of a foot, at least {FEWEST} are needed; "
                         "run `engram data talos step` with a larger --n")  # fmt: skip
    train, test = zip(*map(split, sets), strict=True)
    print(f"fit:    {steps_in(sets)} steps, {steps_in(test)} of them held out", flush=True)
    tables = fit(list(train), list(test), Settings())
    size = nbytes(tables)
    if size > LIMIT:
        raise InputError(f"the tables take {size} bytes, the limit is {LIMIT}: fit fewer samples or coefficients")
    manifest = write_tables(
        out / NAME,
        NAME,
        list(tables.all),
        robot_digest=engine.talos.digest,
        task_digest=engine.TalosSteps.digest,
        data_digest=digest,
        provenance=f"engram fit talos step; {made_from}; {steps_in(train)} steps",
    )
    n = steps_in(test)
    figures = [(f"{table.role}.rms", table.held_out_error, table.held_out_text.split("]")[0][1:], n)
               for table in tables.all]  # fmt: skip
    x, problem = test[0].X[0], engine.TalosSteps()
    problem.set(x[:6].reshape(2, 3), x[None, 6:], 0)
    us = tables.memory().query_us(x[:6].reshape(2, 3), x[6:], 0, problem.x0, QUERIES)
    figures += [("bytes", float(size), "byte", 1)]
    figures += [(f"query_us.p{p}", float(np.percentile(us, p)), "us", QUERIES) for p in (50, 99)]
    for key, value, unit, _ in figures:
        print(f"fit:    {key:<14} {value:.4g} {unit}")
    write_figures("fit_step", [(f"fit.{NAME}.{key}", *rest) for key, *rest in figures])
    print(f"fit:    {relative(out / NAME)}: {len(manifest['files'])} files")
