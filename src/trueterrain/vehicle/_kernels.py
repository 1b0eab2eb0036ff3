"""Loops of the time response and of the contact patch; arguments are checked by the callers."""

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def advance_states(gains, state, before, heights, out):
    """Write displacement, velocity and acceleration after each step into `out`, shape (N, 3n).

    ``gains``, shape (2n + 2w, 3n), hold the effect of state, wheel heights before and wheel heights
    after a step, one per row; ``heights``, shape (N, w), are those after each step.
    """
    steps, wheels = heights.shape
    size = out.shape[1]
    states = state.size
    current = state.copy()
    for k in range(steps):
        for i in range(size):
            out[k, i] = 0.0
        for j in range(states):
            value = current[j]
            for i in range(size):
                out[k, i] += gains[j, i] * value
        for j in range(wheels):
            value = before[j] if k == 0 else heights[k - 1, j]
            for i in range(size):
                out[k, i] += gains[states + j, i] * value
        for j in range(wheels):
            value = heights[k, j]
            for i in range(size):
                out[k, i] += gains[states + wheels + j, i] * value
        for j in range(states):
            current[j] = out[k, j]


@compile_kernel
def weighted_means(strip, weights, line, out):
    """Mean across of `strip` into `line`, shape (along,), its weighted sums along into `out`."""
    along, across = strip.shape
    for i in range(along):
        total = 0.0
        for j in range(across):
            total += strip[i, j]
        line[i] = total / across
    for i in range(out.size):
        total = 0.0
        for j in range(weights.size):
            total += weights[j] * line[i + j]
        out[i] = total
