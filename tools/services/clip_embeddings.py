#!/usr/bin/env python3
"""Makes embeddings of a video's frames and of its text by CLIP, which `hsi4d evaluate` scores (docs/formats.md).

    /home/me/clip/bin/python tools/services/clip_embeddings.py --video runs/first/run/frames --pattern "*_render.png" \\
        --text "The person is watering flowers with a watering can." --frame-rate 10 --out runs/first/run/clip.npz
    hsi4d evaluate runs/first/run

To be run by the Python in which transformers, PyTorch, Pillow and NumPy are installed. As clip.npz in a run's folder
`hsi4d evaluate` finds it; elsewhere --clip names it. The paper does not say with which weights it scores; those of
ViT-B/32 are the custom of the field. Works with transformers 4 and 5; tested with stand-ins for it, the model itself
was not run.
"""

import pathlib
import tempfile

import service


def frame_files(video, pattern, folder):
    """The frames as PNG files, in order: those of a folder, or of a video, taken out by ffmpeg."""
    if pathlib.Path(video).is_dir():
        return sorted(pathlib.Path(video).glob(pattern))
    service.run(["ffmpeg", "-v", "error", "-i", video, "-fps_mode", "passthrough", pathlib.Path(folder) / "%06d.png"])
    return sorted(pathlib.Path(folder).glob("*.png"))


def rows_of(features):
    """The numbers [N,D] of what CLIP returns: of transformers 4 a tensor, of 5 an object that holds it."""
    return getattr(features, "pooler_output", features).float().cpu().numpy()


def embedded(files, text, model_name, device, batch):
    """Rows of numbers [T,D], and [D]."""
    try:
        import numpy as np
        import torch
        from PIL import Image
        from transformers import CLIPModel, CLIPProcessor
    except ImportError as missing:
        service.fail(f"Python's module {missing.name} is not there; run this by the Python of CLIP", service.ASKED_WRONGLY)
    model = CLIPModel.from_pretrained(model_name).to(device).eval()
    processor = CLIPProcessor.from_pretrained(model_name)
    rows = []
    with torch.inference_mode():
        for first in range(0, len(files), batch):
            images = [Image.open(file).convert("RGB") for file in files[first:first + batch]]
            inputs = processor(images=images, return_tensors="pt").to(device)
            rows.append(rows_of(model.get_image_features(**inputs)))
        inputs = processor(text=[text], return_tensors="pt", padding=True, truncation=True).to(device)
        of_text = rows_of(model.get_text_features(**inputs))[0]
    return np.concatenate(rows), of_text


def main():
    parser = service.Parser(__doc__)
    parser.add_argument("--video", required=True, help="a video, or a folder of PNG frames")
    parser.add_argument("--pattern", default="*.png", help="which files of a folder are frames; default: *.png")
    parser.add_argument("--text", required=True, help="what happens in it")
    parser.add_argument("--out", required=True, help="file to write (.npz)")
    parser.add_argument("--frame-rate", type=float, required=True, help="frames a second of the video")
    parser.add_argument("--model", default="openai/clip-vit-base-patch32", help="name of the weights at Hugging Face")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--batch", type=int, default=16, help="frames at once; default: 16")
    a = parser.parse_args()

    service.need(a.video, "video")
    if not a.out.endswith(".npz"):
        service.fail(f"--out: {a.out}: allowed ending: .npz", service.ASKED_WRONGLY)
    if not a.text.strip():
        service.fail("--text: is empty", service.ASKED_WRONGLY)
    if not 0.01 <= a.frame_rate <= 1e5:
        service.fail(f"--frame-rate: {a.frame_rate} is out of range; allowed: 0.01 to 100000", service.ASKED_WRONGLY)
    if a.batch < 1:
        service.fail(f"--batch: {a.batch} is out of range; allowed: 1 or more", service.ASKED_WRONGLY)
    if pathlib.Path(a.video).is_dir() and not any(pathlib.Path(a.video).glob(a.pattern)):
        service.fail(f"{a.video}: has no file {a.pattern}", service.ASKED_WRONGLY)
    if a.dry_run:
        print(f"{a.model} on {a.device}: embeds the frames of {a.video} and \"{a.text}\" into {a.out}")
        return
    with tempfile.TemporaryDirectory() as folder:
        files = frame_files(a.video, a.pattern, folder)
        if not files:
            service.fail(f"{a.video}: holds no frame")
        images, text = embedded(files, a.text, a.model, a.device, a.batch)
    import numpy as np

    np.savez(a.out, image_embeddings=images, text_embedding=text, frame_rate=np.array(a.frame_rate),
             model=np.array(a.model), prompt=np.array(a.text))
    print(f"{a.out}: {len(images)} frames, {images.shape[1]} numbers each, {a.model}")


if __name__ == "__main__":
    main()
