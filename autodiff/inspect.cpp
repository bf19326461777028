#include "autodiff/inspect.h"

#include <set>

#include "core/parallel.h"

namespace hsi4d {

template <class S>
std::vector<typename TapeInspector<S>::ArrayId> TapeInspector<S>::inputs(NodeId n) const {
  const auto& node = tape_.nodes_[n];
  const auto first = tape_.edges_.begin() + node.first_edge;
  return {first, first + node.edge_count};
}

template <class S>
std::vector<typename TapeInspector<S>::ArrayId> TapeInspector<S>::outputs(NodeId n) const {
  std::vector<ArrayId> ids(tape_.nodes_[n].output_count);
  for (std::size_t j = 0; j < ids.size(); ++j) ids[j] = tape_.nodes_[n].first_output + static_cast<ArrayId>(j);
  return ids;
}

template <class S>
std::uint64_t TapeInspector<S>::signature(NodeId n) {
  auto& node = tape_.nodes_[n];
  if (node.table->add_signature == nullptr) return 0;
  Signature signature;
  NodeIo<S> io = tape_.io_of(node);
  node.table->add_signature(node.op, signature, io);
  return signature.value();
}

template <class S>
std::string TapeInspector<S>::array_name(ArrayId id) const {
  const std::string& name = tape_.arrays_[id].name;
  return name.empty() ? "#" + std::to_string(id) : name;
}

template <class S>
void TapeInspector<S>::forward(NodeId n) {
  const FlushDenormals flush;
  tape_.nodes_[n].ran_at = 0;  // inputs may have been changed where the tape does not see it
  tape_.forward_node(tape_.nodes_[n]);
}

template <class S>
void TapeInspector<S>::backward(NodeId n) {
  const FlushDenormals flush;
  tape_.backward_node(tape_.nodes_[n], 0);
}

namespace {

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result;
}

std::string text_of(const Shape& shape) {
  std::ostringstream text;
  text << shape;
  return text.str();
}

}  // namespace

template <class S>
std::string graphviz(Tape<S>& tape, Var<S> result) {
  TapeInspector<S> inspect(tape);
  std::ostringstream dot;
  dot << "digraph tape {\n  rankdir=LR;\n  node [fontname=\"sans-serif\", fontsize=11];\n"
      << "  edge [fontname=\"sans-serif\", fontsize=9];\n";
  const auto colour = [&](std::uint32_t id) { return inspect.needs_gradient(id) ? "black" : "gray60"; };
  std::set<std::uint32_t> leaves;
  std::vector<std::string> origin(inspect.arrays());
  for (const std::uint32_t n : inspect.nodes_of(result)) {
    for (const std::uint32_t id : inspect.outputs(n)) origin[id] = "n" + std::to_string(n);
    const std::uint32_t first = inspect.outputs(n).front();
    const std::string name = inspect.array_name(first);
    dot << "  n" << n << " [shape=box, style=rounded, color=" << colour(first) << ", label=\""
        << inspect.operator_name(n) << (name[0] == '#' ? "" : "\\n" + escaped(name)) << "\\n"
        << inspect.source(n) << "\"];\n";
    for (const std::uint32_t id : inspect.inputs(n)) {
      if (inspect.is_leaf(id) && leaves.insert(id).second) {
        origin[id] = "a" + std::to_string(id);
        dot << "  a" << id << " [shape=ellipse, color=" << colour(id) << ", label=\"" << escaped(inspect.array_name(id))
            << "\"];\n";
      }
      dot << "  " << origin[id] << " -> n" << n << " [color=" << colour(id) << ", label=\""
          << text_of(inspect.shape(id)) << "\"];\n";
    }
  }
  dot << "}\n";
  return dot.str();
}

template class TapeInspector<float>;
template class TapeInspector<double>;
template std::string graphviz(Tape<float>&, Var<float>);
template std::string graphviz(Tape<double>&, Var<double>);

}  // namespace hsi4d
