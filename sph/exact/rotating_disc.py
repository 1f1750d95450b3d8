"""Stress and displacement of an elastic disc that rotates freely, in plane strain (eq 452).

Timoshenko & Goodier (1951), Theory of Elasticity, section 30, with the elastic constants of plane
strain. Displacements are small compared with the radius.
"""

from typing import NamedTuple

import numpy as np

from sph.exact.plate import Material


class Disc(NamedTuple):
    """A disc of radius `radius` at rest, which rotates with the angular velocity `spin`."""

    radius: float
    spin: float
    material: Material

    @property
    def _softness(self) -> float:
        """rho spin^2 / (8 M), with the modulus M = K + 4 G/3 of uniaxial strain."""
        modulus = self.material.bulk + 4.0 * self.material.shear / 3.0
        return self.material.density * self.spin**2 / (8.0 * modulus)

    @property
    def central_stress(self) -> float:
        """Radial stress at the centre, the largest of all stresses in the plane."""
        nu = self.material.poisson
        load = self.material.density * (self.spin * self.radius) ** 2
        return (3.0 - 2.0 * nu) / (8.0 * (1.0 - nu)) * load

    def stretch(self, radius: np.ndarray) -> np.ndarray:
        """Return displacement over radius (N,) of material at `radius` (N,) of the disc at rest."""
        reach = (3.0 - 2.0 * self.material.poisson) * self.radius**2
        return self._softness * (reach - radius**2)

    def stresses(self, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return radial, azimuthal and axial stress (N,) at `radius` (N,)."""
        nu, share = self.material.poisson, (radius / self.radius) ** 2
        radial = self.central_stress * (1.0 - share)
        azimuthal = self.central_stress * (1.0 - (1.0 + 2.0 * nu) / (3.0 - 2.0 * nu) * share)
        return radial, azimuthal, nu * (radial + azimuthal)

    def pressure(self, radius: np.ndarray) -> np.ndarray:
        """Return the pressure (N,) at `radius` (N,): minus the mean of the stresses."""
        return -np.mean(self.stresses(radius), axis=0)

    def deviator(self, offset: np.ndarray) -> np.ndarray:
        """Return the deviatoric stress (2, 2, N) at offsets (2, N) from the centre."""
        radius = np.sqrt((offset**2).sum(axis=0))
        outward = offset / np.where(radius > 0.0, radius, np.inf)
        radial, azimuthal, axial = self.stresses(radius)
        mean = (radial + azimuthal + axial) / 3.0
        along = outward[:, None] * outward[None]
        plane = np.eye(2)[:, :, None]
        return (azimuthal - mean) * plane + (radial - azimuthal) * along
