// The reverse-mode tape.
//
// A tape holds arrays and nodes. A leaf array is a parameter or a constant; every other array is the output of a node,
// which is one operator with a hand-written adjoint. The graph is recorded once and replayed:
//
//   Tape<double> tape;
//   Var<double> x = tape.parameter("x", shape_of(10, 3));
//   Var<double> loss = sum(square(x));          // records nodes; computes nothing
//   fill(tape.write(x), ...);                   // any number of times:
//   tape.forward(loss);                         //   runs the nodes whose inputs changed
//   tape.backward(loss);                        //   d loss / d every unfrozen parameter
//   ... tape.gradient(x), tape.write(x) ...
//
// forward runs the nodes on the way to the loss whose inputs were written or recomputed since they last ran, so what
// does not change (a frozen body's shape, a target's statistics) is computed once. backward visits the nodes between
// unfrozen parameters and the loss only; arrays outside of that have no adjoint at all. A steady iteration allocates
// nothing. See docs/architecture.md for how to write an operator.
#pragma once

#include <algorithm>
#include <cstring>
#include <initializer_list>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "autodiff/arena.h"
#include "autodiff/array.h"
#include "autodiff/tile_mask.h"
#include "core/check.h"

namespace hsi4d {

template <class S>
class Tape;
template <class S>
class TapeInspector;
template <class S>
class Curvature;
template <class S>
class CurvatureWeights;
template <class S>
class Movers;

/// Handle of an array on a tape: plain data, copied freely, valid until the tape is rewound past it.
template <class S>
struct Var {
  Tape<S>* tape = nullptr;
  std::uint32_t id = 0;
  std::uint32_t stamp = 0;  ///< tells a handle from before a rewind

  const Shape& shape() const;
  /// The tape. Throws InternalError for an empty handle.
  Tape<S>& owner() const;
};

/// backward was asked for although, since the forward run, a value was written, a parameter frozen, or the forward of
/// another result left an image with other squares than this result looks at.
class StaleError : public InternalError {
 public:
  using InternalError::InternalError;
};

/// The first non-finite number that anomaly mode met.
class NonFiniteError : public std::runtime_error {
 public:
  struct Place {
    std::string node;    ///< operator, or "leaf"
    std::string array;   ///< name of the array, or its number
    std::string source;  ///< file:line that recorded it
    std::string phase;   ///< "forward" or "backward"
    Index plane, row, col;
    double value;
  };
  explicit NonFiniteError(Place place);
  const Place& place() const { return place_; }

 private:
  Place place_;
};

/// Hash of an operator's discrete choices (visibility, order, branches): equal when the same choices were made, so that
/// a gradient check can tell a kink from a bug.
class Signature {
 public:
  void add(std::uint64_t word) {
    hash_ = (hash_ ^ word) * 0x9E3779B97F4A7C15u;
    hash_ ^= hash_ >> 29;
  }
  std::uint64_t value() const { return hash_; }

