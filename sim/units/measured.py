"""Tables of what was measured: CSV columns named as variables, with units, and beside them their errors."""

import difflib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.units.quantity import Quantity
from sim.units.refusals import BadInput
from sim.units.table import TableError, columns, headings, plain_text

Array = NDArray[np.float64]

#: End of the names of columns with standard errors.
ERROR = "_error"


class Points(NamedTuple):
    """Values of a column [SI] with their standard errors, None where unknown."""

    values: Array
    errors: Array | None


def read(path: Path, known: Mapping[str, Quantity], outcomes: Mapping[str, Quantity]) -> dict[str, Points]:
    """Columns of a table of measured values.

    Parameters
    ----------
    path : Path
        CSV with a header such as ``speed [mm/s], contact_area [mm^2], contact_area_error [mm^2]``.
    known : dict of str to Quantity
        All names that a column may have.
    outcomes : dict of str to Quantity
        Those that may have a column of standard errors beside them, in the same dimension or in ``[%]``.

    Raises
    ------
    BadInput
        With one line.
    """
    try:
        return _columns(plain_text(path), known, outcomes)
    except UnicodeDecodeError:
        raise BadInput([f"{path}: is not UTF-8 text; save it as plain CSV in UTF-8"]) from None
    except OSError as fault:
        raise BadInput([f"{path}: cannot be read ({fault.strerror}); name a CSV file"]) from None
    except TableError as fault:
        raise BadInput([f"{path}: {fault}"]) from None


def given(columns: Mapping[str, Any], known: Mapping[str, Quantity]) -> dict[str, Points]:
    """Columns of measured values [SI] by name, beside some their errors.

    Raises
    ------
    ValueError
        For a name that is not known, or columns of different lengths.
    """
    found = {str(name): np.asarray(values, float) for name, values in columns.items()}
    for name in found:
        if name not in known and not (name.endswith(ERROR) and name.removesuffix(ERROR) in found):
            raise ValueError(_unknown(name, known))
    if len({values.shape for values in found.values()}) != 1 or next(iter(found.values())).ndim != 1:
        raise ValueError("measured columns need the same number of rows; give arrays of one length")
    return {name: Points(values, found.get(name + ERROR)) for name, values in found.items() if name in known}


def _columns(text: str, known: Mapping[str, Quantity], outcomes: Mapping[str, Quantity]) -> dict[str, Points]:
    units = headings(text)
    wanted: dict[str, Quantity] = {}
    for name, unit in units.items():
        base = name.removesuffix(ERROR)
        if name in known:
            wanted[name] = known[name]
        elif base in outcomes and base in units:
            wanted[name] = Quantity("1" if _relative(unit, outcomes[base]) else outcomes[base].unit, name, above=0)
        else:
            raise TableError(_unknown(name, known))
    bare = [name for name, quantity in wanted.items() if not units[name] and quantity.unit != "1"]
    if bare and any(units.values()):
        said = f'column "{bare[0]}" has no unit where others have one; write "{bare[0]} [{wanted[bare[0]].unit}]"'
        raise TableError(f"{said} if that is its unit")
    found = columns(text, wanted)
    points = {}
    for name in (name for name in found if name in known):
        values, errors = found[name], found.get(name + ERROR)
        if errors is not None and _relative(units[name + ERROR], known[name]):
            errors = errors * np.abs(values)
        if errors is not None and not np.all(errors > 0.0):
            raise TableError(f'column "{name}" has a value of 0, whose relative error says nothing; give it in units')
        points[name] = Points(values, errors)
    return points


def _relative(unit: str, quantity: Quantity) -> bool:
    """Whether an error with this unit's text is a share of the value."""
    return unit == "%" and quantity.unit != "1"


def _unknown(name: str, known: Iterable[str]) -> str:
    """What to do about a column that is neither a condition nor a variable."""
    shown = name[:40]
    if name.endswith(ERROR) and name.removesuffix(ERROR) in known:
        return f'column "{shown}" is the error of a column that is missing; add it, or leave the error out'
    near = difflib.get_close_matches(shown, [*known], 1, 0.6)
    cure = f'did you mean "{near[0]}"?' if near else "leave it out, or give it the name of one (docs/dataset.md)"
    return f'column "{shown}" is neither a variable of a dataset nor a number of the scenario; {cure}'
