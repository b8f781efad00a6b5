"""A bounded memory of many numbers, for quantiles of a stream without an end."""

import random
from array import array

import numpy as np

SIZE = 4096


class Sample:
    """A random sample of the numbers that are added: all of them up to ``size``, then ``size`` of
    them, each with the same chance (reservoir sampling, Vitter's algorithm R, the same draws in
    every run). ``count`` and ``largest`` cover all numbers."""

    def __init__(self, size: int = SIZE) -> None:
        self._size, self._draws = size, random.Random(0)
        self.values = array("d")
        self.count, self.largest = 0, float("-inf")

    def add(self, value: float) -> None:
        self.count += 1
        self.largest = max(self.largest, value)
        if len(self.values) < self._size:
            self.values.append(value)
        elif (place := self._draws.randrange(self.count)) < self._size:
            self.values[place] = value

    def quantile(self, fraction: float) -> float:
        """As numpy's; NaN if nothing was added."""
        return float(np.quantile(self.values, fraction)) if self.values else float("nan")