 private:
  std::uint64_t hash_ = 0x243F6A8885A308D3u;
};

/// What a running node sees: its inputs, outputs and their adjoints.
template <class S>
class NodeIo {
 public:
  int inputs() const { return static_cast<int>(input_count_); }
  ConstArray<S> in(int i) const { return tape_->view(input_ids_[i]); }
  Array<S> out(int j = 0) const { return tape_->view(first_output_ + static_cast<std::uint32_t>(j)); }
  /// True when input i needs a gradient; only then may d_in(i) be asked for. Fixed between forward and its backward, so
  /// forward may save only what backward will need.
  bool wants(int i) const { return tape_->arrays_[input_ids_[i]].needs_gradient; }
  /// Changes whenever input i was written or computed again; never a number it had before.
  std::uint64_t version(int i) const { return tape_->arrays_[input_ids_[i]].version; }
  /// In forward: true unless input i is what it was in this node's run before.
  bool is_changed(int i) const { return version(i) > ran_before_; }
  /// In forward: the squares of input i, an image, outside of which it is what it was in this node's run before; null:
  /// all of it may have changed.
  const TileMask* changed(int i) const {
    const auto& array = tape_->arrays_[input_ids_[i]];
    return ran_before_ != 0 && array.version_before <= ran_before_ ? array.changed : nullptr;
  }
  /// The squares of input i, an image, in which its adjoint will be read; null: everywhere. What is outside of them
  /// need not be added, nor assigned.
  const TileMask* read(int i) const { return tape_->arrays_[input_ids_[i]].read; }
  /// In forward: output j is what it was before outside of these squares (kPersistentOutputs), and its adjoint is read
  /// in those. Null: everywhere. The masks have to live as long as the operator.
  void set_dirty_tiles(int j, const TileMask* changed, const TileMask* read) const {
    auto& array = tape_->arrays_[first_output_ + static_cast<std::uint32_t>(j)];
    array.changed = changed;
    array.read = read;
  }
  /// True when input i is a leaf: up to date even before forward.
  bool is_leaf(int i) const { return tape_->arrays_[input_ids_[i]].producer == Tape<S>::kLeaf; }
  /// In forward: the squares of its outputs, images, outside of which nothing reads them; null: all have to be made.
  const TileMask* needed() const { return needed_; }
  /// Adjoint of input i, to be added to, never overwritten (but see must_assign).
  Array<S> d_in(int i) const { return tape_->adjoint_view(input_ids_[i]); }
  /// True when nothing has been added to d_in(i) yet and its numbers are undefined: the operator then assigns what it
  /// else would add. Only operators that declare kAssigns meet it.
  bool must_assign(int i) const { return (assign_mask_ >> i & 1u) != 0; }
  /// For operators that add to rows: makes rows [begin, end) of d_in(i), counted through all planes, zero if they must
  /// be assigned. Does nothing where no gradient is wanted.
  void begin_rows(int i, Index begin, Index end) const {
    if (!wants(i) || !must_assign(i)) return;
    const Array<S> d = d_in(i);
    std::fill(d.row(begin), d.row(end), S(0));
  }
  /// Adjoint of output j; empty (false) when the loss does not depend on output j, which only operators with several
  /// outputs can meet.
  ConstArray<S> d_out(int j = 0) const { return tape_->adjoint_view(first_output_ + static_cast<std::uint32_t>(j)); }
  /// Uninitialised memory for the duration of this call. Ask before going parallel, not inside chunks.
  template <class T = S>
  std::span<T> scratch(Index count) const {
    return {tape_->scratch_.template allocate<T>(count), static_cast<std::size_t>(count)};
  }

 private:
  friend class Tape<S>;
  friend class TapeInspector<S>;
  friend class Curvature<S>;
  friend class CurvatureWeights<S>;
  friend class Movers<S>;
  Tape<S>* tape_ = nullptr;
  const std::uint32_t* input_ids_ = nullptr;
  std::uint32_t input_count_ = 0;
  std::uint32_t first_output_ = 0;
  std::uint64_t ran_before_ = 0;  // clock of the forward before this one; 0: there is none that counts
  std::uint64_t assign_mask_ = 0;
  const TileMask* needed_ = nullptr;
};

/// The functions of an operator type, made from its members by Tape::record.
template <class S>
struct OperatorTable {
  const char* name;
  void (*forward)(void*, NodeIo<S>&);
  void (*backward)(void*, NodeIo<S>&);
  void (*destroy)(void*);
  std::uint64_t (*state_key)(void*, NodeIo<S>&);  // null: no state is kept between runs
  void (*build_state)(void*, NodeIo<S>&);
  void (*add_signature)(void*, Signature&, NodeIo<S>&);    // null: no discrete choices
  Index (*saved_bytes)(const void*);                       // null: nothing saved
  const TileMask* (*looks_at)(void*, NodeIo<S>&, int);     // null: at all of every input
  bool (*weigh)(void*, NodeIo<S>&, CurvatureWeights<S>&);  // these three: see autodiff/curvature.h
  void (*push)(void*, NodeIo<S>&, Movers<S>&);
  void (*collect)(void*, NodeIo<S>&, const CurvatureWeights<S>&, const Movers<S>&, double*);
  bool persistent_outputs;
  bool assigns;
};

/// Figures of one node since the tape was made or `clear_statistics`.
struct NodeStatistics {
  std::string name;
  std::string source;
  Index forward_runs = 0, forward_skips = 0, backward_runs = 0;
  double forward_ns = 0, backward_ns = 0;  ///< only while profiling
  Index value_bytes = 0, adjoint_bytes = 0, saved_bytes = 0;
};

/// What a tape does not compute because the result does not need it. With a skip off the result has the same bits, and
/// takes longer: for who measures what it saves, or suspects it.
struct TapeSkips {
  /// Frozen leaves have no adjoint. Off: every leaf that is no constant has one.
  bool frozen_inputs = true;
  /// A node does not run again when its inputs are as they were. Off: forward runs every node each time, and what nodes
  /// keep for inputs that stay is made anew.
  bool unchanged_inputs = true;
  /// Squares of an image that the one operator on the way to the result which reads it says it does not look at are not
  /// made; they keep what they had. Off: all are.
  bool unread_pixels = true;

