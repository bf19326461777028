// What a file is by its first bytes, for messages about one that is given in place of another.
#pragma once

#include <cstdint>
#include <span>
#include <string>

namespace hsi4d {

/// "a PNG image", "a .glb model", "a .safetensors file (hsi4d avatar)", "JSON", "text": what the bytes begin like.
/// Empty for what is not known.
std::string file_kind(std::span<const std::uint8_t> file);

/// "looks like a PNG image, not like a .npz archive"; empty for what is not known.
/// @param wanted  what it should have been, "a .npz archive"
std::string other_kind(std::span<const std::uint8_t> file, const std::string& wanted);

}  // namespace hsi4d
