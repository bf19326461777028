"""Two meshes with textures whose truth is known, made of closed solids: a furnished room, and a jug beside a box.

    parts = room()                     # or jug_and_box(): a list of Part
    write_glb("room.glb", parts)
    triangles = all_triangles(parts)   # [F,3,3] metres, z up, counter-clockwise seen from free space

The room itself is a hollow: its walls show their fronts to the inside, and all beyond them counts as solid. Solids may reach
into each other and into walls. Needs NumPy and PIL.
"""

import dataclasses
import io
import json
import struct

import numpy as np
from PIL import Image

WHITE = (1.0, 1.0, 1.0)
X, Y, Z = np.eye(3)


@dataclasses.dataclass
class Part:
    texture: str
    color: tuple  # factor of the texture
    triangles: np.ndarray  # [F,3,3]
    uvs: np.ndarray  # [F,3,2], v down


# ---- Shapes: pairs of triangles [F,3,3] and uvs [F,3,2]


def joined(shapes):
    return tuple(np.concatenate(values) for values in zip(*shapes))


def quad(corner, across, up, window=(0, 0, 1, 1)):
    """Its front is where across x up points. window: u, v of the corner and of the one opposite."""
    corner, across, up = (np.asarray(v, float) for v in (corner, across, up))
    places = np.array([corner, corner + across, corner + across + up, corner + up])
    u0, v0, u1, v1 = window
    uvs = np.array([[u0, -v0], [u1, -v0], [u1, -v1], [u0, -v1]]) + [0, 1]
    return places[[[0, 1, 2], [0, 2, 3]]], uvs[[[0, 1, 2], [0, 2, 3]]]


def box(low, high, tile=None):
    """tile: metres of the texture's side; without, each face shows it whole."""
    low, size = np.asarray(low, float), np.subtract(high, low)
    x, y, z = np.diag(size)
    sides = [(low, x, z), (low + x, y, z), (low + x + y, -x, z), (low + y, -y, z), (low + z, x, y), (low + y, x, -y)]
    window = lambda a, b: (0, 0, np.linalg.norm(a) / tile, np.linalg.norm(b) / tile) if tile else (0, 0, 1, 1)
    return joined([quad(corner, a, b, window(a, b)) for corner, a, b in sides])


def lathe(profile, sides=48, repeat=1):
    """A profile of (radius, height), from the axis up the outside and back to the axis, turned about z."""
    profile = np.asarray(profile, float)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    turn[-1] = 0  # the same bits where the surface closes
    along = np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(profile, axis=0), axis=1))])
    places = np.stack([np.outer(np.cos(turn), profile[:, 0]), np.outer(np.sin(turn), profile[:, 0]),
                       np.broadcast_to(profile[:, 1], (sides + 1, len(profile)))], axis=-1)
    u, v = np.meshgrid(np.linspace(0, repeat, sides + 1), 1 - along / along[-1], indexing="ij")
    return sheet(places, np.stack([u, v], axis=-1))


def sheet(places, uvs):
    """The quads of a grid [N,M]; what has no area is left out."""
    def triangles(grid):
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        return np.concatenate([np.stack(corners, axis=2).reshape(-1, 3, grid.shape[-1]) for corners in ([a, b, c], [a, c, d])])

    faces, at = triangles(places), triangles(uvs)
    kept = np.linalg.norm(np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]), axis=1) > 1e-12
    return faces[kept], at[kept]


def ball(radii, sides=24):
    turn = np.linspace(-np.pi / 2, np.pi / 2, sides // 2 + 1)
    profile = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    profile[[0, -1], 0] = 0
    places, uvs = lathe(profile, sides)
    return places * radii, uvs


def tube(path, radius, sides=20):
    """A rod along a path that lies in the plane of x and z, closed at both ends."""
    path = np.asarray(path, float)
    ways = np.gradient(path, axis=0)
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    normals = np.cross(Y, ways)
    turn = np.linspace(0, 2 * np.pi, sides + 1)
    turn[-1] = 0
    ring = radius * (np.cos(turn)[:, None, None] * normals - np.sin(turn)[:, None, None] * Y)
    ends = np.broadcast_to(path[[0, -1]], (sides + 1, 2, 3))
    places = np.concatenate([ends[:, :1], path + ring, ends[:, 1:]], axis=1)
    u, v = np.meshgrid(np.linspace(0, 1, sides + 1), np.linspace(0, 1, len(path) + 2), indexing="ij")
    return sheet(places[::-1], np.stack([u, v], axis=-1)[::-1])


def placed(shape, at=(0, 0, 0), degrees=0.0, tilt=0.0):
    """Tilted about x, then turned about z, then moved."""
    c, s, ct, st = (f(np.radians(angle)) for angle in (degrees, tilt) for f in (np.cos, np.sin))
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[1, 0, 0], [0, ct, -st], [0, st, ct]])
    return shape[0] @ turn.T + at, shape[1]


