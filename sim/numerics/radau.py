"""Numbers of Radau IIA of three stages, order 5 (Hairer & Wanner, Solving ODEs II, IV.8)."""

import math

import numpy as np

_S6 = math.sqrt(6.0)
#: Places of the nodes in a step, and their weights in an integral over it.
NODES = np.array([(4.0 - _S6) / 10.0, (4.0 + _S6) / 10.0, 1.0])
SHARES = np.array([(16.0 - _S6) / 36.0, (16.0 + _S6) / 36.0, 1.0 / 9.0])
#: Derivatives of what vanishes at the start, over the step, from the values at the nodes.
RATES = np.array(
    [
        [2.0 + _S6 / 2.0, -1.2 + 29.0 * _S6 / 30.0, 0.4 - 4.0 * _S6 / 15.0],
        [-1.2 - 29.0 * _S6 / 30.0, 2.0 - _S6 / 2.0, 0.4 + 4.0 * _S6 / 15.0],
        [-1.0 + 8.0 * _S6 / 3.0, -1.0 - 8.0 * _S6 / 3.0, 5.0],
    ]
)
#: Real eigenvalue of ``RATES``.
PACE = 3.637834252744496
