// Plants and the sky of the scenes out of doors.
#pragma once

#include "pipelines/synthetic/kit.h"

namespace hsi4d::detail {

/// Sunlight by the direction of a surface: a greater contrast than indoors.
double sun_light(const Point& normal);

/// Sky with clouds over hills and woods, around the far side.
void add_sky(SceneKit& kit);

/// A ragged ball of leaves. @param half  its radii; @param rough  how far it is from a ball
void add_bush(SceneKit& kit, const Point& center, const Point& half, const Rgb& green, double rough, double detail);

/// A clipped hedge along x.
void add_hedge(SceneKit& kit, double left, double right, double front, double depth, double height);

void add_tree(SceneKit& kit, const Point& foot, double size);

/// A stem, two leaves and a blossom.
void add_flower(SceneKit& kit, const Point& foot, double height);

}  // namespace hsi4d::detail
