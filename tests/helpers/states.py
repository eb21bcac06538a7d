"""States of a march as named arrays, and the march from a state that was laid aside."""

import pickle

import numpy as np


def arrays(state, above=""):
    """The arrays of a state, ``{"bonds.bound": ...}``."""
    named = {}
    for name, value in state._asdict().items():
        inside = isinstance(value, tuple)
        named |= arrays(value, f"{above}{name}.") if inside else {above + name: np.array(value)}
    return named


def laid_aside(state):
    """A state that shares no memory with this one."""
    return pickle.loads(pickle.dumps(state))
