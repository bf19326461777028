// The weights w of a curvature (autodiff/curvature.h): an array of them beside arrays of the tape.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>

#include "autodiff/tape.h"
#include "core/buffer.h"

namespace hsi4d {

/// What a curvature leaves out, and where it rounds.
struct CurvatureRule {
  double least_difference = 0.01;  ///< absolute differences below it count as squares: grey levels, and some
  Index tiles = 1;                 ///< of so many tiles of a render one counts, so many times
  Index turn = 0;                  ///< which of them
  bool structural = true;          ///< SSIM has a part
};

/// w of arrays of one tape. What an operator's `weigh` reads and adds to.
template <class S>
class CurvatureWeights {
 public:
  explicit CurvatureWeights(Tape<S>& tape, const CurvatureRule& given = {}) : rule(given), tape_(tape) {}

  CurvatureRule rule;

  /// w of input i, shaped like it, to be added to; zeros when first asked for.
  Array<S> of_input(const NodeIo<S>& io, int i) { return made(io.input_ids_[i]); }
  /// w of output j; empty (false) where there is none.
  ConstArray<S> of_output(const NodeIo<S>& io, int j = 0) const {
    return of(io.first_output_ + static_cast<std::uint32_t>(j));
  }

  /// w of an array by its number.
  ConstArray<S> of(std::uint32_t id) const {
    const auto found = all_.find(id);
    if (found == all_.end() || !found->second.given) return {};
    return {found->second.numbers.data(), tape_.arrays_[id].shape};
  }
  /// Forgets all of them; their memory is kept.
  void clear() {
    for (auto& [id, weights] : all_) weights.given = false;
  }

 private:
  struct Weights {
    Buffer<S> numbers;
    bool given = false;
  };
  Array<S> made(std::uint32_t id) {
    const Shape& shape = tape_.arrays_[id].shape;
    Weights& weights = all_[id];
    if (!weights.given) {
      weights.numbers.resize(shape.memory());
      std::fill_n(weights.numbers.data(), shape.memory(), S(0));
      weights.given = true;
    }
    return {weights.numbers.data(), shape};
  }

  Tape<S>& tape_;
  std::map<std::uint32_t, Weights> all_;
};

}  // namespace hsi4d
