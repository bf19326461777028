// How messages tell the size of pictures: "512x384".
#pragma once

#include <string>

#include "core/camera.h"
#include "core/image.h"

namespace hsi4d {

inline std::string size_text(int width, int height) { return std::to_string(width) + "x" + std::to_string(height); }

inline std::string size_text(const Image& image) { return size_text(image.width(), image.height()); }

inline std::string size_text(const Camera& camera) { return size_text(camera.width, camera.height); }

}  // namespace hsi4d