  bool operator==(const TapeSkips&) const = default;
};

/// What the last forward and the last backward did.
struct TapeCounters {
  Index forward_nodes = 0, backward_nodes = 0;  ///< that ran
  Index adjoint_numbers = 0;                    ///< of the arrays with an adjoint, padding included

  TapeCounters& operator+=(const TapeCounters& other) {
    forward_nodes += other.forward_nodes;
    backward_nodes += other.backward_nodes;
    adjoint_numbers += other.adjoint_numbers;
    return *this;
  }
};

/// Reverse-mode tape of arrays; see the top of the file. S is float or double. Not copyable; not for use from two
/// threads at once, while its nodes may work in parallel inside.
template <class S>
class Tape {
 public:
  /// Inputs that one operator may have.
  static constexpr std::size_t kMostInputs = 64;

  /// Point in the recording to come back to with rewind.
  struct Mark {
    std::size_t arrays = 0, nodes = 0, edges = 0;
    std::uint32_t stamp = 0;  // of the last array: tells a mark whose recording was rewound
    Arena::Position memory;
  };

  Tape() = default;
  ~Tape();
  Tape(const Tape&) = delete;
  Tape& operator=(const Tape&) = delete;

  // --- recording ---------------------------------------------------------------------------------------------------

  /// A leaf with a gradient, all zeros until written. `name` appears in messages and graph dumps.
  Var<S> parameter(std::string_view name, const Shape& shape, Source where = Source::current());
  /// A leaf without a gradient, all zeros until written.
  Var<S> constant(std::string_view name, const Shape& shape, Source where = Source::current());
  /// A constant scalar.
  Var<S> constant(S value, Source where = Source::current());

  /// Records operator `op` with up to kMostInputs inputs; returns its first output. Nothing is computed.
  ///
  /// Op is a struct with `static constexpr const char* kName`, `void forward(NodeIo<S>&)`, `void backward(NodeIo<S>&)`,
  /// and any of these, each optional:
  ///   `std::uint64_t state_key(NodeIo<S>&)`, `void build_state(NodeIo<S>&)`  state kept between runs: a function of
  ///   the
  ///       key alone. It is built before forward whenever the key differs from the last one, or state was dropped.
  ///   `void add_signature(Signature&, NodeIo<S>&)`  its discrete choices in the last forward.
  ///   `Index saved_bytes() const`                   memory held between forward and backward, for statistics.
  ///   `const TileMask* looks_at(NodeIo<S>&, int i)`  squares of input i, an image, on which forward and backward
  ///       depend; null: all. Asked before forward, when only leaves are up to date.
  ///   `bool weigh(…)`, `void push(…)`, `void collect(…)`  its part in a curvature (autodiff/curvature.h).
  ///   `static constexpr bool kPersistentOutputs = true`  outputs are updated in place, not rewritten.
  ///   `static constexpr bool kAssigns = true`  its adjoint asks io.must_assign(i), and then assigns every number of
  ///       d_in(i): saves clearing that memory and reading it back.
  template <class Op>
  Var<S> record(Op op, std::span<const Var<S>> inputs, std::span<const Shape> outputs, Source where);
  template <class Op>
  Var<S> record(Op op, std::initializer_list<Var<S>> inputs, const Shape& output, Source where) {
    return record(std::move(op), std::span(inputs.begin(), inputs.size()), std::span(&output, 1), where);
  }
  /// Output j of the node whose first output is `first`.
  Var<S> output(Var<S> first, int j) const;

  /// Names an array for messages and graph dumps. Returns it.
  Var<S> name(Var<S> var, std::string_view text);

  /// No gradient flows into `var` (a leaf or an intermediate) from now on / again.
  void freeze(Var<S> var) { set_frozen(var, true); }
  void unfreeze(Var<S> var) { set_frozen(var, false); }
  bool frozen(Var<S> var) const { return arrays_[checked(var)].frozen; }

