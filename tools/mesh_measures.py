"""Measures of triangle meshes by NumPy alone, exact but for rounding: which points are near, inside, seen by cameras.

Triangles are [F,3,3], points [N,3], in double precision. Cameras are those of hsi4d's cameras.json.
"""

import numpy as np

NEAREST = 0.05  # metres before a camera: what is nearer is not seen


def ranges(first, counts):
    """Numbers first, first + 1, … of each row, and which row each is of."""
    row = np.repeat(np.arange(len(counts)), counts)
    return np.repeat(first - np.cumsum(counts) + counts, counts) + np.arange(len(row)), row


def pairs(points, low, high, cell, at_once=500_000):
    """Yields (points, boxes) by numbers: the boxes that touch the cell of a grid which a point is in. [N,D]; [M,D] corners."""
    origin = points.min(0)
    at = np.floor((points - origin) / cell).astype(np.int64)
    shape = at.max(0) + 1
    first, last = np.floor((low - origin) / cell), np.floor((high - origin) / cell)
    boxes = np.flatnonzero(((last >= 0) & (first < shape)).all(1))
    first = np.maximum(first[boxes], 0).astype(np.int64)
    sizes = np.minimum(last[boxes], shape - 1).astype(np.int64) - first + 1
    left, row = ranges(np.zeros(len(boxes), np.int64), sizes.prod(1))
    key = np.zeros(len(row), np.int64)
    for axis in range(points.shape[1]):
        key = key * shape[axis] + first[row, axis] + left % sizes[row, axis]
        left //= sizes[row, axis]
    order = np.argsort(key, kind="stable")
    key, boxes = key[order], boxes[row[order]]
    of_point = np.ravel_multi_index(at.T, shape)
    begin, end = np.searchsorted(key, of_point), np.searchsorted(key, of_point, side="right")
    sums = np.concatenate([[0], np.cumsum(end - begin)])
    n = 0
    while n < len(points):
        until = max(n + 1, int(np.searchsorted(sums, sums[n] + at_once, side="right")) - 1)
        entry, point = ranges(begin[n:until], (end - begin)[n:until])
        yield point + n, boxes[entry]
        n = until


