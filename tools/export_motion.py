#!/usr/bin/env python3
"""Turns what pose estimators write into a motion file that hsi4d reads.

    tools/export_motion.py wham_output.pkl motion.npz --person 0 --fps 30            # WHAM
    tools/export_motion.py hmr4d_results.pt motion.npz --fps 30                      # GVHMR
    tools/export_motion.py results/clip/hps/hps_track_0.npy motion.npz --fps 30      # TRAM, beside results/clip/camera.npy
    tools/export_motion.py demo/clip/mesh motion.npz --body-model SMPLX_NEUTRAL.npz --fps 30   # WHAC, run with --save_mesh
    tools/export_motion.py output__demo-21__0.pkl motion.npz --from lingo --fps 30   # LINGO
    tools/export_motion.py P0_09_outdoor_walk_data.pkl truth.npz --from emdb --fps 30       # truth of EMDB
    tools/export_motion.py test_body/Gym_010_dips2 truth.npz --from rich --fps 30           # truth of RICH
    tools/export_motion.py Res/01/07/Seg_0/res.pkl truth.npz --from intercap --fps 30       # truth of InterCap

The motion is in the world of whatever made it, turned so that z is up, for a body of SMPL-X; rotations as axis-angle, metres.
With --in-camera it is in the camera's frame of every frame (x right, y down, z forward) and not turned.

| estimator | body   | its world                                                            |
|-----------|--------|----------------------------------------------------------------------|
| WHAM      | SMPL   | y up                                                                 |
| GVHMR     | SMPL-X | y up                                                                 |
| TRAM      | SMPL   | y up where its camera.npy has world_cam_R and world_cam_T, aligned   |
|           |        | with an estimate of gravity. Older versions have the first camera's  |
|           |        | world alone, y down: z is then up only as far as it was level        |
| WHAC      | SMPL-X | y up as far as the first camera was level. It writes meshes alone;   |
|           |        | poses are those whose vertices are nearest, in the least squares     |
| LINGO     | SMPL-X | y up; a dictionary of transl, global_orient and body_pose, at 30     |
|           |        | frames a second (10 that are made, interpolated). Hands are flat, or |
|           |        | left_hand_pose and right_hand_pose, taken as turns of a flat hand    |

A body turns about its pelvis, so turning a motion needs the pelvis of the estimator's body at rest: by default that of
the neutral body of mean shape; --pelvis x,y,z for another. SMPL's pelvis stands elsewhere than SMPL-X's; the translation
is corrected, so that the pelvis stays where the estimator has it; the file says where it stands at rest (pelvis_rest)
where that is known. Frames that an estimator left out are interpolated. A motion that begins with a later frame of the
video says which (first_frame, from 0). Other people of the input, and what of it is not read, are printed.

WHAC numbers its meshes one after the other, also where it saw nobody. The frames they are of are in
detection_results.pth beside the folder, which is read where it is there; else they are taken for frames 0, 1, 2, ...
Shape, expression, hands and jaw are fitted too; the largest distance of a vertex is printed.

| EMDB      | SMPL   | y up; good_frames_mask, the frames that its evaluations count, is kept |
| RICH      | SMPL-X | its first camera's, y down: z is then up only as far as it was level |
| InterCap  | SMPL-X | a camera's, as RICH; its object is kept, obj_rot_mat and obj_trans   |

Of EMDB, RICH and InterCap only arrays are unpickled, which runs no code; what else is in a file is refused. The bodies
of EMDB are of a gender and shape of SMPL, which are left out as all shapes of SMPL. RICH is a folder of folders, one a
frame, with a file a person, which --person chooses by its number; frames that it leaves out are interpolated and no good
ones. Hands of RICH and InterCap, which are given by components, and jaws are left out.

TRUMANS's sample_hsi.py saves no motion: it returns vertices, and its lines that write a pickle are comments. Where they
are made to run, their file is read as LINGO's.

Needs Python with NumPy, and joblib for WHAM (and WHAC's frames) or PyTorch for GVHMR and TRAM (for LINGO where its arrays
are tensors).
CHOIS writes no such file: save trans, root_orient, pose_body, obj_rot_mat and obj_com_pos of its results with
numpy.savez, which hsi4d reads as it is. The inputs are pickles, which can run code
when they are read: only read files whose origin you trust.
"""

import argparse
import pathlib
import sys

SMPL_PELVIS = (-0.00217368, -0.24078917, 0.02858379)
SMPLX_PELVIS = (0.00312326, -0.35140747, 0.01203655)
USUAL_RATE = 30  # frames a second
MOST_MISFIT = 0.03  # metres, of a vertex of a mesh: expressions beyond the ten that are fitted move lips and brows


def fail(message):
    sys.exit("export_motion: " + message)


