// The formats of files of Gaussians, one line each. HSI4D_SPLAT_FORMAT(name) stands for `SplatFormat name_format()` in
// splat/files/io_name.cpp; every format listed here is read and written wherever Gaussians are, and named in messages,
// help and settings.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "splat/files/io_spz.h"
#include "splat/files/quantised.h"
#include "splat/files/splat_report.h"
#include "splat/limits.h"

// clang-format off
#define HSI4D_SPLAT_FORMATS          \
  HSI4D_SPLAT_FORMAT(ply)            \
  HSI4D_SPLAT_FORMAT(compressed_ply) \
  HSI4D_SPLAT_FORMAT(splat)          \
  HSI4D_SPLAT_FORMAT(spz)
// clang-format on

namespace hsi4d {

struct SplatWriteOptions {
  SpzOptions spz;
};

struct SplatFormat {
  std::string ending = {};              ///< lower case; of several that a path ends in, the longest counts
  std::string kind = {};                ///< among the formats of one last ending: "INRIA's" and "compressed" of .ply
  std::vector<std::string> magic = {};  ///< first bytes, 16 at most; without, a file is known by its ending alone
  bool gzip = false;                    ///< files may be gzip streams; one format alone can say so
  int sh_degree = kHighestShDegree;     ///< of the harmonics that a file can hold
  /// @param origin_world  what means become relative to, as in read_splats
  SplatFile (*decode)(std::span<const std::uint8_t> file, const std::string& name,
                      const Vector3<double>& origin_world) = nullptr;
  EncodedSplats (*encode)(const Gaussians& gaussians, const SplatWriteOptions& options) = nullptr;
};

#define HSI4D_SPLAT_FORMAT(name) SplatFormat name##_format();
HSI4D_SPLAT_FORMATS
#undef HSI4D_SPLAT_FORMAT

/// In the order of the list.
const std::vector<SplatFormat>& splat_formats();

}  // namespace hsi4d
