r"""Kinetic theory of smooth and rough inelastic hard spheres and disks.

Closed forms for comparison with simulations. All functions are vectorised: every number may be an array,
and arrays broadcast. Units are those of the scene with :math:`k_B = 1`; temperatures are energies,
:math:`T = m\langle|v - V|^2\rangle/d` in ``d`` dimensions.

====================  ==========================================================================
symbol                meaning
====================  ==========================================================================
``d``                 dimension, 2 (disks) or 3 (spheres)
``n``                 number density, particles per volume (3D) or area (2D)
``eta``               packing fraction, :math:`\pi n\sigma^3/6` (3D) or :math:`\pi n\sigma^2/4` (2D)
``sigma``             diameter
``e``                 coefficient of restitution, in [0, 1]
``beta``, ``q``       of rough contacts: coefficient of tangential restitution, in [-1, 1]; :math:`I/(mR^2)`
``T``, ``m``          temperature [energy] and mass
====================  ==========================================================================

Sources
-------
* N. F. Carnahan, K. E. Starling, *J. Chem. Phys.* **51**, 635 (1969)
* D. Henderson, *Mol. Phys.* **30**, 971 (1975)
* J. Kolafa, S. Labík, A. Malijevský, *Phys. Chem. Chem. Phys.* **6**, 2335 (2004)
* P. K. Haff, *J. Fluid Mech.* **134**, 401 (1983)
* T. P. C. van Noije, M. H. Ernst, *Granular Matter* **1**, 57 (1998)
* T. Boublík, *J. Chem. Phys.* **53**, 471 (1970); G. A. Mansoori et al., *ibid.* **54**, 1523 (1971) (BMCSL)
* A. Santos, S. B. Yuste, M. López de Haro, *J. Chem. Phys.* **123**, 234512 (2005)
* J. T. Jenkins, F. Mancini, *J. Appl. Mech.* **54**, 27 (1987)
* J. F. Lutsko, *Phys. Rev. E* **63**, 061211 (2001)
* J. M. Montanero, A. Santos, *Granular Matter* **2**, 53 (2000)
* V. Garzó, J. W. Dufty, *Phys. Rev. E* **60**, 5706 (1999)
* J. L. Lebowitz, J. K. Percus, *Phys. Rev.* **122**, 1675 (1961)
* N. Clisby, B. M. McCoy, *J. Stat. Phys.* **122**, 15 (2006)
* S. Luding, *Phys. Rev. E* **63**, 042201 (2001)
* R. J. Speedy, *Mol. Phys.* **62**, 509 (1987); *J. Phys.: Condens. Matter* **10**, 4387 (1998)
* J. J. Erpenbeck, W. W. Wood, *Phys. Rev. A* **43**, 4254 (1991)
* E. Ruckenstein, H. Liu, *Ind. Eng. Chem. Res.* **36**, 3927 (1997)
* I.-C. Yeh, G. Hummer, *J. Phys. Chem. B* **108**, 15873 (2004)
* P. Müller, T. Pöschel, *Phys. Rev. E* **84**, 021302 (2011)
* M. Huthmann, A. Zippelius, *Phys. Rev. E* **56**, R6275 (1997)
* J. T. Jenkins, M. W. Richman, *J. Fluid Mech.* **192**, 313 (1988)
* J. J. Brey, J. W. Dufty, A. Santos, *J. Stat. Phys.* **97**, 281 (1999)
* V. Garzó, *Granular Gaseous Flows*, Springer (2019)
* N. V. Brilliantov, T. Pöschel, *Kinetic Theory of Granular Gases*, Oxford (2004)

*What to change here.* A new formula, with its source: a module for its subject.

*May import* ``common``.

*Begin with* :mod:`.equilibrium`.
"""

from .collisions import (
    collision_frequency,
    loss_distribution,
    mean_free_time,
    periodic_rate_factor,
)
from .cooling import (
    cooling_curve,
    critical_length,
    haff_temperature,
    haff_time,
    maxwell_component,
    sonine_a2,
    sonine_component,
    sonine_polynomial,
    viscoelastic_restitution,
    viscoelastic_restitution_pade,
)
from .equilibrium import (
    carnahan_starling,
    compressibility,
    contact_value,
    contact_value_after_collision,
    crystal_compressibility,
    henderson,
    kolafa_labik_malijevsky,
    luding_disks,
    number_density,
    packing_fraction,
    periodic_compressibility,
    periodic_contact_value,
    virial_disks,
)
from .heat import heat_flux, temperature_jump, thermal_conductivity
from .heated import added_speed_temperature, heated_temperature, sonine_a2_heated, suspension_temperature
from .mixtures import (
    MixtureRates,
    granular_temperatures,
    mixture_contact_values,
    mixture_cooling_rates,
    mixture_rates,
)
from .rough import RoughLosses, rough_losses, rough_temperature_ratio
from .shear import (
    DenseShearFlow,
    DiluteShearFlow,
    uniform_shear_enskog,
    uniform_shear_model,
    uniform_shear_temperature,
)
from .transport import (
    diffusion_finite_size,
    diffusion_ruckenstein_liu,
    diffusion_speedy,
    enskog_diffusion,
    enskog_tracer_diffusion,
    enskog_viscosity,
)

__all__ = [
    "DenseShearFlow",
    "DiluteShearFlow",
    "MixtureRates",
    "RoughLosses",
    "added_speed_temperature",
    "carnahan_starling",
    "collision_frequency",
    "compressibility",
    "contact_value",
    "contact_value_after_collision",
    "cooling_curve",
    "critical_length",
    "crystal_compressibility",
    "diffusion_finite_size",
    "diffusion_ruckenstein_liu",
    "diffusion_speedy",
    "enskog_diffusion",
    "enskog_tracer_diffusion",
    "enskog_viscosity",
    "granular_temperatures",
    "haff_temperature",
    "haff_time",
    "heat_flux",
    "heated_temperature",
    "henderson",
    "kolafa_labik_malijevsky",
    "loss_distribution",
    "luding_disks",
    "maxwell_component",
    "mean_free_time",
    "mixture_contact_values",
    "mixture_cooling_rates",
    "mixture_rates",
    "number_density",
    "packing_fraction",
    "periodic_compressibility",
    "periodic_contact_value",
    "periodic_rate_factor",
    "rough_losses",
    "rough_temperature_ratio",
    "sonine_a2",
    "sonine_a2_heated",
    "sonine_component",
    "sonine_polynomial",
    "suspension_temperature",
    "temperature_jump",
    "thermal_conductivity",
    "uniform_shear_enskog",
    "uniform_shear_model",
    "uniform_shear_temperature",
    "virial_disks",
    "viscoelastic_restitution",
    "viscoelastic_restitution_pade",
]