def module(name):
    try:
        return __import__(name)
    except ImportError as missing:
        fail(f"Python's module {missing.name} is not there (pip install {missing.name})")


def array(np, value, what, width):
    """Rows of `width` finite numbers, float64."""
    value = value.detach().cpu().numpy() if hasattr(value, "detach") else np.asarray(value)
    if value.dtype == object and any(np.size(row) != width for row in value.reshape(-1)):
        fail(f"{what}: is an array of Python objects that are no rows of {width} numbers")
    if value.dtype == object:
        value = np.stack([np.asarray(row, dtype=np.float64).reshape(-1) for row in value.reshape(-1)])
    value = value.astype(np.float64).reshape(len(value), -1) if value.size else value.reshape(0, width)
    if value.shape[0] == 0 or value.shape[1] != width:
        fail(f"{what}: has shape {list(value.shape)}; [frames,{width}] is needed")
    if not np.isfinite(value).all():
        fail(f"{what}: frame {int(np.argwhere(~np.isfinite(value))[0][0])} has a number that is not finite")
    return value


def need(table, key, what):
    if not hasattr(table, "keys") or key not in table:
        known = ", ".join(map(str, table.keys())) if hasattr(table, "keys") else type(table).__name__
        fail(f"{what}: there is no {key!r}; there is {known}")
    return table[key]


def tell_unread(path, table, read):
    """Prints the keys of a table that are not read: more of the motion may be in them."""
    unread = sorted(str(key) for key in table if key not in read)
    if unread:
        print(f"{path}: not read: {', '.join(unread)}")


# --- rotations, by quaternions (w, x, y, z), one a row ----------------------------------------------------------------


def quaternion_of_vector(np, w):
    half = np.linalg.norm(w, axis=-1, keepdims=True) / 2
    return np.concatenate([np.cos(half), w * np.sinc(half / np.pi) / 2], axis=-1)


def vector_of_quaternion(np, q):
    q = np.where(q[..., :1] < 0, -q, q)
    length = np.linalg.norm(q[..., 1:], axis=-1, keepdims=True)
    angle = 2 * np.arctan2(length, q[..., :1])
    return q[..., 1:] * np.where(length > 1e-12, angle / np.maximum(length, 1e-12), 2)


