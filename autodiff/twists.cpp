#include "autodiff/twists.h"

#include <algorithm>

namespace hsi4d {

template <class S>
Twists<S>& Movers<S>::of_output(const NodeIo<S>& io, int j, Index rows, Index per_row, Index dims) {
  const std::uint32_t id = io.first_output_ + static_cast<std::uint32_t>(j);
  if (!moves(id)) moving_.push_back(id);
  Twists<S>& twists = twists_[id];
  twists.rows = rows;
  twists.per_row = per_row;
  twists.dims = dims;
  twists.movers.resize(rows * per_row);
  twists.rates.resize(rows * per_row * dims * kTwist);
  std::fill_n(twists.movers.data(), twists.movers.size(), std::int32_t(-1));
  return twists;
}

template <class S>
std::int32_t Movers<S>::add(const NodeIo<S>& io, int i, Index row, std::array<std::vector<double>, kTwist> cotangents) {
  all_.push_back({io.input_ids_[i], row, std::move(cotangents)});
  return static_cast<std::int32_t>(all_.size() - 1);
}

template <class S>
void Movers<S>::check(const NodeIo<S>& io, int i) const {
  check(io.input_ids_[i]);
}

/// Down to the operator that could not tell.
template <class S>
void Movers<S>::check(std::uint32_t id) const {
  const auto& array = tape_.arrays_[id];
  if (!array.needs_gradient || moves(id)) return;
  const bool is_leaf = array.producer == Tape<S>::kLeaf;
  if (!is_leaf && tape_.nodes_[array.producer].table->push != nullptr) {
    const auto& node = tape_.nodes_[array.producer];
    for (std::uint32_t e = node.first_edge; e < node.first_edge + node.edge_count; ++e) check(tape_.edges_[e]);
  }
  const std::string name = is_leaf ? array.name : tape_.nodes_[array.producer].table->name;
  throw InternalError("no curvature: a render moves by '" + name + "' (recorded at " +
                      source_name(is_leaf ? array.where : tape_.nodes_[array.producer].where) +
                      "), which does not tell how its rows follow what moves them");
}

template class Movers<float>;
template class Movers<double>;

}  // namespace hsi4d
