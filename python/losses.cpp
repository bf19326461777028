#include "python/losses.h"

#include <algorithm>
#include <cmath>
#include <pybind11/stl.h>

#include "core/suggest.h"
#include "core/text.h"
#include "python/arrays.h"
#include "python/parts.h"

namespace hsi4d::python {

namespace {

// clang-format off
#define HSI4D_INPUT(name, of, is_image) \
  NamedInput{#name, LossInput::of, is_image, &LossInputs<float>::name, &LossInputs<double>::name}
const std::vector<NamedInput>& all_inputs() {
  static const std::vector<NamedInput> inputs = {
      HSI4D_INPUT(rendered, kImage, true),
      HSI4D_INPUT(target, kImage, true),
      HSI4D_INPUT(weight, kImage, true),
      HSI4D_INPUT(object_opacity, kObjectOpacity, true),
      HSI4D_INPUT(object_center_target, kObjectOpacity, false),
      HSI4D_INPUT(object_masks, kObjectOpacity, true),
      HSI4D_INPUT(object_seen, kObjectOpacity, true),
      HSI4D_INPUT(object_place, kObjectOpacity, false),
      HSI4D_INPUT(object_depth, kObjectDepth, false),
      HSI4D_INPUT(object_depth_target, kObjectDepth, false),
      HSI4D_INPUT(human_opacity, kHumanOpacity, true),
      HSI4D_INPUT(human_mask, kHumanOpacity, true),
      HSI4D_INPUT(human_seen, kHumanOpacity, false),
      HSI4D_INPUT(keypoints, kKeypoints, false),
      HSI4D_INPUT(keypoints_target, kKeypoints, false),
      HSI4D_INPUT(bones, kBones, false),
      HSI4D_INPUT(bones_target, kBones, false),
      HSI4D_INPUT(body_rotations, kPose, false),
      HSI4D_INPUT(joints, kMotion, false),
      HSI4D_INPUT(joints_start, kMotion, false),
  };
  return inputs;
}
#undef HSI4D_INPUT
// clang-format on

/// All pixels count where it is not given; a term that names it gets None.
bool may_be_missing(const NamedInput& input) { return std::string_view(input.name) == "weight"; }

// --- the operator ----------------------------------------------------------------------------------------------------

template <class S>
Sizes shape_in_python(const Shape& shape, bool is_image) {
  if (is_image) return {shape.planes, shape.rows, shape.cols};
  return {shape.planes * shape.rows, shape.cols};
}

template <class S>
py::array_t<S> copied(const ConstArray<S>& array, bool is_image) {
  std::vector<S> numbers;
  numbers.reserve(static_cast<std::size_t>(array.shape.count()));
  for (Index r = 0; r < array.total_rows(); ++r)
    numbers.insert(numbers.end(), array.row(r), array.row(r) + array.shape.cols);
  return array_of(std::move(numbers), shape_in_python<S>(array.shape, is_image));
}

/// L = f(inputs), with the adjoints that f gives beside it.
template <class S>
struct PythonTerm {
  static constexpr const char* kName = "python_loss";
  std::shared_ptr<const PythonLoss> loss;
  std::vector<NamedInput> given;              ///< of the node's inputs
  std::vector<std::vector<S>> adjoints = {};  ///< of the last forward, by input; empty: zero

  UserError wrong(const std::string& text) const { return UserError("loss " + loss->name + ": " + text); }

  void forward(NodeIo<S>& io) {
    const py::gil_scoped_acquire acquired;
    const py::tuple result = called(io);
    if (!PyNumber_Check(py::object(result[0]).ptr()))
      throw wrong("its value is a " + std::string(Py_TYPE(py::object(result[0]).ptr())->tp_name) +
                  "; allowed: a number");
    io.out().scalar() = static_cast<S>(py::float_(py::object(result[0])).cast<double>());
    if (!py::isinstance<py::dict>(result[1]))
      throw wrong("its adjoints are a " + std::string(Py_TYPE(py::object(result[1]).ptr())->tp_name) +
                  "; allowed: a dict of names of inputs and arrays");
    keep_adjoints(io, py::dict(result[1]));
  }

  /// What the function returns: a pair.
  py::tuple called(NodeIo<S>& io) const {
    py::dict arguments;
    for (const NamedInput& input : loss->inputs) arguments[input.name] = py::none();
    for (std::size_t i = 0; i < given.size(); ++i)
      arguments[given[i].name] = copied(io.in(static_cast<int>(i)), given[i].is_image);
    const py::object result = loss->function.get()(**arguments);
    if (!py::isinstance<py::tuple>(result) || py::len(result) != 2)
      throw wrong("it returns a " + std::string(Py_TYPE(result.ptr())->tp_name) +
                  "; allowed: a pair (value, {input: adjoint})");
    return py::tuple(result);
  }

  void keep_adjoints(NodeIo<S>& io, const py::dict& by_name) {
    adjoints.assign(given.size(), {});
    for (const auto& [key, value] : by_name) {
      const std::string name = py::str(key);
      const auto input =
          std::find_if(given.begin(), given.end(), [&](const auto& known) { return known.name == name; });
      if (input == given.end()) {
        std::vector<std::string> names;
        for (const NamedInput& known : given) names.emplace_back(known.name);
        throw wrong("it gives an adjoint of \"" + name + "\"" + did_you_mean(name, names) +
                    "; allowed: " + joined(names));
      }
      const auto i = static_cast<std::size_t>(input - given.begin());
      const Sizes shape = shape_in_python<S>(io.in(static_cast<int>(i)).shape, input->is_image);
      adjoints[i] =
          numbers_of<S>(value, shape, "loss " + loss->name + ": the adjoint of " + name, shape_text(shape)).values;
    }
  }

  /// d_input += d_L · adjoint
  void backward(NodeIo<S>& io) {
    const S d_loss = io.d_out().scalar();
    for (int i = 0; i < io.inputs(); ++i) {
      const std::vector<S>& adjoint = adjoints[static_cast<std::size_t>(i)];
      if (!io.wants(i) || adjoint.empty()) continue;
      const Array<S> d = io.d_in(i);
      const S* next = adjoint.data();
      for (Index r = 0; r < d.total_rows(); ++r) {
        for (Index c = 0; c < d.shape.cols; ++c) d.row(r)[c] += d_loss * *next++;
      }
    }
  }

  Index saved_bytes() const {
    std::size_t count = 0;
    for (const std::vector<S>& adjoint : adjoints) count += adjoint.capacity();
    return static_cast<Index>(count * sizeof(S));
  }
};

// --- the term --------------------------------------------------------------------------------------------------------

/// The settings of a term in Python: itself. A config sets nothing of it but the weight.
struct PythonLossSettings {
  std::shared_ptr<const PythonLoss> loss;
};

void describe(ConfigFields&, PythonLossSettings&) {}

template <class S>
Var<S> record_python(const LossInputs<S>& inputs, const std::any& settings) {
  const auto& loss = std::any_cast<const PythonLossSettings&>(settings).loss;
  PythonTerm<S> term{loss, {}};
  std::vector<Var<S>> vars;
  for (const NamedInput& input : loss->inputs) {
    const Var<S> var = input.in(inputs);
    if (!inputs.given(var)) {
      if (may_be_missing(input)) continue;
      return {};
    }
    term.given.push_back(input);
    vars.push_back(var);
  }
  Tape<S>& tape = vars.front().owner();
  return tape.record(std::move(term), std::span<const Var<S>>(vars), std::array{kScalarShape}, Source::current());
}

/// Terms that Python registered. Never destroyed: they hold functions, and the interpreter ends before statics do.
std::vector<LossTerm>& registered() {
  static auto* const terms = new std::vector<LossTerm>;
  return *terms;
}

bool is_name(const std::string& name) {
  const auto may_stand = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_';
  };
  return !name.empty() && std::all_of(name.begin(), name.end(), may_stand);
}

void register_loss(const std::string& name, const std::string& summary, const py::object& function,
                   const std::vector<std::string>& needs, double weight) {
  if (!is_name(name)) throw UserError("name: \"" + name + "\"; allowed: letters, digits and _");
  for (const LossTerm& term : loss_terms()) {
    if (term.description.name == name)
      throw UserError("name: \"" + name + "\" is a loss term of the library; allowed: another name");
  }
  if (!(weight >= 0 && std::isfinite(weight)))
    throw UserError("weight: " + number_text(weight) + "; allowed: 0 or more");
  LossTerm term = python_loss_term({name, inputs_named(needs), HeldFunction(function, "function")}, summary, weight);
  std::erase_if(registered(), [&name](const LossTerm& known) { return known.description.name == name; });
  registered().push_back(std::move(term));
}

py::dict summaries() {
  py::dict all;
  for (const LossTerm& term : known_losses()) all[py::str(term.description.name)] = term.description.summary;
  return all;
}

}  // namespace

LossTerm python_loss_term(PythonLoss loss, const std::string& summary, double weight) {
  LossTerm term;
  const std::string name = loss.name;
  PythonLossSettings settings{std::make_shared<const PythonLoss>(std::move(loss))};
  term.description = describe_loss<PythonLossSettings>(name, summary, settings);
  term.description.weight = weight;
  term.description.needs = [](const std::any& chosen) {
    std::vector<LossInput> needs;
    for (const NamedInput& input : std::any_cast<const PythonLossSettings&>(chosen).loss->inputs) {
      if (std::find(needs.begin(), needs.end(), input.of) == needs.end()) needs.push_back(input.of);
    }
    return needs;
  };
  term.record_float = &record_python<float>;
  term.record_double = &record_python<double>;
  return term;
}

std::vector<std::string> input_names() {
  std::vector<std::string> names;
  for (const NamedInput& input : all_inputs()) names.emplace_back(input.name);
  return names;
}

std::vector<NamedInput> inputs_named(const std::vector<std::string>& names) {
  std::vector<NamedInput> chosen;
  for (const std::string& name : names) {
    const auto& all = all_inputs();
    const auto found =
        std::find_if(all.begin(), all.end(), [&](const NamedInput& input) { return input.name == name; });
    if (found == all.end())
      throw UserError("needs: there is no input \"" + name + "\"" + did_you_mean(name, input_names()) +
                      " (known: " + joined(input_names()) + ")");
    const auto is_it = [&name](const NamedInput& input) { return input.name == name; };
    if (std::any_of(chosen.begin(), chosen.end(), is_it)) throw UserError("needs: \"" + name + "\" is named twice");
    chosen.push_back(*found);
  }
  if (std::all_of(chosen.begin(), chosen.end(), may_be_missing))
    throw UserError("needs: allowed: one or more of " + joined(input_names()) + ", beside weight");
  return chosen;
}

std::vector<LossTerm> known_losses() {
  std::vector<LossTerm> terms = loss_terms();
  terms.insert(terms.end(), registered().begin(), registered().end());
  return terms;
}

void add_losses(py::module_& module) {
  module.def(
      "register_loss", &register_loss, py::arg("name"), py::arg("summary"), py::arg("function"), py::arg("needs"),
      py::arg("weight") = 1.0,
      "Makes a function a loss term that configs which are loaded from then on may name.\n\n"
      "needs: inputs of loss_inputs(). The function gets each as a keyword of its name, an array: images [C,H,W],\n"
      "others [rows,cols] as optim/loss_term.h has them, float32 in a run, float64 in a gradient check; weight is\n"
      "None where all pixels count. It returns (value, {input: adjoint}), the adjoint in the input's shape; inputs\n"
      "that are left out have none. Where an input is missing in a stage the term is off. A name that Python\n"
      "registered before is replaced; configs that were loaded keep what they had.");
  module.def("loss_inputs", &input_names, "Names of what a loss term in Python may need.");
  module.def("losses", &summaries, "All loss terms by name: a line about each.");
}

}  // namespace hsi4d::python
