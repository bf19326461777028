"""Stands in for SAM 2's predictor: what is seen moves to the right by a pixel a frame. Answers in another order than it is
asked, as it may."""
import pathlib

import numpy as np
import torch
from PIL import Image


class SAM2VideoPredictor:
    @classmethod
    def from_pretrained(cls, model, device):
        assert (model, device) == ("facebook/sam2-hiera-large", "cpu"), (model, device)
        return cls()

    def init_state(self, folder):
        files = sorted(path.name for path in pathlib.Path(folder).iterdir())
        assert files == [f"{number:05d}.jpg" for number in range(len(files))], files
        width, height = Image.open(pathlib.Path(folder) / files[0]).size
        return {"video_width": width, "video_height": height, "frames": len(files), "masks": {}}

    def add_new_mask(self, state, frame_idx, obj_id, mask):
        assert frame_idx == 0 and mask.dtype == bool, (frame_idx, mask.dtype)
        assert mask.shape == (state["video_height"], state["video_width"]), mask.shape
        state["masks"][obj_id] = mask

    def propagate_in_video(self, state):
        numbers = sorted(state["masks"], reverse=True)
        for frame in range(state["frames"]):
            logits = [np.where(np.roll(state["masks"][number], frame, axis=1), 3.0, -3.0)[None] for number in numbers]
            yield frame, numbers, [torch.Tensor(logit) for logit in logits]