  /// An operator's only output stays as it is, whatever becomes of its inputs, and gives them no gradient: what only it
  /// needs is not computed. Asked for by itself it is. Throws InternalError for a leaf, one output of several, and
  /// before it was computed.
  void hold(Var<S> var);
  /// It follows its inputs again.
  void release(Var<S> var);
  bool held(Var<S> var) const { return arrays_[checked(var)].held; }

  Mark mark() const {
    const std::uint32_t stamp = arrays_.empty() ? 0 : arrays_.back().stamp;
    return {arrays_.size(), nodes_.size(), edges_.size(), stamp, arena_.position()};
  }
  /// Forgets all that was recorded after `mark`. Handles of it become invalid; values before it stay.
  void rewind(const Mark& mark);

  // --- values ------------------------------------------------------------------------------------------------------

  const Shape& shape(Var<S> var) const { return arrays_[checked(var)].shape; }
  /// The value of a leaf, to be changed: everything that depends on it is stale until the next forward. The view is
  /// good until then; ask again for the next change, which is not seen otherwise.
  Array<S> write(Var<S> leaf);
  /// Writes the numbers of a leaf in row-major order without padding. Throws InternalError when the count differs.
  void set(Var<S> leaf, std::span<const S> values);
  void set(Var<S> leaf, std::initializer_list<S> values) { set(leaf, std::span(values.begin(), values.size())); }
  /// The value as last computed or written.
  ConstArray<S> value(Var<S> var) const { return view(checked(var)); }
  /// d loss / d var of the last backward. Throws InternalError where has_gradient is false.
  ConstArray<S> gradient(Var<S> var) const;
  /// False when var is frozen, or the loss of the last backward does not depend on it.
  bool has_gradient(Var<S> var) const;

  // --- running -----------------------------------------------------------------------------------------------------

  /// Brings `result` up to date. When a node throws, the tape needs another forward before a backward.
  void forward(Var<S> result);
  /// Adjoint of everything between the unfrozen parameters and the scalar `loss`, starting from 1.
  /// Throws StaleError when forward(loss) is not the state of the values.
  void backward(Var<S> loss);
  /// As above for an array of any shape, starting from `cotangent` (row-major, without padding).
  void backward(Var<S> result, std::span<const S> cotangent);
  /// Discrete choices of the last forward(result).
  std::uint64_t signature(Var<S> result);
  /// Drops the state of every node that keeps some (start of a frame, rollback, resume): it is built anew from its key.
  void drop_state();
  /// All are on unless this says so.
  void set_skips(const TapeSkips& skips);

  // --- looking inside ----------------------------------------------------------------------------------------------

  /// Anomaly mode: forward and backward stop with NonFiniteError at the first number that is not finite.
  void set_anomaly(bool on);
  /// Measures the time of each node (two clock readings a run).
  void set_profiling(bool on) { profiling_ = on; }
  std::vector<NodeStatistics> statistics() const;
  void clear_statistics();
  const TapeCounters& counters() const { return counters_; }
  /// Bytes held: values, operators and their saved buffers, adjoints, scratch.
  Index memory_bytes() const;

 private:
  friend class NodeIo<S>;
  friend class TapeInspector<S>;
  friend class Curvature<S>;
  friend class CurvatureWeights<S>;
  friend class Movers<S>;

