"""Look at generated tables: what they hold, whether they are whole, how two generations differ."""

import argparse
from pathlib import Path

from engram.inputs import InputError, closest
from engram.paths import TABLES, relative

EXAMPLES = """examples:
  engram table info panda_reach              what the tables in tables/panda_reach hold
  engram table info panda_reach knn          one of them: its inputs with units and domain, and its arrays
  engram table check                         every table: files, digests, robot and task they belong to
  engram table diff tables/panda_reach old/  largest difference of every array
"""


def add_parser(subparsers) -> argparse.ArgumentParser:
    """Arguments of `engram table`."""
    parser = subparsers.add_parser("table", help=__doc__, description=__doc__, epilog=EXAMPLES)
    actions = parser.add_subparsers(dest="action", metavar="<action>", required=True)
    info = actions.add_parser("info", help="kinds, sizes and held-out errors")
    info.add_argument("folder", help="a folder, or its name in tables/")
    info.add_argument("role", nargs="?", help="one table of it, by its name or the part between folder and version")
    check = actions.add_parser("check", help="compare files, data and digests; exit code 1 if something is wrong")
    check.add_argument("folder", nargs="*", help="folders, or their names in tables/ (default: all)")
    diff = actions.add_parser("diff", help="compare two folders; exit code 1 if they differ")
    diff.add_argument("folder", nargs=2, help="folders, or their names in tables/")
    return parser


def table_folder(name: str) -> Path:
    """The folder a user means: a path, or a name in tables/."""
    known = sorted(path.parent.name for path in TABLES.glob("*/MANIFEST.json"))
    for folder in (Path(name), TABLES / name):
        if (folder / "MANIFEST.json").is_file():
            return folder
    mend = closest(name, known) if known else "run 'make tables'"
    raise InputError(f"'{name}' holds no MANIFEST.json; {mend}")


def info(folder: Path) -> int:
    """Print the manifest for people."""
    from engram.emit.read import read_manifest

    manifest = read_manifest(folder)
    total = sum(f["bytes"] for f in manifest["files"].values())
    print(f"{manifest['name']}: {manifest['provenance']}")
    print(f"robot {manifest['robot_digest']}  task {manifest['task_digest']}  data {manifest['data_digest']}")
    for table in manifest["tables"]:
        sizes = "  ".join(f"{key} {value:g}" for key, value in table["sizes"].items())
        print(f"  {table['name']:<24} {table['kind']:<6} {table['bytes']:>8} bytes  {sizes}")
        print(f"  {'':<24} held-out error {table['held_out_error']:.4g} {table['held_out_text']}")
    print(f"{len(manifest['files'])} files, {total} bytes in the tree")
    return 0


def detail(folder: Path, role: str) -> int:
    """Print one table for people: inputs with units and domain, arrays with their storage."""
    from engram.emit.read import read_folder

    manifest, tables = read_folder(folder)
    short = {table.name.removeprefix(f"{manifest['name']}_").rpartition("_v")[0]: table for table in tables}
    table = short.get(role) or next((table for table in tables if table.name == role), None)
    if table is None:
        raise InputError(f"{relative(folder)} holds no table '{role}'; {closest(role, list(short))}")
    print(f"{table.name}: {table.kind}, digest 0x{table.digest:016x}, {table.entry['bytes']} bytes")
    print(f"held-out error {table.entry['held_out_error']:.4g} {table.entry['held_out_text']}")
    print("sizes  " + "  ".join(f"{key} {value:g}" for key, value in table.entry["sizes"].items()))
    lo, hi = (table.arrays[i].flat for i in (0, 1))
    for (name, unit), a, b in zip(table.inputs, lo, hi, strict=True):
        print(f"  input {name:<12} {a:>11.4g} .. {b:<11.4g} {unit}")
    for array in table.arrays[2:]:
        print(f"  array {array.name:<12} {array.flat.size:>9} {array.type}, {4 * array.words.size} bytes")
    return 0


def expected_digests(name: str) -> dict[str, int]:
    """Digests in tables/<robot>/robot.h and tables/<robot>_<task>/task.h, where these files exist."""
    from engram.emit.digests import header_digest

    robot, task = TABLES / name.partition("_")[0] / "robot.h", TABLES / name / "task.h"
    found = {"robot": robot, "task": task}
    return {key: header_digest(path) for key, path in found.items() if path.is_file()}


def check(folder: Path) -> int:
    """Print what is wrong with a folder, if anything."""
    from engram.emit.read import faults, read_manifest

    found = faults(folder)
    manifest = read_manifest(folder)
    for key, digest in expected_digests(manifest["name"]).items():
        if manifest[f"{key}_digest"] != f"0x{digest:016x}":
            found.append(f"made for another {key}: its digest is {manifest[f'{key}_digest']}, the {key} is 0x{digest:016x}")
    for fault in found:
        print(f"{relative(folder)}: {fault}; run 'make tables'")
    if not found:
        print(f"{relative(folder)}: {len(manifest['tables'])} tables whole, {len(manifest['files'])} files")
    return bool(found)


def diff(first: Path, second: Path) -> int:
    """Print how the tables of two folders differ."""
    import numpy as np

    from engram.emit.read import read_folder

    tables = [{table.name: table for table in read_folder(folder)[1]} for folder in (first, second)]
    differ = False
    for name in sorted({*tables[0], *tables[1]}):
        if any(name not in side for side in tables):
            print(f"{name}: only in {relative(first if name in tables[0] else second)}")
            differ = True
            continue
        a, b = (side[name] for side in tables)
        if (a.digest, a.robot_digest, a.task_digest) == (b.digest, b.robot_digest, b.task_digest):
            print(f"{name}: same")
            continue
        differ = True
        for own, other in zip(a.arrays, b.arrays):
            if own.flat.size != other.flat.size:
                print(f"{name}.{own.name}: {own.flat.size} and {other.flat.size} numbers")
            elif not np.array_equal(own.flat, other.flat):
                gap = np.abs(own.flat.astype(float) - other.flat.astype(float))
                print(f"{name}.{own.name}: {np.count_nonzero(gap)} of {gap.size} differ, by at most {gap.max():.3g}")
        for key in ("robot_digest", "task_digest"):
            if getattr(a, key) != getattr(b, key):
                print(f"{name}: {key} 0x{getattr(a, key):016x} and 0x{getattr(b, key):016x}")
    return differ


def run(args: argparse.Namespace) -> int:
    """Run the action."""
    if args.action == "info":
        folder = table_folder(args.folder)
        return detail(folder, args.role) if args.role else info(folder)
    if args.action == "diff":
        return int(diff(*(table_folder(name) for name in args.folder)))
    folders = args.folder or sorted(str(path.parent) for path in TABLES.glob("*/MANIFEST.json"))
    if not folders:
        raise InputError("tables/ holds no MANIFEST.json; run 'make tables'")
    return max([check(table_folder(name)) for name in folders])
