"""A homogeneous gas whose velocities collide: Bird's no-time-counter scheme; see :mod:`validation.dsmc`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Source = Callable[[float], None]
"""Acts on the velocities for this time, without collisions."""

CLIPPED = 1e-6
"""Largest share of candidates that may be faster than the bound: they collide somewhat too rarely."""


@dataclass(frozen=True)
class Law:
    """Walton's law of impact of equal spheres or disks; smooth if q is None. Contacts add 2 `added` to their speed."""

    e: float
    beta: float = -1.0
    q: float | None = None
    friction: float | None = None
    added: float = 0.0

    def rates(self, dimension: int) -> tuple[float, float, float, float]:
        """A, B, B', C of the Maxwellian approximation without friction, by Huthmann and Zippelius (1997).

        dT_tr/ds = −A T_tr + B T_rot, dT_rot/ds = B' T_tr − C T_rot, with ds = (4/d) ω dt and ω dt the collisions per
        particle. In two dimensions one component is tangential to the contact, in three dimensions two are.
        """
        normal = (1 - self.e**2) / 4
        if self.q is None:
            return normal, 0.0, 0.0, 0.0
        eta = self.q * (1 + self.beta) / (2 * (1 + self.q))
        tangential = (dimension - 1) / 2
        gain = eta**2 / self.q
        decay = eta / self.q * (1 - eta / self.q)
        return normal + tangential * eta * (1 - eta), tangential * gain, gain, decay


def collision_rate(T: float, density: float, chi: float, dimension: int) -> float:
    """Collisions per particle and time of Maxwell velocities: 4nσ²χ√(πT/m) of spheres, 2nσχ√(πT/m) of disks."""
    return (4 if dimension == 3 else 2) * density * chi * math.sqrt(math.pi * T)


