"""Silhouette distance as signed spans."""

from silhouette_core.jit import parallel_kernel, prange


@parallel_kernel
def span_distance(prefix, base, rows, starts, ends, offsets, distances):
    """Fills distances (K,): base plus the signed weights under each silhouette's runs, two look-ups
    a run.
    """
    for k in prange(len(distances)):
        total = base
        for n in range(offsets[k], offsets[k + 1]):
            total += prefix[rows[n], ends[n]] - prefix[rows[n], starts[n]]
        distances[k] = total
