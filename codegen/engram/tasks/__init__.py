"""Tasks: a task vector with ranges, a horizon, weights and a world, and the distribution tasks are drawn from."""
