"""Stands in for PyTorch: arrays in the place of tensors, pickles of them in that of checkpoints."""
import contextlib
import pickle

bfloat16 = "bfloat16"


class Tensor:
    def __init__(self, array):
        self.array = array

    def detach(self):
        return self

    def cpu(self):
        return self

    def numpy(self):
        return self.array

    def __getitem__(self, at):
        return Tensor(self.array[at])

    def __gt__(self, least):
        return Tensor(self.array > least)


def load(path, map_location=None, weights_only=True):
    with open(path, "rb") as file:
        return pickle.load(file)


def inference_mode():
    return contextlib.nullcontext()


def autocast(device, dtype):
    return contextlib.nullcontext()
