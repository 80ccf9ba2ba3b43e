"""One module per subcommand of `engram`; a new file here is a new subcommand, nothing else is to be edited.

A module <name>.py holds

    a docstring                     whose first line is the summary shown by `engram --help`
    def add_parser(subparsers)      adds and returns `subparsers.add_parser("<name>", ...)` with its arguments
    def run(args) -> int | None     does the work; returns the exit code (None: 0)

It is imported only when it is asked for, so a heavy or broken one does not disturb the others.
"""
