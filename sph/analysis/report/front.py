"""The Pareto front of cost and error, the distance of runs from it, and fitted exponents.

All functions take arrays of positive costs and errors, one entry a run.
"""

import numpy as np


def on_front(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(M,) mask of the Pareto front: no other run is better in one and as good in the other."""
    cheaper = cost[None, :] < cost[:, None]
    as_cheap = cost[None, :] <= cost[:, None]
    better = error[None, :] < error[:, None]
    as_good = error[None, :] <= error[:, None]
    is_beaten = (cheaper & as_good) | (as_cheap & better)
    return ~np.any(is_beaten, axis=1)


def cost_at(error: float, front_cost: np.ndarray, front_error: np.ndarray) -> float:
    """Cost of the front at `error`, interpolated between its runs in the logarithms of both.

    For an error above all errors of the front this is the cost of its cheapest run, an upper bound.
    Raises ValueError for an error below all of them.
    """
    if error < front_error.min():
        raise ValueError(f"the front does not reach an error of {error}")
    order = np.argsort(front_error)
    log_cost = np.interp(np.log(error), np.log(front_error[order]), np.log(front_cost[order]))
    return float(np.exp(log_cost))


def excess(cost: np.ndarray, error: np.ndarray) -> np.ndarray:
    """(M,) cost of each run over the front's at the same error: 1 on the front, at least 1 off it.

    It is 1 off the front too where a run is as cheap as the cheapest one there, and less accurate.
    """
    front = on_front(cost, error)
    equal = [cost_at(one, cost[front], error[front]) for one in error]
    return np.where(front, 1.0, cost / np.array(equal, dtype=float))


def slope(x: np.ndarray, y: np.ndarray) -> float | None:
    """Exponent p of y ~ x^p by least squares of the logarithms; None where all x are one."""
    if np.unique(x).size < 2:
        return None
    offset = np.log(x) - np.log(x).mean()
    return float(offset @ np.log(y) / (offset @ offset))
