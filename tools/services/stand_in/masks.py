#!/usr/bin/env python3
"""Stands in for a segmenter: the masks of frame 0 in every frame, or masks that are there.

    stand_in/masks.py --video {video} --objects {objects} --first {first_masks} --out {out} [--masks DIR]
"""

import argparse
import pathlib
import shutil
import sys

import faults

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import service  # noqa: E402


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--video", required=True)
    parser.add_argument("--objects", required=True)
    parser.add_argument("--first", required=True)
    parser.add_argument("--out", required=True)
    parser.add_argument("--masks", help="a folder of masks to give back")
    faults.add_options(parser)
    a = parser.parse_args()
    faults.apply(a)

    if a.masks:
        shutil.copytree(a.masks, a.out)
        return
    for name in a.objects.split(","):
        folder = pathlib.Path(a.out) / name
        folder.mkdir(parents=True)
        for file in service.frame_names(a.video):
            shutil.copyfile(pathlib.Path(a.first) / f"{name}.png", folder / file)


if __name__ == "__main__":
    main()
