"""Checks and statistics on recorded runs, on top of SciPy, freud and pandas.

What is a mean over frames is given a frame, frames such as ``run.frames[::10]`` or :func:`drawn_frames`, or a run, of
which all are taken; what is of one frame, such as clusters, is given one, and :func:`history` has it of every frame.

*What to change here.* A new quantity computed from a file: a module for its subject. Formulas of theory that it is
compared with have their conditions in :mod:`.conditions`.

*May import* ``common``, ``theory``, ``mechanics`` and ``files``.

*Begin with* :mod:`.pairs`, then :mod:`.conditions`.
"""

from .bonds import BondOrder, bond_order
from .clustering import Clusters, clusters
from .conduction import Conduction, heat_conduction
from .cooling import CoolingLaw, HeatedState, cooling_law, gas_restitution, heated_state
from .density import DensityField, density_field
from .distributions import PairDistributions, pair_distributions
from .energies import kinetic_energy, rotational_energy, rotational_temperature, temperature
from .gaps import Gaps, close_gaps
from .heights import HeightProfile, height_axis, height_profile
from .histories import cluster_history, history, structure_history
from .impacts import impacts
from .mixing import Mixing, mixing
from .overlaps import Overlap, max_overlap
from .packings import (
    ContactNetwork,
    JammingFit,
    contact_network,
    contact_tolerance,
    jamming_fraction,
    rattlers,
)
from .porosity import RadialPorosity, radial_porosity
from .pressures import ReducedPressures, reduced_pressure, reduced_pressures
from .profile_means import profile_means
from .scattering import StaticStructure, static_structure
from .statistics import Estimate, Mean, block_average, drawn_frames, mean
from .structure import cluster_sizes, radial_distribution, structure_factor
from .transport import Rheology, Transport, rheology, running_integral, self_diffusion, shear_viscosity, viscosity_scale
from .velocities import scaled_velocities, sonine_a2, velocity_histogram

__all__ = [
    "BondOrder",
    "Clusters",
    "Conduction",
    "ContactNetwork",
    "CoolingLaw",
    "DensityField",
    "Estimate",
    "Gaps",
    "HeatedState",
    "HeightProfile",
    "JammingFit",
    "Mean",
    "Mixing",
    "Overlap",
    "PairDistributions",
    "RadialPorosity",
    "ReducedPressures",
    "Rheology",
    "StaticStructure",
    "Transport",
    "block_average",
    "bond_order",
    "close_gaps",
    "cluster_history",
    "cluster_sizes",
    "clusters",
    "contact_network",
    "contact_tolerance",
    "cooling_law",
    "density_field",
    "drawn_frames",
    "gas_restitution",
    "heat_conduction",
    "heated_state",
    "height_axis",
    "height_profile",
    "history",
    "impacts",
    "jamming_fraction",
    "kinetic_energy",
    "max_overlap",
    "mean",
    "mixing",
    "pair_distributions",
    "profile_means",
    "radial_distribution",
    "radial_porosity",
    "rattlers",
    "reduced_pressure",
    "reduced_pressures",
    "rheology",
    "rotational_energy",
    "rotational_temperature",
    "running_integral",
    "scaled_velocities",
    "self_diffusion",
    "shear_viscosity",
    "sonine_a2",
    "static_structure",
    "structure_factor",
    "structure_history",
    "temperature",
    "velocity_histogram",
    "viscosity_scale",
]
