"""The contact of sphere and half-space: its radius under a load, an indentation, or behind a stiffness."""

from typing import Annotated

from pydantic import Discriminator, Tag

from sim.parts.contact.cohesive import Cohesive
from sim.parts.contact.models import Adhesion, Equilibrium, RateDependent, Solid, Sphere


def _model(value: object) -> object:
    """Return the name of a contact's model, by default equilibrium."""
    return (
        value.get("model", "equilibrium")
        if isinstance(value, dict)
        else getattr(value, "model", None)
    )


Contact = Annotated[
    Annotated[Equilibrium, Tag("equilibrium")]
    | Annotated[RateDependent, Tag("rate_dependent")]
    | Annotated[Cohesive, Tag("cohesive")],
    Discriminator(_model),
]

__all__ = [
    "Adhesion",
    "Cohesive",
    "Contact",
    "Equilibrium",
    "RateDependent",
    "Solid",
    "Sphere",
]
