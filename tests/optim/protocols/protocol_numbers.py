#!/usr/bin/env python3
"""The numbers of "metrics of protocols are those of NumPy" in world_motion_metrics_test.cpp and human_object_metrics_test.cpp.

    python3 tests/optim/protocols/protocol_numbers.py

By NumPy's singular value decomposition, from the published words of the protocols; nothing of hsi4d is used.
"""

import numpy as np


def waves(frames, points, phase, size, drift=0.02):
    t, p, c = np.meshgrid(np.arange(frames), np.arange(points), np.arange(3), indexing="ij")
    return size * np.sin(0.37 * t + 1.1 * p + 2.3 * c + phase) + drift * t * (c + 1)


def fit(x, y, scale):
    x, y = x.reshape(-1, 3), y.reshape(-1, 3)
    mx, my = x.mean(0), y.mean(0)
    u, d, v = np.linalg.svd((y - my).T @ (x - mx))
    s = np.diag([1, 1, np.sign(np.linalg.det(u) * np.linalg.det(v))])
    turn = u @ s @ v
    size = (d * np.diag(s)).sum() / ((x - mx) ** 2).sum() if scale else 1
    return lambda p: size * (p - mx) @ turn.T + my


def lengths(x):
    return np.linalg.norm(x, axis=-1)


truth, own = waves(230, 22, 0, 0.5), 1.2 * waves(230, 22, 0.3, 0.5)[..., [1, 2, 0]] + 0.05 * waves(230, 22, 2, 1)
wa, w = [], []
for begin in range(0, 230, 100):
    a, b = own[begin:begin + 100], truth[begin:begin + 100]
    wa.append(lengths(fit(a, b, True)(a) - b).mean(-1))
    w.append(lengths(fit(a[:2], b[:2], True)(a) - b).mean(-1))
print("WA-MPJPE-100", repr(1000 * np.concatenate(wa).mean()))
print("W-MPJPE-100", repr(1000 * np.concatenate(w).mean()))
way = lengths(np.diff(truth[:, 0], axis=0)).sum()
print("RTE", repr(100 * lengths(fit(own[:, 0], truth[:, 0], False)(own[:, 0]) - truth[:, 0]).mean() / way))
print("jitter", repr((lengths(np.diff(own, 3, axis=0)) * 30**3).mean() / 10))
feet, its_feet = waves(230, 4, 0.2, 0.03, 0.001), waves(230, 4, 0.1, 0.02, 0)
stands = lengths(np.diff(its_feet, axis=0)) < 0.01
print("foot sliding", repr(1000 * lengths(np.diff(feet, axis=0))[stands].mean()), stands.sum())

human, its_human = waves(10, 30, 0.4, 0.6), waves(10, 30, 0, 0.5)
thing, its_thing = waves(10, 12, 0.9, 0.3), waves(10, 12, 0.7, 0.35)
cds, bends = {"human": [], "object": [], "both": []}, {"human": [], "object": []}


def chamfer(a, b):
    d = lengths(a[:, None] - b[None])
    return d.min(0).mean() + d.min(1).mean()


for begin in range(0, 10, 4):
    part = slice(begin, min(begin + 4, 10))
    lay = fit(np.concatenate([human[part].reshape(-1, 3), thing[part].reshape(-1, 3)]),
              np.concatenate([its_human[part].reshape(-1, 3), its_thing[part].reshape(-1, 3)]), True)
    laid, laid_thing = lay(human[part]), lay(thing[part])
    for t in range(part.stop - part.start):
        cds["human"].append(chamfer(laid[t], its_human[begin + t]))
        cds["object"].append(chamfer(laid_thing[t], its_thing[begin + t]))
        cds["both"].append(chamfer(np.concatenate([laid[t], laid_thing[t]]),
                                   np.concatenate([its_human[begin + t], its_thing[begin + t]])))
    if part.stop - part.start >= 3:
        for name, a, b in (("human", laid, its_human[part]), ("object", laid_thing, its_thing[part])):
            bends[name] += [lengths(np.diff(a - b, 2, axis=0)).mean()] * (part.stop - part.start)
for name, numbers in cds.items():
    print("CD", name, repr(100 * np.mean(numbers)))
for name, numbers in bends.items():
    print("acceleration", name, repr(100 * np.mean(numbers)))
