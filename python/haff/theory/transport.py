"""Diffusion and viscosity of the elastic fluid of spheres: Enskog's theory, and fits to simulations."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._common import Array, numeric
from .equilibrium import contact_value, packing_fraction

# Chapman and Cowling: factors of higher Sonine polynomials over the first approximation.
_DIFFUSION = 1.018954
_VISCOSITY = 1.016034

# Constant of a cubic lattice of images (Hasimoto 1959).
_IMAGES = 2.837297


@numeric
def enskog_diffusion(
    n: ArrayLike, sigma: ArrayLike, T: ArrayLike = 1.0, m: ArrayLike = 1.0, g0: ArrayLike | None = None
) -> Array:
    r"""Self-diffusion coefficient [length²/time] of spheres by Enskog's theory.

    :math:`D_E = 1.01895\cdot\frac38\sqrt{T/\pi m}\,/\,(n\sigma^2 g_0)`; ``g0`` defaults to that of
    :func:`~haff.theory.kolafa_labik_malijevsky`. Correlated collisions make the actual coefficient a third larger at
    :math:`n\sigma^3 = 0.5` and half as large near freezing.
    """
    n, sigma, T, m = (np.asarray(x, float) for x in (n, sigma, T, m))
    return _DIFFUSION * _first_diffusion(n, sigma, T, m) / _contact(n, sigma, g0)


@numeric
def enskog_tracer_diffusion(
    n: ArrayLike,
    sigma: ArrayLike,
    sigma_tracer: ArrayLike,
    m: ArrayLike = 1.0,
    m_tracer: ArrayLike = 1.0,
    T: ArrayLike = 1.0,
    g: ArrayLike | None = None,
) -> Array:
    r"""Diffusion coefficient [length²/time] of a few spheres among others, in three dimensions, by Enskog's theory.

    .. math:: D = \frac{3}{8 n \sigma_{12}^2 g}\sqrt{\frac{T}{2\pi\mu}}\,\frac1{1 - \Delta},\qquad
              \Delta = \frac{m^2}{30 m_t^2 + 16 m m_t + 13 m^2}

    with the contact distance :math:`\sigma_{12}`, the reduced mass :math:`\mu`, and the second Sonine approximation
    (Chapman and Cowling, 9.81): at equal masses 1.0172 of the first one, where all of them give 1.0190, and of very
    light tracers 13/12, where they give 1.1318.

    Parameters
    ----------
    n, sigma, m
        Number density, diameter and mass of the others.
    sigma_tracer, m_tracer
        Diameter and mass of the tracers, so few that they do not meet each other.
    g
        Contact value of a tracer and another sphere; default :func:`mixture_contact_values` of no tracers.

    Notes
    -----
    The theory is one of single collisions. It leaves out the flow of the others that a tracer drags along, so that
    tracers which are not small against the mean free path diffuse faster: by the factor 1.35 ± 0.03 with three times
    the diameter and ten times the mass at a packing fraction of 0.1, where the mean free path is about a diameter
    (docs/howto/measuring.md).
    """
    n, sigma, sigma_tracer, m, m_tracer, T = (np.asarray(x, float) for x in (n, sigma, sigma_tracer, m, m_tracer, T))
    between, reduced = 0.5 * (sigma + sigma_tracer), m * m_tracer / (m + m_tracer)
    if g is None:
        eta, star = packing_fraction(n, sigma), sigma * sigma_tracer / (sigma + sigma_tracer)
        # ξ₂ = η/σ of the others alone.
        g = 1 / (1 - eta) + 3 * eta / sigma * star / (1 - eta) ** 2 + 2 * (eta / sigma * star) ** 2 / (1 - eta) ** 3
    delta = m**2 / (30 * m_tracer**2 + 16 * m * m_tracer + 13 * m**2)
    first = 3 / (8 * n * between**2 * np.asarray(g, float)) * np.sqrt(T / (2 * np.pi * reduced))
    return first / (1 - delta)


@numeric
def enskog_viscosity(
    n: ArrayLike, sigma: ArrayLike, T: ArrayLike = 1.0, m: ArrayLike = 1.0, g0: ArrayLike | None = None
) -> Array:
    r"""Shear viscosity [mass/(length time)] of spheres by Enskog's theory.

    .. math:: \eta_E = 1.01603\cdot\frac5{16\sigma^2}\sqrt{\frac{mT}\pi}\,
              \Bigl[\frac1{g_0} + 0.8\,\beta + 0.7614\,\beta^2 g_0\Bigr],\qquad \beta = \tfrac23\pi n\sigma^3.

    Simulations are within 3 % of it up to a packing fraction of 0.37, and far above near freezing.
    """
    n, sigma, T, m = (np.asarray(x, float) for x in (n, sigma, T, m))
    g = _contact(n, sigma, g0)
    covolume = 2 / 3 * np.pi * n * sigma**3
    dilute = _VISCOSITY * 5 / 16 * np.sqrt(m * T / np.pi) / sigma**2
    return dilute * (1 / g + 0.8 * covolume + 0.7614 * covolume**2 * g)


@numeric
def diffusion_speedy(n: ArrayLike, sigma: ArrayLike, T: ArrayLike = 1.0, m: ArrayLike = 1.0) -> Array:
    r"""Self-diffusion coefficient [length²/time] of about 500 spheres in a periodic cube: Speedy's fit (1987).

    :math:`D = \frac38\sqrt{T/\pi m}\,(n\sigma^2)^{-1}\,(1 - \nu/1.09)\,[1 + \nu^2(0.4 - 0.83\,\nu^2)]`,
    :math:`\nu = n\sigma^3`, to one or two percent, into the metastable fluid.
    """
    n, sigma, T, m = (np.asarray(x, float) for x in (n, sigma, T, m))
    nu = n * sigma**3
    return _first_diffusion(n, sigma, T, m) * (1 - nu / 1.09) * (1 + nu**2 * (0.4 - 0.83 * nu**2))


@numeric
def diffusion_ruckenstein_liu(n: ArrayLike, sigma: ArrayLike, T: ArrayLike = 1.0, m: ArrayLike = 1.0) -> Array:
    r"""Self-diffusion coefficient [length²/time] of infinitely many spheres: fit of Ruckenstein and Liu (1997).

    :math:`D = \frac38\sqrt{T/\pi m}\,(n\sigma^2g_0)^{-1}\,[1 + 0.94605\,\nu^{3/2} + 1.4022\,\nu^3 -
    5.6898\,\nu^5 + 2.6626\,\nu^7]`, :math:`\nu = n\sigma^3`, to the simulations of Erpenbeck and Wood (1991), with the
    contact value of Carnahan and Starling; good to about two percent up to freezing.
    """
    n, sigma, T, m = (np.asarray(x, float) for x in (n, sigma, T, m))
    nu = n * sigma**3
    g0 = contact_value(packing_fraction(n, sigma))
    return (
        _first_diffusion(n, sigma, T, m)
        / g0
        * (1 + 0.94605 * nu**1.5 + 1.4022 * nu**3 - 5.6898 * nu**5 + 2.6626 * nu**7)
    )


@numeric
def diffusion_finite_size(viscosity: ArrayLike, L: ArrayLike, T: ArrayLike = 1.0) -> Array:
    r"""Finite-size correction of the self-diffusion coefficient in a periodic cube of side ``L`` [length²/time].

    :math:`D_\infty - D_L = 2.837297\,T/(6\pi\eta L)` (Yeh–Hummer 2004): the interaction of a particle with its images.
    """
    viscosity, L, T = (np.asarray(x, float) for x in (viscosity, L, T))
    return _IMAGES * T / (6 * np.pi * viscosity * L)


def _first_diffusion(n: Array, sigma: Array, T: Array, m: Array) -> Array:
    """The first Sonine approximation of a dilute gas."""
    return 3 / 8 * np.sqrt(T / (np.pi * m)) / (n * sigma**2)


def _contact(n: Array, sigma: Array, g0: ArrayLike | None) -> Array:
    return contact_value(packing_fraction(n, sigma), 3, "klm") if g0 is None else np.asarray(g0, float)
