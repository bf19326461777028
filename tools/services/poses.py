#!/usr/bin/env python3
"""Estimates the human's poses in a video by GVHMR or WHAM, for /sources/motion of a config.

    "command": ["tools/services/poses.py", "--estimator", "gvhmr", "--folder", "/home/me/GVHMR", "--python",
                "/home/me/gvhmr/bin/python", "--video", "{video}", "--rate", "{video_rate}", "--out", "{out}"]

Runs demo.py of github.com/zju3dv/GVHMR or github.com/yohanshin/WHAM in --folder by the Python of --python, and turns
what it writes into a motion by tools/export_motion.py. With --moving the camera is estimated too, else it stands. The
commands are checked by a dry run only; the estimators themselves were not run.
"""

import pathlib
import sys
import tempfile

import service

EXPORT = pathlib.Path(__file__).resolve().parent.parent / "export_motion.py"


def gvhmr(video, work, moving):
    """The command, and where its result is."""
    camera = [] if moving else ["--static_cam"]
    command = ["tools/demo/demo.py", "--video", video, "--output_root", work, *camera]
    return command, work / video.stem / "hmr4d_results.pt"


def wham(video, work, moving):
    camera = [] if moving else ["--estimate_local_only"]
    command = ["demo.py", "--video", video, "--output_pth", work, "--save_pkl", *camera]
    return command, work / video.stem / "wham_output.pkl"


def main():
    parser = service.Parser(__doc__)
    parser.add_argument("--estimator", required=True, choices=["gvhmr", "wham"])
    parser.add_argument("--folder", required=True, help="where the estimator is")
    parser.add_argument("--video", required=True, help="a video, or a folder of PNG frames")
    parser.add_argument("--rate", required=True, type=float, help="frames a second of the video")
    parser.add_argument("--out", required=True, help="the motion to write (.npz)")
    parser.add_argument("--person", type=int, help="which of several persons; of WHAM")
    parser.add_argument("--moving", action="store_true", help="the camera moves")
    parser.add_argument("--python", default=sys.executable, help="the Python of the estimator's environment")
    a = parser.parse_args()

    folder, python = service.need(a.folder, "folder"), service.program(a.python)
    video = service.need(a.video, "video")
    if a.rate <= 0:
        service.fail("--rate: nobody says how many frames a second the video has; data.video_rate does", service.ASKED_WRONGLY)
    with tempfile.TemporaryDirectory() as work:
        work = pathlib.Path(work)
        video = service.as_video(video, a.rate, work, a.dry_run)
        command, result = {"gvhmr": gvhmr, "wham": wham}[a.estimator](video, work / "result", a.moving)
        service.run([python, *command], folder, a.dry_run)
        person = [] if a.person is None else ["--person", a.person]
        if not a.dry_run and not result.exists():
            service.fail(f"the estimator wrote nothing at {result}; does it see a person?")
        service.run([python, EXPORT, result, pathlib.Path(a.out).resolve(), "--fps", a.rate, *person], None, a.dry_run)


if __name__ == "__main__":
    main()
