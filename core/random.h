// Random numbers that are a function of (seed, stream, index): no state, any order, any thread.
//
// The generator is Philox4x32-10 [Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC
// 2011], a bijection of 128-bit counters for each 64-bit key. Key = seed; counter = (index, stream), 64 bits each, so
// streams of one seed never share a block. Each index owns one block of 128 bits; what is drawn at one index from one
// stream (uniform, normal, …) comes from the same bits: different purposes take different streams.
//
// Only integer operations, + − × / and square roots of IEEE doubles are used, own logarithm and sine included, so every
// number is the same, bit for bit, on every platform (with -ffp-contract=off, which the library's targets set).
#pragma once

#include <array>
#include <cstdint>
#include <string_view>
#include <utility>
#include <vector>

#include "core/linear.h"
#include "core/types.h"

namespace hsi4d {

using PhiloxCounter = std::array<std::uint32_t, 4>;
using PhiloxKey = std::array<std::uint32_t, 2>;

/// Philox4x32-10: 128 random bits of a counter and a key.
PhiloxCounter philox(PhiloxCounter counter, PhiloxKey key);

/// A stream's number from a word ("contact.noise"): FNV-1a, 64 bits.
constexpr std::uint64_t random_stream(std::string_view name) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const char c : name) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

/// Random access to one stream.
class Random {
 public:
  explicit Random(std::uint64_t seed, std::uint64_t stream = 0) : seed_(seed), stream_(stream) {}

  std::uint64_t seed() const { return seed_; }
  std::uint64_t stream() const { return stream_; }

  /// The 128 bits at an index, of which everything below is made.
  PhiloxCounter block(std::uint64_t index) const;
  /// 64 random bits.
  std::uint64_t bits(std::uint64_t index) const;
  /// Uniform in [0, 1): a multiple of 2⁻⁵³ for double, of 2⁻²⁴ for float (the double cut off, so never 1).
  template <class S = double>
  S uniform(std::uint64_t index) const;
  /// Uniform in [low, high), double. Throws InternalError unless low < high, both finite.
  double uniform(std::uint64_t index, double low, double high) const;
  /// Integer in [0, count), all equally likely (Lemire's multiply and reject). Throws InternalError if count is 0.
  std::uint64_t below(std::uint64_t index, std::uint64_t count) const;
  /// Two independent standard normals by Box and Muller; |value| ≤ 8.6.
  std::pair<double, double> normal_pair(std::uint64_t index) const;
  /// The first of the pair.
  double normal(std::uint64_t index) const { return normal_pair(index).first; }
  /// Unit quaternion wxyz, uniform over all rotations. [Shoemake 1992, Graphics Gems III]
  Vector4<double> rotation(std::uint64_t index) const;
  /// Order of 0 … count−1, all equally likely (Fisher and Yates); takes the indices index … index+count−2.
  /// Throws InternalError if count is negative.
  std::vector<Index> permutation(std::uint64_t index, Index count) const;

 private:
  std::uint64_t seed_;
  std::uint64_t stream_;
};

template <>
double Random::uniform<double>(std::uint64_t index) const;
template <>
float Random::uniform<float>(std::uint64_t index) const;

/// The same numbers one after the other: the n-th call gives what Random gives at index n. `position` is all its state.
class RandomSequence {
 public:
  explicit RandomSequence(Random random, std::uint64_t position = 0) : random_(random), position_(position) {}
  explicit RandomSequence(std::uint64_t seed, std::uint64_t stream = 0) : RandomSequence(Random(seed, stream)) {}

  std::uint64_t position() const { return position_; }
  std::uint64_t bits() { return random_.bits(position_++); }
  template <class S = double>
  S uniform() {
    return random_.uniform<S>(position_++);
  }
  double uniform(double low, double high) { return random_.uniform(position_++, low, high); }
  std::uint64_t below(std::uint64_t count) { return random_.below(position_++, count); }
  double normal() { return random_.normal(position_++); }
  Vector4<double> rotation() { return random_.rotation(position_++); }
  /// Advances by count − 1.
  std::vector<Index> permutation(Index count) {
    std::vector<Index> order = random_.permutation(position_, count);
    if (count > 1) position_ += static_cast<std::uint64_t>(count - 1);
    return order;
  }

 private:
  Random random_;
  std::uint64_t position_;
};

}  // namespace hsi4d
