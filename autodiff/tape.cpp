// Recording, values, and the plans of what running a result takes; tape_run.cpp runs them.
#include "autodiff/tape.h"

#include <algorithm>

#include "autodiff/copy_in.h"

namespace hsi4d {

namespace {

std::string describe(const NonFiniteError::Place& p) {
  std::ostringstream text;
  text << p.value << " in " << p.phase << " of '" << p.node << "' (recorded at " << p.source << "), "
       << (p.phase == "forward" ? "value" : "gradient") << " of array '" << p.array << "', ";
  if (p.plane != 0) text << "plane " << p.plane << ", ";
  text << "row " << p.row << ", column " << p.col;
  return text.str();
}

void check_shape(const Shape& shape) {
  HSI4D_CHECK(shape.planes >= 0 && shape.rows >= 0 && shape.cols >= 0 && shape.stride >= shape.cols,
              detail::both_values("shape", shape));
}

}  // namespace

std::ostream& operator<<(std::ostream& stream, const Shape& shape) {
  stream << '[';
  if (shape.planes != 1) stream << shape.planes << ',';
  return stream << shape.rows << ',' << shape.cols << ']';
}

NonFiniteError::NonFiniteError(Place place) : std::runtime_error(describe(place)), place_(std::move(place)) {}

template <class S>
Tape<S>::~Tape() {
  for (const NodeRecord& node : nodes_) node.table->destroy(node.op);
}

// --- recording -------------------------------------------------------------------------------------------------------

template <class S>
std::uint32_t Tape<S>::checked(Var<S> var) const {
  if (var.tape == this && var.id < arrays_.size() && arrays_[var.id].stamp == var.stamp) return var.id;
  throw InternalError(var.tape == nullptr ? "an empty Var was used"
                      : var.tape != this  ? "a Var of another tape was used"
                                          : "a Var from before a rewind was used");
}

template <class S>
std::uint32_t Tape<S>::add_array(const Shape& shape, std::uint32_t producer, const Source& where) {
  check_shape(shape);
  ArrayRecord array;
  array.shape = shape;
  array.value = arena_.template allocate<S>(shape.memory());
  std::memset(array.value, 0, static_cast<std::size_t>(shape.memory()) * sizeof(S));
  array.producer = producer;
  array.stamp = next_stamp_++;
  array.where = where;
  arrays_.push_back(std::move(array));
  ++structure_;
  return static_cast<std::uint32_t>(arrays_.size() - 1);
}

template <class S>
Var<S> Tape<S>::add_leaf(std::string_view name, const Shape& shape, bool constant, const Source& where) {
  const std::uint32_t id = add_array(shape, kLeaf, where);
  arrays_[id].name = name;
  arrays_[id].constant = arrays_[id].frozen = constant;
  arrays_[id].version = ++clock_;
  return handle(id);
}

template <class S>
Var<S> Tape<S>::parameter(std::string_view name, const Shape& shape, Source where) {
  return add_leaf(name, shape, false, where);
}

template <class S>
Var<S> Tape<S>::constant(std::string_view name, const Shape& shape, Source where) {
  return add_leaf(name, shape, true, where);
}

template <class S>
Var<S> Tape<S>::constant(S value, Source where) {
  const Var<S> var = add_leaf("", kScalarShape, true, where);
  arrays_[var.id].value[0] = value;
  return var;
}

template <class S>
void Tape<S>::check_node(const char* name, std::span<const Var<S>> inputs, std::span<const Shape> outputs) const {
  for (const Var<S>& input : inputs) checked(input);
  HSI4D_CHECK(inputs.size() <= kMostInputs, std::string(name) + ": " + std::to_string(inputs.size()) +
                                                " inputs; at most " + std::to_string(kMostInputs));
  HSI4D_CHECK(!outputs.empty(), std::string(name) + ": no output");
  for (const Shape& shape : outputs) check_shape(shape);
}

template <class S>
Var<S> Tape<S>::add_node(const OperatorTable<S>* table, void* op, std::span<const Var<S>> inputs,
                         std::span<const Shape> outputs, const Source& where) {
  NodeRecord node;
  node.table = table;
  node.op = op;
  node.first_edge = static_cast<std::uint32_t>(edges_.size());
  node.edge_count = static_cast<std::uint32_t>(inputs.size());
  node.first_output = static_cast<std::uint32_t>(arrays_.size());
  node.output_count = static_cast<std::uint32_t>(outputs.size());
  node.where = where;
  for (const Var<S>& input : inputs) edges_.push_back(input.id);
  nodes_.push_back(node);
  for (const Shape& shape : outputs) add_array(shape, static_cast<std::uint32_t>(nodes_.size() - 1), where);
  return handle(node.first_output);
}

template <class S>
Var<S> Tape<S>::output(Var<S> first, int j) const {
  const std::uint32_t producer = arrays_[checked(first)].producer;
  HSI4D_CHECK(producer != kLeaf && j >= 0 && static_cast<std::uint32_t>(j) < nodes_[producer].output_count,
              "output " + std::to_string(j));
  return handle(nodes_[producer].first_output + static_cast<std::uint32_t>(j));
}

template <class S>
Var<S> Tape<S>::name(Var<S> var, std::string_view text) {
  arrays_[checked(var)].name = text;
  return var;
}

template <class S>
void Tape<S>::set_frozen(Var<S> var, bool frozen) {
  ArrayRecord& array = arrays_[checked(var)];
  HSI4D_CHECK(frozen || !array.constant, "constant '" + array.name + "' can not be unfrozen");
  if (array.frozen == frozen) return;
  array.frozen = frozen;
  ++structure_;
}

template <class S>
void Tape<S>::hold(Var<S> var) {
  ArrayRecord& array = arrays_[checked(var)];
  HSI4D_CHECK(array.producer != kLeaf, "leaf '" + array.name + "' can not be held, freeze it");
  HSI4D_CHECK(nodes_[array.producer].output_count == 1,
              "'" + array.name + "' is one output of several, and can not be held");
  HSI4D_CHECK(array.version > 0, "'" + array.name + "' has not been computed, and can not be held");
  if (std::exchange(array.held, true)) return;
  ++structure_;
}

template <class S>
void Tape<S>::release(Var<S> var) {
  if (std::exchange(arrays_[checked(var)].held, false)) ++structure_;
}

template <class S>
void Tape<S>::set_skips(const TapeSkips& skips) {
  if (skips == skips_) return;
  skips_ = skips;
  ++structure_;
}

template <class S>
void Tape<S>::rewind(const Mark& mark) {
  HSI4D_CHECK(mark.arrays <= arrays_.size() && (mark.arrays == 0 || arrays_[mark.arrays - 1].stamp == mark.stamp),
              "the mark is of a recording that was rewound");
  for (std::size_t n = nodes_.size(); n > mark.nodes; --n) nodes_[n - 1].table->destroy(nodes_[n - 1].op);
  nodes_.resize(mark.nodes);
  arrays_.resize(mark.arrays);
  edges_.resize(mark.edges);
  arena_.rewind(mark.memory);
  std::erase_if(plans_, [&](const Plan& plan) { return plan.result >= mark.arrays; });
  if (active_result_ >= mark.arrays) active_structure_ = 0;
  ++structure_;
}

// --- values ----------------------------------------------------------------------------------------------------------

template <class S>
Array<S> Tape<S>::write(Var<S> leaf) {
  ArrayRecord& array = arrays_[checked(leaf)];
  HSI4D_CHECK(array.producer == kLeaf, "only leaves are written; '" + array.name + "' is computed");
  array.version_before = std::exchange(array.version, ++clock_);
  return {array.value, array.shape};
}

template <class S>
void Tape<S>::set(Var<S> leaf, std::span<const S> values) {
  detail::copy_in(values, write(leaf));
}

template <class S>
bool Tape<S>::has_gradient(Var<S> var) const {
  const ArrayRecord& array = arrays_[checked(var)];
  return array.adjoint != nullptr && !array.frozen;
}

template <class S>
ConstArray<S> Tape<S>::gradient(Var<S> var) const {
  HSI4D_CHECK(has_gradient(var), "array '" + arrays_[var.id].name +
                                     "' has no gradient: it is frozen, or the last backward did not depend on it");
  return adjoint_view(var.id);
}

// --- running ---------------------------------------------------------------------------------------------------------

/// Works out which arrays need a gradient; a node whose wants changed must run again, for it may save other things.
template <class S>
void Tape<S>::update_structure() {
  if (current_structure_ == structure_) return;
  for (ArrayRecord& array : arrays_) {
    if (array.producer == kLeaf) array.needs_gradient = skips_.frozen_inputs ? !array.frozen : !array.constant;
  }
  for (NodeRecord& node : nodes_) {
    std::uint64_t wants = 0;
    for (std::uint32_t i = 0; i < node.edge_count; ++i) {
      wants |= std::uint64_t(arrays_[edges_[node.first_edge + i]].needs_gradient) << i;
    }
    if (wants != node.wants_mask) node.ran_at = 0;
    node.wants_mask = wants;
    for (std::uint32_t j = 0; j < node.output_count; ++j) {
      ArrayRecord& output = arrays_[node.first_output + j];
      output.needs_gradient = wants != 0 && !output.frozen && !output.held;
    }
  }
  current_structure_ = structure_;
}

template <class S>
typename Tape<S>::Plan& Tape<S>::plan_for(std::uint32_t result) {
  update_structure();
  auto found = std::find_if(plans_.begin(), plans_.end(), [&](const Plan& plan) { return plan.result == result; });
  if (found == plans_.end()) {
    found = plans_.emplace(plans_.end());
    found->result = result;
  }
  if (found->structure != structure_) build(*found);
  return *found;
}

template <class S>
void Tape<S>::build(Plan& plan) {
  plan.leaves.clear();
  plan.forward_nodes.clear();
  plan.backward_nodes.clear();
  plan.adjoints.clear();
  plan.adjoint_size = 0;
  plan.forward_at = 0;
  reached_.assign(arrays_.size(), 0);
  reached_[plan.result] = 1;
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    const NodeRecord& node = nodes_[n];
    const auto outputs = reached_.begin() + node.first_output;
    if (std::none_of(outputs, outputs + node.output_count, [](std::uint8_t hit) { return hit != 0; })) continue;
    plan.forward_nodes.push_back(static_cast<std::uint32_t>(n));
    for (std::uint32_t i = 0; i < node.edge_count; ++i) {
      const std::uint32_t input = edges_[node.first_edge + i];
      if (!arrays_[input].held) reached_[input] = 1;
    }
  }
  std::reverse(plan.forward_nodes.begin(), plan.forward_nodes.end());
  for (std::uint32_t id = 0; id < arrays_.size(); ++id) {
    if (!reached_[id]) continue;
    if (arrays_[id].producer == kLeaf) plan.leaves.push_back(id);
  }
  // A node takes part in backward when a gradient arrives at one of its outputs: not behind a frozen array.
  carries_.assign(arrays_.size(), 0);
  carries_[plan.result] = arrays_[plan.result].needs_gradient;
  for (auto n = plan.forward_nodes.rbegin(); n != plan.forward_nodes.rend(); ++n) {
    const NodeRecord& node = nodes_[*n];
    const auto outputs = carries_.begin() + node.first_output;
    if (std::none_of(outputs, outputs + node.output_count, [](std::uint8_t hit) { return hit != 0; })) continue;
    plan.backward_nodes.push_back(*n);
    for (std::uint32_t i = 0; i < node.edge_count; ++i) {
      const std::uint32_t input = edges_[node.first_edge + i];
      if (arrays_[input].needs_gradient) carries_[input] = 1;
    }
  }
  place_adjoints(plan);
  find_sole_readers(plan);
  plan.structure = structure_;
}

