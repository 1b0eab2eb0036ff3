"""Figures of accuracy tests: drawn values equal the results."""

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from matplotlib.patches import Rectangle

from trueterrain.figures import plate_errors, position_sensitivity


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def test_errors_of_several_methods_are_lines_broken_at_gaps():
    s = np.array([0.0, 0.01, 0.02, 0.5, 0.51])
    one = xr.Dataset({"error": ("s", 1e-3 * np.arange(5.0))}, {"s": s})
    ax = plate_errors({"thesis": one.isel(s=[2, 0, 1, 4, 3]), "ours": one})
    lines = {line.get_label(): line for line in ax.lines}
    for name in ("thesis", "ours"):
        x, y = lines[name].get_data()
        np.testing.assert_array_equal(x, [0.0, 0.01, 0.02, np.nan, 0.5, 0.51])
        np.testing.assert_array_equal(y, [0.0, 1e-3, 2e-3, np.nan, 3e-3, 4e-3])
    assert ax.get_ylabel() == "Error [mm]"


def test_published_values_are_a_line_or_a_band():
    spread = xr.Dataset(
        {"rms": (("row", "beside"), [[1e-3, 2e-3], [2e-3, 3e-3]]),
         "low": ("row", [1.1e-3, 1.8e-3]), "high": ("row", [1.1e-3, 1.95e-3])},
        {"row": ["static", "excited"], "beside": [-0.25, 0.25]},
    )  # fmt: skip
    ax = position_sensitivity(spread)
    np.testing.assert_allclose(ax.lines[0].get_ydata(), [1.0, 2.0])
    dashed = [line for line in ax.lines if line.get_linestyle() == "--"]
    assert [line.get_ydata()[0] for line in dashed] == [pytest.approx(1.1)]
    (band,) = (patch for patch in ax.patches if isinstance(patch, Rectangle))
    np.testing.assert_allclose([band.get_y(), band.get_y() + band.get_height()], [1.8, 1.95])
