"""Doubles of renderers with fewer digits than binary32: NumPy that does what an error model allows, in several ways."""

from dataclasses import dataclass, replace

import numpy as np

from gsvc_base.constants import LN_255, SMALLEST_NORMAL
from gsvc_base.rendering.bounds import coverage_margin
from gsvc_base.rendering.definition import footprint
from gsvc_base.rendering.error_models import LOCAL, ErrorModel

NEAREST, DOWN, UP, RANDOM = "nearest", "towards zero", "away from zero", "at random"
ROUNDINGS = (NEAREST, DOWN, UP, RANDOM)


def to_digits(x, unit, rounding, rng):
    """To 1 - log2(unit) significant bits."""
    fraction, exponent = np.frexp(np.asarray(x, np.float64))
    scaled = fraction * (2 / unit)  # of a fraction from 1/2 to 1
    whole = np.trunc(scaled)
    away = whole + np.sign(scaled) * (whole != scaled)
    if rounding == NEAREST:
        rounded = np.rint(scaled)
    elif rounding == RANDOM:
        rounded = np.where(rng.random(np.shape(scaled)) < 0.5, whole, away)
    else:
        rounded = whole if rounding == DOWN else away
    with np.errstate(over="ignore"):
        return np.where(np.isfinite(x), np.ldexp(rounded * (unit / 2), exponent), x)


@dataclass
class Narrow:
    """Arithmetic inside an error model.

    Attributes
    ----------
    model
        The error model.
    rounding
        Where numbers go that have too many digits: one of `ROUNDINGS`.
    backwards
        Whether sums go from the last splat to the first.
    flushed
        Whether what is subnormal becomes zero.
    local
        Whether positions are stored relative to a tile.
    seed
        Of what is random.
    """

    model: ErrorModel
    rounding: str = NEAREST
    backwards: bool = False
    flushed: bool = False
    local: bool = True
    seed: int = 0

    def __post_init__(self):
        self._rng = np.random.default_rng(self.seed)

    def binary32(self, x):
        """To binary32; the numbers stay binary64."""
        with np.errstate(over="ignore"):
            return np.asarray(x, np.float64).astype(np.float32).astype(np.float64)

    def stored(self, x):
        """As it is stored."""
        if not self.model.stored:
            return x
        narrow = to_digits(x, self.model.stored, self.rounding, self._rng)
        narrow = np.where(abs(narrow) > self.model.largest, np.sign(narrow) * np.inf, narrow)
        return np.where(abs(narrow) < self.model.eta, 0.0, narrow) if self.flushed else narrow

    def factor(self, x):
        """As a factor of a product."""
        return to_digits(x, self.model.factor, self.rounding, self._rng) if self.model.factor else x

    def product(self, a, b):
        return self.stored(self.binary32(self.factor(a) * self.factor(b)))

    def sum(self, a, b):
        return self.stored(self.binary32(a + b))

    def reciprocal(self, a):
        return self.stored(self.binary32(1 / a))

    def distance(self, size, position):
        """Pixel centres minus a position, (size,)."""
        centers = np.arange(size) + 0.5
        origin = LOCAL * np.floor(centers / LOCAL) if self.local and self.model.stored else 0.0
        return self.sum(centers - origin, -self.stored(self.binary32(position - origin)))

    def total(self, terms):
        """The sum of terms (n, ...): in stored groups where the model has these, then in binary32."""
        size = self.model.terms
        groups = np.concatenate([terms, np.zeros(-len(terms) % size)]).reshape(size, -1)
        left = groups[0]
        for group in groups[1:]:
            left = self.sum(left, group)
        added = np.add.reduce(left.astype(np.float32), dtype=np.float32)
        return self.stored(np.asarray(added, np.float64))

    def weights(self, parameters, width, height):
        """Per splat: index, box (rows, columns), u1, u2 and g over the box, (h, w) each; g is 0 beside the splat."""
        for n in range(len(parameters))[:: -1 if self.backwards else 1]:
            given = parameters[n, :5].astype(np.float64)
            x, y, l11, l21, l22 = (*given[:2], *self.stored(given[2:]))
            box = footprint(given, width, height, margin=coverage_margin(given, self.model))
            if box is None or not (0 < l11 < np.inf and 0 < l22 < np.inf):
                continue
            r1, r2 = self.reciprocal(l11), self.reciprocal(l22)
            d_x = self.distance(width, x)[box.columns]
            d_y = self.distance(height, y)[box.rows, None]
            u1 = self.product(d_x, r1)
            u2 = self.product(self.sum(d_y, -self.product(l21, u1)), r2)
            u1 = np.broadcast_to(u1, u2.shape)
            sigma = self.sum(self.product(u1, u1), self.product(u2, u2)) / 2
            limit = self.stored(np.float64(LN_255))
            g = np.where(sigma <= limit, self.stored(self.binary32(np.exp(-sigma))), 0.0)
            yield n, (box.rows, box.columns), u1, u2, g

    def render_sum(self, parameters, width, height):
        C, part = np.zeros((2, height, width, 3))
        colors = self.stored(parameters[:, 5:].astype(np.float64))
        held = 0
        for n, at, _, _, g in self.weights(parameters, width, height):
            term = np.where((g > 0)[..., None], self.product(g[..., None], colors[n]), 0.0)
            if self.model.terms == 1:
                C[at] = self.binary32(C[at] + term)
                continue
            part[at] = self.sum(part[at], term)
            held += 1
            if held == self.model.terms:
                C, part, held = self.binary32(C + part), np.zeros_like(part), 0
        return {"sum": self.stored(self.binary32(C + part)).astype(np.float32)}

    def render_frame(self, parameters, width, height, bit_depth):
        C = self.render_sum(parameters, width, height)["sum"].astype(np.float64)
        frame = np.rint(self.binary32(np.clip(C, 0, 1) * (2**bit_depth - 1)))
        return {"frame": frame.astype(np.uint8 if bit_depth == 8 else np.uint16)}

    def render_gradients(self, parameters, residual):
        height, width, _ = residual.shape
        result = np.zeros((len(parameters), 8))
        residual = self.stored(residual.astype(np.float64))
        for n, at, u1, u2, g in self.weights(parameters, width, height):
            covered = g > 0
            u1, u2, g, e = u1[covered], u2[covered], g[covered], residual[at][covered]
            l11, l21, l22, *c = self.stored(parameters[n, 2:].astype(np.float64))
            red, green, blue = (self.product(e[:, k], c[k]) for k in range(3))
            dot = self.sum(self.sum(red, green), blue)
            q = self.product(g, dot)
            moments = (u1, u2, self.product(u1, u1), self.product(u1, u2), self.product(u2, u2))
            of_1, of_2, of_11, of_12, of_22 = (self.total(self.product(q, m)) for m in moments)
            r1, r2 = self.reciprocal(l11), self.reciprocal(l22)
            shear = self.product(self.product(l21, r2), r1)
            result[n] = [
                self.sum(self.product(of_1, r1), -self.product(shear, of_2)),
                self.product(of_2, r2),
                self.sum(self.product(of_11, r1), -self.product(shear, of_12)),
                self.product(of_12, r2),
                self.product(of_22, r2),
                *(self.total(self.product(g, e[:, k])) for k in range(3)),
            ]
        with np.errstate(over="ignore"):
            return {"gradients": result.astype(np.float32)}

    def loss(self, picture, target):
        clamped, wanted = self.stored(np.clip(picture, 0, 1)), self.stored(target.astype(np.float64))
        difference = self.sum(clamped.astype(np.float64), -wanted)
        pixels = picture.shape[0] * picture.shape[1]
        squares = self.product(difference, difference).reshape(-1)
        loss = self.stored(self.binary32(self.total(squares) / pixels))
        residual = self.stored(self.binary32(self.sum(difference, difference) / pixels))
        return {"loss": np.asarray(loss, np.float64), "residual": residual.astype(np.float32)}


