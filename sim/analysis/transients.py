"""Answers of friction to a jump of the speed, and of the contact area to a force that grows from rest."""

import functools
import math
from typing import Any

import numpy as np
import xarray as xr

from sim.analysis.scene import MEMBERS, in_pieces, speed_name, speed_of, sweep_dims, with_trajectories, word
from sim.analysis.stick_slip import LEAST

#: A speed jumps between two records if it changes by more than this many times what it does before and after.
_JUMP = 4.0
#: A force begins at zero if it is below this share of its largest, and a change below it in parts is of rounding.
_REST, _ROUNDING = 0.01, 1e-9
#: Share of the largest force up to which the law of incipient shear is fitted.
_FITTED = 0.5
_STEP = {
    "direct_effect": ("N", "rise of friction after the first jump of the speed to a higher one"),
    "step_overshoot": ("N", "largest friction after the first jump of the speed over the level at which it settles"),
    "step_length": ("m", "sliding distance after a jump until friction stays within 1/e of the overshoot of its level"),
}
_PULL = {
    "static_threshold": ("N", "largest force on the way to sliding"),
    "area_at_threshold": ("1", "contact area at the static threshold over that at rest"),
    "area_by_law": ("1", "what A0 - alpha Q^2 gives of the area at rest there, fitted up to half of that force"),
    "incipient_alpha": ("m^2/N^2", "coefficient alpha of A0 - alpha Q^2"),
}


def jumps(speed: np.ndarray, turns: bool = False) -> np.ndarray:
    """Records before which the speed has jumped: its change stands out from those before and after.

    With ``turns`` also those before which it has changed its sign.

    >>> jumps(np.array([1.0, 1.0, 1.0, -1.0, -1.0, -1.0]))
    array([3])
    >>> jumps(np.array([2.0, 1.0, -1.0, -2.0])), jumps(np.array([2.0, 1.0, -1.0, -2.0]), turns=True)
    (array([], dtype=int64), array([2]))
    """
    change = np.abs(np.diff(speed))
    jumped = np.append(False, change[1:-1] > _JUMP * np.maximum(change[:-2], change[2:]))
    turned = (speed[1:] * speed[:-1] < 0.0) & turns
    return np.flatnonzero(np.pad(jumped, (0, change.size - jumped.size)) | turned) + 1


def speed_step(dataset: xr.Dataset) -> xr.Dataset:
    """Answer of friction to the first jump of the prescribed speed to a higher one, of each member.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        ``direct_effect`` [N], the rise of friction from before the jump to its largest value before the next one;
        ``step_overshoot`` [N] of that over the mean of the second half of this time; ``step_length`` [m], how far the
        slider goes from the jump until friction stays within 1/e of the overshoot of that mean. nan where friction does
        not overshoot, or settle in the first half of the time. Empty where no speed is prescribed, or it does not jump.
    """
    if bool((word(dataset, "drive.model", "") == "force").any()) or speed_name(dataset) not in dataset:
        return xr.Dataset()
    speeds = speed_of(dataset).transpose(..., "t").to_numpy()
    if not any(_rise(own) for own in speeds.reshape(-1, speeds.shape[-1])):
        return xr.Dataset()
    return _of_each(dataset, _STEP, _stepped, speed_name(dataset), "friction_force", "slider_position")


def _rise(speed: np.ndarray) -> tuple[int, int] | None:
    """The record at which the speed has first jumped to a higher one, and that of the next jump."""
    places = [*jumps(speed), len(speed)]
    rises = [n for n, at in enumerate(places[:-1]) if 0.0 < speed[at - 1] * np.sign(speed[at]) < abs(speed[at])]
    return (places[rises[0]], places[rises[0] + 1]) if rises else None


def _stepped(speed: np.ndarray, force: np.ndarray, position: np.ndarray) -> tuple[float, ...]:
    """What ``speed_step`` gives of one trajectory."""
    unknown = (math.nan,) * len(_STEP)
    if (place := _rise(speed)) is None:
        return unknown
    start, stop = place
    after = force[start:stop] * np.sign(speed[start])
    half = len(after) // 2
    level, most = np.mean(after[half:]), np.max(after)
    over = most - level
    if not over > _ROUNDING * abs(level):
        return unknown
    beyond = np.abs(after - level) - over / math.e
    last = int(np.flatnonzero(beyond > 0.0)[-1])
    if last + 1 >= half:
        return unknown
    gone = np.abs(position[start + last : start + last + 2] - position[start - 1])
    share = beyond[last] / (beyond[last] - beyond[last + 1])
    return most - force[start - 1] * np.sign(speed[start]), over, gone[0] + share * (gone[1] - gone[0])