template <class S>
void Tape<S>::find_sole_readers(Plan& plan) {
  readers_.assign(nodes_.size(), 0);
  const auto count = [&](std::uint32_t id) {
    if (arrays_[id].producer != kLeaf) ++readers_[arrays_[id].producer];
  };
  count(plan.result);
  for (const std::uint32_t n : plan.forward_nodes) {
    for (std::uint32_t i = 0; i < nodes_[n].edge_count; ++i) count(edges_[nodes_[n].first_edge + i]);
  }
  plan.sole_readers.clear();
  for (const std::uint32_t n : plan.forward_nodes) {
    if (nodes_[n].table->looks_at == nullptr) continue;
    for (std::uint32_t i = 0; i < nodes_[n].edge_count; ++i) {
      const std::uint32_t producer = arrays_[edges_[nodes_[n].first_edge + i]].producer;
      if (producer != kLeaf && readers_[producer] == 1) plan.sole_readers.push_back({producer, n, static_cast<int>(i)});
    }
  }
}

/// Finds which node is the first to meet each adjoint, and lays the adjoints out: those that must be cleared, then
/// those whose first node assigns them.
template <class S>
void Tape<S>::place_adjoints(Plan& plan) {
  enum : std::uint8_t { kUntouched, kAdded, kAssigned };
  assigned_.assign(arrays_.size(), kUntouched);
  assigned_[plan.result] = kAdded;  // the seed
  plan.assign_masks.clear();
  for (const std::uint32_t n : plan.backward_nodes) {
    const NodeRecord& node = nodes_[n];
    const auto first = edges_.begin() + node.first_edge, last = first + node.edge_count;
    std::uint64_t mask = 0;
    for (auto edge = first; edge != last; ++edge) {
      if (!arrays_[*edge].needs_gradient || assigned_[*edge] != kUntouched) continue;
      const bool once = std::count(first, last, *edge) == 1;
      assigned_[*edge] = node.table->assigns && once ? kAssigned : kAdded;
      mask |= std::uint64_t(assigned_[*edge] == kAssigned) << (edge - first);
    }
    plan.assign_masks.push_back(mask);
  }
  for (const bool assigned : {false, true}) {
    for (std::uint32_t id = 0; id < arrays_.size(); ++id) {
      if (!carries_[id] || (assigned_[id] == kAssigned) != assigned) continue;
      plan.adjoints.push_back({id, plan.adjoint_size});
      plan.adjoint_size += round_up(arrays_[id].shape.memory(), kAlignment / static_cast<Index>(sizeof(S)));
    }
    if (!assigned) plan.cleared_size = plan.adjoint_size;
  }
}

