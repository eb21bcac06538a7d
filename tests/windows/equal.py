"""Compare two datasets in the Windows Python: ``equal.py A B`` prints "equal" if all numbers are, bit for bit."""

import sys

import netCDF4
import numpy as np


def numbers(path):
    """Return the bytes of each variable of a file."""
    with netCDF4.Dataset(path) as file:
        file.set_auto_mask(False)
        return {
            name: np.asarray(variable[:]).tobytes()
            for name, variable in file.variables.items()
        }


if __name__ == "__main__":
    first, second = map(numbers, sys.argv[1:])
    print("equal" if first == second else "different")
