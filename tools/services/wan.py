#!/usr/bin/env python3
"""Makes a video of an image by Wan 2.1 (github.com/Wan-Video/Wan2.1), for /sources/video of a config.

    "command": ["tools/services/wan.py", "--folder", "/home/me/Wan2.1", "--image", "{first_frame}",
                "--prompt={prompt}", "--out", "{out}"]

Runs its generate.py in --folder by the Python of --python (that of its environment) with the checkpoint of
--checkpoint, and scales the video to the image's size, as hsi4d wants it: 81 frames, 16 a second. The commands are
checked by a dry run only; the model itself was not run.
"""

import pathlib
import sys
import tempfile

import service

# generate.py rounds both sides down to multiples of 16 pixels and squeezes the image to that, which is undone here: of
# the 480 pixels of its smallest size that is one in thirty.
MOST_STRETCH = 0.035


def main():
    parser = service.Parser(__doc__)
    parser.add_argument("--folder", required=True, help="where Wan 2.1 is")
    parser.add_argument("--image", required=True, help="the first frame, a PNG file")
    parser.add_argument("--prompt", required=True, help="as --prompt=TEXT, which may then begin with a -")
    parser.add_argument("--out", required=True, help="the video to write, an MP4 file")
    parser.add_argument("--checkpoint", default="Wan2.1-I2V-14B-720P", help="folder of the weights, in --folder")
    parser.add_argument("--size", default="1280*720", help="area of the video; its shape is the image's")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--python", default=sys.executable)
    parser.add_argument("more", nargs="*", help="more arguments of generate.py, after --")
    a = parser.parse_args()

    folder, image = service.need(a.folder, "folder"), service.need(a.image, "image")
    service.need(folder / "generate.py", "program")
    with tempfile.TemporaryDirectory() as work:
        video = pathlib.Path(work) / "video.mp4"
        service.run([service.program(a.python), "generate.py", "--task", "i2v-14B", "--size", a.size, "--ckpt_dir", a.checkpoint,
                     "--image", image, f"--prompt={a.prompt}", "--base_seed", a.seed, "--save_file", video, *a.more],
                    folder, a.dry_run)
        if not a.dry_run:
            service.fit_video(video, image, pathlib.Path(a.out), MOST_STRETCH)


if __name__ == "__main__":
    main()
