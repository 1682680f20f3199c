"""Where a series becomes steady, and the error of its mean after that."""

import numpy as np


def start(values, blocks=40):
    """Index from which the mean has the least standard error (White 1997, MSER on block means); at most three quarters of the way."""
    values = np.asarray(values, dtype=float)
    size = max(1, len(values) // blocks)
    means = values[: len(values) // size * size].reshape(-1, size).mean(axis=1)
    errors = [np.var(means[k:]) / (len(means) - k) for k in range(max(1, 3 * len(means) // 4))]
    return int(np.argmin(errors)) * size


def mean(values, blocks=8):
    """Mean and its standard error by block means."""
    values = np.asarray(values, dtype=float)
    size = len(values) // blocks
    if size == 0:
        return values.mean(), float("nan")
    means = values[: size * blocks].reshape(blocks, size).mean(axis=1)
    return values.mean(), means.std(ddof=1) / np.sqrt(blocks)