def cross2(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


def crossings(points, triangles):
    """Yields (points, triangles, shares of the corners) where a triangle of the plane has a point in it. [N,2]; [F,3,2]"""
    cell = max((points.max(0) - points.min(0)).max() / 128, 1e-9)
    for p, t in pairs(points, triangles.min(1), triangles.max(1), cell):
        a, b, c = (triangles[t, k] - points[p] for k in range(3))
        shares = np.stack([cross2(b, c), cross2(c, a), cross2(a, b)], axis=1)
        area = shares.sum(1)
        is_in = ((shares * np.sign(area)[:, None] >= 0).all(1)) & (area != 0)
        yield p[is_in], t[is_in], shares[is_in] / area[is_in, None]


def winding(points, triangles):
    """[N] How often closed surfaces go around a point: 1 in a solid, -1 in a hollow, the sum where several are. A ray goes up
    and counts the faces that it leaves through, less those that it enters by."""
    turns = np.sign(cross2(triangles[:, 1, :2] - triangles[:, 0, :2], triangles[:, 2, :2] - triangles[:, 0, :2])).astype(int)
    total = np.zeros(len(points), int)
    for p, t, shares in crossings(points[:, :2], triangles[..., :2]):
        is_above = (shares * triangles[t, :, 2]).sum(1) > points[p, 2]
        np.add.at(total, p[is_above], turns[t[is_above]])
    return total


def squared_to_edge(points, a, b):
    along = b - a
    share = np.clip(((points - a) * along).sum(1) / np.maximum((along * along).sum(1), 1e-300), 0, 1)
    return ((points - a - share[:, None] * along)**2).sum(1)


def squared_distances(points, triangles):
    """Of each point and the triangle of the same row."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    least = np.minimum(np.minimum(squared_to_edge(points, a, b), squared_to_edge(points, b, c)), squared_to_edge(points, c, a))
    normal = np.cross(b - a, c - a)
    over = np.ones(len(points), bool)  # whether the point is over the triangle's inside
    for p, q in ((a, b), (b, c), (c, a)):
        over &= (np.cross(normal, q - p) * (points - p)).sum(1) >= 0
    size = (normal * normal).sum(1)
    height = ((points - a) * normal).sum(1)
    return np.where(over & (size > 0), height**2 / np.maximum(size, 1e-300), least)


def is_near(points, triangles, within):
    """[N] whether some triangle is at most so far away."""
    near = np.zeros(len(points), bool)
    for p, t in pairs(points, triangles.min(1) - within, triangles.max(1) + within, 2 * within):
        near[p[squared_distances(points[p], triangles[t]) <= within**2]] = True
    return near


def split(triangles, longest):
    """The same surface of triangles without longer edges."""
    done = []
    while len(triangles):
        lengths = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        worst = lengths.argmax(1)
        is_long = lengths.max(1) > longest
        done.append(triangles[~is_long])
        a, b, c = (triangles[is_long, (worst[is_long] + k) % 3] for k in range(3))
        middle = (a + b) / 2
        triangles = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return np.concatenate(done)


def sampled(triangles, count, seed):
    """Places on a surface, evenly by area, and its normals there: [N,3] each."""
    random = np.random.default_rng(seed)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    of = random.choice(len(triangles), count, p=areas / areas.sum())
    a, b = np.sqrt(random.random((count, 1))), random.random((count, 1))
    corner = triangles[of]
    return (1 - a) * corner[:, 0] + a * (1 - b) * corner[:, 1] + a * b * corner[:, 2], normals[of] / areas[of, None]


def in_camera(points, camera):
    """[...,3] in the camera's axes: right, down, away."""
    matrix = np.asarray(camera["world_to_camera"], float)
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def eye_of(camera):
    """[3] where a camera is."""
    matrix = np.asarray(camera["world_to_camera"], float)
    return -matrix[:3, :3].T @ matrix[:3, 3]


def projected(points, camera):
    """[...,2] pixels of points in the camera's axes."""
    return points[..., :2] / points[..., 2:] * (camera["fx"], camera["fy"]) + (camera["cx"], camera["cy"])


def in_view(triangles, camera):
    """Pixels [F,3,2], 1/depths [F,3] and numbers of the triangles that are before a camera as a whole."""
    corners = in_camera(triangles, camera)
    numbers = np.flatnonzero(corners[..., 2].min(1) > NEAREST)
    corners = corners[numbers]
    return projected(corners, camera), 1 / corners[..., 2], numbers


def seen_by(camera, points, normals, triangles):
    """[N] whether a camera sees points of a surface: they are in its picture, face it, and no triangle is before them. Triangles
    are small beside the room before the camera (split): those that reach behind it are passed over."""
    slack = 0.001  # metres: what is so near before a point does not hide it
    local = in_camera(points, camera)
    seen = (local[:, 2] > NEAREST) & (((eye_of(camera) - points) * normals).sum(1) > 0)
    at = projected(np.where(seen[:, None], local, 1), camera)
    seen &= (at >= 0).all(1) & (at < (camera["width"], camera["height"])).all(1)
    kept = np.flatnonzero(seen)
    if len(kept) == 0:
        return seen
    corners, nearness, _ = in_view(triangles, camera)
    for p, t, shares in crossings(at[kept], corners):
        is_hidden = 1 / (shares * nearness[t]).sum(1) < local[kept[p], 2] - slack
        seen[kept[p[is_hidden]]] = False
    return seen


def picture_of(triangles, camera, color=(0.80, 0.77, 0.72)):
    """[H,W,3] a mesh as of clay, lit from the camera's upper left; white where nothing is."""
    y, x = np.mgrid[:camera["height"], :camera["width"]]
    pixels = np.stack([x.ravel() + 0.5, y.ravel() + 0.5], axis=1)
    corners, nearness, numbers = in_view(triangles, camera)
    local = in_camera(triangles[numbers], camera)
    normals = np.cross(local[:, 1] - local[:, 0], local[:, 2] - local[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    light = np.array([-0.4, -0.6, -0.7]) / np.linalg.norm([-0.4, -0.6, -0.7])
    shade = 0.35 + 0.65 * np.clip(0.5 + 0.5 * normals @ light, 0, 1)
    best, image = np.zeros(len(pixels)), np.ones((len(pixels), 3))
    for p, t, shares in crossings(pixels, corners):
        near = (shares * nearness[t]).sum(1)
        order = np.argsort(near)
        p, t, near = p[order], t[order], near[order]  # of a pixel the nearest comes last, and stays
        better = near > best[p]
        best[p[better]] = near[better]
        image[p[better]] = shade[t[better], None] * color
    return image.reshape(camera["height"], camera["width"], 3)


def is_closed(faces):
    """Whether each edge has two faces that go along it in opposite directions. [F,3] numbers of vertices"""
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    there, back = (np.sort(a * (faces.max() + 1) + b) for a, b in (ends.T, ends.T[::-1]))
    return bool((there == back).all() and (np.diff(there) > 0).all())


def read_ply(path):
    """Vertices and faces of a mesh that `hsi4d mesh` has written."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    counts = [int(line.split()[2]) for line in data[:end].decode().splitlines() if line.startswith("element")]
    vertices = np.frombuffer(data, "<f8", 3 * counts[0], end).reshape(-1, 3)
    faces = np.frombuffer(data, np.dtype([("corners", "u1"), ("face", "<i4", 3)]), counts[1], end + vertices.nbytes)["face"]
    return vertices, faces