class Gas:
    """N particles without positions: velocities `v` ``[3, N]`` and, of rough ones, u = R ω ``[3, N]``."""

    def __init__(
        self, rng: np.random.Generator, law: Law, dimension: int, particles: int, T: float = 1.0, T_rot: float = 0.0
    ) -> None:
        if dimension not in (2, 3):
            raise ValueError("dimension must be 2 or 3")
        if not (0 <= law.e <= 1 and -1 <= law.beta <= 1):
            raise ValueError("e must be in [0, 1] and beta in [-1, 1]")
        self.rng, self.law, self.dimension = rng, law, dimension
        self.spin_axes = slice(3) if dimension == 3 else slice(2, 3)
        self.v = np.zeros((3, particles))
        self.v[:dimension] = math.sqrt(T) * rng.standard_normal((dimension, particles))
        self.u: Array | None = None
        if law.q is not None:
            self.u = np.zeros((3, particles))
            axes = self.u[self.spin_axes]
            axes += math.sqrt(T_rot / law.q) * rng.standard_normal(axes.shape)
        self.tries = self.clipped = 0
        self._first = np.zeros(particles, np.int64)
        self.center()

    @property
    def size(self) -> int:
        """Number of particles."""
        return self.v.shape[1]

    def center(self) -> None:
        """Takes out the mean velocity: it is conserved, but for rounding."""
        self.v -= self.v.mean(axis=1, keepdims=True)

    def temperature(self) -> float:
        """T_tr = m⟨c²⟩/d."""
        return float(np.vdot(self.v, self.v)) / (self.dimension * self.size)

    def rotational_temperature(self) -> float:
        """T_rot = I⟨ω²⟩/d_rot."""
        if self.u is None or self.law.q is None:
            return 0.0
        axes = 3 if self.dimension == 3 else 1
        return self.law.q * float(np.vdot(self.u, self.u)) / (axes * self.size)

    def fourth(self) -> float:
        """d⟨c⁴⟩/((d + 2)⟨c²⟩²) − 1."""
        square = _dot(self.v, self.v)
        return float(self.dimension * np.mean(square**2) / ((self.dimension + 2) * np.mean(square) ** 2) - 1)

    def scale(self, factor: float) -> None:
        """Multiplies velocities and spins: the law of impact has no scale of its own."""
        self.v *= factor
        if self.u is not None:
            self.u *= factor

    def collide(self, span: float) -> int:
        """All collisions of a time, in units of 1/(n σ^(d−1) χ); returns their number.

        A pair collides at the rate (n σ^(d−1) χ/N) ∫ g·n dn over g·n > 0, which is π g/N for spheres, 2 g/N for disks.
        """
        fastest = np.sqrt(np.partition(_dot(self.v, self.v), -2)[-2:]).sum()
        rate = (math.pi if self.dimension == 3 else 2.0) * fastest * self.size / 2
        tries = int(self.rng.poisson(rate * span))
        i = self.rng.integers(self.size, size=tries)
        j = self.rng.integers(self.size - 1, size=tries)
        j += j >= i
        threshold = fastest * self.rng.random(tries)
        self.tries += tries
        done = 0
        while len(i):
            turn = np.arange(len(i))
            # Assigned backwards, so that each particle keeps the first pair it is in.
            self._first[np.stack((i, j), axis=1).ravel()[::-1]] = np.repeat(turn, 2)[::-1]
            ready = (self._first[i] == turn) & (self._first[j] == turn)
            done += self._impacts(i[ready], j[ready], threshold[ready], fastest)
            later = ~ready
            i, j, threshold = i[later], j[later], threshold[later]
        return done

    def _impacts(self, i: NDArray[np.int64], j: NDArray[np.int64], threshold: Array, fastest: float) -> int:
        """Lets disjoint pairs collide whose relative speed is above their threshold; returns how many did."""
        g = self.v[:, i] - self.v[:, j]
        speed = np.sqrt(_dot(g, g))
        self.clipped += int(np.count_nonzero(speed > fastest))
        hit = speed > threshold
        i, j, g = i[hit], j[hit], g[:, hit]
        ahead = g / speed[hit]
        if self.dimension == 3:
            # A sphere scatters into all directions s alike; n bisects g and −s.
            s = self.rng.standard_normal(g.shape)
            n = ahead - s / np.sqrt(_dot(s, s))
            n /= np.sqrt(_dot(n, n))
        else:
            sine = self.rng.uniform(-1, 1, len(i))
            n = np.sqrt(1 - sine**2) * ahead
            n[0] -= sine * ahead[1]
            n[1] += sine * ahead[0]
        # From 1 to 2, g·n > 0. μ_r = 1/2; particle 1 gets −P, 2 gets +P.
        g_n = _dot(g, n)
        P_n = 0.5 * (1 + self.law.e) * g_n + self.law.added
        impulse = P_n * n
        q, friction = self.law.q, self.law.friction
        if self.u is not None and q is not None:
            g_t = g - g_n * n - _cross(n, self.u[:, i] + self.u[:, j])
            P_t = 0.5 * (1 + self.law.beta) * q / (1 + q) * g_t
            if friction is not None:
                size = np.sqrt(_dot(P_t, P_t))
                P_t *= np.minimum(1.0, friction * P_n / np.maximum(size, 1e-300))
            impulse += P_t
            # −P at R n and +P at −R n have the same torque −R n × P_t; R² / I = 1 / q.
            turned = _cross(n, P_t) / q
            self.u[:, i] -= turned
            self.u[:, j] -= turned
        self.v[:, i] -= impulse
        self.v[:, j] += impulse
        return len(i)

    def advance(self, steps: int, dt: float, span: float, source: Source) -> None:
        """Steps of half the source, collisions, half the source; halves that meet are one whole."""
        source(dt / 2)
        for step in range(steps):
            self.collide(span)
            source(dt if step < steps - 1 else dt / 2)

    def check(self) -> None:
        """Raises if the bound on relative speeds was exceeded more than rarely."""
        if self.clipped > CLIPPED * self.tries + 3:
            raise ArithmeticError(f"{self.clipped} of {self.tries} candidates were faster than the bound")


def _dot(a: Array, b: Array) -> Array:
    """Scalar products of ``[3, M]``."""
    product: Array = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


def _cross(a: Array, b: Array) -> Array:
    """Vector products of ``[3, M]``."""
    return np.stack((a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]))
