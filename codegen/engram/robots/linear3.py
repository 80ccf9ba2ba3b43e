"""3-vectors and 3x3 matrices to the same bits on every machine, which BLAS and LAPACK do not promise: sums run in order."""

import math

import numpy as np

SWEEPS = 12  # of Jacobi rotations; convergence is quadratic, five reach rounding


def product(*factors: np.ndarray) -> np.ndarray:
    """Product of 3x3 matrices, the last of which may be a 3-vector."""
    result = factors[0]
    for factor in factors[1:]:
        result = sum(np.multiply.outer(result[:, k], factor[k]) for k in range(3))
    return result


def unit(v: np.ndarray) -> np.ndarray:
    """v / |v|."""
    return v / math.hypot(*v)


def turn_to(axis: np.ndarray) -> np.ndarray:
    """A rotation whose third column is `axis`; a cyclic permutation, without rounding, for an axis along x, y or z."""
    i = int(np.argmax(np.abs(axis)))
    x = np.eye(3)[(i + 1) % 3]
    x = unit(x - axis * axis[(i + 1) % 3])
    return np.column_stack([x, np.cross(axis, x), axis])


def principal_axes(inertia: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Moments m (3, ascending) and right-handed axes R (3, 3) with R diag(m) R^T = inertia, by Jacobi rotations."""
    A, R = np.array(inertia), np.eye(3)
    for _ in range(SWEEPS):
        for p, q in ((0, 1), (0, 2), (1, 2)):
            if A[p, q] == 0.0:
                continue
            # t = tan of the angle that zeroes A[p, q], the smaller of the two
            theta = float(A[q, q] - A[p, p]) / (2.0 * float(A[p, q]))
            t = math.copysign(1.0, theta) / (abs(theta) + math.hypot(theta, 1.0))
            c = 1.0 / math.hypot(t, 1.0)
            J = np.eye(3)
            J[p, p] = J[q, q] = c
            J[p, q], J[q, p] = t * c, -t * c
            A, R = product(J.T, A, J), product(R, J)
            A[p, q] = A[q, p] = 0.0
    order = np.argsort(np.diag(A), kind="stable")
    moments, R = np.diag(A)[order], R[:, order]
    handed = np.cross(R[:, 0], R[:, 1])
    return moments, np.column_stack([R[:, 0], R[:, 1], handed])
