"""The fibre that all renderers are given, and what yarnray makes of it.

Mitsuba's `hair` and Cycles' Principled Hair (Chiang) are one model: Chiang et al., "A Practical and Controllable Hair and
Fur Model for Production Path Tracing", 2016, a dielectric cylinder seen at an offset h from its axis. yarnray's fibre has
the lobes R, TT and D, averaged over the width. The peers get the dielectric; yarnray gets, of each of its lobes, the share
of light and the width, averaged over h. D is even in all directions and stands for TRT and what follows.
"""

from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Dielectric:
    """A fibre as Chiang et al. describe it: scales without tilt, `sigma` the absorption per fibre radius and channel."""

    ior: float
    sigma: tuple[float, float, float]
    longitudinal: float  # beta_m, 0 to 1
    azimuthal: float  # beta_n, 0 to 1


@dataclass(frozen=True)
class Lobes:
    """yarnray's fibre: albedos per channel, widths in degrees."""

    r: list[float]
    tt: list[float]
    d: list[float]
    beta_r: float
    beta_tt: float
    beta_n: float

    def toml(self):
        return "{" + ", ".join(f"{key} = {value}" for key, value in asdict(self).items()) + "}"


def fresnel(cos_i, eta):
    """Unpolarised reflectance of a dielectric."""
    cos_t = np.sqrt(1 - (1 - cos_i**2) / eta**2)
    parallel = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    across = (cos_i - eta * cos_t) / (cos_i + eta * cos_t)
    return (parallel**2 + across**2) / 2


def albedos(ior, sigma, count=400):
    """R, TT and all that follows, of one channel: means over the width and over light that is even from all sides.

    Also the standard deviation of TT's azimuth that the cylinder itself makes, at theta = 0, in radians.
    """
    middles = (np.arange(count) + 0.5) / count
    h = (2 * middles - 1)[:, None]
    theta = (np.pi / 2 * middles)[None, :]
    sin, cos = np.sin(theta), np.cos(theta)
    refracted = h * cos / np.sqrt(ior**2 - sin**2)  # sin(gamma_t), with the azimuthal index of refraction
    cos_theta_t = np.sqrt(1 - (sin / ior) ** 2)
    reflected = fresnel(cos * np.sqrt(1 - h**2), ior)
    passed = np.exp(-sigma * 2 * np.sqrt(1 - refracted**2) / cos_theta_t)
    tt = (1 - reflected) ** 2 * passed
    later = tt * reflected * passed / (1 - reflected * passed)
    weight = np.broadcast_to(cos**2, tt.shape)  # projected width and solid angle
    bend = 2 * (np.arcsin(refracted[:, 0]) - np.arcsin(h[:, 0]))
    spread = np.sqrt(np.average(bend**2, weights=tt[:, 0]))
    return [np.average(lobe, weights=weight) for lobe in (reflected, tt, later)], spread


def equivalent(fiber):
    """What yarnray is given for a fibre of the peers."""
    channels = [albedos(fiber.ior, sigma) for sigma in fiber.sigma]
    r, tt, d = ([round(float(lobes[i]), 5) for lobes, _ in channels] for i in range(3))
    # Their roughnesses as standard deviations: of theta_i, twice yarnray's theta_h; and of a logistic distribution.
    m, n = fiber.longitudinal, fiber.azimuthal
    theta = 0.726 * m + 0.812 * m**2 + 3.7 * m**20
    logistic = np.sqrt(np.pi / 8) * (0.265 * n + 1.194 * n**2 + 5.372 * n**22) * np.pi / np.sqrt(3)
    bend = np.mean([spread for _, spread in channels])
    degrees = [round(float(np.degrees(x)), 3) for x in (theta / 2, theta / 4, np.hypot(bend, logistic))]
    return Lobes(r, tt, d, *degrees)


def absorbing(ior, albedo):
    """The absorption that gives a fibre this albedo of all lobes together."""
    low, high = 0.0, 20.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if sum(albedos(ior, middle)[0]) > albedo else (low, middle)
    return round(low, 5)


# Total albedos and longitudinal width of R as of `silk` in scenes/yarns.toml.
SILK = Dielectric(1.55, tuple(absorbing(1.55, a) for a in (0.33, 0.95, 0.55)), 0.307, 0.3)
