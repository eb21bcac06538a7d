"""Adhesive contact of a sphere with an elastic half-space: Johnson, Kendall & Roberts, and Hertz.

Loads press: a load P above 0 pushes the sphere into the half-space, P = -F for the tractive force F
of Menga, Carbone & Dini (MCD); an indentation delta is -s for their separation s. ``modulus`` is
the contact modulus E* = E/(1 - nu^2) throughout. The contact with radius a and work of adhesion w
obeys ``energy_release_rate = w``; of its two solutions every law here returns the stable one, the
wider.

The control is a load, an indentation, or a displacement ``Delta = delta + P/k`` of a base behind a spring
of stiffness k, which comprises both: k = inf is an indentation, k -> 0 at a given k Delta a load. In names
``_at_load`` and so on mean an equilibrium under that control (a work of adhesion is given), and ``_under_load``
any contact of a given radius, in equilibrium or not.

Where no equilibrium exists (pulled beyond the fold, or pulled at all without adhesion) the result
is nan. A work of zero or below, as when stress fluctuations outweigh adhesion, leaves Hertz's
contact. A nan among the numbers a result depends on makes it nan; nothing raises.
"""

from sim.laws.jkr.displacement import radius_at_displacement
from sim.laws.jkr.energy import (
    energy_release_rate,
    energy_release_rate_at_indentation,
    potential_at_indentation,
    potential_at_load,
    potential_slope_at_indentation,
    potential_slope_at_load,
)
from sim.laws.jkr.hertz import hertz_radius_at_indentation, hertz_radius_at_load
from sim.laws.jkr.indentation import (
    indentation_at_radius,
    load_under_indentation,
    pull_off_indentation,
    radius_at_indentation,
)
from sim.laws.jkr.load import indentation_under_load, load_at_radius, pull_off_load, radius_at_load
from sim.laws.jkr.stiffness import (
    PullOff,
    energy_release_rate_at_displacement,
    indentation_under_displacement,
    load_under_displacement,
    pull_off_at_stiffness,
    pull_off_displacement,
)
