"""The `engram` command: finds the subcommand's module, lets it parse its arguments, and runs it."""

import argparse
import ast
import importlib
import pkgutil
import sys
from pathlib import Path

from engram import __version__, commands
from engram.inputs import InputError, closest

EXAMPLES = """examples:
  engram robot panda            write tables/panda/robot.h and robot.xml from the URDF
  engram task panda reach       write tables/panda_reach/task.h and the scene for MuJoCo
  engram <command> --help       arguments and examples of one command
"""


def summaries() -> dict[str, str]:
    """Names of the subcommands and the first line of their docstrings, read without importing them."""
    folder = Path(commands.__path__[0])
    found = {}
    for module in pkgutil.iter_modules([str(folder)]):
        docstring = ast.get_docstring(ast.parse((folder / f"{module.name}.py").read_text(encoding="utf-8"))) or ""
        found[module.name] = docstring.partition("\n")[0].rstrip(".")
    return found


def build_parser(asked: str | None = None) -> argparse.ArgumentParser:
    """The parser: summaries of all subcommands, arguments of the one that is `asked` for."""
    parser = argparse.ArgumentParser(
        prog="engram",
        description="Engram, offline: from robot models and solved tasks to the tables the controller flies on.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"engram {__version__}")
    subparsers = parser.add_subparsers(dest="command", metavar="<command>", required=True)
    for name, summary in summaries().items():
        if name == asked:
            module = importlib.import_module(f"engram.commands.{name}")
            added = module.add_parser(subparsers)
            added.formatter_class = argparse.RawDescriptionHelpFormatter
            added.set_defaults(run=module.run)
        else:
            subparsers.add_parser(name, help=summary)
    return parser


def main(argv: list[str] | None = None) -> int:
    """Run `engram <argv>`. Exit code: 0 done, 2 wrong input (one message on stderr), else the subcommand's own."""
    argv = sys.argv[1:] if argv is None else argv
    asked = argv[0] if argv else None
    try:
        if asked is not None and not asked.startswith("-") and asked not in summaries():
            raise InputError(f"unknown command '{asked}'; {closest(asked, list(summaries()))}")
        args = build_parser(asked).parse_args(argv)
        return args.run(args) or 0
    except InputError as error:
        print(f"engram: error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("engram: interrupted", file=sys.stderr)
        return 130
