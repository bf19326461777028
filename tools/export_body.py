#!/usr/bin/env python3
"""Turns a pickled body model of SMPL, SMPL-H or SMPL-X into a file that hsi4d reads.

    tools/export_body.py basicmodel_neutral_lbs_10_207_0_v1.1.0.pkl SMPL_NEUTRAL.npz
    hsi4d pose --body-model SMPL_NEUTRAL.npz --params P.npz --out F.npz

The models come from https://smpl.is.tue.mpg.de and https://mano.is.tue.mpg.de and have licences of their own. SMPL-H as it
comes with AMASS (model.npz) and SMPL-X (.npz) need no turning: hsi4d reads them as they are.

Only arrays are unpickled, which runs no code: those of NumPy, sparse matrices of SciPy, and chumpy's arrays that are
nothing but numbers. Neither SciPy nor chumpy need be there. What else is in a file is refused, naming it. Needs Python
with NumPy.
"""

import argparse
import pathlib
import pickle
import sys

NEEDED = ("v_template", "f", "weights", "kintree_table", "shapedirs", "J_regressor")
OPTIONAL = ("posedirs", "hands_meanl", "hands_meanr", "hands_componentsl", "hands_componentsr")
NUMPY = ("numpy", "numpy.core.multiarray", "numpy._core.multiarray", "numpy.core.numeric", "numpy._core.numeric")
KNOWN = {"_reconstruct", "ndarray", "dtype", "scalar", "_frombuffer"}
PLAIN = {("collections", "OrderedDict"), ("_codecs", "encode"), ("copy_reg", "_reconstructor"),
         ("copyreg", "_reconstructor"), ("__builtin__", "object"), ("builtins", "object")}
SPARSE = ("csc_matrix", "csr_matrix", "coo_matrix")


def fail(message):
    sys.exit("export_body: " + message)


class State:
    """What a pickled object of another library is made of; `kind` is its class."""

    kind = ""

    def __init__(self, *_):
        self.state = {}

    def __setstate__(self, state):
        self.state = state


def read(path):
    class ArraysAlone(pickle.Unpickler):
        def find_class(self, home, name):
            if (home in NUMPY and name in KNOWN) or (home, name) in PLAIN:
                return super().find_class(home, name)
            if (home.startswith("scipy.sparse") and name in SPARSE) or (home == "chumpy.ch" and name == "Ch"):
                return type(name, (State,), {"kind": name})
            fail(f"{path}: holds {home}.{name}, which is no plain array and is not unpickled")

    try:
        with open(path, "rb") as file:
            return ArraysAlone(file, encoding="latin1").load()
    except OSError as error:
        fail(f"{path}: {error.strerror}")
    except (pickle.UnpicklingError, EOFError, AttributeError, ImportError, IndexError, TypeError, ValueError) as error:
        fail(f"{path}: is no pickle of a body model: {error}")


def numbers(np, value, what):
    """An array of a pickled one."""
    if isinstance(value, State):
        state = value.state
        if not isinstance(state, dict):
            fail(f"{what}: a {value.kind} of an unknown form")
        if value.kind == "Ch":
            if "x" not in state:
                fail(f"{what}: an array of chumpy that has no numbers of its own")
            return numbers(np, state["x"], what)
        return dense(np, value.kind, state, what)
    array = np.asarray(value)
    if array.dtype.kind not in "fiu":
        fail(f"{what}: holds no numbers")
    return array


def dense(np, kind, state, what):
    """Of a sparse matrix: compressed columns or rows, or places."""
    shape = state.get("_shape", state.get("shape"))
    try:
        data = np.asarray(state["data"], dtype=float)
        full = np.zeros(shape)
        if kind == "coo_matrix":
            rows, columns = state["coords"] if "coords" in state else (state["row"], state["col"])
        else:
            starts = np.asarray(state["indptr"])
            lines = np.repeat(np.arange(len(starts) - 1), np.diff(starts))
            rows, columns = (state["indices"], lines) if kind == "csc_matrix" else (lines, state["indices"])
        np.add.at(full, (np.asarray(rows), np.asarray(columns)), data)
    except (KeyError, IndexError, TypeError, ValueError) as error:
        fail(f"{what}: a {kind} that does not fit together ({error})")
    return full


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=pathlib.Path, help="the pickle")
    parser.add_argument("out", type=pathlib.Path, help="the .npz to write")
    arguments = parser.parse_args()
    try:
        import numpy as np
    except ImportError:
        fail("Python's module numpy is not there (pip install numpy)")
    if arguments.out.suffix != ".npz":
        fail(f"{arguments.out}: allowed: a name that ends in .npz")
    model = read(arguments.model)
    if not isinstance(model, dict):
        fail(f"{arguments.model}: is no table of arrays")
    missing = [name for name in NEEDED if name not in model]
    if missing:
        fail(f"{arguments.model}: has no {', '.join(missing)}")
    arrays = {}
    for name in (*NEEDED, *OPTIONAL):
        if name in model:
            arrays[name] = numbers(np, model[name], f"{arguments.model}: {name}")
    joints = arrays["kintree_table"].shape[-1]
    if joints not in (24, 52, 55):
        fail(f"{arguments.model}: kintree_table: has {joints} joints; allowed: 24 (SMPL), 52 (SMPL-H), 55 (SMPL-X)")
    for name in ("f", "kintree_table"):
        arrays[name] = arrays[name].astype(np.int64)
    partial = arguments.out.with_name(arguments.out.name + ".part.npz")
    np.savez(partial, **arrays)
    partial.replace(arguments.out)
    left = sorted(str(name) for name in set(model) - set(arrays))
    print(f"{arguments.out}: {len(arrays['v_template'])} vertices, {joints} joints, {arrays['shapedirs'].shape[-1]} shapes"
          + (f"; not read: {', '.join(left)}" if left else ""))


if __name__ == "__main__":
    main()
