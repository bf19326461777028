// What the writers and readers of quantised formats share.
#pragma once

#include <cstdint>
#include <string>

#include "core/file.h"
#include "splat/files/splat_report.h"

namespace hsi4d {

/// A file's bytes, and what the format could not hold of the Gaussians beyond rounding: reasons and numbers.
struct EncodedSplats {
  Bytes bytes;
  Counts losses;
};

/// Holds numbers within a range and counts those that were outside by more than the rounding of a float.
class HeldNumbers {
 public:
  HeldNumbers(double least, double most) : least_(least), most_(most), rounding_(1e-6 * (most - least)) {}
  double hold(double value) {
    if (value >= least_ && value <= most_) return value;
    if (value < least_ - rounding_ || value > most_ + rounding_) ++count_;
    return value < least_ ? least_ : most_;
  }
  Index count() const { return count_; }

 private:
  double least_, most_, rounding_;
  Index count_ = 0;
};

/// Adds a reason with its count unless that is 0.
void add_loss(Counts& losses, const std::string& reason, Index count);

/// Level of an opacity in 8 bits: 255/(1 + e⁻ˣ), rounded.
std::uint8_t opacity_level(float logit);

/// Logit of an opacity of `level`/255. The end levels stand for a quarter of a step inside of 0 and 1 (±6.92), so that
/// the logit is finite, still moves, and rounds to the same level again.
float opacity_logit(std::uint8_t level);

/// Throws InternalError as check_sizes; UserError naming the Gaussian when one has a number that is not finite (an
/// opacity of ±inf is allowed), which `format` cannot hold.
void check_finite(const Gaussians& gaussians, const std::string& format);

/// Mean n in the world, metres.
Vector3<double> mean_world(const Gaussians& gaussians, Index n);

/// Rotation n as a unit quaternion wxyz.
Vector4<double> unit_quat(const Gaussians& gaussians, Index n);

/// Little-endian numbers at the end of `bytes`.
void append_uint(Bytes& bytes, std::uint64_t value, int size);
void append_float(Bytes& bytes, float value);

/// A little-endian number of `size` bytes.
std::uint64_t load_uint(const std::uint8_t* bytes, int size);
float load_float(const std::uint8_t* bytes);

}  // namespace hsi4d
