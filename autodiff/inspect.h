// Looking into a tape: its nodes and arrays one by one, and the graph as a drawing.
//
// For gradient checks, tests and debugging. Running single nodes goes around the tape's bookkeeping: afterwards, run
// forward and backward on the tape again before relying on its values.
#pragma once

#include <string>
#include <vector>

#include "autodiff/tape.h"

namespace hsi4d {

template <class S>
class TapeInspector {
 public:
  explicit TapeInspector(Tape<S>& tape) : tape_(tape) {}

  /// Number of an array: the id of its Var.
  using ArrayId = std::uint32_t;
  using NodeId = std::uint32_t;

  NodeId nodes() const { return static_cast<NodeId>(tape_.nodes_.size()); }
  ArrayId arrays() const { return static_cast<ArrayId>(tape_.arrays_.size()); }
  /// Nodes that `result` depends on, in the order of forward.
  std::vector<NodeId> nodes_of(Var<S> result) { return tape_.plan_for(tape_.checked(result)).forward_nodes; }

  const char* operator_name(NodeId n) const { return tape_.nodes_[n].table->name; }
  /// "file.cpp:12", where the node was recorded.
  std::string source(NodeId n) const { return source_name(tape_.nodes_[n].where); }
  std::vector<ArrayId> inputs(NodeId n) const;
  std::vector<ArrayId> outputs(NodeId n) const;
  bool persistent_outputs(NodeId n) const { return tape_.nodes_[n].table->persistent_outputs; }
  /// Discrete choices of one node in its last forward; 0 when it makes none.
  std::uint64_t signature(NodeId n);

  Var<S> handle(ArrayId id) const { return tape_.handle(id); }
  /// The name given, or "#id".
  std::string array_name(ArrayId id) const;
  bool is_leaf(ArrayId id) const { return tape_.arrays_[id].producer == Tape<S>::kLeaf; }
  bool needs_gradient(ArrayId id) const { return tape_.arrays_[id].needs_gradient; }
  const Shape& shape(ArrayId id) const { return tape_.arrays_[id].shape; }
  Array<S> value(ArrayId id) { return tape_.view(id); }
  /// Empty (false) where the last backward has no adjoint.
  Array<S> adjoint(ArrayId id) { return tape_.adjoint_view(id); }

  /// Runs one node on the present values / adjoints.
  void forward(NodeId n);
  void backward(NodeId n);

 private:
  Tape<S>& tape_;
};

/// The graph as a Graphviz description (`dot -Tsvg`): boxes are operators with their source lines, ellipses are leaves;
/// edges carry shapes; what has no gradient is grey. Limited to what `result` depends on.
template <class S>
std::string graphviz(Tape<S>& tape, Var<S> result);

extern template class TapeInspector<float>;
extern template class TapeInspector<double>;

}  // namespace hsi4d
