"""The figure of the competing theories: contact area under shear by each of them, and what was simulated."""

import contextlib
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim.analysis import control, is_steady, setting, settled
from sim.analysis.scene import of_dataset
from sim.laws.theories import compare_at_indentation, compare_at_load
from sim.plots import style
from sim.plots.curves import choice

#: Name of each theory, its colour and line style.
_THEORIES: dict[str, tuple[str, str, Any]] = {
    "jkr": ("JKR; Menga, Carbone & Dini 2019", style.REFERENCE, "--"),
    "hertz": ("Hertz", style.REFERENCE, ":"),
    "uncorrected": ("Menga et al. 2018, uncorrected", style.LINES[4], "-"),
    "savkoor_briggs": ("Savkoor & Briggs, full stick", style.LINES[1], "-"),
    "reversible_force": ("reversible, force held", style.LINES[5], "--"),
    "reversible_stress": ("reversible, stress held", style.LINES[2], "-"),
    "fraction": ("a fraction {share:.3g} reversible", style.LINES[3], "-."),
    "scaled_angle": (r"mixed mode $1+\tan^2((1-\lambda)\psi)$", style.LINES[6], "-"),
    "shear_share": (r"mixed mode $1/(1-(1-\lambda)\sin^2\psi)$", style.LINES[6], "--"),
    "scaled_tangent": (r"mixed mode $1+(1-\lambda)\tan^2\psi$, $\lambda=$ {mixity:.3g}", style.LINES[6], "-."),
}

#: Reversible fraction that is drawn where the dataset has none of its own.
_FRACTION = 0.1

#: Mixity lambda of the mixed-mode theories, halfway between JKR and Savkoor & Briggs.
_MIXITY = 0.5

#: Stresses at which theories are evaluated, and the widest area drawn, in JKR's.
_FINE, _WIDEST = 1500, 1.6

#: Points of a dataset that are drawn at most.
_POINTS = 40

#: What areas are drawn over: in words, its unit, and the power of the area that the stress is multiplied by.
_AXES = ((r"shear stress $\tau$", "Pa", 0), (r"tangential force $T = \tau A$", "N", 1))

#: Control of the contact: the law of all theories under it, its symbol and unit.
_CONTROLS: Any = {"load": (compare_at_load, "$P$", "N"), "indentation": (compare_at_indentation, r"$\delta$", "m")}


class Case(NamedTuple):
    """What the theories need of a scene: ``held`` is "load" [N] or "indentation" [m], rest as in ``laws.theories``."""

    held: str
    value: float
    work: float
    sphere_radius: float
    modulus: float
    poisson_ratio: float
    reversible: float

    def radii(self, stress: np.ndarray) -> dict[str, np.ndarray]:
        """Contact radius at shear stresses [Pa] by theory [m]."""
        found = _CONTROLS[self.held][0](stress, *self[1:], mixity=_MIXITY)
        return {name: radius for name, radius in found.items() if name in _THEORIES}

    @property
    def scale(self) -> float:
        """Stress whose energy, all of it, is the work of adhesion at JKR's radius: sqrt(pi E* w/(6 a)) [Pa]."""
        radius = float(self.radii(np.zeros(1))["jkr"][0])
        return float(np.sqrt(np.pi * self.modulus * self.work / (6.0 * radius)))


def _fractions(dataset: xr.Dataset) -> np.ndarray:
    with contextlib.suppress(KeyError):  # the whole table is swept
        return setting(dataset, "contact.reversible").to_numpy().ravel()
    return np.empty(0)


def sweeps_theories(dataset: xr.Dataset) -> bool:
    """Whether the reversible fraction, on which the theories differ, is swept."""
    return _fractions(dataset).size > 1


def case_of(dataset: xr.Dataset) -> Case:
    """The scene of the theories, with the first reversible fraction of the dataset that no other theory stands for.

    Raises
    ------
    ValueError
        If the sphere is not held at one load or indentation, with adhesion and in contact.
    """
    found: dict[str, xr.DataArray] = {}
    with contextlib.suppress(KeyError):
        held = control(dataset).kind
        found["value"] = setting(dataset, f"contact.{held}")
    if not found or held not in _CONTROLS:
        cure = 'run it with [contact] load = "4 mN", or with an indentation'
        raise ValueError(f"theories need a load or an indentation that stays; {cure}")
    found |= {"work": setting(dataset, "adhesion.work"), "sphere_radius": setting(dataset, "sphere.radius")}
    found |= {"modulus": dataset["contact_modulus"], "poisson_ratio": dataset["effective_poisson_ratio"]}
    if not float(found["work"].max()) > 0.0:
        raise ValueError("there is no adhesion that theories could differ on; give [adhesion] a work above 0")
    if not bool((dataset["radius_at_rest"] > 0.0).any()):
        raise ValueError("there is no contact at rest; raise the load or the indentation")
    for values in found.values():
        if float(values.min()) < float(values.max()):
            raise ValueError(f"theories are of one contact; {choice(dataset, str(values.dims[0]))}")
    shares = [float(share) for share in _fractions(dataset) if 0.0 < share != 1.0]
    numbers = {key: float(values.max()) for key, values in found.items()}
    return Case(held, reversible=(shares or [_FRACTION])[0], **numbers)


