"""Nested dissection of a mesh: an elimination order that keeps fill-in low, and the tree of separators behind it.

George, SIAM J. Numer. Anal. 10 (1973) 345. A set of vertices is cut by a straight line; the vertices on one side with a
neighbour on the other form the separator, and both sides are cut again. Nodes between
vertices belong to the deepest of their sets, which keeps every triangle's nodes on one path to the root.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.sparse import coo_array

from ertskin.physics.conduction.triangle import SIDES, Space, lattice

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

LEAF_VERTICES = {1: 12, 2: 5, 3: 3, 4: 2}  # below this a set is eliminated whole; measured on 2,500 to 40,000 nodes


@dataclass(frozen=True, eq=False)
class Dissection:
    """Sets of nodes in elimination order. ``parent`` (S,): the separator above each set, -1 at the root, children
    before parents; ``member`` (N,): the set every node belongs to."""

    parent: Indices
    member: Indices


def dissect(space: Space, leaf_vertices: int | None = None) -> Dissection:
    """The dissection of a space's nodes."""
    triangle = space.element[:, :3]
    count = int(triangle.max()) + 1
    a, b = triangle[:, SIDES].reshape(-1, 2).T
    graph = coo_array((np.ones(2 * len(a)), (np.r_[a, b], np.r_[b, a])), shape=(count, count)).tocsr()
    leaf = LEAF_VERTICES[space.degree] if leaf_vertices is None else leaf_vertices
    parent, depth, member = _bisect(graph.indptr, graph.indices, np.ascontiguousarray(space.node_m[:count]), leaf)
    # Sets were made from the root down; turned round, children come before parents.
    last = len(parent) - 1
    parent = np.where(parent < 0, -1, last - parent)[::-1]
    member, depth = last - member, depth[::-1]
    if space.degree > 1:
        member = _deepest(space, member, depth)
    return Dissection(parent, member)


def _deepest(space: Space, member: Indices, depth: Indices) -> Indices:
    """(N,) sets of all nodes from their triangles' corners': the deepest of those that the node lies between."""
    corner = member[space.element[:, :3]]
    everywhere = np.zeros(space.nodes, dtype=np.intp)
    for local, share in enumerate(lattice(space.degree)):
        between = corner[:, share > 0]
        everywhere[space.element[:, local]] = np.take_along_axis(
            between, depth[between].argmax(axis=1)[:, None], axis=1
        )[:, 0]
    return everywhere


@njit(cache=True, nogil=True)
def _bisect(indptr, indices, xy, leaf):  # type: ignore[no-untyped-def]
    """Parents and depths of the sets from the root down, and the set of every vertex."""
    count = len(xy)
    member = np.zeros(count, np.int64)
    parent = [-1]
    depth = [0]
    parent.pop()
    depth.pop()
    side = np.zeros(count, np.int8)
    inside = np.zeros(count, np.int64) - 1
    pending = [(np.arange(count), -1)]
    stamp = 0
    while len(pending) > 0:
        nodes, above = pending.pop()
        number = len(parent)
        parent.append(above)
        depth.append(0 if above < 0 else depth[above] + 1)
        if len(nodes) <= leaf:
            member[nodes] = number
            continue
        stamp += 1
        inside[nodes] = stamp
        best, best_angle, best_cut = np.inf, 0, 0
        for angle in range(4):
            order = np.argsort(_along(xy, nodes, angle))
            for tenth in range(8, 13):
                cut = max(1, len(nodes) * tenth // 20)
                side[nodes[order[:cut]]] = 0
                side[nodes[order[cut:]]] = 1
                width = _boundary(indptr, indices, nodes, side, inside, stamp)
                cost = width * (1.0 + 0.05 * abs(tenth - 10))
                if cost < best:
                    best, best_angle, best_cut = cost, angle, cut
        order = np.argsort(_along(xy, nodes, best_angle))
        side[nodes[order[:best_cut]]] = 0
        side[nodes[order[best_cut:]]] = 1
        for k in range(len(nodes)):
            if side[nodes[k]] == 0 and _crosses(indptr, indices, nodes[k], side, inside, stamp):
                side[nodes[k]] = 2
        member[nodes[side[nodes] == 2]] = number
        for half in range(2):
            part = nodes[side[nodes] == half]
            if len(part) > 0:
                pending.append((part, number))
    return np.array(parent), np.array(depth), member


@njit(cache=True, nogil=True)
def _along(xy, nodes, angle):  # type: ignore[no-untyped-def]
    """Place of the nodes along one of four directions, 45 degrees apart; ties broken across it."""
    x, y = xy[nodes, 0], xy[nodes, 1]
    if angle == 0:
        return x + 1e-7 * y
    if angle == 1:
        return y - 1e-7 * x
    if angle == 2:
        return x + y + 1e-7 * x
    return x - y + 1e-7 * x


@njit(cache=True, nogil=True)
def _crosses(indptr, indices, node, side, inside, stamp):  # type: ignore[no-untyped-def]
    for k in range(indptr[node], indptr[node + 1]):
        other = indices[k]
        if inside[other] == stamp and side[other] == 1:
            return True
    return False


@njit(cache=True, nogil=True)
def _boundary(indptr, indices, nodes, side, inside, stamp):  # type: ignore[no-untyped-def]
    """How many nodes of side 0 have a neighbour on side 1."""
    width = 0
    for node in nodes:
        if side[node] == 0 and _crosses(indptr, indices, node, side, inside, stamp):
            width += 1
    return width
