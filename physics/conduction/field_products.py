"""Products of the fields' gradients at the quadrature points: what a change of the conductivity is weighed with."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import csc_array

from ertskin.physics.conduction.triangle import Space, quadrature, shape_slopes

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

BLOCK = 64  # quadrature points whose gradients are held at once
LANES = 8  # numbers of single precision that are multiplied at once


def field_products(space: Space, potential: Array, elements: Indices, tensor: bool) -> Array:
    """(n,Q,C,L(L+1)/2) lower triangles of the products of L fields (N,L) in the elements (n,), in 1/m².

    C = 1: grad u_i . grad u_j; with ``tensor`` C = 3: what multiplies sigma_xx, sigma_xy and sigma_yy.
    """
    slopes = np.ascontiguousarray(shape_slopes(space.degree, quadrature(space.degree)[0]))
    count = potential.shape[1]
    product = np.empty((len(elements), len(slopes), 3 if tensor else 1, count * (count + 1) // 2))
    _multiply(product, elements, slopes, space.slope, space.element, np.ascontiguousarray(potential))
    return product


def gathered_products(
    space: Space, potential: Array, elements: Indices, tensors: Array, gather: csc_array, weight: Array
) -> NDArray[np.float32]:
    """(C,G,L(L+1)/2) sums of gather @ (weight * grad u_i . A_c grad u_j) over the elements' n quadrature points.

    ``tensors`` (C,3) of xx, xy, yy; ``gather`` (G,n); ``weight`` (n,). The products (n, L(L+1)/2) are never stored. In
    single precision, in which twice as many fit into an instruction.
    """
    slopes = np.ascontiguousarray(shape_slopes(space.degree, quadrature(space.degree)[0]))
    count = potential.shape[1]
    # Fields in whole groups of lanes, and of every product's row the groups up to the diagonal.
    groups = -(-count // LANES)
    fields = np.zeros((len(potential), groups * LANES), dtype=np.float32)
    fields[:, :count] = potential
    row = np.cumsum([0, *(LANES * (i // LANES + 1) for i in range(groups * LANES))])
    total = np.zeros((len(tensors), gather.shape[0], row[-1]), dtype=np.float32)
    forms, weights, share = (np.ascontiguousarray(part, dtype=np.float32) for part in (tensors, weight, gather.data))
    columns = (gather.indptr, gather.indices, share)
    _gather(total, elements, slopes, space.slope, space.element, fields, forms, *columns, weights)
    i, j = np.tril_indices(count)
    return np.asarray(total[..., row[i] + j])


def pair_losses(space: Space, potential: Array, weight_m2: Array) -> Array:
    """(L(L-1)/2, E, Q) weight times |grad (u_i - u_j)|² for all pairs i < j of L fields (N,L)."""
    slopes = np.ascontiguousarray(shape_slopes(space.degree, quadrature(space.degree)[0]))
    count = potential.shape[1]
    losses = np.empty((count * (count - 1) // 2, *weight_m2.shape))
    flat = losses.reshape(len(losses), -1)
    _pair_losses(flat, slopes, space.slope, space.element, np.ascontiguousarray(potential), weight_m2.ravel())
    return losses


@njit(cache=True, nogil=True, fastmath={"contract"})
def _pair_losses(losses, slopes, slope, element, potential, weight):  # type: ignore[no-untyped-def]
    points, nodes, _ = slopes.shape
    count = potential.shape[1]
    total = losses.shape[1]
    gradient = np.empty((2, count, BLOCK))
    each = np.empty((2, count))
    for first in range(0, total, BLOCK):
        last = min(first + BLOCK, total)
        for n in range(first, last):
            e, q = n // points, n % points
            each[:] = 0.0
            for a in range(nodes):
                x, y = 0.0, 0.0
                for b in range(3):
                    x += slopes[q, a, b] * slope[e, b, 0]
                    y += slopes[q, a, b] * slope[e, b, 1]
                row = potential[element[e, a]]
                for i in range(count):
                    each[0, i] += x * row[i]
                    each[1, i] += y * row[i]
            root = np.sqrt(weight[n])
            for i in range(count):
                gradient[0, i, n - first] = root * each[0, i]
                gradient[1, i, n - first] = root * each[1, i]
        pair = 0
        for i in range(count):
            for j in range(i + 1, count):
                xi, yi, xj, yj = gradient[0, i], gradient[1, i], gradient[0, j], gradient[1, j]
                out = losses[pair, first:last]
                for n in range(last - first):
                    out[n] = (xi[n] - xj[n]) ** 2 + (yi[n] - yj[n]) ** 2
                pair += 1


@njit(cache=True, nogil=True, fastmath={"contract"})
def _multiply(product, elements, slopes, slope, element, potential):  # type: ignore[no-untyped-def]
    points, nodes, _ = slopes.shape
    count = potential.shape[1]
    gradient = np.empty((2, count))
    for n in range(len(elements)):
        e = elements[n]
        for q in range(points):
            gradient[:] = 0.0
            for a in range(nodes):
                for d in range(2):
                    c = 0.0
                    for b in range(3):
                        c += slopes[q, a, b] * slope[e, b, d]
                    for i in range(count):
                        gradient[d, i] += c * potential[element[e, a], i]
            x, y = gradient[0], gradient[1]
            out = product[n, q]
            k = 0
            for i in range(count):
                if len(out) == 1:
                    for j in range(i + 1):
                        out[0, k + j] = x[i] * x[j] + y[i] * y[j]
                else:
                    for j in range(i + 1):
                        out[0, k + j] = x[i] * x[j]
                        out[1, k + j] = x[i] * y[j] + y[i] * x[j]
                        out[2, k + j] = y[i] * y[j]
                k += i + 1


@njit(cache=True, nogil=True, fastmath={"contract"})
def _gather(total, elements, slopes, slope, element, potential, tensors, start, index, share, weight):  # type: ignore[no-untyped-def]
    points, nodes, _ = slopes.shape
    width = potential.shape[1]
    local = np.empty((nodes, width), dtype=np.float32)
    by_node = np.empty((2 * points, nodes), dtype=np.float32)
    gradient, bent = np.empty((2 * points, width), dtype=np.float32), np.empty((2, width), dtype=np.float32)
    product = np.empty(total.shape[2], dtype=np.float32)
    for n in range(len(elements)):
        _gradients(elements[n], slopes, slope, element, potential, local, by_node, gradient)
        for q in range(points):
            at = n * points + q
            if start[at] == start[at + 1]:
                continue
            for c in range(len(tensors)):
                xx, xy, yy = weight[at] * tensors[c, 0], weight[at] * tensors[c, 1], weight[at] * tensors[c, 2]
                for i in range(width):
                    bent[0, i] = xx * gradient[q, i] + xy * gradient[points + q, i]
                    bent[1, i] = xy * gradient[q, i] + yy * gradient[points + q, i]
                _multiplied(bent, gradient, q, product)
                for entry in range(start[at], start[at + 1]):
                    sums = total[c, index[entry]]
                    part = share[entry]
                    for k in range(len(product)):
                        sums[k] += part * product[k]


@njit(inline="always")
def _gradients(e, slopes, slope, element, potential, local, by_node, gradient):  # type: ignore[no-untyped-def]
    """Fill ``gradient`` (2Q,L) of the fields at an element's points, all by x and then all by y."""
    points, nodes, _ = slopes.shape
    for a in range(nodes):
        for i in range(local.shape[1]):
            local[a, i] = potential[element[e, a], i]
    for q in range(points):
        for a in range(nodes):
            for d in range(2):
                c = 0.0
                for b in range(3):
                    c += slopes[q, a, b] * slope[e, b, d]
                by_node[d * points + q, a] = c
    np.dot(by_node, local, gradient)


@njit(inline="always")
def _multiplied(bent, gradient, q, product):  # type: ignore[no-untyped-def]
    """Fill ``product`` with each field's bent gradient times those of the fields up to it, in whole groups of lanes."""
    x, y = gradient[q], gradient[q + len(gradient) // 2]
    k = 0
    for i in range(gradient.shape[1]):
        by_x, by_y = bent[0, i], bent[1, i]
        for first in range(0, i + 1, LANES):
            out, along, across = product[k : k + LANES], x[first : first + LANES], y[first : first + LANES]
            for j in range(LANES):
                out[j] = by_x * along[j] + by_y * across[j]
            k += LANES
