"""The contact to scale: profiles of sphere and half-space, and a map of the stress around the contact circle."""

import base64
import io
import math
from typing import Any, cast

import numpy as np
from PIL import Image

from sim.parts.exchange import Array
from sim.scenario.scenario import Scenario
from sim.spectrum.families import Ripple
from sim.study.curves import curves

#: Points of a profile, and along a side of the map; sides over the radius of the contact.
_PROFILE, _MAP, _WIDE = 161, 128, 4.0
#: Pixels of a single wave, below which it is not drawn.
_FINE = 4.0
#: Colours of the most negative and of the most positive number; levels of a colour.
_BLUE, _RED, _LEVELS = (33, 102, 172), (178, 24, 43), 127


def contact(scenario: Scenario, speed: float) -> dict[str, Any]:
    """Return what is drawn of the contact in steady sliding at a speed [m/s].

    ``radius`` and ``jkr_radius`` are in m, 0 if the contact is open; ``fluctuation_energy`` is in J/m². ``x``,
    ``sphere`` and ``surface`` are profiles [m], positive upwards from the undeformed half-space. ``stress`` is a map of
    one realisation of the shear stress [Pa], its mean included, of the side ``side`` [m]; None if the stress is the
    same everywhere, or a wave too short to be drawn.
    """
    at_speed = {
        name: float(values[0])
        for name, values in curves(scenario, np.array([speed])).items()
    }
    radius, share = at_speed["contact_radius"], at_speed["area_ratio"] or math.nan
    full = math.sqrt(at_speed["contact_area"] / math.pi / share)
    wide = _WIDE / 2.0 * (radius or full or 0.0)
    result: dict[str, Any] = {
        "speed": speed,
        "radius": radius,
        "jkr_radius": full if math.isfinite(full) else None,
        "fluctuation_energy": at_speed["fluctuation_energy"],
    }
    if not wide > 0.0:
        return result
    x = np.linspace(-wide, wide, _PROFILE)
    surface, sphere = 0.0 * x, x**2 / (2.0 * scenario.sphere.radius)
    if radius:
        work = at_speed["work_of_adhesion"]
        held = radius, work, scenario.bodies
        surface, sphere = scenario.contact.heights(np.abs(x), *held)
    profiles = {"x": listed(x), "surface": listed(surface), "sphere": listed(sphere)}
    stress = _stress(scenario, at_speed, 2.0 * wide)
    return result | profiles | {"side": 2.0 * wide, "stress": stress}


def picture(values: Array) -> str:
    """Return a square map as the address of a picture, blue where it is negative and red where it is positive.

    The first axis of the map runs to the right, the second one upwards.
    """
    most = float(np.max(np.abs(values))) or 1.0
    levels = np.round(_LEVELS * (1.0 + values / most)).astype(np.uint8)
    image = Image.fromarray(np.flipud(levels.T), "P")
    shares = np.abs(np.arange(2 * _LEVELS + 1) / _LEVELS - 1.0)[:, np.newaxis]
    blue, red = (255.0 + (np.array(ends) - 255.0) * shares for ends in (_BLUE, _RED))
    colours = np.concatenate([blue[:_LEVELS], red[_LEVELS:]])
    image.putpalette(np.round(colours).astype(np.uint8).tobytes())
    file = io.BytesIO()
    image.save(file, "PNG")
    return f"data:image/png;base64,{base64.b64encode(file.getvalue()).decode()}"


def listed(values: Any) -> list[float | None]:
    """Return numbers as JSON has them, None for one that is not finite."""
    return [float(x) if math.isfinite(x) else None for x in np.asarray(values, float)]


def _stress(
    scenario: Scenario, at_speed: dict[str, float], side: float
) -> Array | None:
    """Return a map of a realisation of the stress on a square [Pa]; None without fluctuations, or of a measured map.

    The amplitude is that at the speed of the curves ``at_speed``. Waves shorter than two pixels are left out.
    """
    shear, full = (
        scenario.fluctuations,
        scenario.elastic.stored_energy(scenario.fluctuations.spectrum),
    )
    if shear.passes or not full > 0.0 or not at_speed["fluctuation_energy"] > 0.0:
        return None
    pixel, white = (
        side / _MAP,
        np.random.default_rng(scenario.seed).standard_normal((_MAP, _MAP)),
    )
    q = 2.0 * math.pi * np.fft.fftfreq(_MAP, pixel)
    try:
        density = shear.spectrum.density(q[:, np.newaxis], q)
        field = np.real(np.fft.ifft2(np.fft.fft2(white) * np.sqrt(density))) / pixel
    except ValueError:  # of a single wave, which has no density
        place = pixel * np.arange(_MAP)
        qx, qy = cast(Ripple, shear.spectrum).wavevector
        if 2.0 * math.pi / math.hypot(qx, qy) < _FINE * pixel:
            return None
        field = math.sqrt(2.0 * shear.spectrum.variance) * np.cos(
            qx * place[:, np.newaxis] + qy * place
        )
    return np.asarray(
        at_speed["shear_stress"]
        + math.sqrt(at_speed["fluctuation_energy"] / full) * field
    )