  struct ArrayRecord {
    Shape shape;
    S* value = nullptr;
    S* adjoint = nullptr;       // inside the adjoint buffer of the active plan; null when there is none
    std::uint64_t version = 0;  // clock of the last write
    std::uint64_t version_before = 0;
    const TileMask* changed = nullptr;  // by the last write; see NodeIo::changed
    const TileMask* read = nullptr;
    std::uint32_t producer = 0;  // node, or kLeaf
    std::uint32_t stamp = 0;
    bool constant = false;  // a leaf that can not be unfrozen
    bool frozen = false;
    bool held = false;
    bool needs_gradient = false;  // depends on an unfrozen parameter; of the current structure
    std::string name;
    Source where;
  };
  struct NodeRecord {
    const OperatorTable<S>* table = nullptr;
    void* op = nullptr;
    std::uint32_t first_edge = 0, edge_count = 0;
    std::uint32_t first_output = 0, output_count = 0;
    std::uint64_t ran_at = 0;      // clock of the last forward; 0: must run
    std::uint64_t wants_mask = 0;  // which inputs needed a gradient when it ran
    std::uint64_t state_key = 0;
    bool state_valid = false;
    const TileMask* needed = nullptr;                 // in the forward run at hand; see NodeIo::needed
    std::uint64_t needed_key = 0, made_key = kWhole;  // of `needed`, and of what it was when it ran last
    Index forward_runs = 0, forward_skips = 0, backward_runs = 0;
    double forward_ns = 0, backward_ns = 0;
    Source where;
  };
  /// What running one result takes; rebuilt when the structure (recording, freezing) changed.
  struct Plan {
    struct Slot {
      std::uint32_t array;
      Index offset;
    };
    struct Reader {
      std::uint32_t producer, node;
      int input;
    };
    std::uint32_t result = 0;
    std::uint64_t structure = 0;
    std::uint64_t forward_at = 0;  // clock when forward finished; 0: never, or not since the structure changed
    std::vector<std::uint32_t> leaves, forward_nodes, backward_nodes;
    std::vector<std::uint64_t> needed_keys;   // of forward_nodes, in the last forward
    std::vector<std::uint64_t> assign_masks;  // of backward_nodes: which inputs they meet first, and assign
    std::vector<Reader> sole_readers;         // that say what they look at, of nodes that nothing else reads
    std::vector<Slot> adjoints;
    Index adjoint_size = 0;
    Index cleared_size = 0;  // the adjoints that are added to from the start lie in front, and are cleared each time
  };

  static constexpr std::uint32_t kLeaf = ~std::uint32_t(0);
  static constexpr std::uint64_t kWhole = 0;  // key of no mask

  std::uint32_t checked(Var<S> var) const;
  Array<S> view(std::uint32_t id) const { return {arrays_[id].value, arrays_[id].shape}; }
  Array<S> adjoint_view(std::uint32_t id) const { return {arrays_[id].adjoint, arrays_[id].shape}; }
  NodeIo<S> io_of(const NodeRecord& node);
  Var<S> handle(std::uint32_t id) const { return {const_cast<Tape*>(this), id, arrays_[id].stamp}; }

  Var<S> add_leaf(std::string_view name, const Shape& shape, bool constant, const Source& where);
  std::uint32_t add_array(const Shape& shape, std::uint32_t producer, const Source& where);
  Var<S> add_node(const OperatorTable<S>* table, void* op, std::span<const Var<S>> inputs,
                  std::span<const Shape> outputs, const Source& where);
  void check_node(const char* name, std::span<const Var<S>> inputs, std::span<const Shape> outputs) const;
  void set_frozen(Var<S> var, bool frozen);

  void update_structure();
  Plan& plan_for(std::uint32_t result);
  void build(Plan& plan);
  void find_sole_readers(Plan& plan);
  void place_adjoints(Plan& plan);
  void activate(const Plan& plan);
  void tell_needed(const Plan& plan);
  void run_forward(Plan& plan);
  void run_backward(Plan& plan);
  void forward_node(NodeRecord& node);
  void backward_node(NodeRecord& node, std::uint64_t assign_mask);
  bool up_to_date(const NodeRecord& node) const;
  void check_leaves(const Plan& plan) const;
  void check_needed(const Plan& plan) const;
  void invalidate(const std::vector<std::uint32_t>& nodes);
  void check_finite(std::uint32_t array, const NodeRecord* node, bool adjoint) const;