class Flushing(Narrow):
    """Binary32 that takes every subnormal number for zero, as float atomics of GPUs do; sums are formed in pairs."""

    def binary32(self, x):
        rounded = super().binary32(x)
        return np.where(abs(rounded) < SMALLEST_NORMAL, 0.0, rounded)

    def total(self, terms):
        while len(terms) > 1:
            terms = self.sum(*np.concatenate([terms, np.zeros(len(terms) % 2)]).reshape(2, -1))
        return terms.sum()


class TermByTerm(Narrow):
    """The terms of (10-7) as they are written: v1 and v2 at each pixel, in place of moments."""

    def render_gradients(self, parameters, residual):
        gradients = super().render_gradients(parameters, residual)["gradients"]
        height, width, _ = residual.shape
        for n, at, u1, u2, g in self.weights(parameters, width, height):
            l11, l21, l22, *color = parameters[n, 2:].astype(np.float64)
            v2 = self.product(u2, self.reciprocal(l22))
            v1 = self.product(self.sum(u1, -self.product(l21, v2)), self.reciprocal(l11))
            q = self.product(g, (residual[at] * color).sum(axis=2))
            gradients[n, :2] = [self.total(self.product(q, v)[g > 0]) for v in (v1, v2)]
        return {"gradients": gradients}


class FlushingTermByTerm(TermByTerm, Flushing):
    """Both: what (13-16) has no room for."""


def shifted(double, by):
    """A double whose splats lie `by` pixels to the left: a real fault."""
    return Changed(double, lambda parameters: parameters - np.float32([by, 0, 0, 0, 0, 0, 0, 0]))


def tinted(double, by):
    """A double whose colours are a factor of 1 + `by` too large."""
    return Changed(double, lambda parameters: parameters * np.float32([1, 1, 1, 1, 1, 1 + by, 1 + by, 1 + by]))


@dataclass
class Changed:
    """A double that is asked about other splats."""

    double: Narrow
    change: object

    def render_sum(self, parameters, **size):
        return self.double.render_sum(self.change(parameters), **size)

    def render_frame(self, parameters, **size):
        return self.double.render_frame(self.change(parameters), **size)

    def render_gradients(self, parameters, residual):
        return self.double.render_gradients(self.change(parameters), residual)


def in_the_frame(double):
    """A double that stores positions in the frame."""
    return replace(double, local=False)
