#!/usr/bin/env python3
"""Stands in for an image-to-video model: a video of the first frame that stands still, or a clip that is there.

    stand_in/video.py --image {first_frame} --prompt={prompt} --out {out} [--frames N] [--rate HZ] [--clip PATH]

--out is an .mp4 file (made by ffmpeg), or a folder of PNG files.
"""

import argparse
import pathlib
import shutil
import subprocess

import faults


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--image", required=True)
    parser.add_argument("--prompt", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--frames", type=int, default=51)
    parser.add_argument("--rate", type=float, default=10)
    parser.add_argument("--clip", help="a video, or a folder of frames, to give back")
    faults.add_options(parser)
    a = parser.parse_args()
    faults.apply(a)

    out = pathlib.Path(a.out)
    if a.clip:
        (shutil.copytree if pathlib.Path(a.clip).is_dir() else shutil.copyfile)(a.clip, out)
    elif out.suffix:
        subprocess.run(["ffmpeg", "-v", "error", "-loop", "1", "-framerate", str(a.rate), "-i", a.image, "-frames:v",
                        str(a.frames), "-crf", "10", "-pix_fmt", "yuv444p", "-colorspace", "smpte170m", str(out)], check=True)
    else:
        out.mkdir()
        for number in range(a.frames):
            shutil.copyfile(a.image, out / f"{number:04d}.png")


if __name__ == "__main__":
    main()
