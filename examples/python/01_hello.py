"""Two blocks on the floor, pushed sideways: one sticks, one slides. 01_hello_batch.cpp in Python."""

import numpy as np

import stiction

A = np.tile(np.eye(3), (2, 1, 1))  # blocks of 1 kg: J M^-1 J' is the identity
b = np.array([[-9.81, 2.0, 0.0], [-9.81, 6.0, 0.0]])  # acceleration without contact: normal, two tangents [m/s2]

batch = stiction.Batch.from_delassus(A, b, mu=0.5, law="coulomb")
solution = stiction.Solver(device="cpu", solver="npgs").solve(batch)

for lambda_, w, status in zip(solution.lambda_, solution.w, solution.status):
    print(f"normal {lambda_[0]:.3f} N, friction {lambda_[1]:.3f} N, slides at {w[1]:.3f} m/s2: "
          f"{stiction.CODES[status['code']]}")
