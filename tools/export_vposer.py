#!/usr/bin/env python3
"""Turns the public checkpoint of VPoser v2 into a file that hsi4d reads.

    tools/export_vposer.py V02_05 vposer.npz          # or vposer.safetensors
    tools/export_vposer.py V02_05/snapshots/V02_05_epoch=13_val_loss=0.03.ckpt vposer.npz

IN is the folder of the download (its last snapshot is taken) or a checkpoint. Needs Python with PyTorch and NumPy. The
checkpoint comes from https://smpl-x.is.tue.mpg.de and has a licence of its own.

A checkpoint is a pickle, which can run code when it is read. It is read with PyTorch's reader of plain tensors; where
that refuses, because the file holds other objects too, --trust reads it all the same: only for files whose origin you
trust.
"""

import argparse
import json
import pathlib
import struct
import sys

MAPS = {
    "encoder_net.2": (None, 63),
    "encoder_net.6": (None, None),
    "encoder_net.7": (None, None),
    "encoder_net.8.mu": (None, None),
    "decoder_net.0": (None, None),
    "decoder_net.3": (None, None),
    "decoder_net.5": (126, None),
}
NORMALIZATIONS = {"encoder_net.1": 63, "encoder_net.4": None}


def fail(message):
    sys.exit("export_vposer: " + message)


def needed_modules():
    try:
        import numpy
        import torch
    except ImportError as missing:
        fail(f"Python's module {missing.name} is not there; needed are torch and numpy (pip install torch numpy)")
    return torch, numpy


def checkpoint_of(path):
    if path.is_file():
        return path
    if not path.exists():
        fail(f"{path}: there is no such file or folder")
    found = sorted(path.glob("snapshots/*.ckpt")) + sorted(path.glob("snapshots/*.pt"))
    found = found or sorted(path.glob("*.ckpt")) + sorted(path.glob("*.pt"))
    if not found:
        fail(f"{path}: holds no checkpoint (*.ckpt or *.pt, also in snapshots/)")
    return max(found, key=lambda file: file.stat().st_mtime)


def read_checkpoint(torch, path, trust):
    try:
        return torch.load(path, map_location="cpu", weights_only=not trust)
    except Exception as fault:  # torch raises whatever its unpickler does
        hint = "" if trust else "; --trust reads files that hold other objects than tensors, and runs what is in them"
        fail(f"{path}: cannot be read: {fault}{hint}")


def arrays_of(numpy, state, path):
    """The arrays that hsi4d reads, float32, by their names in the network."""
    tensors = {name.removeprefix("vp_model."): tensor for name, tensor in state.items()}
    wanted = {}
    for name, (rows, columns) in MAPS.items():
        wanted[name + ".weight"] = (rows, columns)
        wanted[name + ".bias"] = (rows,)
    for name, count in NORMALIZATIONS.items():
        for part in ("weight", "bias", "running_mean", "running_var"):
            wanted[f"{name}.{part}"] = (count,)
    arrays = {}
    for name, shape in wanted.items():
        if name not in tensors:
            fail(f"{path}: has no tensor {name}; it is no VPoser v2 (those of v1 have other layers)")
        array = tensors[name].detach().cpu().numpy().astype(numpy.float32)
        fits = array.ndim == len(shape) and all(n is None or n == m for n, m in zip(shape, array.shape))
        if not fits:
            fail(f"{path}: tensor {name} has shape {list(array.shape)}; {list(shape)} is needed (None: any)")
        arrays[name] = numpy.ascontiguousarray(array)
    return arrays


def write_safetensors(path, arrays):
    header, at = {}, 0
    for name, array in arrays.items():
        header[name] = {"dtype": "F32", "shape": list(array.shape), "data_offsets": [at, at + array.nbytes]}
        at += array.nbytes
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 8)
    with open(path, "wb") as file:
        file.write(struct.pack("<Q", len(text)) + text)
        for array in arrays.values():
            file.write(array.astype("<f4").tobytes())


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("input", metavar="IN", type=pathlib.Path)
    parser.add_argument("output", metavar="OUT", type=pathlib.Path)
    parser.add_argument("--trust", action="store_true", help="unpickle everything in IN, which can run code")
    arguments = parser.parse_args()
    if arguments.output.suffix not in (".npz", ".safetensors"):
        fail(f"{arguments.output}: allowed endings: .npz, .safetensors")
    torch, numpy = needed_modules()
    path = checkpoint_of(arguments.input)
    content = read_checkpoint(torch, path, arguments.trust)
    state = content.get("state_dict", content) if isinstance(content, dict) else None
    if not isinstance(state, dict):
        fail(f"{path}: holds no table of tensors")
    arrays = arrays_of(numpy, state, path)
    if arguments.output.suffix == ".npz":
        numpy.savez(arguments.output, **arrays)
    else:
        write_safetensors(arguments.output, arrays)
    latents = arrays["encoder_net.8.mu.bias"].shape[0]
    print(f"{arguments.output}: {len(arrays)} arrays of {path.name}, {latents} latents")


if __name__ == "__main__":
    main()