def way_to_sliding(dataset: xr.Dataset) -> xr.Dataset:
    """Static threshold of a slider that a stage pulls from rest, and the contact area on the way there, of each member.

    Parameters
    ----------
    dataset : xarray.Dataset
        As ``sim run`` writes it.

    Returns
    -------
    xarray.Dataset
        ``static_threshold`` [N], the force of the spring before it first falls; ``area_at_threshold`` [1], the contact
        area there over that at rest; ``area_by_law`` [1], what A0 - alpha Q^2 gives there; ``incipient_alpha``
        [m^2/N^2], see ``incipient_law``. nan where the force does not fall while the stage is not slowed down, or the
        area does not. Empty where no stage pulls.
    """
    if "stage_speed" not in dataset:
        return xr.Dataset()
    return _of_each(dataset, _PULL, _pulled, "stage_speed", "spring_force", "contact_area")


def _pulled(speed: np.ndarray, force: np.ndarray, area: np.ndarray) -> tuple[float, ...]:
    """What ``way_to_sliding`` gives of one trajectory."""
    slowed = np.flatnonzero(np.diff(np.abs(speed)) < 0.0) + 1
    turned = np.flatnonzero(speed[1:] * speed[:-1] < 0.0) + 1
    force = np.abs(force[: min([*slowed[:1], *turned[:1], len(force)])])
    top, alpha = incipient_law(force, area)
    known = force[0] <= _REST * force[top] and np.nanmin(force[top:]) < (1.0 - _ROUNDING) * force[top]
    if not (known and area[top] < (1.0 - _ROUNDING) * area[0]):
        return (math.nan,) * len(_PULL)
    return force[top], area[top] / area[0], 1.0 - alpha * force[top] ** 2 / area[0], alpha


def incipient_law(force: np.ndarray, area: np.ndarray) -> tuple[int, float]:
    """The record at which a force [N] is largest before it first falls by 2 %, and alpha of A0 - alpha Q^2 [m^2/N^2].

    That is fitted to the area [m^2] by least squares up to half of the largest force.

    >>> top, alpha = incipient_law(np.array([0.0, 1.0, 2.0, 3.0, 1.0]), np.array([8.0, 7.9, 7.6, 7.0, 7.0]))
    >>> print(top, round(alpha, 3))
    3 0.1
    """
    fallen = np.flatnonzero(force < (1.0 - LEAST) * np.fmax.accumulate(force))
    top = int(np.nanargmax(force[: fallen[0]] if fallen.size else force))
    small = np.flatnonzero(force[:top] <= _FITTED * force[top])
    with np.errstate(invalid="ignore"):  # no force at all
        alpha = np.sum(force[small] ** 2 * (area[0] - area[small])) / np.sum(force[small] ** 4)
    return top, float(alpha)


def _of_each(dataset: xr.Dataset, described: dict[str, tuple[str, str]], of: Any, *read: str) -> xr.Dataset:
    """What a function gives of the trajectories ``read`` of each member, described by units and meanings."""
    first = dataset[read[-1]]
    outer = [name for name in (*sweep_dims(dataset), MEMBERS) if name in first.dims]
    block = functools.partial(_block, described=described, of=of, read=read)
    return in_pieces(with_trajectories(dataset, *read), outer, block)


def _block(dataset: xr.Dataset, described: dict[str, tuple[str, str]], of: Any, read: tuple[str, ...]) -> xr.Dataset:
    series = [dataset[name].astype(float).broadcast_like(dataset[read[-1]]) for name in read]
    dims: Any = {"input_core_dims": [["t"]] * len(read), "output_core_dims": [[]] * len(described), "vectorize": True}
    found = xr.apply_ufunc(of, *series, **dims)
    about = ((name, one, *described[name]) for name, one in zip(described, found, strict=True))
    return xr.Dataset({name: one.assign_attrs(units=unit, long_name=text) for name, one, unit, text in about})
