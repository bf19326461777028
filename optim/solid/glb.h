// Numbers of binary glTF files.   [glTF 2.0, Khronos Group: chapters 3.6, 3.7, 4]
#pragma once

#include <cstdint>

namespace hsi4d::glb {

inline constexpr std::uint32_t kMagic = 0x46546C67, kJsonChunk = 0x4E4F534A, kBinaryChunk = 0x004E4942;
inline constexpr int kFloat = 5126, kUnsignedByte = 5121, kUnsignedShort = 5123, kUnsignedInt = 5125;  // components
inline constexpr int kTriangles = 4;                                                                   // primitive.mode
inline constexpr int kVertexBuffer = 34962, kIndexBuffer = 34963;  // bufferView.target

}  // namespace hsi4d::glb
