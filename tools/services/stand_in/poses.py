#!/usr/bin/env python3
"""Stands in for a pose estimator: a motion that is there, in another world and disturbed.

    stand_in/poses.py --video {video} --out {out} --motion M.npz [--turn DEG] [--move X,Y,Z] [--noise DEG] [--seed N]

The world is turned about the vertical and moved, as that of an estimator is not the scene's, and every joint gets normal
noise about each axis. Frames are those of M.npz. Needs NumPy.
"""

import argparse
import pathlib
import sys

import faults

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent.parent))
import export_motion  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--video", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--motion", required=True, help="by AMASS's names: poses [T,165], trans [T,3], pelvis_rest [3]")
    parser.add_argument("--turn", type=float, default=0, help="degrees about the vertical")
    parser.add_argument("--move", default="0,0,0", help="metres")
    parser.add_argument("--noise", type=float, default=0, help="standard deviation, degrees")
    parser.add_argument("--seed", type=int, default=0)
    faults.add_options(parser)
    a = parser.parse_args()
    faults.apply(a)

    import numpy as np

    with np.load(a.motion) as file:
        motion = {name: file[name] for name in file.files}
    poses, trans, pelvis = motion["poses"], motion["trans"], motion["pelvis_rest"]
    poses = poses + np.random.default_rng(a.seed).normal(0, np.radians(a.noise), poses.shape)
    matrix = export_motion.matrix_of_vector(np, np.array([0, 0, np.radians(a.turn)]))
    root = export_motion.matrix_of_vector(np, poses[:, :3])
    poses[:, :3] = export_motion.vector_of_matrix(np, matrix @ root)
    move = np.array([float(number) for number in a.move.split(",")])
    trans = (trans + pelvis) @ matrix.T + move - pelvis
    rate = motion["mocap_frame_rate"]
    np.savez(a.out, poses=poses, trans=trans, pelvis_rest=pelvis, mocap_frame_rate=rate, betas=motion["betas"])


if __name__ == "__main__":
    main()
