// Running plans: forward, backward, and the search for numbers that are not finite.
#include <algorithm>
#include <chrono>

#include "autodiff/copy_in.h"
#include "autodiff/finite.h"
#include "autodiff/tape.h"
#include "core/huge_pages.h"
#include "core/parallel.h"

namespace hsi4d {

namespace {

using Clock = std::chrono::steady_clock;

template <class S>
void clear_padding(const Array<S>& array) {
  if (array.shape.dense()) return;
  for (Index r = 0; r < array.total_rows(); ++r) {
    std::fill(array.row(r) + array.shape.cols, array.row(r) + array.shape.stride, S(0));
  }
}

/// Another number for another set of squares, and not 0.
std::uint64_t key_of(const TileMask& mask) {
  Signature key;
  for (Index r = 0; r < mask.rows(); ++r) {
    for (Index c = 0; c < mask.cols(); ++c) {
      if (mask.has(r, c)) key.add(static_cast<std::uint64_t>(r * mask.cols() + c));
    }
  }
  return key.value() | 1;
}

double nanoseconds_since(Clock::time_point start) {
  return std::chrono::duration<double, std::nano>(Clock::now() - start).count();
}

}  // namespace

template <class S>
NodeIo<S> Tape<S>::io_of(const NodeRecord& node) {
  NodeIo<S> io;
  io.tape_ = this;
  io.input_ids_ = edges_.data() + node.first_edge;
  io.input_count_ = node.edge_count;
  io.first_output_ = node.first_output;
  io.needed_ = node.needed;
  return io;
}

template <class S>
void Tape<S>::activate(const Plan& plan) {
  if (active_result_ == plan.result && active_structure_ == plan.structure) return;
  for (ArrayRecord& array : arrays_) array.adjoint = nullptr;
  const S* const before = adjoints_.data();
  adjoints_.resize(plan.adjoint_size);
  if (adjoints_.data() != before) {
    advise_huge_pages(adjoints_.data(), adjoints_.capacity_bytes());
    defined_adjoints_ = 0;
  }
  if (plan.adjoint_size > defined_adjoints_) {
    std::fill(adjoints_.data() + defined_adjoints_, adjoints_.data() + plan.adjoint_size, S(0));
    defined_adjoints_ = plan.adjoint_size;
  }
  for (const auto& slot : plan.adjoints) {
    ArrayRecord& array = arrays_[slot.array];
    array.adjoint = adjoints_.data() + slot.offset;
    clear_padding(adjoint_view(slot.array));  // it may hold what lay there before, and is never written
  }
  active_result_ = plan.result;
  active_structure_ = plan.structure;
}

template <class S>
bool Tape<S>::up_to_date(const NodeRecord& node) const {
  if (node.ran_at == 0 || !skips_.unchanged_inputs) return false;
  if (node.made_key != kWhole && node.made_key != node.needed_key) return false;
  const std::uint32_t* edge = edges_.data() + node.first_edge;
  for (std::uint32_t i = 0; i < node.edge_count; ++i) {
    if (arrays_[edge[i]].version > node.ran_at) return false;
  }
  return true;
}

template <class S>
void Tape<S>::forward_node(NodeRecord& node) {
  NodeIo<S> io = io_of(node);
  const auto start = profiling_ ? Clock::now() : Clock::time_point{};
  io.ran_before_ = node.ran_at;
  node.ran_at = 0;  // stays so if the operator throws
  for (std::uint32_t j = 0; j < node.output_count; ++j) io.set_dirty_tiles(static_cast<int>(j), nullptr, nullptr);
  if (node.table->state_key != nullptr) {
    const std::uint64_t key = node.table->state_key(node.op, io);
    if (!node.state_valid || key != node.state_key) {
      node.state_valid = false;
      node.table->build_state(node.op, io);
      node.state_key = key;
      node.state_valid = true;
    }
  }
  node.table->forward(node.op, io);
  scratch_.reset();
  node.ran_at = ++clock_;
  node.made_key = node.needed_key;
  for (std::uint32_t j = 0; j < node.output_count; ++j) {
    ArrayRecord& output = arrays_[node.first_output + j];
    output.version_before = std::exchange(output.version, clock_);
  }
  ++node.forward_runs;
  if (profiling_) node.forward_ns += nanoseconds_since(start);
}

template <class S>
void Tape<S>::backward_node(NodeRecord& node, std::uint64_t assign_mask) {
  NodeIo<S> io = io_of(node);
  io.assign_mask_ = assign_mask;
  const auto start = profiling_ ? Clock::now() : Clock::time_point{};
  node.table->backward(node.op, io);
  scratch_.reset();
  ++node.backward_runs;
  if (profiling_) node.backward_ns += nanoseconds_since(start);
}

template <class S>
void Tape<S>::tell_needed(const Plan& plan) {
  for (const std::uint32_t n : plan.forward_nodes) {
    nodes_[n].needed = nullptr;
    nodes_[n].needed_key = kWhole;
  }
  if (!skips_.unread_pixels) return;
  for (const auto& reader : plan.sole_readers) {
    NodeIo<S> io = io_of(nodes_[reader.node]);
    NodeRecord& producer = nodes_[reader.producer];
    producer.needed = nodes_[reader.node].table->looks_at(nodes_[reader.node].op, io, reader.input);
    if (producer.needed != nullptr) producer.needed_key = key_of(*producer.needed);
  }
}

template <class S>
void Tape<S>::run_forward(Plan& plan) {
  plan.forward_at = 0;
  tell_needed(plan);
  plan.needed_keys.clear();
  for (const std::uint32_t n : plan.forward_nodes) plan.needed_keys.push_back(nodes_[n].needed_key);
  counters_.forward_nodes = 0;
  if (anomaly_) {
    for (const std::uint32_t leaf : plan.leaves) check_finite(leaf, nullptr, false);
  }
  for (const std::uint32_t n : plan.forward_nodes) {
    NodeRecord& node = nodes_[n];
    if (up_to_date(node)) {
      ++node.forward_skips;
      continue;
    }
    forward_node(node);
    ++counters_.forward_nodes;
    if (!anomaly_) continue;
    for (std::uint32_t j = 0; j < node.output_count; ++j) check_finite(node.first_output + j, &node, false);
  }
  plan.forward_at = clock_;
}

/// After an error: these nodes run again, and no result counts as up to date.
template <class S>
void Tape<S>::invalidate(const std::vector<std::uint32_t>& nodes) {
  for (const std::uint32_t n : nodes) nodes_[n].ran_at = 0;
  for (Plan& plan : plans_) plan.forward_at = 0;
}

template <class S>
void Tape<S>::run_backward(Plan& plan) {
  for (std::size_t k = 0; k < plan.backward_nodes.size(); ++k) {
    NodeRecord& node = nodes_[plan.backward_nodes[k]];
    backward_node(node, plan.assign_masks[k]);
    if (!anomaly_) continue;
    for (std::uint32_t i = 0; i < node.edge_count; ++i) {
      const std::uint32_t input = edges_[node.first_edge + i];
      if (arrays_[input].needs_gradient) check_finite(input, &node, true);
    }
  }
}

template <class S>
void Tape<S>::forward(Var<S> result) {
  const std::uint32_t id = checked(result);
  const FlushDenormals flush;
  scratch_.reset();
  Plan& plan = plan_for(id);
  try {
    run_forward(plan);
  } catch (...) {
    invalidate(plan.forward_nodes);
    throw;
  }
}

template <class S>
void Tape<S>::check_leaves(const Plan& plan) const {
  if (plan.forward_at == 0) {
    throw StaleError("Stale: backward without a forward of the same result since it was recorded, frozen or failed");
  }
  for (const std::uint32_t leaf : plan.leaves) {
    if (arrays_[leaf].version > plan.forward_at) {
      throw StaleError("Stale: array '" + arrays_[leaf].name + "' was written after the forward run");
    }
  }
}

template <class S>
void Tape<S>::check_needed(const Plan& plan) const {
  for (std::size_t k = 0; k < plan.forward_nodes.size(); ++k) {
    const NodeRecord& node = nodes_[plan.forward_nodes[k]];
    if (node.made_key == kWhole || node.made_key == plan.needed_keys[k]) continue;
    throw StaleError(std::string("Stale: the forward of another result made other squares of '") + node.table->name +
                     "' than this result looks at; run the forward of this one again");
  }
}

template <class S>
void Tape<S>::backward(Var<S> loss) {
  HSI4D_CHECK(shape(loss).is_scalar(), detail::both_values("a loss is one number; shape", shape(loss)));
  const S one = 1;
  backward(loss, std::span(&one, 1));
}

template <class S>
void Tape<S>::backward(Var<S> result, std::span<const S> cotangent) {
  const std::uint32_t id = checked(result);
  HSI4D_CHECK_EQ(static_cast<Index>(cotangent.size()), arrays_[id].shape.count());
  Plan& plan = plan_for(id);
  check_leaves(plan);
  check_needed(plan);
  activate(plan);
  const FlushDenormals flush;
  scratch_.reset();
  std::fill_n(adjoints_.data(), plan.cleared_size, S(0));
  counters_.backward_nodes = std::ssize(plan.backward_nodes);
  counters_.adjoint_numbers = plan.adjoint_size;
  if (!arrays_[id].needs_gradient) return;
  detail::copy_in(cotangent, adjoint_view(id));
  try {
    run_backward(plan);
  } catch (...) {
    invalidate(plan.backward_nodes);  // what nodes saved may be half used
    active_structure_ = 0;            // gradients are not to be read
    for (ArrayRecord& array : arrays_) array.adjoint = nullptr;
    throw;
  }
}

template <class S>
std::uint64_t Tape<S>::signature(Var<S> result) {
  Signature signature;
  for (const std::uint32_t n : plan_for(checked(result)).forward_nodes) {
    if (nodes_[n].table->add_signature == nullptr) continue;
    NodeIo<S> io = io_of(nodes_[n]);
    nodes_[n].table->add_signature(nodes_[n].op, signature, io);
  }
  return signature.value();
}

template <class S>
void Tape<S>::drop_state() {
  for (NodeRecord& node : nodes_) {
    if (node.table->state_key == nullptr) continue;
    node.state_valid = false;
    node.ran_at = 0;
  }
  for (Plan& plan : plans_) plan.forward_at = 0;
}

// --- anomaly mode ----------------------------------------------------------------------------------------------------

template <class S>
void Tape<S>::set_anomaly(bool on) {
  if (on && !anomaly_) {  // what ran before was not looked at
    for (NodeRecord& node : nodes_) node.ran_at = 0;
    for (Plan& plan : plans_) plan.forward_at = 0;
    active_structure_ = 0;  // adjoints that nobody reads must be finite too
    defined_adjoints_ = 0;
  }
  anomaly_ = on;
}

template <class S>
void Tape<S>::check_finite(std::uint32_t id, const NodeRecord* node, bool adjoint) const {
  const ArrayRecord& array = arrays_[id];
  const ConstArray<S> numbers = adjoint ? adjoint_view(id) : view(id);
  const Index bad = first_non_finite(numbers);
  if (bad < 0) return;
  const Index row = bad / array.shape.cols;
  const Index plane = row / array.shape.rows;
  NonFiniteError::Place place;
  place.node = node == nullptr ? "leaf" : node->table->name;
  place.array = array.name.empty() ? "#" + std::to_string(id) : array.name;
  place.source = source_name(node == nullptr ? array.where : node->where);
  place.phase = adjoint ? "backward" : "forward";
  place.plane = plane;
  place.row = row - plane * array.shape.rows;
  place.col = bad % array.shape.cols;
  place.value = static_cast<double>(numbers.row(row)[place.col]);
  throw NonFiniteError(std::move(place));
}

// The members of this file; tape.cpp instantiates the others with the class.
#define HSI4D_TAPE_RUN(S)                                               \
  template NodeIo<S> Tape<S>::io_of(const NodeRecord&);                 \
  template void Tape<S>::activate(const Plan&);                         \
  template bool Tape<S>::up_to_date(const NodeRecord&) const;           \
  template void Tape<S>::forward_node(NodeRecord&);                     \
  template void Tape<S>::backward_node(NodeRecord&, std::uint64_t);     \
  template void Tape<S>::tell_needed(const Plan&);                      \
  template void Tape<S>::run_forward(Plan&);                            \
  template void Tape<S>::run_backward(Plan&);                           \
  template void Tape<S>::invalidate(const std::vector<std::uint32_t>&); \
  template void Tape<S>::check_leaves(const Plan&) const;               \
  template void Tape<S>::check_needed(const Plan&) const;               \
  template void Tape<S>::forward(Var<S>);                               \
  template void Tape<S>::backward(Var<S>);                              \
  template void Tape<S>::backward(Var<S>, std::span<const S>);          \
  template std::uint64_t Tape<S>::signature(Var<S>);                    \
  template void Tape<S>::drop_state();                                  \
  template void Tape<S>::set_anomaly(bool);                             \
  template void Tape<S>::check_finite(std::uint32_t, const NodeRecord*, bool) const;
HSI4D_TAPE_RUN(float)
HSI4D_TAPE_RUN(double)
#undef HSI4D_TAPE_RUN

}  // namespace hsi4d
