#!/usr/bin/env python3
"""Makes masks of a video by SAM 2 (github.com/facebookresearch/sam2), for /sources/masks of a config.

    "command": ["/home/me/sam2/bin/python", "tools/services/sam2_masks.py", "--video", "{video}",
                "--objects", "{objects}", "--first", "{first_masks}", "--out", "{out}"]

To be run by the Python in which sam2 is installed. What of the human and of each object is seen in frame 0 is given to
it as masks, which it follows through the video. Writes OUT/NAME/NNNN.png, 255 where NAME is seen. Tried against a
stand-in of the package only; the model itself was not run.
"""

import importlib
import pathlib
import tempfile

import service


def jpeg_frames(video, folder):
    """SAM 2 reads a folder of JPEG files whose names are numbers."""
    words, place = service.input_of(video)
    service.run(["ffmpeg", "-v", "error", *words, "-fps_mode", "passthrough", "-q:v", "2", "-start_number", "0",
                 pathlib.Path(folder).resolve() / "%05d.jpg"], place)


def modules(*names):
    """Modules that SAM 2 and what it stands on bring: this is to be run by their Python."""
    try:
        return [importlib.import_module(name) for name in names]
    except ImportError as missing:
        service.fail(f"Python's module {missing.name} is not there; run this by the Python of SAM 2", service.ASKED_WRONGLY)


def read_mask(path, width, height):
    """Where a grey image of any size is at least 128, [height,width]."""
    np, Image = modules("numpy", "PIL.Image")
    return np.asarray(Image.open(path).convert("L").resize((width, height))) >= 128


def write_mask(path, seen):
    np, Image = modules("numpy", "PIL.Image")
    Image.fromarray(seen.astype(np.uint8) * 255).save(path)


def followed(predictor, folder, first):
    """Where each name is seen, frame by frame.

    @param folder  of the video's frames, as jpeg_frames writes them
    @param first   the file of a mask in frame 0 by name
    @return        (frame, name, [height,width]) of every frame and name
    """
    names = list(first)
    state = predictor.init_state(folder)
    for number, name in enumerate(names):
        mask = read_mask(first[name], state["video_width"], state["video_height"])
        predictor.add_new_mask(state, frame_idx=0, obj_id=number, mask=mask)
    for frame, numbers, logits in predictor.propagate_in_video(state):
        for number, logit in zip(numbers, logits):
            yield frame, names[number], (logit[0] > 0).cpu().numpy()


def main():
    parser = service.Parser(__doc__)
    parser.add_argument("--video", required=True, help="a video, or a folder of PNG frames")
    parser.add_argument("--objects", required=True, help="names apart by commas")
    parser.add_argument("--first", required=True, help="folder with NAME.png, the masks of frame 0")
    parser.add_argument("--out", required=True, help="folder to write")
    parser.add_argument("--model", default="facebook/sam2-hiera-large", help="name of the weights at Hugging Face")
    parser.add_argument("--device", default="cuda")
    a = parser.parse_args()

    names = a.objects.split(",")
    a.video = service.need(a.video, "video")
    first = {name: service.need(pathlib.Path(a.first) / f"{name}.png", "mask") for name in names}
    if a.dry_run:
        print(f"{a.model} on {a.device}: follows {', '.join(names)} through {a.video} into {a.out}")
        return
    torch, sam2 = modules("torch", "sam2.sam2_video_predictor")
    files = service.frame_names(a.video)
    for name in names:
        (pathlib.Path(a.out) / name).mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        jpeg_frames(a.video, folder)
        predictor = sam2.SAM2VideoPredictor.from_pretrained(a.model, device=a.device)
        with torch.inference_mode(), torch.autocast(a.device, dtype=torch.bfloat16):
            for frame, name, seen in followed(predictor, folder, first):
                write_mask(pathlib.Path(a.out) / name / files[frame], seen)


if __name__ == "__main__":
    main()
