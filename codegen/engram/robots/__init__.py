"""One kinematic tree per robot: URDF -> C++ constants and MJCF, in one pass."""
