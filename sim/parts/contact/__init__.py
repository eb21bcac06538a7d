"""The contact of sphere and half-space: its radius under a load, an indentation, or behind a stiffness."""

from sim.parts.contact.models import (
    Adhesion,
    Contact,
    Equilibrium,
    RateDependent,
    Solid,
    Sphere,
)
