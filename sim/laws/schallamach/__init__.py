"""Bonds between sliding surfaces, in closed form: their number and the force that they bear.

From the law of Menga, Carbone & Dini to fuller ones, each with its own assumption on rupture:

- ``linear``: their fraction ``1/(1 + V/Vc)``, its rate equation and exact step;
- ``renewal``: any rupture law, from three moments of the life of a bond; a constant rate;
- ``bell``: a rupture rate that grows exponentially with force; exact, with the friction maximum;
- ``first_moment``: the same in mean field, whose maximum is too high;
- ``cut_off``: bonds that break at a stretch, whose limit without thermal rupture is ``linear``;
- ``catch``: bonds that force first holds and then breaks;
- ``loading``: a Bell bond pulled once: rupture forces and the static peak;
- ``cluster``: a finite number of bonds under a shared force;
- ``stability``: where bonds of a density over their stretch make a slider behind a spring oscillate.

``linear`` counts bonds relative to rest throughout. The others start from sites: ``bound`` is a share of
the sites, ``*_fraction`` the number of bonds relative to rest.
"""

from sim.laws.schallamach.bell import (
    bell_critical_speed,
    bell_fraction,
    bell_lives,
    bell_moments,
    bell_peak,
    bell_stress,
)
from sim.laws.schallamach.catch import catch_lives, catch_moments
from sim.laws.schallamach.cluster import cluster_lifetime
from sim.laws.schallamach.cut_off import cut_off_fraction, cut_off_moments, cut_off_stress
from sim.laws.schallamach.first_moment import (
    first_moment_amplitude,
    first_moment_fraction,
    first_moment_onset,
    first_moment_peak,
    first_moment_stress,
    first_moment_stretch,
)
from sim.laws.schallamach.linear import (
    fraction_rate,
    linear_onset,
    relax_fraction,
    steady_fraction,
    transition_probabilities,
)
from sim.laws.schallamach.loading import (
    StartUpPeak,
    bell_rupture_force,
    bell_rupture_force_density,
    start_up_force,
    start_up_peak,
)
from sim.laws.schallamach.renewal import Lives, Peak, SiteMoments, constant_moments, renewal, rest_share
from sim.laws.schallamach.stability import Body, Onset, resolved_onset
