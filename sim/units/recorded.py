"""Names of the quantities that a dataset may hold of each record and of each whole run."""

from typing import Literal

#: Names of which ``record.quantities`` chooses.
Recorded = Literal[
    "speed", "slider_position", "bond_fraction", "shear_stress", "fluctuation_energy", "work_of_adhesion",
    "contact_radius", "contact_area", "normal_load", "indentation", "displacement", "friction_force", "in_contact",
    "masked", "detachment_time", "dissipated_energy", "jkr_radius", "hertz_radius", "bonds_radius",
    "fluctuations_radius", "equilibrium_radius", "applied_load",
    "stage_position", "stage_speed", "spring_force", "drive_work", "stored_energy", "dissipated_by_damping",
    "dissipated_by_viscosity", "dissipated_by_rupture", "dissipated_by_snaps", "dissipated_by_area", "energy_residual",
    "substeps",
    "runaway_time",
    "peak_stress", "peak_friction", "peak_time", "pull_off_load", "pull_off_time",
]  # fmt: skip