def matrix_of_vector(np, w):
    q = quaternion_of_vector(np, w)
    s, v = q[..., 0], q[..., 1:]
    m = 2 * v[..., :, None] * v[..., None, :]
    eye = np.eye(3)
    m += (1 - 2 * (v * v).sum(-1))[..., None, None] * eye
    cross = np.zeros(v.shape[:-1] + (3, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    cross -= np.swapaxes(cross, -1, -2)
    return m + 2 * s[..., None, None] * cross


def vector_of_matrix(np, m):
    """By the largest component of the quaternion, so that half turns are as accurate as others."""
    trace = np.trace(m, axis1=-2, axis2=-1)
    diagonal = np.diagonal(m, axis1=-2, axis2=-1)
    four = np.empty(m.shape[:-2] + (4, 4))
    four[..., 0, 0] = 1 + trace
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        four[..., 1 + i, 1 + i] = 1 + 2 * diagonal[..., i] - trace
        four[..., 0, 1 + i] = four[..., 1 + i, 0] = m[..., k, j] - m[..., j, k]
        four[..., 1 + i, 1 + j] = four[..., 1 + j, 1 + i] = m[..., i, j] + m[..., j, i]
    pivot = np.argmax(np.diagonal(four, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(four, pivot[..., None, None], axis=-2)[..., 0, :]
    return vector_of_quaternion(np, q / np.linalg.norm(q, axis=-1, keepdims=True))


def slerp(np, a, b, u):
    """Between two rows of axis-angle vectors [J,3]."""
    p, q = quaternion_of_vector(np, a), quaternion_of_vector(np, b)
    q = np.where((p * q).sum(-1, keepdims=True) < 0, -q, q)
    angle = np.arccos(np.clip((p * q).sum(-1, keepdims=True), -1, 1))
    safe = np.where(angle < 1e-6, 1, np.sin(angle))
    first = np.where(angle < 1e-6, 1 - u, np.sin((1 - u) * angle) / safe)
    second = np.where(angle < 1e-6, u, np.sin(u * angle) / safe)
    mixed = first * p + second * q
    return vector_of_quaternion(np, mixed / np.linalg.norm(mixed, axis=-1, keepdims=True))


# --- estimators: pose [T,3J] (of SMPL-X body, and both hands where they are known), trans [T,3], betas [T,B], frame numbers, whether the body is SMPL-X, world --------------


def frames_text(np, person):
    """Which frames of the video somebody is in."""
    if not hasattr(person, "keys") or "frame_ids" not in person or not len(person["frame_ids"]):
        return "frames not said"
    frames = np.asarray(person["frame_ids"]).reshape(-1)
    return f"frames {int(frames.min())} to {int(frames.max())}"


def read_wham(np, path, arguments):
    joblib = module("joblib")
    people = joblib.load(path)
    if not hasattr(people, "keys") or not len(people):
        fail(f"{path}: holds no people; it is no wham_output.pkl")
    keys = list(people.keys())
    if arguments.person >= len(keys):
        fail(f"{path}: has {len(keys)} people; --person can be 0 to {len(keys) - 1}")
    one, what = people[keys[arguments.person]], f"{path}: person {keys[arguments.person]}"
    suffix = "" if arguments.in_camera else "_world"
    pose = array(np, need(one, "pose" + suffix, what), f"{what}: pose{suffix}", 72)
    trans = array(np, need(one, "trans" + suffix, what), f"{what}: trans{suffix}", 3)
    betas = array(np, need(one, "betas", what), f"{what}: betas", 10)
    frames = one["frame_ids"] if "frame_ids" in one else range(len(pose))
    tell_unread(what, one, ("pose" + suffix, "trans" + suffix, "betas", "frame_ids"))
    others = [f"{key} ({frames_text(np, people[key])})" for key in keys if key != keys[arguments.person]]
    if others:
        print(f"{path}: person {keys[arguments.person]} is read ({frames_text(np, one)}), not {', '.join(others)}")
    return pose, trans, betas, frames, False, "y up"


def read_gvhmr(np, path, arguments):
    torch = module("torch")
    results = torch.load(path, map_location="cpu", weights_only=not arguments.trust)
    name = "smpl_params_incam" if arguments.in_camera else "smpl_params_global"
    one, what = need(results, name, path), f"{path}: {name}"
    root = array(np, need(one, "global_orient", what), f"{what}: global_orient", 3)
    body = array(np, need(one, "body_pose", what), f"{what}: body_pose", 63)
    trans = array(np, need(one, "transl", what), f"{what}: transl", 3)
    betas = array(np, need(one, "betas", what), f"{what}: betas", 10)
    tell_unread(what, one, ("global_orient", "body_pose", "transl", "betas"))
    return np.concatenate([root, body], axis=1), trans, betas, range(len(root)), True, "y up"


def read_tram(np, path, arguments):
    module("torch")  # the arrays in the file are tensors
    one = np.load(path, allow_pickle=True).item()
    rotations = need(one, "pred_rotmat", path)
    rotations = array(np, rotations, f"{path}: pred_rotmat", 24 * 9).reshape(-1, 24, 3, 3)
    trans = array(np, need(one, "pred_trans", path), f"{path}: pred_trans", 3)
    betas = array(np, need(one, "pred_shape", path), f"{path}: pred_shape", 10)
    frames = np.asarray(need(one, "frame", path)).reshape(-1)
    tell_unread(path, one, ("pred_rotmat", "pred_trans", "pred_shape", "frame"))
    others = sorted(other.name for other in path.parent.glob("hps_track_*.npy") if other.name != path.name)
    if others:
        print(f"{path}: is read, not {', '.join(others)} beside it")
    pose = vector_of_matrix(np, rotations).reshape(-1, 72)
    if arguments.in_camera:
        return pose, trans, betas, frames, False, "camera"
    camera_path = arguments.camera or path.parent.parent / "camera.npy"
    if not camera_path.exists():
        fail(f"{camera_path}: there is no such file; TRAM's camera.npy is needed (--camera), or --in-camera")
    camera = np.load(camera_path, allow_pickle=True).item()
    is_level = hasattr(camera, "keys") and "world_cam_R" in camera and "world_cam_T" in camera
    name = "world_cam" if is_level else "pred_cam"
    turns = need(camera, name + "_R", camera_path)
    turns = array(np, turns, f"{camera_path}: {name}_R", 9).reshape(-1, 3, 3)
    places = array(np, need(camera, name + "_T", camera_path), f"{camera_path}: {name}_T", 3)
    if len(turns) != len(places):
        fail(f"{camera_path}: {name}_R has {len(turns)} frames, {name}_T {len(places)}")
    if frames.max() >= len(turns):
        fail(f"{camera_path}: has {len(turns)} frames; {path} is of frame {int(frames.max())} too")
    pose, trans = moved(np, pose, trans, turns[frames], places[frames], pelvis_of(np, arguments, False))
    return pose, trans, betas, frames, False, "y up" if is_level else "y down"


def read_lingo(np, path, arguments):
    if arguments.in_camera:
        fail(f"{path}: is in the world of its scene; there is no camera")
    with open(path, "rb") as file:
        one = __import__("pickle").load(file)
    root = array(np, need(one, "global_orient", path), f"{path}: global_orient", 3)
    body = array(np, need(one, "body_pose", path), f"{path}: body_pose", 63)
    trans = array(np, need(one, "transl", path), f"{path}: transl", 3)
    if not len(root) == len(body) == len(trans):
        fail(f"{path}: global_orient has {len(root)} frames, body_pose {len(body)}, transl {len(trans)}")
    parts, hands = [root, body], ("left_hand_pose", "right_hand_pose")
    if any(name in one for name in hands):
        for name in hands:
            hand = array(np, one[name], f"{path}: {name}", 45) if name in one else np.zeros((len(root), 45))
            if len(hand) != len(root):
                fail(f"{path}: global_orient has {len(root)} frames, {name} {len(hand)}")
            parts.append(hand)
        print(f"{path}: hands are taken as turns of a flat hand, not of the body model's mean hand")
    tell_unread(path, one, ("global_orient", "body_pose", "transl", *hands))
    return np.concatenate(parts, axis=1), trans, np.zeros((1, 10)), range(len(root)), True, "y up"


# --- WHAC: meshes of SMPL-X to poses ------------------------------------------------------------------------------------


class SmplxMesh:
    """A body model as a function of pose [55,3], shape and expression [S], and translation to vertices [V,3]."""

    def __init__(self, np, path):
        try:
            with np.load(path, allow_pickle=True) as file:
                model = {name: file[name] for name in file.files}
        except Exception as fault:  # whatever an unpickler or an archive raises
            fail(f"{path}: is no body model (.npz): {fault}")
        self.rest = array(np, need(model, "v_template", path), f"{path}: v_template", 3)
        count = len(self.rest)
        self.weights = array(np, need(model, "weights", path), f"{path}: weights", 55)
        self.parents = np.asarray(need(model, "kintree_table", path))[0].astype(np.int64)
        self.parents[0] = -1
        regressor = need(model, "J_regressor", path)
        self.regressor = array(np, regressor, f"{path}: J_regressor", count)
        shapes = np.asarray(need(model, "shapedirs", path), dtype=np.float64)
        if shapes.ndim != 3 or shapes.shape[:2] != (count, 3) or shapes.shape[2] < 20:
            fail(f"{path}: shapedirs: has shape {list(shapes.shape)}; [{count},3,20] or more is needed")
        first = 300 if shapes.shape[2] >= 400 else 10  # of the expression
        self.shapes = np.concatenate([shapes[..., :10], shapes[..., first:first + 10]], axis=2)
        self.correctives = np.asarray(model["posedirs"], dtype=np.float64) if "posedirs" in model else None
        if self.correctives is not None and self.correctives.shape != (count, 3, 486):
            fail(f"{path}: posedirs: has shape {list(self.correctives.shape)}; [{count},3,486] is needed")
        if len(self.weights) != count or len(self.regressor) != 55 or len(self.parents) != 55:
            fail(f"{path}: v_template, weights, J_regressor and kintree_table do not fit each other")
        self.below = np.zeros((55, 55))  # [a, b]: b is a or hangs on it
        for joint in range(55):
            above = joint
            while above >= 0:
                self.below[above, joint] = 1
                above = self.parents[above]

    def posed(self, np, pose, shape, place):
        """Vertices, and what their derivatives need: joints [55,3], rotations [55,3,3], vertices by joint's motion [55,V,3]."""
        rest = self.rest + self.shapes @ shape
        joints = self.regressor @ rest
        local = matrix_of_vector(np, pose)
        if self.correctives is not None:
            rest = rest + self.correctives @ (local[1:] - np.eye(3)).reshape(-1)
        turns, places = local.copy(), joints.copy()
        for joint in range(1, 55):
            parent = self.parents[joint]
            turns[joint] = turns[parent] @ local[joint]
            places[joint] = places[parent] + turns[parent] @ (joints[joint] - joints[parent])
        moved_rest = np.einsum("jab,jvb->jva", turns, rest[None] - joints[:, None]) + places[:, None]
        parts = self.weights.T[:, :, None] * moved_rest
        return parts.sum(axis=0) + place, places, turns, parts

    def derivatives(self, np, places, turns, parts):
        """[V,3,188]: of 55 rotations (turned from the left, in the world), 20 of shape and expression, and translation.

        The correctives' own change by the pose is left out: it only slows the last steps.
        """
        count = parts.shape[1]
        moving = np.einsum("ab,bvc->avc", self.below, parts) - (self.below @ self.weights.T)[:, :, None] * places[:, None]
        rows = np.zeros((count, 3, 188))
        for axis in range(3):
            unit = np.zeros(3)
            unit[axis] = 1
            rows[:, :, axis:165:3] = np.cross(unit, moving).transpose(1, 2, 0)
        shapes = np.einsum("vj,jab->vab", self.weights, turns) @ self.shapes
        bones = np.einsum("jv,vcs->jcs", self.regressor, self.shapes)
        shift = np.zeros_like(bones)  # of where joints are
        shift[0] = bones[0]
        for joint in range(1, 55):
            parent = self.parents[joint]
            shift[joint] = shift[parent] + turns[parent] @ (bones[joint] - bones[parent])
        rows[:, :, 165:185] = shapes + np.einsum("vj,jcs->vcs", self.weights, shift - np.einsum("jab,jbs->jas", turns, bones))
        rows[:, :, 185:] = np.eye(3)
        return rows

    def start(self, np, vertices):
        """Rotations that turn the vertices of each joint at rest into those of the mesh, and where the pelvis then is."""
        turns = np.tile(np.eye(3), (55, 1, 1))
        for joint in range(55):
            weight = self.weights[:, joint] ** 2 if joint else np.ones(len(vertices))
            if weight.sum() < 1e-3:
                turns[joint] = turns[self.parents[joint]]
                continue
            weight = weight / weight.sum()
            a, b = self.rest - weight @ self.rest, vertices - weight @ vertices
            u, _, v = np.linalg.svd((b * weight[:, None]).T @ a)
            turns[joint] = u @ np.diag([1, 1, np.linalg.det(u @ v)]) @ v
        local = turns.copy()
        for joint in range(1, 55):
            local[joint] = turns[self.parents[joint]].T @ turns[joint]
        return vector_of_matrix(np, local)


def fitted_mesh(np, body, vertices):
    """Pose [55,3], shape and expression [20], translation, the largest distance of a vertex: Gauss-Newton.

    The distance is infinite where it does not come to an end.
    """
    pose, shape, place = body.start(np, vertices), np.zeros(20), np.zeros(3)
    place = (vertices - body.posed(np, pose, shape, place)[0]).mean(axis=0)
    for _ in range(30):
        mesh, places, turns, parts = body.posed(np, pose, shape, place)
        rows = body.derivatives(np, places, turns, parts).reshape(-1, 188)
        curvature = rows.T @ rows
        # What no vertex tells (an eye's turn about its axis) stays.
        curvature[np.diag_indices(188)] += 1e-6 * np.trace(curvature) / 188
        step = np.linalg.solve(curvature, rows.T @ (vertices - mesh).reshape(-1))
        above = np.concatenate([np.eye(3)[None], turns[body.parents[1:]]])  # a turn of the world, in the parent's frame
        turn = np.einsum("jba,jb->ja", above, step[:165].reshape(55, 3))
        pose = vector_of_matrix(np, matrix_of_vector(np, turn) @ matrix_of_vector(np, pose))
        shape, place = shape + step[165:185], place + step[185:]
        if np.abs(step).max() < 1e-6:
            mesh = body.posed(np, pose, shape, place)[0]
            return pose, shape, place, np.linalg.norm(mesh - vertices, axis=1).max()
    return pose, shape, place, np.inf


def vertices_in(np, path, count):
    lines = [line[2:] for line in path.read_text().splitlines() if line.startswith("v ")]
    vertices = array(np, np.array([line.split()[:3] for line in lines], dtype=np.float64).reshape(-1, 3), str(path), 3)
    if len(vertices) != count:
        fail(f"{path}: has {len(vertices)} vertices, the body model {count}")
    return vertices


def frames_of_meshes(np, folder, count):
    """Which frames of the video WHAC saw its person in: the one that it saw in most."""
    path = folder.parent / "detection_results.pth"
    if not path.exists():
        print(f"{folder}: its meshes are taken for frames 0 to {count - 1}, as there is no {path}")
        return range(count)
    people = module("joblib").load(path)
    if not hasattr(people, "items") or not len(people):
        fail(f"{path}: holds no people; it is not what WHAC writes")
    seen = {key: need(person, "frame_id", path) for key, person in people.items()}
    of = max(seen, key=lambda key: len(seen[key]))  # of equals the first
    frames = seen[of]
    others = [f"{key} ({len(seen[key])} frames)" for key in seen if key != of]
    if others:
        print(f"{path}: the meshes are of person {of} ({len(frames)} frames), not of {', '.join(others)}")
    if len(frames) != count:
        fail(f"{folder}: has {count} meshes, {path} {len(frames)} frames of the person")
    return [int(frame) for frame in frames]


def read_whac(np, path, arguments):
    if arguments.body_model is None:
        fail("--body-model names the file of SMPL-X (SMPLX_NEUTRAL.npz), by which meshes are read")
    if arguments.in_camera:
        fail(f"{path}: its meshes are in the world; there is no camera")
    if arguments.pelvis:
        fail("--pelvis: the pelvis is that of --body-model in the shape of the meshes")
    files = sorted(path.glob("whac_results_*.obj")) if path.is_dir() else []
    if not files:
        fail(f"{path}: holds no whac_results_*.obj; WHAC writes them into demo/NAME/mesh with --save_mesh")
    if [file.stem for file in files] != [f"whac_results_{number:06}" for number in range(len(files))]:
        fail(f"{path}: its meshes are not numbered from 000000 on without a gap")
    body = SmplxMesh(np, arguments.body_model)
    fits = [fitted_mesh(np, body, vertices_in(np, file, len(body.rest))) for file in files]
    farthest = max(fit[3] for fit in fits)
    if farthest > MOST_MISFIT:
        names = ", ".join(file.name for file, fit in zip(files, fits) if fit[3] > MOST_MISFIT)
        fail(f"{path}: no pose of {arguments.body_model} has the vertices of {names}: they miss by more than "
             f"{1000 * MOST_MISFIT:.0f} mm, or the fit came to no end; is it the model that WHAC was run with?")
    print(f"{path}: the farthest vertex is {1000 * farthest:.2f} mm from that of its pose")
    shapes = np.stack([fit[1] for fit in fits])
    pelvis = lambda shape: body.regressor[0] @ (body.rest + body.shapes @ shape)  # noqa: E731
    betas = np.concatenate([shapes[:, :10].mean(axis=0), np.zeros(10)])
    arguments.pelvis = tuple(pelvis(betas))
    # The pelvis stays where it is: shapes differ from mesh to mesh, the motion has one.
    trans = np.stack([place + pelvis(shape) - arguments.pelvis for _, shape, place, _ in fits])
    poses = np.stack([fit[0] for fit in fits])
    pose = np.concatenate([poses[:, :22], poses[:, 25:]], axis=1).reshape(len(fits), -1)  # without jaw and eyes
    return pose, trans, betas[None, :10], frames_of_meshes(np, path, len(files)), True, "y up"


# --- data sets --------------------------------------------------------------------------------------------------------


def arrays_of(path):
    """What a pickle holds, if that is numbers, texts and arrays of NumPy in tables and lists alone."""
    pickle = __import__("pickle")
    known = {"_reconstruct", "ndarray", "dtype", "scalar", "_frombuffer", "OrderedDict", "encode"}
    homes = ("numpy", "numpy.core.multiarray", "numpy._core.multiarray", "numpy.core.numeric", "numpy._core.numeric",
             "collections", "_codecs")

    class ArraysAlone(pickle.Unpickler):
        def find_class(self, home, name):
            if home not in homes or name not in known:
                fail(f"{path}: holds {home}.{name}, which is no array and is not unpickled")
            return super().find_class(home, name)

    with open(path, "rb") as file:
        return ArraysAlone(file).load()


def read_emdb(np, path, arguments):
    if arguments.in_camera:
        fail(f"{path}: the truth of EMDB is in the world")
    one = arrays_of(path)
    smpl, what = need(one, "smpl", path), f"{path}: smpl"
    root = array(np, need(smpl, "poses_root", what), f"{what}: poses_root", 3)
    body = array(np, need(smpl, "poses_body", what), f"{what}: poses_body", 69)
    trans = array(np, need(smpl, "trans", what), f"{what}: trans", 3)
    if not len(root) == len(body) == len(trans):
        fail(f"{what}: poses_root has {len(root)} frames, poses_body {len(body)}, trans {len(trans)}")
    good = np.asarray(need(one, "good_frames_mask", path)).reshape(-1)
    if len(good) != len(root) or not np.isin(good, (0, 1)).all():
        fail(f"{path}: good_frames_mask: is no mask of {len(root)} frames")
    arguments.more = {"good_frames_mask": good.astype(np.uint8)}
    return np.concatenate([root, body], axis=1), trans, np.zeros((1, 10)), range(len(root)), False, "y up"


def read_rich(np, path, arguments):
    if arguments.in_camera:
        fail(f"{path}: the truth of RICH is in the world of its first camera already")
    files = sorted(path.glob("*/*.pkl")) if path.is_dir() else []
    if not files:
        fail(f"{path}: holds no FRAME/PERSON.pkl; a sequence's folder in the bodies of RICH is needed")
    if not all(file.stem.isdecimal() and file.parent.name.isdecimal() for file in files):
        odd = next(file for file in files if not (file.stem.isdecimal() and file.parent.name.isdecimal()))
        fail(f"{odd}: is not called FRAME/PERSON.pkl, by numbers")
    people = sorted({int(file.stem) for file in files})
    person = people[0] if len(people) == 1 and not arguments.person else arguments.person
    if person not in people:
        fail(f"{path}: has no person {person}; --person can be {', '.join(map(str, people))}")
    if len(people) > 1:
        print(f"{path}: person {person} is read, not {', '.join(str(one) for one in people if one != person)}")
    rows = {"global_orient": [], "body_pose": [], "transl": [], "betas": []}
    widths = {"global_orient": 3, "body_pose": 63, "transl": 3, "betas": 10}
    files = [file for file in files if int(file.stem) == person]
    for file in files:
        one = arrays_of(file)
        for name, width in widths.items():
            row = array(np, np.asarray(need(one, name, file)).reshape(1, -1), f"{file}: {name}", width)
            rows[name].append(row[0])
    pose = np.concatenate([np.stack(rows["global_orient"]), np.stack(rows["body_pose"])], axis=1)
    frames = np.array([int(file.parent.name) for file in files])
    print(f"{path}: frames {frames.min()} to {frames.max()} of the sequence are counted from 0")
    good = np.zeros(frames.max() - frames.min() + 1, dtype=np.uint8)
    good[frames - frames.min()] = 1
    arguments.more = {"good_frames_mask": good}
    return pose, np.stack(rows["transl"]), np.stack(rows["betas"]), frames - frames.min(), True, "y down"


def read_intercap(np, path, arguments):
    if arguments.in_camera:
        fail(f"{path}: the truth of InterCap is in the world of a camera already")
    one = arrays_of(path)
    widths = {"global_orient": 3, "body_pose": 63, "transl": 3, "betas": 10, "ob_pose": 3, "ob_trans": 3}
    rows = {name: array(np, need(one, name, path), f"{path}: {name}", width) for name, width in widths.items()}
    for name in rows:
        if len(rows[name]) != len(rows["transl"]) and not (name == "betas" and len(rows[name]) == 1):
            fail(f"{path}: transl has {len(rows['transl'])} frames, {name} {len(rows[name])}")
    tell_unread(path, one, widths)
    arguments.object = (matrix_of_vector(np, rows["ob_pose"]), rows["ob_trans"])
    pose = np.concatenate([rows["global_orient"], rows["body_pose"]], axis=1)
    return pose, rows["transl"], rows["betas"], range(len(pose)), True, "y down"


READERS = {"wham": read_wham, "gvhmr": read_gvhmr, "tram": read_tram, "whac": read_whac, "lingo": read_lingo,
           "emdb": read_emdb, "rich": read_rich, "intercap": read_intercap}
ENDINGS = {".pkl": "wham", ".pickle": "wham", ".pt": "gvhmr", ".npy": "tram"}


# --- the motion -------------------------------------------------------------------------------------------------------


def pelvis_of(np, arguments, is_smplx):
    return np.array(arguments.pelvis or (SMPLX_PELVIS if is_smplx else SMPL_PELVIS))


def moved(np, pose, trans, turns, places, pelvis):
    """x' = R x + c: the body turns about its pelvis, t' = R t + (R - I) pelvis + c."""
    pose = pose.copy()
    pose[:, :3] = vector_of_matrix(np, turns @ matrix_of_vector(np, pose[:, :3]))
    trans = np.einsum("tij,tj->ti", turns, trans + pelvis) - pelvis + places
    return pose, trans


def filled(np, pose, trans, frames, what):
    """A row for every frame from the first to the last, those between neighbours interpolated; the first, how many."""
    frames = np.asarray(frames, dtype=np.int64).reshape(-1)
    if len(frames) != len(pose) or len(trans) != len(pose):
        fail(f"{what}: has {len(pose)} poses, {len(trans)} translations and {len(frames)} frame numbers")
    order = np.argsort(frames, kind="stable")
    pose, trans, frames = pose[order], trans[order], frames[order]
    if frames[0] < 0:
        fail(f"{what}: begins with frame {int(frames[0])}; frames are counted from 0")
    if (np.diff(frames) <= 0).any():
        fail(f"{what}: has frame {int(frames[np.argwhere(np.diff(frames) <= 0)[0][0]])} twice")
    if len(frames) > 1 and np.diff(frames).max() > 1000:
        fail(f"{what}: has no frame for {int(np.diff(frames).max()) - 1} frames in a row; allowed: 999")
    poses, places = [pose[0]], [trans[0]]
    for i in range(1, len(frames)):
        gap = int(frames[i] - frames[i - 1])
        for k in range(1, gap):
            u = k / gap
            poses.append(slerp(np, pose[i - 1].reshape(-1, 3), pose[i].reshape(-1, 3), u).reshape(-1))
            places.append((1 - u) * trans[i - 1] + u * trans[i])
        poses.append(pose[i])
        places.append(trans[i])
    return np.stack(poses), np.stack(places), int(frames[0]), len(poses) - len(frames)


def parsed_pelvis(text):
    try:
        numbers = tuple(float(word) for word in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != 3:
        raise argparse.ArgumentTypeError(f"{text!r} is no place; allowed: three numbers x,y,z")
    return numbers


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", metavar="IN", type=pathlib.Path)
    parser.add_argument("output", metavar="OUT.npz", type=pathlib.Path)
    parser.add_argument("--from", dest="source", choices=READERS, help="the estimator; default: by IN's ending")
    parser.add_argument("--fps", type=float, help=f"frames a second of the video; default: {USUAL_RATE}, which is told")
    parser.add_argument("--person", type=int, default=0, help="which of WHAM's people, from 0; of RICH's by its number")
    parser.add_argument("--camera", type=pathlib.Path, help="TRAM's camera.npy; default: beside the folder of IN")
    parser.add_argument("--in-camera", action="store_true", help="in the camera's frame, not turned")
    parser.add_argument("--body-model", type=pathlib.Path, help="WHAC: the SMPL-X model (.npz) that its meshes are of")
    parser.add_argument("--pelvis", type=parsed_pelvis, help="x,y,z of the estimator's body at rest, metres")
    parser.add_argument("--trust", action="store_true", help="GVHMR: unpickle everything in IN, which can run code")
    arguments = parser.parse_args()
    arguments.more = {}  # arrays of the input that the motion keeps
    arguments.object = None  # rotations and places of an object's origin, in the input's world
    if arguments.output.suffix != ".npz":
        fail(f"{arguments.output}: allowed ending: .npz")
    if arguments.fps is None:
        arguments.fps = USUAL_RATE
        print(f"{arguments.input}: taken for {USUAL_RATE} frames a second, as --fps does not say otherwise")
    if not arguments.fps > 0 or arguments.fps == float("inf"):
        fail(f"--fps: {arguments.fps} is out of range; allowed: above 0")
    if arguments.person < 0:
        fail(f"--person: {arguments.person} is out of range; allowed: 0 or more")
    is_whac = arguments.input.is_dir() and any(arguments.input.glob("whac_results_*.obj"))
    source = arguments.source or ("whac" if is_whac else ENDINGS.get(arguments.input.suffix))
    if source is None:
        fail(f"{arguments.input}: known endings are {', '.join(ENDINGS)}, and folders of whac_results_*.obj; --from names the estimator")
    if arguments.body_model and source != "whac":
        fail(f"--body-model: nothing reads it of {source}")
    if not arguments.input.exists():
        fail(f"{arguments.input}: there is no such file")
    np = module("numpy")
    try:
        pose, trans, betas, frames, is_smplx, world = READERS[source](np, arguments.input, arguments)
    except (ValueError, TypeError, EOFError, KeyError, AttributeError, IndexError) as fault:
        fail(f"{arguments.input}: is not what {source} writes: {fault}")
    except Exception as fault:  # whatever an unpickler raises
        fail(f"{arguments.input}: cannot be read: {fault}")
    pose, trans, first, added = filled(np, pose, trans, frames, str(arguments.input))
    pelvis = pelvis_of(np, arguments, is_smplx)
    if not arguments.in_camera:
        sign = 1 if world == "y up" else -1
        turn = np.array([[1, 0, 0], [0, 0, -sign], [0, sign, 0]], dtype=np.float64)
        pose, trans = moved(np, pose, trans, np.tile(turn, (len(pose), 1, 1)), np.zeros(3), pelvis)
        if arguments.object:
            turns, places = arguments.object
            arguments.more.update(obj_rot_mat=turn @ turns, obj_trans=places @ turn.T)
    if not is_smplx:
        trans = trans + pelvis - np.array(SMPLX_PELVIS)
    # SMPL's shape is not SMPL-X's: its numbers are left out.
    shape = betas.mean(axis=0) if is_smplx else np.zeros(10)
    # Of a body of SMPL-X in a shape it is not known.
    is_known = not is_smplx or arguments.pelvis or not shape.any()
    rest = {"pelvis_rest": pelvis if is_smplx else np.array(SMPLX_PELVIS)} if is_known else {}
    hands = {"pose_hand": pose[:, 66:156]} if is_smplx and pose.shape[1] == 156 else {}
    np.savez(
        arguments.output,
        **rest,
        **hands,
        **arguments.more,
        **({"first_frame": np.array(float(first))} if first else {}),
        trans=trans,
        root_orient=pose[:, :3],
        pose_body=pose[:, 3:66],
        betas=shape,
        gender=np.array("neutral"),
        surface_model_type=np.array("smplx"),
        mocap_frame_rate=np.array(arguments.fps),
        mocap_framerate=np.array(arguments.fps),
    )
    note = f", {added} of them interpolated" if added else ""
    note += f", from frame {first} of the video" if first else ""
    print(f"{arguments.output}: {len(pose)} frames{note}, {source}")


if __name__ == "__main__":
    main()
