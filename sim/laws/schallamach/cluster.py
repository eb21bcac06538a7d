"""A cluster of bonds that share a given force equally (Erdmann & Schwarz, PRL 92, 108102 (2004))."""

import math

from sim.numerics.jit import law


@law
def cluster_lifetime(bonds, force, zero_force_rate, bell_force, rebinding_rate):
    """Mean time until the last of some Bell bonds has broken that share a constant force [s].

    Parameters
    ----------
    bonds : float or array
        N, a whole number from 1: sites, all bound at the start.
    force : float or array
        F [N] on the whole cluster; i bonds bear F/i each, whether old or just bound.
    zero_force_rate, bell_force : float or array
        k_0 [1/s], above 0; f_b [N], above 0.
    rebinding_rate : float or array
        k_on [1/s] of each open site, as long as one bond is left.

    Returns
    -------
    float or array
        T [s]; infinite where it is beyond the largest float; nan for numbers that are not whole.

    Notes
    -----
    With i bonds, rupture at ``r_i = i k_0 e^(F/(i f_b))`` and rebinding at ``g_i = k_on (N - i)``, the mean time
    from i bonds to i - 1 is ``t_i = (1 + g_i t_(i+1))/r_i``, and T is the sum of them: positive terms
    throughout. Bonds of a sliding population do not share their load; the two agree only without
    rebinding, at rest.

    Examples
    --------
    Without force and rebinding a harmonic number of lives; a force of two Bell forces takes away most:

    >>> print("%.4f %.4f" % tuple(cluster_lifetime(5, [0.0, 2.0], 1.0, 1.0, 0.0)))
    2.2833 0.7761
    """
    if not bonds >= 1.0 or bonds != math.floor(bonds) or bonds == math.inf:
        return math.nan
    total, step = 0.0, 0.0
    for i in range(int(bonds), 0, -1):
        open_sites = bonds - i
        step = (1.0 + rebinding_rate * open_sites * step) * math.exp(-force / (i * bell_force)) / (i * zero_force_rate)
        total += step
        if total == math.inf:
            return total
    return total
