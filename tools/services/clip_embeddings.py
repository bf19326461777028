#!/usr/bin/env python3
"""Makes embeddings of a video's frames and of its text by CLIP, which `hsi4d evaluate` scores (docs/formats.md).

    /home/me/clip/bin/python tools/services/clip_embeddings.py --video runs/first/run/frames --pattern "*_render.png" \\
        --text "The person is watering flowers with a watering can." --frame-rate 10 --out runs/first/run/clip.npz
    /home/me/clip/bin/python tools/services/clip_embeddings.py --runs runs/first/run runs/anyinteraction_static
    hsi4d evaluate runs/first/run

With --runs, all from what runs and sweeps hold: the frames that were rendered, the text and the rate. The model is
loaded once, and a run whose clip.npz is not older than its frames is left as it is.

To be run by the Python in which transformers, PyTorch, Pillow and NumPy are installed. As clip.npz in a run's folder
`hsi4d evaluate` finds it; elsewhere --clip names it. The paper does not say with which weights it scores; those of
ViT-B/32 are the custom of the field. Works with transformers 4 and 5; tested with stand-ins for it, the model itself
was not run.
"""

import json
import pathlib
import struct
import tempfile
import zipfile

import service


def frame_files(video, pattern, folder):
    """The frames as PNG files, in order: those of a folder, or of a video, taken out by ffmpeg."""
    if pathlib.Path(video).is_dir():
        return service.visible(video, pattern)
    words, _ = service.input_of(video)
    service.run(["ffmpeg", "-v", "error", *words, "-fps_mode", "passthrough", pathlib.Path(folder) / "%06d.png"])
    return sorted(pathlib.Path(folder).glob("*.png"))


def rows_of(features):
    """The numbers [N,D] of what CLIP returns: of transformers 4 a tensor, of 5 an object that holds it."""
    return getattr(features, "pooler_output", features).float().cpu().numpy()


class Clip:
    """The model, loaded."""

    def __init__(self, model_name, device, batch):
        try:
            import numpy as np
            import torch
            from PIL import Image
            from transformers import CLIPModel, CLIPProcessor
        except ImportError as missing:
            service.fail(f"Python's module {missing.name} is not there; run this by the Python of CLIP", service.ASKED_WRONGLY)
        self.np, self.torch, self.image = np, torch, Image
        self.name, self.device, self.batch = model_name, device, batch
        self.model = CLIPModel.from_pretrained(model_name).to(device).eval()
        self.processor = CLIPProcessor.from_pretrained(model_name)

    def embedded(self, files, text):
        """Rows of numbers [T,D], and [D]."""
        rows = []
        with self.torch.inference_mode():
            for first in range(0, len(files), self.batch):
                images = [self.image.open(file).convert("RGB") for file in files[first:first + self.batch]]
                inputs = self.processor(images=images, return_tensors="pt").to(self.device)
                rows.append(rows_of(self.model.get_image_features(**inputs)))
            inputs = self.processor(text=[text], return_tensors="pt", padding=True, truncation=True).to(self.device)
            of_text = rows_of(self.model.get_text_features(**inputs))[0]
        return self.np.concatenate(rows), of_text

    def write(self, out, files, text, frame_rate):
        """Writes the embeddings, whole or not at all."""
        images, of_text = self.embedded(files, text)
        part = pathlib.Path(f"{out}.tmp")
        with part.open("wb") as file:
            self.np.savez(file, image_embeddings=images, text_embedding=of_text, frame_rate=self.np.array(frame_rate),
                          model=self.np.array(self.name), prompt=self.np.array(text))
        part.replace(out)
        print(f"{out}: {len(images)} frames, {images.shape[1]} numbers each, {self.name}", flush=True)


def member(folder, name):
    """A JSON file of a run."""
    try:
        return json.loads((folder / name).read_text())
    except (OSError, ValueError) as error:
        service.fail(f"{folder / name}: cannot be read: {error}", service.ASKED_WRONGLY)


def is_done(folder):
    return (folder / "status.json").exists() and member(folder, "status.json").get("state") == "done"


def runs_in(folder):
    """The run, or those of a sweep that are done, in its order."""
    if (folder / "status.json").exists():
        return [folder]
    if not (folder / "sweep.json").exists():
        service.fail(f"{folder}: holds no run of hsi4d and no sweep", service.ASKED_WRONGLY)
    ids = dict.fromkeys(run["id"] for run in member(folder, "sweep.json")["runs"])
    return [folder / "runs" / name for name in ids if is_done(folder / "runs" / name)]


