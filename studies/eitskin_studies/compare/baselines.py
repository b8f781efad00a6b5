"""The reconstructions that others use, done properly: what this project's solver is compared with.

All take the sensitivity J (m, n), V per (S/m), and turn difference frames dv (k, m) in V into
images (k, n) of the change of conductivity. None is a straw man: each has its regularisation chosen
on training scenes (compare.py), and FISTA has the exact Lipschitz constant. Strengths are relative,
so that they do not depend on units. ``macs`` is what a frame costs in multiply-accumulates of
matrix products, all of J's rows taken; what is made once for a skin is not counted.

    linear back projection   x = J' dv, each pixel over the norm of its sensitivities
    Gauss-Newton, one step   x = (J'J + a s_1^2 I)^-1 J' dv                        (Tikhonov)
    NOSER                    x = (J'J + a s_1^2 R / mean(R))^-1 J' dv,  R = diag(J'J)^p, p = 1/2
    GREIT-like               one matrix, trained to show small targets as blurred discs: greit.py
    conjugate gradient       CGLS, stopped after a few steps: the stop is the regularisation
    plain FISTA              min 1/2 |J x - dv|^2 + lambda |x|_1, signed or x >= 0, K iterations
    total variation          few edges between pixels and x >= 0, by ADMM
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_matrix

from eitskin.arrays import BoolArray, FloatArray, IntArray
from eitskin.errors import FrameError, UsageError


def difference_frames(dv: npt.ArrayLike, rows: int) -> FloatArray:
    """``dv`` as (k, m) floats; a single frame (m,) becomes (1, m).

    Raises:
        FrameError: the frames do not have ``rows`` values each, or a value is not finite.
    """
    frames = np.atleast_2d(np.asarray(dv, dtype=np.float64))
    if frames.ndim != 2 or frames.shape[1] != rows:
        raise FrameError(
            f"frames of shape {np.shape(dv)} do not fit: the model has {rows} rows; check the"
            " protocol"
        )
    finite = np.isfinite(frames).all(axis=1)
    if not finite.all():
        raise FrameError(
            f"frame {int(np.argmin(finite))} (from 0) has values that are not finite; drop or"
            " repair it"
        )
    return frames


@dataclass(frozen=True, eq=False)
class LinearMethod:
    """A reconstruction that is one matrix.

    Attributes:
        name: what tables call it.
        matrix: (n, m), image = matrix @ frame.
    """

    name: str
    matrix: FloatArray

    @property
    def macs(self) -> int:
        """Multiply-accumulates a frame: n m."""
        return self.matrix.size

    def reconstruct(self, dv: npt.ArrayLike) -> FloatArray:
        """Images (k, n) of difference frames (k, m).

        Raises:
            FrameError: as :func:`difference_frames`.
        """
        return np.asarray(difference_frames(dv, self.matrix.shape[1]) @ self.matrix.T)


def back_projection(jacobian: FloatArray, norm: float = 1.0) -> LinearMethod:
    """Linear back projection with normalised sensitivity: x_j = sum_i J_ij dv_i / |J_.j|; its scale
    is arbitrary.

    With ``norm`` 1 (C. G. Xie et al., IEE Proc. G 139 (1992) 89-98) a pixel is divided by the sum
    of its sensitivities, with 2 by their Euclidean length, which makes it a matched filter. A pixel
    without sensitivity stays 0.
    """
    length = np.linalg.norm(jacobian, ord=norm, axis=0)
    return LinearMethod("linear back projection", (jacobian / np.where(length > 0, length, 1.0)).T)


def gauss_newton(jacobian: FloatArray, strength: float) -> LinearMethod:
    """One Gauss-Newton step with a Tikhonov prior, ``strength`` relative to the largest eigenvalue
    s_1^2 of J'J.

    Raises:
        UsageError: the strength is not above 0.
    """
    return LinearMethod(
        "Gauss-Newton (Tikhonov)", _regularised(jacobian, np.ones(jacobian.shape[1]), strength)
    )


def noser(jacobian: FloatArray, strength: float, exponent: float = 0.5) -> LinearMethod:
    """NOSER: one step with the prior R = diag(J'J)^exponent, scaled to mean 1, ``strength`` as in
    :func:`gauss_newton`.

    M. Cheney et al., "NOSER: an algorithm for solving the inverse conductivity problem", Int. J.
    Imaging Syst. Technol. 2 (1990) 66-75, doi 10.1002/ima.1850020203; there the exponent is 1, and
    1/2 is in common use.

    Raises:
        UsageError: the strength is not above 0, or a pixel has no sensitivity.
    """
    power = (jacobian**2).sum(axis=0)
    if exponent and not power.min() > 0:
        raise UsageError(
            f"NOSER: pixel {int(np.argmin(power))} (from 0) has no sensitivity; leave it out of the"
            " grid"
        )
    prior = power**exponent
    return LinearMethod("NOSER", _regularised(jacobian, prior / prior.mean(), strength))


def _regularised(jacobian: FloatArray, prior: FloatArray, strength: float) -> FloatArray:
    """(J'J + a s_1^2 diag(prior))^-1 J', by way of the smaller m x m system."""
    if not strength > 0:
        raise UsageError(f"regularisation strength {strength!r} must be above 0")
    weighted = jacobian / prior
    a = strength * float(np.linalg.norm(jacobian, 2)) ** 2
    return np.asarray(
        np.linalg.solve(weighted @ jacobian.T + a * np.eye(len(jacobian)), weighted).T
    )


@dataclass(frozen=True, eq=False)
class ConjugateGradient:
    """CGLS (Hestenes and Stiefel 1952; Hansen, Discrete Inverse Problems, SIAM 2010, section 6.3)
    from 0.

    Attributes:
        jacobian: J (m, n).
        steps: after how many steps to stop; more fit the noise.
    """

    jacobian: FloatArray
    steps: int
    name: str = "conjugate gradient"

    @property
    def macs(self) -> int:
        """Multiply-accumulates a frame in products with J and J': one for the start, two a step."""
        return (1 + 2 * self.steps) * self.jacobian.size

    def reconstruct(self, dv: npt.ArrayLike) -> FloatArray:
        """Images (k, n) of difference frames (k, m).

        Raises:
            FrameError: as :func:`difference_frames`.
        """
        residual = difference_frames(dv, len(self.jacobian)).copy()
        gradient = residual @ self.jacobian
        image, direction = np.zeros_like(gradient), gradient
        power = (gradient**2).sum(axis=1)
        enough = power * 1e-24
        for _ in range(self.steps):
            forward = direction @ self.jacobian.T
            alpha = _ratio(power, (forward**2).sum(axis=1), power > enough)
            image += alpha[:, None] * direction
            residual -= alpha[:, None] * forward
            gradient = residual @ self.jacobian
            before, power = power, (gradient**2).sum(axis=1)
            direction = gradient + _ratio(power, before, before > enough)[:, None] * direction
        return np.asarray(image)


def _ratio(a: FloatArray, b: FloatArray, where: BoolArray) -> FloatArray:
    return np.divide(a, b, out=np.zeros_like(a), where=where & (b > 0))


@dataclass(frozen=True, eq=False)
class PlainFista:
    """FISTA (Beck and Teboulle, SIAM J. Imaging Sci. 2 (2009) 183-202, doi 10.1137/080716542) on J
    as it is.

    Each frame has lambda = ``ratio`` lambda_max, lambda_max being the smallest lambda whose
    solution is 0: max |J'dv|, or max J'dv where x >= 0.

    Attributes:
        jacobian: J (m, n).
        iterations: K, from 0.
        ratio: lambda / lambda_max, in (0, 1).
        signed: both signs allowed, or x >= 0.
    """

    jacobian: FloatArray
    iterations: int
    ratio: float
    signed: bool = False

    def __post_init__(self) -> None:
        if not (0 < self.ratio < 1 and self.iterations >= 1):
            raise UsageError(
                f"FISTA needs a ratio within (0, 1), not {self.ratio!r}, and at least 1 iteration"
            )

    @property
    def name(self) -> str:
        """Says sign and iterations."""
        return f"plain FISTA {self.iterations}, {'signed' if self.signed else 'non-negative'}"

    @property
    def macs(self) -> int:
        """Multiply-accumulates a frame in products with J and J': one for lambda, two an
        iteration."""
        return (1 + 2 * self.iterations) * self.jacobian.size

    @cached_property
    def step(self) -> float:
        """1 / L, with L the largest eigenvalue of J'J; found once, as a stored model has it."""
        return 1.0 / float(np.linalg.norm(self.jacobian, 2)) ** 2

    def lambdas(self, dv: npt.ArrayLike) -> FloatArray:
        """The lambda of each frame: (k,), at least 0."""
        slope = difference_frames(dv, len(self.jacobian)) @ self.jacobian
        return np.asarray(
            self.ratio * np.maximum((np.abs(slope) if self.signed else slope).max(axis=1), 0.0)
        )

    def reconstruct(self, dv: npt.ArrayLike) -> FloatArray:
        """Images (k, n) of difference frames (k, m); all frames advance together.

        Raises:
            FrameError: as :func:`difference_frames`.
        """
        frames = difference_frames(dv, len(self.jacobian))
        step = self.step
        shrink = (step * self.lambdas(frames))[:, None]
        image = np.zeros((len(frames), self.jacobian.shape[1]))
        ahead, t = image, 1.0
        for _ in range(self.iterations):
            moved = ahead - step * ((ahead @ self.jacobian.T - frames) @ self.jacobian)
            new = np.maximum(moved - shrink, 0.0)
            if self.signed:
                new -= np.maximum(-moved - shrink, 0.0)
            t_new = (1.0 + np.sqrt(1.0 + 4.0 * t * t)) / 2.0
            ahead = new + ((t - 1.0) / t_new) * (new - image)
            image, t = new, t_new
        return image


def neighbours(number: IntArray) -> csr_matrix:
    """The differences (edges, pixels) between kept pixels that share an edge. ``number`` (rows,
    columns) has the place of each pixel in images, -1 where none is kept (``Grid.number``)."""
    sides = ((number[:, :-1], number[:, 1:]), (number[:-1], number[1:]))
    pairs = np.concatenate([np.stack(side, axis=-1).reshape(-1, 2) for side in sides])
    pairs = pairs[(pairs >= 0).all(axis=1)]
    edge = np.arange(len(pairs))
    signs = np.repeat([-1.0, 1.0], len(pairs))
    where = (np.tile(edge, 2), pairs.T.ravel())
    return csr_matrix((signs, where), shape=(len(pairs), int(number.max()) + 1))


@dataclass(frozen=True, eq=False)
class TotalVariation:
    """x >= 0 of the least |A x - d|^2 / 2 + weight sum |differences of x|, where A = J / s_1 and d
    is dv / s_1, scaled so that max |A'd| is 1, by ADMM (S. Boyd et al., Found. Trends Mach. Learn.
    3 (2011) 1-122, doi 10.1561/2200000016) on x, its differences z and a copy w of x that is not
    negative.

    Attributes:
        jacobian: J (m, n).
        edges: the differences, of :func:`neighbours`.
        weight: above 0.
        iterations: of ADMM; small weights have not converged after 200.
    """

    jacobian: FloatArray
    edges: csr_matrix
    weight: float
    iterations: int = 200
    name: str = "total variation, non-negative"

    def __post_init__(self) -> None:
        if not (self.weight > 0 and self.iterations >= 1):
            raise UsageError(
                f"total variation needs a weight above 0, not {self.weight!r}, and at least 1"
                " iteration"
            )

    @property
    def macs(self) -> int:
        """Multiply-accumulates a frame in products with J' and with the inverse."""
        return self.jacobian.size + self.iterations * int(self.jacobian.shape[1]) ** 2

    @property
    def penalty(self) -> float:
        """ADMM's penalty on its constraints."""
        return 50.0 * self.weight

    @cached_property
    def inverse(self) -> FloatArray:
        """(A'A + penalty (D'D + I))^-1, with the differences D; made once for a skin."""
        a = self.jacobian / np.linalg.norm(self.jacobian, 2)
        constraints = (self.edges.T @ self.edges).toarray() + np.eye(a.shape[1])
        return np.asarray(np.linalg.inv(a.T @ a + self.penalty * constraints))

    def reconstruct(self, dv: npt.ArrayLike) -> FloatArray:
        """Images (k, n) of difference frames (k, m), each up to a positive factor of its own; all
        frames advance together.

        Raises:
            FrameError: as :func:`difference_frames`.
        """
        pull = difference_frames(dv, len(self.jacobian)) @ self.jacobian
        size = np.maximum(np.abs(pull).max(axis=1, keepdims=True), np.finfo(float).tiny)
        pull, rho, d = pull / size, self.penalty, self.edges
        w, off_w = np.zeros_like(pull), np.zeros_like(pull)
        z, off_z = np.zeros((len(pull), d.shape[0])), np.zeros((len(pull), d.shape[0]))
        for _ in range(self.iterations):
            x = (pull + rho * ((d.T @ (z - off_z).T).T + w - off_w)) @ self.inverse
            steps = (d @ x.T).T + off_z
            z = np.sign(steps) * np.maximum(np.abs(steps) - self.weight / rho, 0.0)
            off_z = steps - z
            w = np.maximum(x + off_w, 0.0)
            off_w += x - w
        return np.asarray(w * size)
