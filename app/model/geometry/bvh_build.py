"""The compiled half of `bvh`: binned surface-area splitting, bounded in depth.

In a file of its own so that numba is imported (0.4 s) only when a tree must truly be built.
Wald 2007, "On fast Construction of SAH-based Bounding Volume Hierarchies" (binning);
Goldsmith and Salmon 1987 (the cost).
"""

from __future__ import annotations

import numpy as np

from ...base.compiling import compiled

BIN_COUNT = 16
# A visit fetches and tests two boxes.
NODE_COST = 2.0
TRIANGLE_COST = 1.0


@compiled
def _half_area(box):
    """Half the surface of a box (min xyz, max xyz); 0 for one that holds nothing."""
    dx = box[3] - box[0]
    dy = box[4] - box[1]
    dz = box[5] - box[2]
    if dx < 0.0:
        return 0.0
    return dx * dy + dy * dz + dz * dx


@compiled
def _clear(box):
    for k in range(3):
        box[k] = np.inf
        box[3 + k] = -np.inf


@compiled
def _grow(box, other):
    for k in range(3):
        box[k] = min(box[k], other[k])
        box[3 + k] = max(box[3 + k], other[3 + k])


@compiled
def _bin_scale(low, high, bins):
    """Bins per unit; 0 where the centroids coincide or their spread is too small to divide by."""
    spread = high - low
    if spread <= 0.0:
        return 0.0
    scale = bins * (1.0 - 1e-6) / spread
    return scale if np.isfinite(scale) else 0.0


@compiled
def _select(order, key, first, count, middle):
    """Permute order[first:first+count] so that keys left of `middle` are <= those from it on (Hoare)."""
    low = first
    high = first + count - 1
    while low < high:
        pivot = key[order[(low + high) // 2]]
        i = low
        j = high
        while i <= j:
            while key[order[i]] < pivot:
                i += 1
            while key[order[j]] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@compiled
def _best_split(boxes, order, first, count, centroid_box, limit, bin_boxes, bin_counts, right_cost):
    """Cheapest bin boundary whose two sides hold at most `limit` triangles.

    Returns (cost × area, axis, boundary); axis is -1 when there is no such boundary.
    """
    best_cost = np.inf
    best_axis = -1
    best_boundary = 0
    bins = bin_counts.shape[0]
    box = np.empty(6)
    for axis in range(3):
        low = centroid_box[axis]
        scale = _bin_scale(low, centroid_box[3 + axis], bins)
        if scale == 0.0:
            continue
        for b in range(bins):
            bin_counts[b] = 0
            _clear(bin_boxes[b])
        for i in range(first, first + count):
            t = order[i]
            b = int(((boxes[t, axis] + boxes[t, 3 + axis]) * 0.5 - low) * scale)
            bin_counts[b] += 1
            _grow(bin_boxes[b], boxes[t])
        _clear(box)
        n = 0
        for b in range(bins - 1, 0, -1):
            if bin_counts[b] > 0:
                n += bin_counts[b]
                _grow(box, bin_boxes[b])
            right_cost[b] = n * _half_area(box)
        _clear(box)
        n = 0
        for b in range(bins - 1):
            if bin_counts[b] == 0:
                continue
            n += bin_counts[b]
            if n > limit or n == count:
                break
            _grow(box, bin_boxes[b])
            if count - n <= limit:
                cost = n * _half_area(box) + right_cost[b + 1]
                if cost < best_cost:
                    best_cost = cost
                    best_axis = axis
                    best_boundary = b + 1
    return best_cost, best_axis, best_boundary


@compiled
def _partition(boxes, order, first, count, axis, low, scale, boundary):
    """Move the triangles of the bins below `boundary` to the front; returns where the others start."""
    i = first
    j = first + count - 1
    while i <= j:
        t = order[i]
        b = int(((boxes[t, axis] + boxes[t, 3 + axis]) * 0.5 - low) * scale)
        if b < boundary:
            i += 1
        else:
            order[i] = order[j]
            order[j] = t
            j -= 1
    return i


@compiled
def build(triangles_xyz, max_depth, max_leaf, bounds, links):
    """Fill `bounds` (2T-1, 6) float32 and `links` (2T-1, 2) uint32.

    Returns (order int32 (T,), node count, depth of the deepest leaf). No node at `depth` holds
    more than max_leaf · 2^(max_depth - depth) triangles, so halving always ends in time.
    """
    total = triangles_xyz.shape[0]
    boxes = np.empty((total, 6))
    middle_key = np.empty(total)
    order = np.empty(total, np.int32)
    for t in range(total):
        order[t] = t
        for k in range(3):
            a, b, c = triangles_xyz[t, 0, k], triangles_xyz[t, 1, k], triangles_xyz[t, 2, k]
            boxes[t, k] = min(a, b, c)
            boxes[t, 3 + k] = max(a, b, c)

    bin_boxes = np.empty((BIN_COUNT, 6))
    bin_counts = np.empty(BIN_COUNT, np.int64)
    right_cost = np.empty(BIN_COUNT)
    box = np.empty(6)
    centroid_box = np.empty(6)
    stack = np.empty((max_depth + 2, 4), np.int64)
    stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0, 0, total, 0
    height = 1
    node_count = 1
    deepest = 0
    while height > 0:
        height -= 1
        node, first, count, depth = stack[height, 0], stack[height, 1], stack[height, 2], stack[height, 3]
        deepest = max(deepest, depth)
        _clear(box)
        _clear(centroid_box)
        for i in range(first, first + count):
            t = order[i]
            _grow(box, boxes[t])
            for k in range(3):
                centre = (boxes[t, k] + boxes[t, 3 + k]) * 0.5
                centroid_box[k] = min(centroid_box[k], centre)
                centroid_box[3 + k] = max(centroid_box[3 + k], centre)
        for k in range(6):
            bounds[node, k] = box[k]

        split = first
        if count > 1 and depth < max_depth:
            limit = max_leaf << (max_depth - depth - 1)
            cost, axis, boundary = _best_split(
                boxes, order, first, count, centroid_box, limit, bin_boxes, bin_counts, right_cost
            )
            leaf_cost = TRIANGLE_COST * count * _half_area(box)
            split_cost = NODE_COST * _half_area(box) + TRIANGLE_COST * cost
            if axis >= 0 and (count > max_leaf or split_cost < leaf_cost):
                low = centroid_box[axis]
                scale = _bin_scale(low, centroid_box[3 + axis], BIN_COUNT)
                split = _partition(boxes, order, first, count, axis, low, scale, boundary)
            elif count > max_leaf:
                # No boundary (all centroids equal) or none even enough for the depth: halve.
                axis = 0
                for k in range(1, 3):
                    if centroid_box[3 + k] - centroid_box[k] > centroid_box[3 + axis] - centroid_box[axis]:
                        axis = k
                for i in range(first, first + count):
                    t = order[i]
                    middle_key[t] = boxes[t, axis] + boxes[t, 3 + axis]
                split = first + count // 2
                _select(order, middle_key, first, count, split)

        if split == first:
            links[node, 0] = first
            links[node, 1] = count
            continue
        links[node, 0] = node_count
        links[node, 1] = 0
        # The right child is pushed first, so the left subtree's triangles and nodes come first.
        for side in (1, 0):
            stack[height, 0] = node_count + side
            stack[height, 1] = split if side else first
            stack[height, 2] = first + count - split if side else split - first
            stack[height, 3] = depth + 1
            height += 1
        node_count += 2
    return order, node_count, deepest