def text_of(folder):
    """What is to happen in a run's video, as its config says."""
    config = member(folder, "config.resolved.json")
    text = config.get("sources", {}).get("prompt") or config.get("instance", {}).get("prompt") or ""
    if not text.strip():
        service.fail(f"{folder}: its config says no text (sources.prompt, instance.prompt); embed it by --video and --text",
                     service.ASKED_WRONGLY)
    return text


def rate_of(folder):
    """Frames a second of a run, as its motion says: a number of 8 bytes at the end of its array, without NumPy."""
    try:
        with zipfile.ZipFile(folder / "motion.npz") as motion:
            return struct.unpack("<d", motion.read("mocap_frame_rate.npy")[-8:])[0]
    except (OSError, KeyError, zipfile.BadZipFile, struct.error) as error:
        service.fail(f"{folder / 'motion.npz'}: does not say its rate: {error}", service.ASKED_WRONGLY)


def embed_runs(a):
    tasks = []
    for folder in (run for given in a.runs for run in runs_in(service.need(given, "folder"))):
        files = service.visible(folder / "frames", "*_render.png")
        if not files:
            service.fail(f"{folder / 'frames'}: has no file *_render.png", service.ASKED_WRONGLY)
        out = folder / "clip.npz"
        if not out.exists() or out.stat().st_mtime < max(file.stat().st_mtime for file in files):
            tasks.append((out, files, text_of(folder), rate_of(folder)))
    if a.dry_run:
        for out, files, text, rate in tasks:
            print(f'{out}: {len(files)} frames at {rate:g} a second, "{text}"')
    if not tasks:
        print("every run has its embeddings")
    elif not a.dry_run:
        clip = Clip(a.model, a.device, a.batch)
        for task in tasks:
            clip.write(*task)


def embed_video(a):
    for option in ("video", "text", "out", "frame_rate"):
        if getattr(a, option) is None:
            service.fail(f"--{option.replace('_', '-')} is required, or --runs", service.ASKED_WRONGLY)
    service.need(a.video, "video")
    if not a.out.endswith(".npz"):
        service.fail(f"--out: {a.out}: allowed ending: .npz", service.ASKED_WRONGLY)
    if not a.text.strip():
        service.fail("--text: is empty", service.ASKED_WRONGLY)
    if not 0.01 <= a.frame_rate <= 1e5:
        service.fail(f"--frame-rate: {a.frame_rate} is out of range; allowed: 0.01 to 100000", service.ASKED_WRONGLY)
    if pathlib.Path(a.video).is_dir() and not service.visible(a.video, a.pattern):
        service.fail(f"{a.video}: has no file {a.pattern}", service.ASKED_WRONGLY)
    if a.dry_run:
        print(f"{a.model} on {a.device}: embeds the frames of {a.video} and \"{a.text}\" into {a.out}")
        return
    with tempfile.TemporaryDirectory() as folder:
        files = frame_files(a.video, a.pattern, folder)
        if not files:
            service.fail(f"{a.video}: holds no frame")
        Clip(a.model, a.device, a.batch).write(a.out, files, a.text, a.frame_rate)


def main():
    parser = service.Parser(__doc__)
    parser.add_argument("--runs", nargs="+", metavar="DIR", help="runs of hsi4d, and sweeps for all of theirs that are done: clip.npz goes into each")
    parser.add_argument("--video", help="or a video, or a folder of PNG frames")
    parser.add_argument("--pattern", default="*.png", help="which files of a folder are frames; default: *.png")
    parser.add_argument("--text", help="what happens in the video")
    parser.add_argument("--out", help="file to write (.npz)")
    parser.add_argument("--frame-rate", type=float, help="frames a second of the video")
    parser.add_argument("--model", default="openai/clip-vit-base-patch32", help="name of the weights at Hugging Face")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--batch", type=int, default=16, help="frames at once; default: 16")
    a = parser.parse_args()
    if a.batch < 1:
        service.fail(f"--batch: {a.batch} is out of range; allowed: 1 or more", service.ASKED_WRONGLY)
    if not a.runs:
        embed_video(a)
        return
    for option in ("video", "text", "out", "frame_rate"):
        if getattr(a, option) is not None:
            service.fail(f"--{option.replace('_', '-')} is not for --runs, which say it themselves", service.ASKED_WRONGLY)
    embed_runs(a)


if __name__ == "__main__":
    main()