@of_dataset
def points_of(dataset: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Shear stress [Pa] and contact area [m^2] of closed contacts, means over the members.

    Of steady sliding the mean over the second half of the run at each point of the sweep, else records
    spread evenly over the run.
    """
    found = xr.Dataset({name: style.mean_of(dataset, name) for name in ("shear_stress", "contact_area")})
    if is_steady(dataset):
        found = settled(found)
    else:
        found = found.isel(t=np.unique(np.rint(np.linspace(0, dataset.sizes["t"] - 1, _POINTS)).astype(int)))
    stress, area = (values.to_numpy().ravel() for values in xr.broadcast(found["shear_stress"], found["contact_area"]))
    closed = area > 0.0
    return np.abs(stress[closed]), area[closed]


def theories_figure(dataset: xr.Dataset) -> Figure:
    """Contact area by every theory, and simulated, over shear stress and tangential force."""
    case = case_of(dataset)
    stress, area = points_of(dataset)
    sheared = stress[stress > 0.0]
    low, high = 0.1 * case.scale, max(3.0 * case.scale, 1.3 * float(np.max(sheared, initial=0.0)))
    low = max(0.01 * case.scale, 0.7 * float(np.min(sheared, initial=low / 0.7)))
    fine = np.geomspace(low, high, _FINE)
    areas = {name: np.pi * radius**2 for name, radius in case.radii(fine).items()}
    figure, axes = style.pairs(3.3, shared=True)
    full, mark = areas["jkr"][0], style.HOLLOW | {"color": style.BOTH, "zorder": 4}
    factor = style.in_unit(axes[0].yaxis, "contact area $A$", areas["jkr"], "m^2")
    for panel, (words, si, power) in zip(axes, _AXES, strict=True):
        unit = style.Unit.of(full**power * fine, si, logarithmic=True)
        along = {name: unit.factor * values**power * fine for name, values in areas.items()}
        _panel(panel, case, along, areas, factor)
        x = unit.factor * stress * area**power
        panel.plot(x, factor * area, label="simulated", **mark)
        if not is_steady(dataset) and area.size:
            panel.plot(x[-1:], factor * area[-1:], label="simulated, the last record", **mark | {"mfc": style.BOTH})
        style.across(panel, unit.factor * np.array([low, high]) * full**power, unit.label(words), "log")
    # heights from Hertz's area, or none, to somewhat above JKR's: the uncorrected theory goes far beyond
    least = float(np.nan_to_num(areas["hertz"][0]))
    bottom = min(least - 0.3 * (full - least), float(np.min(area, initial=least)))
    top = max(_WIDEST * full, 1.05 * float(np.max(area, initial=0.0)))
    axes[0].set_ylim(factor * max(bottom, 0.0), factor * top)
    _, symbol, si = _CONTROLS[case.held]
    words = f"{symbol} = {style.text_of(case.value, si)}, $w$ = {style.text_of(case.work, 'J/m^2')}"
    look: Any = {"ncols": 3, "handletextpad": 0.5, "labelspacing": 0.25, "alignment": "left", "title_fontsize": 7.0}
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper left", title=words, **look)
    return figure


def _panel(panel: Axes, case: Case, along: dict[str, np.ndarray], areas: dict[str, np.ndarray], factor: float) -> None:
    """Every theory along its own x, as far as its adhesive branch goes."""
    for name, (words, colour, line) in _THEORIES.items():
        values, label = factor * areas[name], words.format(share=case.reversible, mixity=_MIXITY)
        if name in ("jkr", "hertz"):  # whatever the shear
            panel.axhline(values[0], linestyle=line, label=label, **style.GREY)
            continue
        branch = adhesive(values, factor * areas["hertz"])
        panel.plot(along[name], branch, linestyle=line, color=colour, label=label)
        held = np.flatnonzero(np.isfinite(branch))
        if held.size and held[-1] < len(branch) - 1:  # it ends: at a fold with a dot
            panel.plot(along[name][held[-1]], branch[held[-1]], "o", markersize=3, color=colour)


def adhesive(areas: np.ndarray, hertz: np.ndarray) -> np.ndarray:
    """Areas of a theory while adhesion still holds the contact; nan from where it has Hertz's on.

    >>> adhesive(np.array([3.0, 2.0, 1.0]), np.array([1.0, 1.0, 1.0]))
    array([ 3.,  2., nan])
    """
    return np.where(areas > np.nan_to_num(hertz) * (1.0 + 1e-9), areas, np.nan)
