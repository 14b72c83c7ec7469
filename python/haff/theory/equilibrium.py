"""Density, pressure and structure of the elastic fluid and crystal."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..common import arguments
from ._common import Array, check_dimension, chosen, numeric


@numeric
def packing_fraction(n: ArrayLike, sigma: ArrayLike, d: int = 3) -> Array:
    r"""Packing fraction, :math:`\eta = \pi n\sigma^3/6` (3D) or :math:`\pi n\sigma^2/4` (2D)."""
    n, sigma = np.asarray(n, float), np.asarray(sigma, float)
    return np.pi * n * sigma**3 / 6 if check_dimension(d) == 3 else np.pi * n * sigma**2 / 4


@numeric
def number_density(eta: ArrayLike, sigma: ArrayLike, d: int = 3) -> Array:
    """Number density of a packing fraction: the inverse of :func:`packing_fraction`."""
    eta, sigma = np.asarray(eta, float), np.asarray(sigma, float)
    return 6 * eta / (np.pi * sigma**3) if check_dimension(d) == 3 else 4 * eta / (np.pi * sigma**2)


@numeric
def carnahan_starling(eta: ArrayLike) -> Array:
    r"""Contact value of 3D spheres, :math:`g_0 = (1 - \eta/2)/(1 - \eta)^3` (Carnahan–Starling 1969).

    Low by about 0.3 % in pressure at mid density.
    """
    eta = np.asarray(eta, float)
    return (1 - eta / 2) / (1 - eta) ** 3


@numeric
def henderson(eta: ArrayLike) -> Array:
    r"""Contact value of 2D disks, :math:`g_0 = (1 - 7\eta/16)/(1 - \eta)^2` (Henderson 1975).

    High by 0.14 % in pressure at :math:`\eta = 0.4` and by 0.5 % at 0.5.
    """
    eta = np.asarray(eta, float)
    return (1 - 7 * eta / 16) / (1 - eta) ** 2


# Virial coefficients B_k / B₂^(k−1) of hard disks, k = 1 … 10; B₂ρ = 2η (Clisby–McCoy 2006).
_DISKS = (1.0, 1.0, 0.782004, 0.5322318, 0.33355604, 0.1988425, 0.1148728, 0.064993, 0.0362193, 0.0199537)


@numeric
def virial_disks(eta: ArrayLike, denominator: int = 5) -> Array:
    r"""Compressibility :math:`Z = PV/NT` of the elastic 2D fluid, good to 1e-4 up to :math:`\eta = 0.5`.

    Padé approximant of the ten known virial coefficients, its denominator of order ``denominator``; the
    difference of orders 5 and 4 estimates its error. At :math:`\eta = 0.65` it is high by 0.4 %: see
    :func:`luding_disks`.
    """
    from scipy.interpolate import pade

    denominator = arguments.count("denominator", denominator, 1, 8)
    numerator, divisor = pade(_DISKS, denominator, 9 - denominator)
    x = 2 * np.asarray(eta, float)
    return np.asarray(numerator(x) / divisor(x), float)


@numeric
def luding_disks(eta: ArrayLike) -> Array:
    r"""Compressibility :math:`Z = PV/NT` of the elastic 2D fluid, good to about 0.1 % up to freezing (Luding 2001).

    :func:`henderson` less :math:`\eta^3/[128(1 - \eta)^4]`, fitted to simulations; it has the 8.306 of Erpenbeck and
    Luban (1985) at 1.4 times the closest packing's area, :math:`\eta = 0.648`.
    """
    eta = np.asarray(eta, float)
    return 1 + 2 * eta * (henderson(eta) - eta**3 / (128 * (1 - eta) ** 4))


# Coefficients of x^k, x = η/(1 − η): modified Kolafa–Labík–Malijevský equation of state.
_KLM = {
    0: 1.0,
    1: 4.0,
    2: 6.0,
    3: 2.3647684,
    4: -0.8698551,
    5: 1.1062803,
    6: -1.1014221,
    7: 0.66605866,
    8: -0.03633431,
    10: -0.20965164,
    14: 0.10555569,
    22: -0.0087238,
}


@numeric
def kolafa_labik_malijevsky(eta: ArrayLike) -> Array:
    r"""Compressibility :math:`Z = PV/NT` of the elastic 3D fluid, good to about 4e-5.

    Modified equation of Kolafa, Labík and Malijevský (2004), a polynomial in
    :math:`x = \eta/(1 - \eta)`; fluid phase only, :math:`\eta < 0.494`.
    """
    eta = np.asarray(eta, float)
    x = eta / (1 - eta)
    return sum(c * x**k for k, c in _KLM.items()) + np.zeros_like(x)


@numeric
def contact_value(eta: ArrayLike, d: int = 3, equation: str | None = None) -> Array:
    r"""Pair distribution at contact, :math:`g_0 = g(\sigma^+)`, of the elastic fluid.

    Parameters
    ----------
    equation
        ``"carnahan-starling"`` (default) or ``"klm"`` in 3D, ``"henderson"`` (default) or ``"virial"`` in 2D.
        ``"klm"`` takes :math:`g_0 = (Z - 1)/(4\eta)` from :func:`kolafa_labik_malijevsky`, ``"virial"``
        :math:`(Z - 1)/(2\eta)` from :func:`virial_disks`; both are 1 at :math:`\eta = 0`.
    """
    equation = chosen(equation, d, ("carnahan-starling", "klm"), ("henderson", "virial"))
    if equation == "carnahan-starling":
        return carnahan_starling(eta)
    if equation in ("klm", "virial"):
        eta = np.asarray(eta, float)
        safe = np.where(eta > 0, eta, 1e-3)
        excess = (kolafa_labik_malijevsky(safe) if d == 3 else virial_disks(safe)) - 1
        return np.where(eta > 0, excess / (_pairs(d) * safe), 1.0)
    return henderson(eta)


@numeric
def contact_value_after_collision(g0: ArrayLike, e: ArrayLike) -> Array:
    r"""Contact value seen in a frame of an inelastic gas, :math:`g(\sigma^+) = g_0(1 + e)/(2e)`.

    :math:`g_0` counts approaching pairs; separating pairs are slower by ``e`` and so linger at contact
    longer by ``1/e`` (Lutsko 2001). Infinite at e = 0.
    """
    g0, e = np.asarray(g0, float), np.asarray(e, float)
    with np.errstate(divide="ignore"):
        return g0 * (1 + e) / (2 * e)


@numeric
def compressibility(eta: ArrayLike, e: ArrayLike = 1.0, d: int = 3, equation: str | None = None) -> Array:
    r"""Compressibility :math:`Z = PV/NT`.

    :math:`Z = 1 + 2(1 + e)\eta g_0` in 3D, :math:`1 + (1 + e)\eta g_0` in 2D; at e < 1 this assumes
    molecular chaos.
    """
    eta, e = np.asarray(eta, float), np.asarray(e, float)
    return 1 + _pairs(d) * (1 + e) / 2 * eta * contact_value(eta, d, equation)


def _pairs(d: int) -> float:
    """Z − 1 = ``_pairs(d)`` η g₀ of the elastic fluid: the second virial coefficient in powers of η."""
    return 4.0 if check_dimension(d) == 3 else 2.0


@numeric
def crystal_compressibility(eta: ArrayLike) -> Array:
    r"""Compressibility :math:`Z = PV/NT` of the elastic fcc crystal of spheres (Speedy 1998).

    :math:`Z = 3/(1 - z) - 0.5921\,(z - 0.7072)/(z - 0.601)`, :math:`z = \eta/(\pi/\sqrt{18})`; melting is at
    :math:`\eta = 0.545`, and the crystal can be followed somewhat below.
    """
    z = np.asarray(eta, float) * np.sqrt(18) / np.pi
    return 3 / (1 - z) - 0.5921 * (z - 0.7072) / (z - 0.601)


# --- a finite number of particles ------------------------------------------------------------------


@numeric
def periodic_contact_value(eta: ArrayLike, particles: ArrayLike, d: int = 3, equation: str | None = None) -> Array:
    r"""Contact value of ``particles`` elastic spheres or disks in a periodic box.

    A fixed number of particles has fewer pairs than an open region of a large fluid (Lebowitz–Percus 1961):

    .. math:: g_N = g_0 - \frac{S}{2N}\frac{\partial^2(\eta^2 g_0)}{\partial\eta^2},\qquad
              S = \left[\frac{\partial(\eta Z)}{\partial\eta}\right]^{-1},

    which is :math:`1 - 1/N` for a dilute gas. Terms of order :math:`1/N^2` are left out, and the box must be wider than
    the structure of the fluid.
    """
    eta, particles = np.asarray(eta, float), np.asarray(particles, float)
    step = 1e-3 * np.minimum(eta, 0.1)

    def g(x: Array) -> Array:
        return contact_value(x, d, equation)

    def pressure(x: Array) -> Array:
        return x * (1 + _pairs(d) * x * g(x))

    structure = 2 * step / (pressure(eta + step) - pressure(eta - step))
    low, mid, high = ((x**2) * g(x) for x in (eta - step, eta, eta + step))
    return g(eta) - structure / (2 * particles) * (low - 2 * mid + high) / step**2


@numeric
def periodic_compressibility(eta: ArrayLike, particles: ArrayLike, d: int = 3, equation: str | None = None) -> Array:
    r"""Compressibility :math:`Z = PV/NT` of ``particles`` elastic spheres or disks in a periodic box at rest.

    :func:`periodic_contact_value` with :math:`T = \sum mv^2/(dN)`; a total momentum of zero makes the relative speeds
    larger by :math:`N/(N - 1)`. For large N this is :func:`compressibility`.
    """
    eta, particles = np.asarray(eta, float), np.asarray(particles, float)
    return 1 + _pairs(d) * eta * periodic_contact_value(eta, particles, d, equation) * particles / (particles - 1)