def wall(corner, across, up, tile, hole=None):
    """A wall, and about a hole (low and high along `across` and `up`, depth) the sides of a recess without its back."""
    a, u = (v / np.linalg.norm(v) for v in (across, up))
    n, width, height = np.cross(a, u), np.linalg.norm(across), np.linalg.norm(up)
    at = lambda x, y, d=0.0: corner + x * a + y * u - d * n
    flat = lambda x0, y0, x1, y1: quad(at(x0, y0), (x1 - x0) * a, (y1 - y0) * u, (x0 / tile, y0 / tile, x1 / tile, y1 / tile))
    if hole is None:
        return flat(0, 0, width, height)
    x0, y0, x1, y1, d = hole
    w, h, back = (x1 - x0) * a, (y1 - y0) * u, d * n
    sides = [(at(x0, y0, d), back, w), (at(x0, y1, d), w, back), (at(x0, y0, d), h, back), (at(x1, y0, d), back, h)]
    return joined([flat(0, 0, width, y0), flat(0, y1, width, height), flat(0, y0, x0, y1), flat(x1, y0, width, y1)] +
                  [quad(c, p, q, (0, 0, np.linalg.norm(p) / tile, np.linalg.norm(q) / tile)) for c, p, q in sides])


# ---- Textures: [H,W,3], 0 to 1


