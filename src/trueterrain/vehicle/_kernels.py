"""Compiled loops of the time response and the contact patch; the callers check the arguments."""

from trueterrain.core.kernels import compile_kernel


@compile_kernel
def advance_states(gains, state, before, heights, out):
    """Advance a discrete model of n degrees of freedom on w wheels over N steps.

    ``gains``, shape (2n + 2w, 3n): effect on (q, q', q''), columns, of the state (q, q'), the wheel
    heights before and those after a step, rows. ``state``, shape (2n,): q and q' before the first
    step [m or rad, m/s or rad/s]. ``before``, shape (w,): wheel heights before it [m]. ``heights``,
    shape (N, w): wheel heights after each step [m]. ``out``, shape (N, 3n): receives displacement,
    velocity and acceleration after each step.
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
        # displacement and velocity of this step are the state of the next one
        for j in range(states):
            current[j] = out[k, j]


@compile_kernel
def weighted_means(strip, weights, line, out):
    """Mean of a strip of heights across the path, then its moving weighted mean along the path.

    ``strip``, shape (along, across): heights [m]. ``weights``, shape (patch,): weights of the
    samples under a contact patch, sum 1. ``line``, shape (along,): receives the means across [m].
    ``out``, shape (along - patch + 1,): receives the weighted means [m].
    """
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