// --- looking inside --------------------------------------------------------------------------------------------------

template <class S>
std::vector<NodeStatistics> Tape<S>::statistics() const {
  std::vector<NodeStatistics> all;
  all.reserve(nodes_.size());
  for (const NodeRecord& node : nodes_) {
    NodeStatistics s;
    s.name = node.table->name;
    s.source = source_name(node.where);
    s.forward_runs = node.forward_runs;
    s.forward_skips = node.forward_skips;
    s.backward_runs = node.backward_runs;
    s.forward_ns = node.forward_ns;
    s.backward_ns = node.backward_ns;
    for (std::uint32_t j = node.first_output; j < node.first_output + node.output_count; ++j) {
      const Index bytes = arrays_[j].shape.memory() * static_cast<Index>(sizeof(S));
      s.value_bytes += bytes;
      if (arrays_[j].adjoint != nullptr) s.adjoint_bytes += bytes;
    }
    if (node.table->saved_bytes != nullptr) s.saved_bytes = node.table->saved_bytes(node.op);
    all.push_back(std::move(s));
  }
  return all;
}

template <class S>
void Tape<S>::clear_statistics() {
  for (NodeRecord& node : nodes_) {
    node.forward_runs = node.forward_skips = node.backward_runs = 0;
    node.forward_ns = node.backward_ns = 0;
  }
}

template <class S>
Index Tape<S>::memory_bytes() const {
  Index bytes = arena_.capacity_bytes() + scratch_.capacity_bytes() + adjoints_.capacity_bytes();
  for (const NodeRecord& node : nodes_) {
    if (node.table->saved_bytes != nullptr) bytes += node.table->saved_bytes(node.op);
  }
  return bytes;
}

template class Tape<float>;
template class Tape<double>;

}  // namespace hsi4d
