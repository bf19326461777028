// How points move with bones, rigid objects and the camera: the middle part of a curvature (autodiff/curvature.h).
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "autodiff/tape.h"
#include "core/buffer.h"

namespace hsi4d {

/// Numbers of a twist: velocity of the mover's origin, angular velocity.
inline constexpr Index kTwist = 6;

/// How rows of points move with movers: d x_n = Σ_k rate(n, k) · twist of mover(n, k).
template <class S>
struct Twists {
  Index rows = 0, dims = 0;
  Index per_row = 0;            ///< movers of a row, at most
  Buffer<std::int32_t> movers;  ///< [rows, per_row]; −1: none
  Buffer<S> rates;              ///< [rows, per_row, dims, 6]

  std::int32_t& mover(Index row, Index k) { return movers[row * per_row + k]; }
  std::int32_t mover(Index row, Index k) const { return movers[row * per_row + k]; }
  S* rate(Index row, Index k) { return rates.data() + (row * per_row + k) * dims * kTwist; }
  const S* rate(Index row, Index k) const { return rates.data() + (row * per_row + k) * dims * kTwist; }
};

/// A row of an array that moves points rigidly.
struct Mover {
  std::uint32_t array = 0;  ///< id of its Var
  Index row = 0;
  /// Of the row's numbers: cotangents[k] · d row is number k of the twist.
  std::array<std::vector<double>, kTwist> cotangents;
};

/// The movers of one tape, and how arrays follow them. What an operator's `push` reads and adds to.
template <class S>
class Movers {
 public:
  explicit Movers(Tape<S>& tape) : tape_(tape) {}

  Index count() const { return static_cast<Index>(all_.size()); }
  const Mover& operator[](Index m) const { return all_[static_cast<std::size_t>(m)]; }

  /// How input i moves; null: it does not.
  const Twists<S>* of_input(const NodeIo<S>& io, int i) const {
    const std::uint32_t id = io.input_ids_[i];
    return moves(id) ? &twists_.at(id) : nullptr;
  }
  /// Room for how output j moves: no movers, undefined rates.
  Twists<S>& of_output(const NodeIo<S>& io, int j, Index rows, Index per_row, Index dims);
  /// Makes a row of input i a mover, and returns its number.
  std::int32_t add(const NodeIo<S>& io, int i, Index row, std::array<std::vector<double>, kTwist> cotangents);
  /// Throws InternalError where input i needs a gradient and nothing says how it moves, naming the operator.
  void check(const NodeIo<S>& io, int i) const;
  /// Forgets all of them; their memory is kept.
  void clear() {
    all_.clear();
    moving_.clear();
  }

 private:
  void check(std::uint32_t id) const;
  bool moves(std::uint32_t id) const { return std::find(moving_.begin(), moving_.end(), id) != moving_.end(); }

  Tape<S>& tape_;
  std::vector<Mover> all_;
  std::vector<std::uint32_t> moving_;
  std::map<std::uint32_t, Twists<S>> twists_;
};

extern template class Movers<float>;
extern template class Movers<double>;

}  // namespace hsi4d
