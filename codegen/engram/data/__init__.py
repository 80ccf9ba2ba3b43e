"""Data: tasks drawn at random and solved by the compiled solver, in a pool of processes that may be stopped at any time."""
