"""Baseline methods that learn places from the same presses; each chooses its parameters by
five-fold cross-validation on them. All see each press divided by its norm, since depths differ:
that takes a third to a half off their errors."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eitskin.arrays import FloatArray
from eitskin_studies.harness.extras import missing_studies_extra

# data and places (n, m), (n, 2) taught, data (k, m) judged: places (k, 2)
Baseline = Callable[[FloatArray, FloatArray, FloatArray], FloatArray]


def of_norm_1(data: FloatArray) -> FloatArray:
    """Each press (n, m) over its norm."""
    return np.asarray(data / np.linalg.norm(data, axis=1, keepdims=True))


def _searched(estimator: Any, grid: dict[str, list[Any]]) -> Baseline:
    def predict(data: FloatArray, place: FloatArray, new: FloatArray) -> FloatArray:
        try:
            from sklearn.compose import TransformedTargetRegressor
            from sklearn.model_selection import GridSearchCV
            from sklearn.pipeline import make_pipeline
            from sklearn.preprocessing import StandardScaler
        except ModuleNotFoundError:
            raise missing_studies_extra("peers", "scikit-learn") from None
        centred = TransformedTargetRegressor(estimator(), transformer=StandardScaler())
        search = GridSearchCV(
            make_pipeline(StandardScaler(), centred),
            {f"transformedtargetregressor__regressor__{k}": v for k, v in grid.items()},
            cv=min(5, len(data)), scoring="neg_mean_absolute_error",
        )  # fmt: skip
        return np.asarray(search.fit(of_norm_1(data), place).predict(of_norm_1(new)))

    return predict


def _ridge() -> Any:
    from sklearn.linear_model import Ridge

    return Ridge()


def _kernel_ridge() -> Any:
    from sklearn.kernel_ridge import KernelRidge

    return KernelRidge(kernel="rbf")


def _nearest() -> Any:
    from sklearn.neighbors import KNeighborsRegressor

    return KNeighborsRegressor(weights="distance")


def _mlp() -> Any:
    from sklearn.neural_network import MLPRegressor

    return MLPRegressor(hidden_layer_sizes=(128, 64), solver="lbfgs", max_iter=150, random_state=0)


POWERS = [10.0**k for k in range(-5, 5)]
BASELINES: dict[str, Baseline] = {
    "kernel ridge": _searched(
        _kernel_ridge, {"alpha": POWERS[:5], "gamma": [1e-4, 3e-4, 1e-3, 3e-3, 1e-2]}
    ),
    "MLP": _searched(_mlp, {"alpha": [0.1, 10.0]}),
    "k-nearest": _searched(_nearest, {"n_neighbors": [1, 2, 3, 4, 6]}),
    "ridge": _searched(_ridge, {"alpha": POWERS}),
}