def noise(size, cells, seed):
    """Smooth, 0 to 1, fits to itself at its sides; cells along columns and along rows."""
    down, across = np.broadcast_to(cells, 2)
    grid = np.random.default_rng(seed).random((down, across), dtype=np.float32)
    padded = np.pad(grid, 2, mode="wrap")
    large = Image.fromarray(padded).resize((size * (across + 4) // across, size * (down + 4) // down), Image.BICUBIC)
    y, x = 2 * size // down, 2 * size // across
    return np.clip(np.asarray(large)[y:y + size, x:x + size], 0, 1)


def clouds(size, seed, cells=4, octaves=4):
    layers = [noise(size, cells << k, seed + k) / 2**k for k in range(octaves)]
    return sum(layers) / sum(0.5**k for k in range(octaves))


def mixed(share, first, second):
    return (1 - share[..., None]) * np.asarray(first) + share[..., None] * np.asarray(second)


def grid_of(size):
    """x and y (down) of the texels' centres, 0 to 1."""
    at = (np.arange(size) + 0.5) / size
    return np.meshgrid(at, at)


def planks():
    x, y = grid_of(512)
    row = np.floor(8 * y).astype(int)
    along = (x + np.array([0, 0.4, 0.15, 0.7, 0.3, 0.85, 0.55, 0.05])[row]) % 1
    tone = np.random.default_rng(1).uniform(0, 0.7, (8, 2))[row, (along > 0.5).astype(int)]
    image = mixed(0.6 * tone + 0.4 * noise(512, (64, 4), 2), (0.43, 0.27, 0.15), (0.68, 0.48, 0.29))
    gap = (np.abs(8 * y - np.round(8 * y)) < 0.02) | (np.abs(2 * along - np.round(2 * along)) < 0.005)
    return image * np.where(gap, 0.55, 1)[..., None]


def wood():
    return mixed(0.6 * noise(256, (64, 4), 5) + 0.4 * noise(256, (16, 2), 6), (0.50, 0.31, 0.17), (0.73, 0.52, 0.32))


def wallpaper():
    x, y = grid_of(512)
    stripe = 0.5 + 0.5 * np.tanh(6 * np.sin(8 * np.pi * x))
    fx, fy = (4 * x) % 1 - 0.25, (4 * y + 0.5 * np.floor(4 * x)) % 1 - 0.5
    petals = np.hypot(fx, fy) < 0.10 + 0.05 * np.cos(5 * np.arctan2(fy, fx))
    image = mixed(stripe, (0.80, 0.78, 0.70), (0.74, 0.75, 0.68)) + 0.04 * (clouds(512, 10)[..., None] - 0.5)
    return np.where(petals[..., None], (0.62, 0.66, 0.58), image)


def plaster():
    return 0.96 + 0.05 * (clouds(256, 20, 8)[..., None] - 0.5) * np.ones(3)


def cloth():
    x, y = grid_of(256)
    return np.clip(0.86 + 0.05 * (np.sin(32 * np.pi * x) * np.sin(32 * np.pi * y) + 2 * clouds(256, 30) - 1), 0, 1)[..., None] * np.ones(3)


def rug():
    x, y = grid_of(512)
    edge = np.minimum(np.minimum(x, 1 - x), np.minimum(y, 1 - y))
    diamonds = np.abs((6 * x) % 1 - 0.5) + np.abs((4 * y) % 1 - 0.5)
    image = mixed(np.tanh(12 * (diamonds - 0.5)) / 2 + 0.5, (0.66, 0.22, 0.17), (0.20, 0.25, 0.42))
    image[diamonds < 0.16] = (0.90, 0.76, 0.45)
    border = (edge < 0.11) & (edge > 0.02)
    image[border] = np.where((np.sin(40 * np.pi * (x + y)) > 0)[border][:, None], (0.88, 0.80, 0.62), (0.55, 0.16, 0.14))
    image[edge < 0.02] = (0.18, 0.16, 0.20)
    return image * (0.9 + 0.2 * (clouds(512, 40, 16)[..., None] - 0.5))


def outside():
    """What is seen in the window."""
    x, y = grid_of(512)
    image = mixed(y, (0.45, 0.66, 0.92), (0.90, 0.94, 0.97))
    image = mixed(0.6 * np.clip(3 * clouds(512, 52, 2, 5) - 1.4, 0, 1) * (y < 0.7), image, WHITE)
    hills = [(0.62, (0.52, 0.62, 0.66)), (0.72, (0.38, 0.52, 0.40)), (0.84, (0.27, 0.44, 0.22))]
    for k, (level, color) in enumerate(hills):
        ridge = level - 0.12 * (noise(512, (1, 4 + 3 * k), 60 + k)[0] - 0.5)
        image = np.where((y > ridge)[..., None], np.asarray(color) * (0.85 + 0.3 * clouds(512, 70 + k, 16)[..., None]), image)
    return image


def sunset():
    x, y = grid_of(256)
    image = mixed(np.clip(1.5 * y, 0, 1), (0.23, 0.20, 0.42), (0.98, 0.62, 0.32))
    image = np.where((np.hypot(x - 0.62, y - 0.52) < 0.11)[..., None], (1.0, 0.90, 0.62), image)
    for k in range(4):
        ridge = 0.58 + 0.11 * k - 0.2 * (noise(256, (1, 4 << k), 80 + k)[0] - 0.5) / (1 + k)
        image = np.where((y > ridge)[..., None], np.array([0.42, 0.26, 0.36]) * (1 - 0.22 * k), image)
    return image


def abstract():
    x, y = grid_of(256)
    image = np.ones((256, 256, 3)) * (0.93, 0.90, 0.82)
    random = np.random.default_rng(7)
    palette = np.array([(0.80, 0.20, 0.16), (0.12, 0.30, 0.52), (0.95, 0.74, 0.20), (0.13, 0.13, 0.15), (0.30, 0.55, 0.47)])
    for k in range(14):
        cx, cy, r, turn = random.uniform((0.1, 0.1, 0.05, 0), (0.9, 0.9, 0.22, np.pi))
        a, b = (x - cx) * np.cos(turn) + (y - cy) * np.sin(turn), (y - cy) * np.cos(turn) - (x - cx) * np.sin(turn)
        shape = [np.hypot(a, b) < r, (np.abs(a) < r) & (np.abs(b) < 0.3 * r), np.abs(np.hypot(a, b) - r) < 0.015][k % 3]
        image[shape] = palette[k % 5]
    return image


def waves():
    x, y = grid_of(256)
    height = np.sin(14 * y + 3 * np.sin(6 * x) + 6 * clouds(256, 90, 2))
    return mixed(0.5 + 0.5 * height, (0.08, 0.28, 0.42), (0.72, 0.86, 0.84))


def spine():
    """Of a book, grey: its colour is the part's."""
    x, y = grid_of(64)
    image = 0.85 + 0.1 * noise(64, 16, 100)
    is_gilt = (np.abs(y - 0.2) < 0.025) | (np.abs(y - 0.85) < 0.025) | ((np.abs(y - 0.45) < 0.14) & (np.abs(x - 0.5) < 0.14))
    image = np.where(is_gilt, 1.25, image)
    return np.clip(image[..., None] * np.ones(3) * 0.8, 0, 1)


def leaf():
    x, y = grid_of(128)
    veins = np.abs(np.sin(30 * (y + 0.3 * np.abs(x - 0.5)))) < 0.15
    return np.where(veins[..., None], (0.48, 0.68, 0.32), mixed(clouds(128, 110), (0.16, 0.38, 0.14), (0.30, 0.54, 0.22)))


def glaze():
    """Bands with dots, of vases."""
    x, y = grid_of(256)
    image = mixed(clouds(256, 120, 8), (0.86, 0.83, 0.76), (0.93, 0.91, 0.86))
    for level in (0.25, 0.4, 0.7):
        image[np.abs(y - level) < 0.012] = (0.16, 0.28, 0.48)
    image[np.hypot((12 * x) % 1 - 0.5, 12 * (y - 0.325)) < 0.32] = (0.72, 0.32, 0.18)
    return image


def pottery():
    """Of the jug: the outside is the lower half of the picture's height, as the profile goes up and down again."""
    x, y = grid_of(512)
    image = mixed(clouds(512, 130, 8, 5), (0.60, 0.36, 0.22), (0.76, 0.50, 0.32))
    wave = 0.80 + 0.02 * np.sin(2 * np.pi * 8 * x)
    image[np.abs(y - wave) < 0.014] = (0.95, 0.90, 0.78)
    image[np.abs(y - 0.70) < 0.008] = (0.20, 0.30, 0.42)
    image[np.abs(y - 0.90) < 0.008] = (0.20, 0.30, 0.42)
    fx, fy = (8 * x) % 1 - 0.5, (y - 0.635) * 16
    image[np.hypot(fx, fy) < 0.22 + 0.12 * np.cos(6 * np.arctan2(fy, fx))] = (0.16, 0.34, 0.38)
    return image


def cardboard():
    x, y = grid_of(256)
    image = mixed(0.5 * clouds(256, 140, 8) + 0.5 * noise(256, (4, 64), 141), (0.64, 0.48, 0.31), (0.76, 0.60, 0.41))
    image[np.abs(x - 0.5) < 0.07] = (0.82, 0.74, 0.58)
    label = (np.abs(x - 0.27) < 0.17) & (np.abs(y - 0.62) < 0.15)
    image[label] = (0.95, 0.95, 0.93)
    lines = label & (np.abs((18 * y) % 1 - 0.5) < 0.16) & (np.abs(x - 0.25) < 0.11)
    image[lines] = (0.15, 0.15, 0.20)
    image[(np.abs(x - 0.78) < 0.09) & (np.abs(y - 0.3) < 0.09)] = (0.76, 0.18, 0.16)
    return image


def paint():
    return 0.93 + 0.06 * (clouds(128, 150, 8)[..., None] - 0.5) * np.ones(3)


TEXTURES = {f.__name__: f for f in (planks, wood, wallpaper, plaster, cloth, rug, outside, sunset, abstract, waves, spine, leaf, glaze, pottery,
                                    cardboard, paint)}


# ---- The room: 4.8 x 3.8 x 2.5 m, the floor's middle is the origin


LOW, HIGH = np.array([-2.4, -1.9, 0.0]), np.array([2.4, 1.9, 2.5])
UNDER = -0.01  # metres: what stands on the floor reaches a little below it
HOLE = (0.6, 0.95, 2.2, 2.15, 0.25)  # the window's recess in the wall


def room():
    parts = []

    def add(texture, shape, color=WHITE):
        parts.append(Part(texture, color, *shape))

    add_walls(add)
    add_table(add, (0.95, -0.25))
    for at, degrees in [((0.55, 0.42), 5), ((1.35, 0.40), -8), ((0.60, -0.95), 172), ((1.95, -0.25), -95)]:
        add_chair(add, at, degrees)
    add_shelf(add, (-2.4, -1.45))
    add_sofa(add, (-1.0, 1.36))
    add("rug", box((-1.75, -0.75, UNDER), (0.05, 0.75, 0.012)))
    add_pictures(add)
    add_sideboard(add, (-0.45, -1.9))
    add_lamp(add, (2.05, 1.55))
    add_plant(add, (2.02, -1.52))
    return parts


def add_walls(add):
    width, depth, height = HIGH - LOW
    add("planks", wall(LOW, width * X, depth * Y, 1.6))
    add("plaster", wall(LOW + height * Z, depth * Y, width * X, 1.5))
    add("wallpaper", wall(LOW + depth * Y, width * X, height * Z, 0.8, HOLE))
    add("wallpaper", wall(LOW + width * X, -width * X, height * Z, 0.8))
    add("wallpaper", wall(LOW, depth * Y, height * Z, 0.8))
    add("wallpaper", wall(LOW + width * X + depth * Y, -depth * Y, height * Z, 0.8))
    x0, z0, x1, z1, deep = HOLE
    corner = LOW + [x0, depth + deep, z0]
    add("outside", quad(corner, (x1 - x0) * X, (z1 - z0) * Z))
    middle = corner[0] + (x1 - x0) / 2
    bars = [((x0 - 2.42, z0), (x0 - 2.35, z1)), ((x1 - 2.45, z0), (x1 - 2.38, z1)), ((middle - 0.03, z0), (middle + 0.03, z1)),
            ((x0 - 2.42, z0 - 0.02), (x1 - 2.38, z0 + 0.05)), ((x0 - 2.42, z1 - 0.05), (x1 - 2.38, z1 + 0.02))]
    for (left, low), (right, high) in bars:
        add("paint", box((left, 1.9 + deep - 0.06, low), (right, 1.9 + deep + 0.01, high)))
    add("paint", box((x0 - 2.45, 1.84, z0 - 0.04), (x1 - 2.35, 1.9 + deep, z0)))
    skirting = [((-2.41, 1.88), (2.41, 1.91)), ((-2.41, -1.91), (2.41, -1.88)), ((-2.41, -1.91), (-2.38, 1.91)), ((2.38, -1.91), (2.41, 1.91))]
    for low, high in skirting:
        add("paint", box((*low, UNDER), (*high, 0.08)))


def add_table(add, at):
    x, y = at
    add("wood", box((x - 0.75, y - 0.42, 0.71), (x + 0.75, y + 0.42, 0.75), 0.8))
    for dx in (-0.68, 0.62):
        for dy in (-0.35, 0.29):
            add("wood", box((x + dx, y + dy, UNDER), (x + dx + 0.06, y + dy + 0.06, 0.715), 0.5))
    bowl = [(0, 0.74), (0.07, 0.74), (0.11, 0.78), (0.15, 0.85), (0.135, 0.855), (0.09, 0.785), (0, 0.775)]
    add("glaze", placed(lathe(bowl), (x - 0.1, y + 0.05, 0)), (0.75, 0.90, 0.95))
    for dx, dy, dz in [(-0.05, 0.02, 0.82), (0.05, 0.03, 0.82), (0.0, -0.05, 0.82), (0.005, 0.0, 0.895)]:
        add("plaster", placed(ball((0.045, 0.045, 0.045)), (x - 0.1 + dx, y + 0.05 + dy, dz)), (1.0, 0.56, 0.14))
    vase = [(0, 0.74), (0.05, 0.74), (0.075, 0.82), (0.07, 0.90), (0.035, 0.98), (0.045, 1.03), (0, 1.03)]
    add("glaze", placed(lathe(vase), (x + 0.42, y - 0.1, 0)))
    for k, color in enumerate([(0.20, 0.35, 0.60), (0.75, 0.25, 0.20)]):
        add("spine", placed(box((-0.12, -0.085, 0.745 + 0.032 * k), (0.12, 0.085, 0.78 + 0.032 * k)), (x - 0.5, y - 0.18, 0), 20 + 18 * k), color)


def add_chair(add, at, degrees):
    """It looks to -y before it is turned."""
    def put(low, high, tile=0.5):
        add("wood", placed(box(low, high, tile), (*at, 0), degrees), (0.85, 0.72, 0.60))
    put((-0.21, -0.21, 0.43), (0.21, 0.21, 0.47))
    for x in (-0.21, 0.17):
        put((x, -0.21, UNDER), (x + 0.04, -0.17, 0.435))
        put((x, 0.17, UNDER), (x + 0.04, 0.21, 0.95))
    for z in (0.60, 0.75, 0.88):
        put((-0.175, 0.178, z), (0.175, 0.202, z + 0.07))
    add("cloth", placed(box((-0.18, -0.18, 0.46), (0.18, 0.16, 0.49), 0.2), (*at, 0), degrees), (0.45, 0.60, 0.55))


def add_shelf(add, at):
    x, y = at
    width, depth, height = 1.3, 0.30, 1.95
    back = x - 0.01
    add("wood", box((back, y, UNDER), (x + 0.02, y + width, height), 0.6), (0.80, 0.80, 0.80))
    for side in (y - 0.015, y + width - 0.015):
        add("wood", box((back, side, UNDER), (x + depth, side + 0.03, height), 0.6))
    levels = [0.08, 0.46, 0.84, 1.22, 1.60]
    for z in levels + [height - 0.03]:
        add("wood", box((back, y, z - 0.03), (x + depth - 0.005, y + width, z), 0.6))
    random = np.random.default_rng(11)
    palette = [(0.70, 0.22, 0.20), (0.22, 0.36, 0.58), (0.30, 0.50, 0.34), (0.85, 0.70, 0.35), (0.45, 0.30, 0.45), (0.90, 0.86, 0.78),
               (0.25, 0.26, 0.30)]
    for level, (z, end) in enumerate(zip(levels, (1.2, 0.75, 1.0, 0.6, 0.9))):
        at_y, n = 0.04, 0
        while at_y < end:
            thick, tall, deep = random.uniform((0.03, 0.20, 0.16), (0.06, 0.30, 0.22))
            color = palette[(3 * level + n) % len(palette)]
            add("spine", box((x + 0.01, y + at_y, z - 0.01), (x + deep, y + at_y + thick - 0.002, z + tall)), color)
            at_y, n = at_y + thick, n + 1
    vases = [(0.46, 0.98, (0.60, 0.80, 0.85)), (1.22, 0.82, WHITE), (1.22, 1.08, (0.95, 0.75, 0.60)), (1.60, 1.08, (0.70, 0.85, 0.70))]
    for z, dy, color in vases:
        vase = [(0, -0.005), (0.05, -0.005), (0.085, 0.07), (0.08, 0.14), (0.04, 0.21), (0.05, 0.25), (0, 0.25)]
        add("glaze", placed(lathe(vase, 36), (x + 0.14, y + dy, z)), color)


def add_sofa(add, at):
    x, y = at
    color = (0.50, 0.62, 0.70)
    seat, back = ((-0.95, -0.42, 0.10), (0.95, 0.44, 0.28)), ((-0.95, 0.22, 0.20), (0.95, 0.46, 0.80))
    arms = ((-1.0, -0.42, 0.08), (-0.80, 0.46, 0.58)), ((0.80, -0.42, 0.08), (1.0, 0.46, 0.58))
    for low, high in (seat, back, *arms):
        add("cloth", box(np.add((x, y, 0), low), np.add((x, y, 0), high), 0.3), color)
    for dx in (-0.795, 0.005):
        add("cloth", box((x + dx, y - 0.44, 0.27), (x + dx + 0.79, y + 0.23, 0.43), 0.3), (0.55, 0.67, 0.75))
    for dx in (-0.93, 0.87):
        for dy in (-0.38, 0.36):
            add("wood", box((x + dx, y + dy, UNDER), (x + dx + 0.06, y + dy + 0.06, 0.12), 0.5))
    for dx, degrees, color in [(-0.55, 12, (0.85, 0.55, 0.25)), (0.5, -15, (0.75, 0.30, 0.30))]:
        add("cloth", placed(box((-0.2, -0.06, 0), (0.2, 0.06, 0.38), 0.2), (x + dx, y + 0.10, 0.42), degrees, -14), color)


def add_pictures(add):
    def hang(corner, across, up, texture):
        n = np.cross(across, up) / (np.linalg.norm(across) * np.linalg.norm(up))
        a, u = across / np.linalg.norm(across), up / np.linalg.norm(up)
        outer = np.stack([corner - 0.05 * a - 0.05 * u - 0.01 * n, corner + across + up + 0.05 * a + 0.05 * u + 0.025 * n])
        inner = np.stack([corner - 0.01 * n, corner + across + up + 0.032 * n])
        add("wood", box(outer.min(0), outer.max(0), 0.4), (0.45, 0.38, 0.34))
        add(texture, box(inner.min(0), inner.max(0)))
    hang(np.array([2.4, 0.75, 1.2]), -1.0 * Y, 0.7 * Z, "sunset")
    hang(np.array([0.65, -1.9, 1.25]), -0.75 * X, 0.75 * Z, "abstract")
    hang(np.array([1.75, -1.9, 1.15]), -0.6 * X, 0.85 * Z, "waves")
    hang(np.array([-2.4, 0.45, 1.25]), 0.8 * Y, 0.6 * Z, "waves")
    hang(np.array([0.6, 1.9, 1.25]), 0.7 * X, 0.7 * Z, "abstract")


def add_sideboard(add, at):
    x, y = at
    add("wood", box((x - 0.7, y - 0.01, 0.10), (x + 0.7, y + 0.42, 0.70), 0.7), (0.78, 0.66, 0.58))
    for k in range(3):
        left = x - 0.67 + 0.455 * k
        add("wood", box((left, y + 0.40, 0.14), (left + 0.43, y + 0.435, 0.66), 0.5), (0.90, 0.84, 0.76))
        add("paint", placed(ball((0.018, 0.018, 0.018), 16), (left + 0.215, y + 0.445, 0.42)), (0.35, 0.33, 0.30))
    for dx in (-0.66, 0.60):
        for dy in (0.02, 0.34):
            add("wood", box((x + dx, y + dy, UNDER), (x + dx + 0.06, y + dy + 0.06, 0.12), 0.5))
    add("cardboard", placed(box((-0.14, -0.1, 0.69), (0.14, 0.1, 0.88)), (x - 0.42, y + 0.2, 0), 15))
    jug = [(0, 0.69), (0.07, 0.69), (0.11, 0.78), (0.10, 0.88), (0.055, 0.96), (0.07, 1.02), (0, 1.02)]
    add("glaze", placed(lathe(jug), (x + 0.1, y + 0.2, 0)), (0.65, 0.75, 0.95))
    add("rug", placed(ball((0.11, 0.11, 0.11), 32), (x + 0.45, y + 0.2, 0.80)))


def add_lamp(add, at):
    foot = [(0, UNDER), (0.16, UNDER), (0.16, 0.02), (0.03, 0.045), (0.018, 0.06), (0.018, 1.40), (0, 1.40)]
    shade = [(0, 1.35), (0.21, 1.35), (0.13, 1.68), (0, 1.68)]
    add("paint", placed(lathe(foot, 32), (*at, 0)), (0.40, 0.38, 0.36))
    add("cloth", placed(lathe(shade, repeat=4), (*at, 0)), (1.0, 0.92, 0.72))


def add_plant(add, at):
    pot = [(0, UNDER), (0.12, UNDER), (0.17, 0.32), (0.145, 0.32), (0.14, 0.28), (0, 0.28)]
    add("plaster", placed(lathe(pot), (*at, 0)), (0.80, 0.48, 0.34))
    add("wood", placed(lathe([(0, 0.25), (0.02, 0.25), (0.016, 0.9), (0, 0.9)], 16), (*at, 0)), (0.6, 0.7, 0.5))
    for k in range(13):
        shape = placed(ball((0.055, 0.16, 0.009), 20), (0, 0.15, 0))
        add("leaf", placed(shape, (*at, 0.42 + 0.045 * k), 137.5 * k, 25 + 2.5 * k))


# ---- A jug with a handle, and a box beside it


def jug_and_box():
    outer = [(0, 0), (0.055, 0), (0.062, 0.004), (0.083, 0.05), (0.094, 0.10), (0.090, 0.15), (0.070, 0.20), (0.058, 0.23), (0.060, 0.25),
             (0.068, 0.27)]
    inner = [(0.057, 0.27), (0.049, 0.25), (0.047, 0.23), (0.059, 0.197), (0.079, 0.147), (0.083, 0.10), (0.072, 0.052), (0.050, 0.013),
             (0, 0.012)]
    t = np.linspace(0, 1, 25)[:, None]
    bends = np.array([(0.054, 0, 0.245), (0.16, 0, 0.245), (0.17, 0, 0.10), (0.0885, 0, 0.10)])  # Bezier's; its ends lie in the wall
    handle = (1 - t)**3 * bends[0] + 3 * t * (1 - t)**2 * bends[1] + 3 * t**2 * (1 - t) * bends[2] + t**3 * bends[3]
    at = (-0.07, 0.02, 0)
    shapes = [("pottery", lathe(outer + inner, 72)), ("plaster", tube(handle, 0.0105))]
    parts = [Part(texture, WHITE if texture == "pottery" else (0.62, 0.38, 0.25), *placed(shape, at, -150)) for texture, shape in shapes]
    return parts + [Part("cardboard", WHITE, *placed(box((-0.075, -0.055, 0), (0.075, 0.055, 0.13)), (0.13, -0.02, 0), 25))]


# ---- Files


def all_triangles(parts):
    return np.concatenate([part.triangles for part in parts])


def png(image):
    file = io.BytesIO()
    Image.fromarray(np.round(255 * np.clip(image, 0, 1)).astype(np.uint8)).save(file, "PNG")
    return file.getvalue()


def write_glb(path, parts):
    """Binary glTF, y up, with the textures inside. Parts of one look become one piece."""
    blocks, views, accessors, primitives, materials = [], [], [], [], []

    def view(data):
        views.append({"buffer": 0, "byteOffset": sum(map(len, blocks)), "byteLength": len(data)})
        blocks.append(data + bytes(-len(data) % 4))
        return len(views) - 1

    def accessor(rows, kind):
        rows = np.ascontiguousarray(rows, dtype="<f4")
        accessors.append({"bufferView": view(rows.tobytes()), "componentType": 5126, "count": len(rows), "type": kind,
                          "min": rows.min(0).tolist(), "max": rows.max(0).tolist()})
        return len(accessors) - 1

    names = sorted({part.texture for part in parts})
    images = [{"bufferView": view(png(TEXTURES[name]())), "mimeType": "image/png"} for name in names]
    for texture, color in sorted({(part.texture, part.color) for part in parts}):
        alike = [part for part in parts if (part.texture, part.color) == (texture, color)]
        places = np.concatenate([part.triangles for part in alike]).reshape(-1, 3)
        primitives.append({"attributes": {"POSITION": accessor(np.stack([places[:, 0], places[:, 2], -places[:, 1]], axis=1), "VEC3"),
                                          "TEXCOORD_0": accessor(np.concatenate([part.uvs for part in alike]).reshape(-1, 2), "VEC2")},
                           "material": len(materials)})
        materials.append({"pbrMetallicRoughness": {"baseColorFactor": [*color, 1], "baseColorTexture": {"index": names.index(texture)},
                                                   "metallicFactor": 0}})
    data = b"".join(blocks)
    text = json.dumps({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                       "meshes": [{"primitives": primitives}], "materials": materials, "images": images,
                       "textures": [{"source": k} for k in range(len(images))], "accessors": accessors, "bufferViews": views,
                       "buffers": [{"byteLength": len(data)}]}).encode()
    text += b" " * (-len(text) % 4)
    with open(path, "wb") as file:
        file.write(struct.pack("<4sII", b"glTF", 2, 28 + len(text) + len(data)))
        file.write(struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(data), b"BIN\0") + data)
