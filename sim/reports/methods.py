"""A paragraph on the methods of a run, ready to be pasted, with what to cite."""

import html
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from sim.read.dataset import has_noise, is_stationary, sweep_dims, word
from sim.read.errors import systematic_errors
from sim.read.statistics import over_members
from sim.units.notation import engineering
from sim.units.terminal import plain

_FOLDER = Path(__file__).parent
#: Parts of a scenario that are chosen by their models.
_PARTS = ("contact", "drive", "bonds", "shear")
#: Numbers of a scenario that a reader expects in the text.
_NUMBERS = (
    "sphere_radius",
    "solid_shear_modulus",
    "solid_poisson_ratio",
    "adhesion_work",
    "contact_load",
    "contact_indentation",
    "contact_displacement",
    "contact_stiffness",
    "drive_speed",
    "drive_stage",
    "drive_force",
    "drive_stiffness",
    "bonds_critical_speed",
    "bonds_stress",
    "temperature_value",
    "temperature_reference",
)
#: A standard error that is of rounding.
_ROUNDING = 1e-12


class Methods(NamedTuple):
    """A paragraph of methods, ``text``, and its references, ``bibtex``."""

    text: str
    bibtex: str

    def __repr__(self) -> str:
        return f"{self.text}\n\n{self.bibtex}"

    def _repr_html_(self) -> str:
        text, bibtex = map(html.escape, self)
        return f"<p>{text}</p><pre>{bibtex}</pre>"


def methods(dataset: xr.Dataset) -> Methods:
    """Return a paragraph on version, models, numbers, seed, members, clock and errors of a run, with its references."""
    models = (word(dataset, f"{part}.model", "").astype(str) for part in _PARTS)
    swept = {name: dataset.sizes[name] for name in sweep_dims(dataset)}
    numbers = {
        dataset[name].attrs.get("long_name", name): _size(dataset[name])
        for name in _NUMBERS
        if name in dataset and bool(dataset[name].notnull().any())
    }
    text = rendered(
        "methods.txt",
        attrs=dataset.attrs,
        models={
            part: np.unique(names) for part, names in zip(_PARTS, models, strict=True)
        },
        numbers=numbers,
        swept={name: count for name, count in swept.items() if count > 1},
        step=_size(dataset["clock_step"]),
        duration=_size(dataset["clock_duration"]),
        is_random=bool(has_noise(dataset).any()),
        is_stationary=is_stationary(dataset),
        errors=errors(dataset),
        estimated=is_estimated(dataset),
    )
    references = (_FOLDER / "cite.bib").read_text(encoding="utf-8")
    version = dataset.attrs["sim_version"]
    return Methods(" ".join(text.split()), references.replace("VERSION", version))


def is_estimated(dataset: xr.Dataset) -> bool:
    """Return True if errors of the area were estimated before the run."""
    return any(str(name).endswith("_error_area") for name in dataset.variables)


def errors(dataset: xr.Dataset) -> list[str]:
    """Return the systematic errors that matter, and the largest standard error of a run, in words."""
    known = systematic_errors(dataset)
    result = [str(error._replace(cure="")) for error in known if error.matters]
    ratios = over_members(dataset, ["area_ratio"], quantiles=False)
    sem = ratios["area_ratio"].sem if "area_ratio" in ratios else None
    if sem is not None and (error := float(sem.max())) > _ROUNDING:
        words = "largest standard error of the mean area over JKR's"
        result.append(f"{words} {100.0 * error:.3g} %")
    return result


def rendered(template: str, **values: Any) -> str:
    """Return a template of this folder with values, which are escaped in HTML and lose control characters."""
    # heavy: for reports alone
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    templates = Environment(
        loader=FileSystemLoader(_FOLDER),
        autoescape=template.endswith(".html"),
        undefined=StrictUndefined,
        # values marked as HTML stay as they are
        finalize=lambda value: plain(value) if type(value) is str else value,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return templates.get_template(template).render(values)


def _size(values: xr.DataArray) -> str:
    """Return a number of the scenario with its unit, or the range of several."""
    ends = (float(end) for end in (values.min(), values.max()))
    unit = values.attrs.get("units", "1")
    return " to ".join(dict.fromkeys(engineering(end, unit) for end in ends))
