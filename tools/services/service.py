"""What the services have in common: how they end, the programs that they run, and frames of videos.

A service is a program that hsi4d runs for a part of its inputs; docs/services.md tells what is expected of it.
"""

import argparse
import pathlib
import shlex
import shutil
import struct
import subprocess
import sys

FAILED, ASKED_WRONGLY, TRY_AGAIN = 1, 2, 75  # exit statuses, beside 0


class Parser(argparse.ArgumentParser):
    """Arguments of a service: its text is the help, and --dry-run is always there."""

    def __init__(self, text):
        super().__init__(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
        self.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")


def fail(message, status=FAILED):
    """Ends the service: the last words of its standard error are what hsi4d tells."""
    print(f"{pathlib.Path(sys.argv[0]).name}: {message}", file=sys.stderr)
    sys.exit(status)


def need(path, what):
    """The path, where there is something; else the service was asked wrongly."""
    if not pathlib.Path(path).exists():
        fail(f"{path}: there is no such {what}", ASKED_WRONGLY)
    return pathlib.Path(path).resolve()


def run(command, folder=None, dry_run=False):
    """Runs a program to its end; a dry run tells it."""
    command = [str(word) for word in command]
    if dry_run:
        print((f"in {folder}: " if folder else "") + shlex.join(command))
        return
    try:
        ended = subprocess.run(command, cwd=folder, stdout=sys.stderr, check=False)
    except OSError as error:
        fail(f"{command[0]}: cannot be run: {error.strerror}", ASKED_WRONGLY)
    if ended.returncode != 0:
        fail(f"{command[0]} ended with status {ended.returncode}")


def png_size(path):
    """Width and height of a PNG file."""
    with open(path, "rb") as file:
        head = file.read(24)
    if head[:8] != b"\x89PNG\r\n\x1a\n" or len(head) < 24:
        fail(f"{path}: is no PNG file", ASKED_WRONGLY)
    return struct.unpack(">II", head[16:24])


def video_size(path):
    """Width and height of a video."""
    asked = ["ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries", "stream=width,height", "-of", "csv=p=0"]
    told = subprocess.run([*asked, str(path)], capture_output=True, text=True, check=False).stdout.strip().split(",")
    if len(told) < 2 or not all(number.isdigit() for number in told[:2]):
        fail(f"{path}: is no video that ffprobe can read")
    return int(told[0]), int(told[1])


def fit_video(video, image, out):
    """Writes a video at `out` whose frames are as large as the image: what a model wrote, in another size, is scaled."""
    size = png_size(image)
    if video_size(video) == size:
        shutil.copyfile(video, out)
        return
    scale = f"scale={size[0]}:{size[1]}:flags=lanczos"
    run(["ffmpeg", "-v", "error", "-y", "-i", video, "-an", "-vf", scale, "-crf", "12", "-pix_fmt", "yuv444p", out])


def frame_names(video):
    """The names that masks of a video have: those of a folder's frames, or numbers. Counted by ffprobe."""
    if pathlib.Path(video).is_dir():
        return sorted(path.name for path in pathlib.Path(video).glob("*.png"))
    asked = ["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries", "stream=nb_read_frames"]
    told = subprocess.run([*asked, "-of", "csv=p=0", str(video)], capture_output=True, text=True, check=False)
    count = told.stdout.strip().strip(",")
    if not count.isdigit():
        fail(f"{video}: is no video that ffprobe can read")
    return [f"{number:04d}.png" for number in range(int(count))]


def as_video(video, rate, folder, dry_run=False):
    """The video as one file: itself, or one made of a folder's frames."""
    if pathlib.Path(video).is_file():
        return pathlib.Path(video)
    made = pathlib.Path(folder) / "video.mp4"
    images = str(pathlib.Path(video) / "*.png")
    run(["ffmpeg", "-v", "error", "-y", "-framerate", rate, "-pattern_type", "glob", "-i", images, "-crf", "10",
         "-pix_fmt", "yuv420p", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", made], dry_run=dry_run)
    return made
