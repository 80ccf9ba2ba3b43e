"""Learning: solved optimal control problems -> compact trajectories, neighbours, regressors and their trust."""
