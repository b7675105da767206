"""The quadrature against 40-digit arithmetic on the F4 scene: own roots, own classes, mpmath's quadrature."""

from __future__ import annotations

import itertools

import mpmath as mp
import numpy as np
import pytest

import atmoref.truth as truth
from atmoref.scene import load_scene

mpf = mp.mpf


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def _minus(a, b):
    return [x - y for x, y in zip(a, b, strict=True)]


def _vector(v):
    return [mpf(float(x)) for x in v]


class _F4:
    """F4 in mpmath: eye looking along +z, one light shining down, one sphere, the ground."""

    def __init__(self, s):
        self.s = s
        self.eye = _vector(s.camera.position_m)
        light = s.lights[0]
        self.light = _vector(light.position_m)
        self.cos_outer = mp.cos(mp.radians(mpf(light.outer_half_angle_deg)))
        self.cos_inner = mp.cos(mp.radians(mpf(light.inner_half_angle_deg)))
        ball = next(thing for thing in s.objects if thing.type == "sphere")
        self.to_ball = _minus(_vector(ball.center_m), self.light)
        self.radius = mpf(ball.radius_m)
        self.sigma = mpf(s.medium.extinction_per_m[0])
        power = mpf(light.radiant_intensity_w_per_sr[0]) * mpf(light.peak)
        self.factor = power * self.sigma * mpf(s.medium.single_scattering_albedo[0]) / (4 * mp.pi)

    def ray(self, column, row):
        width, height = self.s.image.width, self.s.image.height
        half = mp.tan(mp.radians(mpf(self.s.camera.vertical_fov_deg)) / 2)
        x = (2 * (column + mpf("0.5")) / width - 1) * half * width / height
        y = (1 - 2 * (row + mpf("0.5")) / height) * half
        length = mp.sqrt(1 + x * x + y * y)
        return [-x / length, y / length, 1 / length]  # right = forward × up = -x

    def end(self, d):
        t = -self.eye[1] / d[1] if d[1] < 0 else mp.inf
        w = _minus(_minus(self.eye, self.light), self.to_ball)
        b = _dot(w, d)
        root = b * b - _dot(w, w) + self.radius**2
        return min(t, -b - mp.sqrt(root)) if root > 0 else t

    def beam(self, column, row):
        """Return the beam term of a pixel, to about 30 digits."""
        d = self.ray(column, row)
        foot = _dot(_minus(self.light, self.eye), d)
        q = _minus([e + foot * x for e, x in zip(self.eye, d, strict=True)], self.light)
        v = mp.sqrt(_dot(q, q))
        low, high = -foot, self.end(d) - foot
        distance = mp.sqrt(_dot(self.to_ball, self.to_ball))
        tangent = mp.sqrt(1 - (self.radius / distance) ** 2)
        down = [mpf(0), mpf(-1), mpf(0)]
        cuts = [low, mpf(0), *_cone(q, d, v, down, self.cos_outer), *_cone(q, d, v, down, self.cos_inner)]
        cuts += _cone(q, d, v, [x / distance for x in self.to_ball], tangent)
        cuts = [*sorted(u for u in cuts if low <= u < high), high]
        total = mpf(0)
        for a, b in itertools.pairwise(cuts):
            middle = (a + b) / 2 if b < mp.inf else a + 1
            if self._lit([x + middle * y for x, y in zip(q, d, strict=True)]):
                ends = mp.linspace(mp.atan(a / v), mp.atan(b / v), 4)
                total += mp.quad(lambda theta: self._integrand(q, d, v, foot, theta), ends)
        return self.factor * total

    def _cosine(self, w):
        return -w[1] / mp.sqrt(_dot(w, w))

    def _lit(self, w):
        if self._cosine(w) <= self.cos_outer:
            return False
        k = min(max(_dot(self.to_ball, w) / _dot(w, w), 0), 1)
        gap = [x - k * y for x, y in zip(self.to_ball, w, strict=True)]
        return _dot(gap, gap) >= self.radius**2

    def _integrand(self, q, d, v, foot, theta):
        """Per angle at the light: 1/s² du = d(theta) / v."""
        u = v * mp.tan(theta)
        w = [x + u * y for x, y in zip(q, d, strict=True)]
        x = min(max((self._cosine(w) - self.cos_outer) / (self.cos_inner - self.cos_outer), 0), 1)
        return x * x * (3 - 2 * x) * mp.exp(-self.sigma * (mp.sqrt(_dot(w, w)) + u + foot)) / v


def _cone(q, d, v, axis, cosine):
    a_q, a_d = _dot(q, axis), _dot(d, axis)
    square, half, constant = a_d**2 - cosine**2, a_q * a_d, a_q**2 - cosine**2 * v * v
    root = half**2 - square * constant
    return [] if root < 0 else [(-half - mp.sqrt(root)) / square, (-half + mp.sqrt(root)) / square]


def _check(pixels, result, s):
    with mp.workdps(40):
        f4 = _F4(s)
        for column, row in pixels:
            exact = f4.beam(column, row)
            got = float(result.buffers["beam"][row, column, 0])
            off = abs(mpf(got) - exact)
            assert off <= float(result.error[row, column, 0]), (column, row, float(off / exact))
            assert off <= 1e-9 * exact


def test_pixels_of_f4_in_forty_digits():
    """Around the apex, across both cones, beside and in the sphere's shadow, on the ground, and two that only graze."""
    s = load_scene("fig4d")
    result = truth.solve(s)
    pixels = [(150, 134), (123, 189), (151, 247), (112, 414), (98, 398), (119, 350), (253, 285), (2, 350)]
    _check(pixels, result, s)


@pytest.mark.slow
def test_more_pixels_of_f4_in_forty_digits():
    """The dimmest lit pixels, where rounding is worst, and others by chance."""
    s = load_scene("fig4d")
    result = truth.solve(s)
    rows, columns = np.nonzero(result.buffers["beam"][..., 0])
    order = np.argsort(result.buffers["beam"][rows, columns, 0])
    chosen = [*order[:40], *np.random.default_rng(1).choice(rows.size, 60, replace=False)]
    _check([(int(columns[k]), int(rows[k])) for k in chosen], result, s)
