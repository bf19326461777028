"""What the services have in common: how they end, the programs that they run, and frames of videos.

A service is a program that hsi4d runs for a part of its inputs; docs/services.md tells what is expected of it.
"""

import argparse
import functools
import json
import os
import pathlib
import shlex
import shutil
import signal
import struct
import subprocess
import sys

FAILED, ASKED_WRONGLY, TRY_AGAIN = 1, 2, 75  # exit statuses, beside 0


class Parser(argparse.ArgumentParser):
    """Arguments of a service: its text is the help, and --dry-run is always there."""

    def __init__(self, text):
        super().__init__(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
        self.add_argument("--dry-run", action="store_true", help="say what would be done, and do nothing")
        # hsi4d asks by SIGTERM to end: as an exception, so that what is temporary is removed.
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))


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


@functools.cache
def video_stream(video):
    """What ffprobe tells of the stream that hsi4d reads of a video: the first that is no attached picture and has more
    than one frame (core/video_probe.h). Tells of others."""
    command = ["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v", "-show_entries",
               "stream=index,width,height,color_space,nb_read_frames:stream_disposition=attached_pic", "-of", "json",
               "-i", str(video)]
    try:
        told = subprocess.run(command, capture_output=True, text=True, check=False).stdout
    except OSError as error:
        fail(f"ffprobe: cannot be run: {error.strerror}", ASKED_WRONGLY)
    streams = json.loads(told or "{}").get("streams", [])
    videos = [one for one in streams if not one["disposition"]["attached_pic"] and int(one.get("nb_read_frames", 0)) > 1]
    if not videos:
        fail(f"{video}: is no video that ffprobe can read")
    if len(videos) > 1:
        others = ", ".join(str(one["index"]) for one in videos[1:])
        print(f"{video}: holds {len(videos)} videos; stream {videos[0]['index']} is read, not {others}", file=sys.stderr)
    return videos[0]


def stream_words(video):
    """ffmpeg's words that choose this stream of its one input."""
    return ["-map", f"0:{video_stream(video)['index']}"]


def matrix_words(video, size):
    """ffmpeg's words that keep the colours of a video which is scaled: one that does not name its matrix is taken for
    BT.709 or BT.601 by its size (core/video_probe.h), so its copy in another size names it."""
    if video_stream(video).get("color_space", "unknown") not in ("unknown", "reserved"):
        return []
    return ["-colorspace", "bt709" if size[0] >= 1280 or size[1] >= 720 else "smpte170m"]


def fit_video(video, image, out, most_stretch=0.02):
    """Writes a video at `out` whose frames are as large as the image: what a model wrote, in another size, is scaled.
    Fails where that would stretch it by more than `most_stretch`: the model has then shown something else."""
    stream, size = video_stream(video), png_size(image)
    found = stream["width"], stream["height"]
    if found == size:
        shutil.copyfile(video, out)
        return
    stretch = size[0] * found[1] / (size[1] * found[0])
    if max(stretch, 1 / stretch) > 1 + most_stretch:
        fail(f"the model's video is {found[0]}x{found[1]}, the first frame {size[0]}x{size[1]}: their shapes differ by "
             f"{100 * (max(stretch, 1 / stretch) - 1):.1f} %, at most {100 * most_stretch:g} % are scaled away")
    scale = f"scale={size[0]}:{size[1]}:flags=lanczos"
    run(["ffmpeg", "-v", "error", "-y", "-i", video, *stream_words(video), "-vf", scale, "-crf", "12", "-pix_fmt", "yuv444p",
         *matrix_words(video, found), out])


def visible(folder, pattern):
    """The files of a folder, in order, but for hidden ones, which are no frames ("._0002.png")."""
    return sorted(path for path in pathlib.Path(folder).glob(pattern) if not path.name.startswith("."))


def frame_names(video):
    """The names that masks of a video have: those of a folder's frames, or numbers. Counted by ffprobe."""
    if pathlib.Path(video).is_dir():
        return [path.name for path in visible(video, "*.png")]
    return [f"{number:04d}.png" for number in range(int(video_stream(video)["nb_read_frames"]))]


def input_of(video):
    """ffmpeg's words for a video or a folder of PNG frames, and the folder to run it in: in a pattern any name of the
    folder itself would have a meaning."""
    if pathlib.Path(video).is_dir():
        return ["-pattern_type", "glob", "-i", "*.png"], video
    return ["-i", str(video), *stream_words(video)], None


def as_video(video, rate, folder, dry_run=False):
    """The video as one file: itself, or one made of a folder's frames. Of several streams the other program chooses."""
    if pathlib.Path(video).is_file():
        if not dry_run:
            video_stream(video)  # tells of others
        return pathlib.Path(video)
    made = pathlib.Path(folder).resolve() / "video.mp4"
    words, place = input_of(video)
    run(["ffmpeg", "-v", "error", "-y", "-framerate", rate, *words, "-crf", "10", "-pix_fmt", "yuv420p",
         "-colorspace", "smpte170m", "-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", made], place, dry_run)
    return made


def program(name):
    """A program to be run in another folder: a path is that of this folder. Links stay: an environment's Python is one."""
    return os.path.abspath(name) if "/" in name else name