  Arena arena_;    // values and operators
  Arena scratch_;  // within one call of one node
  std::vector<ArrayRecord> arrays_;
  std::vector<NodeRecord> nodes_;
  std::vector<std::uint32_t> edges_;  // input ids of all nodes
  std::vector<Plan> plans_;
  std::vector<std::uint8_t> reached_;   // scratch of build: the result depends on it
  std::vector<std::uint32_t> readers_;  // scratch of find_sole_readers: by node
  std::vector<std::uint8_t> carries_;   // scratch of build: a gradient arrives at it
  std::vector<std::uint8_t> assigned_;  // scratch of place_adjoints
  Buffer<S> adjoints_;
  Index defined_adjoints_ = 0;  // numbers of them that were written since there was room for them
  std::uint64_t clock_ = 1;
  std::uint64_t structure_ = 1;          // changes with recording and freezing
  std::uint64_t current_structure_ = 0;  // the one that needs_gradient describes
  std::uint64_t active_structure_ = 0;   // plan whose adjoints the arrays point into
  std::uint32_t active_result_ = 0;
  std::uint32_t next_stamp_ = 1;
  bool anomaly_ = false;
  bool profiling_ = false;
  TapeSkips skips_;
  TapeCounters counters_;
};

template <class S>
Tape<S>& Var<S>::owner() const {
  HSI4D_CHECK(tape != nullptr, "an empty Var was used");
  return *tape;
}

template <class S>
const Shape& Var<S>::shape() const {
  return owner().shape(*this);
}

namespace detail {

template <class S, class Op>
constexpr OperatorTable<S> make_operator_table() {
  OperatorTable<S> table{};
  table.name = Op::kName;
  table.forward = [](void* op, NodeIo<S>& io) { static_cast<Op*>(op)->forward(io); };
  table.backward = [](void* op, NodeIo<S>& io) { static_cast<Op*>(op)->backward(io); };
  table.destroy = [](void* op) { static_cast<Op*>(op)->~Op(); };
  if constexpr (requires(Op op, NodeIo<S> io) { op.state_key(io); }) {
    table.state_key = [](void* op, NodeIo<S>& io) { return static_cast<Op*>(op)->state_key(io); };
    table.build_state = [](void* op, NodeIo<S>& io) { static_cast<Op*>(op)->build_state(io); };
  }
  if constexpr (requires(Op op, Signature s, NodeIo<S> io) { op.add_signature(s, io); }) {
    table.add_signature = [](void* op, Signature& signature, NodeIo<S>& io) {
      static_cast<Op*>(op)->add_signature(signature, io);
    };
  }
  if constexpr (requires(const Op op) { op.saved_bytes(); }) {
    table.saved_bytes = [](const void* op) { return static_cast<const Op*>(op)->saved_bytes(); };
  }
  if constexpr (requires(Op op, NodeIo<S> io) { op.looks_at(io, 0); }) {
    table.looks_at = [](void* op, NodeIo<S>& io, int i) { return static_cast<Op*>(op)->looks_at(io, i); };
  }
  if constexpr (requires(Op op, NodeIo<S> io, CurvatureWeights<S> & weights) { op.weigh(io, weights); }) {
    table.weigh = [](void* op, NodeIo<S>& io, CurvatureWeights<S>& weights) {
      return static_cast<Op*>(op)->weigh(io, weights);
    };
  }
  if constexpr (requires(Op op, NodeIo<S> io, Movers<S> & movers) { op.push(io, movers); }) {
    table.push = [](void* op, NodeIo<S>& io, Movers<S>& movers) { static_cast<Op*>(op)->push(io, movers); };
  }
  if constexpr (requires(Op op, NodeIo<S> io, const CurvatureWeights<S>& weights, const Movers<S>& movers,
                         double* sum) { op.collect(io, weights, movers, sum); }) {
    table.collect = [](void* op, NodeIo<S>& io, const CurvatureWeights<S>& weights, const Movers<S>& movers,
                       double* sum) { static_cast<Op*>(op)->collect(io, weights, movers, sum); };
  }
  if constexpr (requires { Op::kPersistentOutputs; }) table.persistent_outputs = Op::kPersistentOutputs;
  if constexpr (requires { Op::kAssigns; }) table.assigns = Op::kAssigns;
  return table;
}

template <class S, class Op>
inline constexpr OperatorTable<S> kOperatorTable = make_operator_table<S, Op>();

}  // namespace detail

template <class S>
template <class Op>
Var<S> Tape<S>::record(Op op, std::span<const Var<S>> inputs, std::span<const Shape> outputs, Source where) {
  static_assert(alignof(Op) <= kAlignment);
  check_node(Op::kName, inputs, outputs);
  const Mark before = mark();
  Op* placed = new (arena_.allocate(static_cast<Index>(sizeof(Op)))) Op(std::move(op));
  try {
    return add_node(&detail::kOperatorTable<S, Op>, placed, inputs, outputs, where);
  } catch (...) {  // out of memory
    if (nodes_.size() == before.nodes) placed->~Op();
    rewind(before);
    throw;
  }
}

extern template class Tape<float>;
extern template class Tape<double>;

}  // namespace hsi4d
