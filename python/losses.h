// Loss terms that are functions of Python.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "python/held_function.h"

namespace hsi4d::python {

/// An input that a term in Python may name.
struct NamedInput {
  const char* name;
  LossInput of;                           ///< what a stage gives it with
  bool is_image;                          ///< [C,H,W]; else [rows, cols]
  Var<float> LossInputs<float>::*floats;  ///< in runs
  Var<double> LossInputs<double>::*doubles;

  template <class S>
  Var<S> in(const LossInputs<S>& inputs) const {
    if constexpr (std::is_same_v<S, float>) {
      return inputs.*floats;
    } else {
      return inputs.*doubles;
    }
  }
};

/// A term in Python. It travels to the stages as its settings.
struct PythonLoss {
  std::string name;
  std::vector<NamedInput> inputs;
  HeldFunction function;
};

/// The term. Values and adjoints are checked when they come: UserError that names the term.
LossTerm python_loss_term(PythonLoss loss, const std::string& summary, double weight);

/// The inputs of these names. Throws UserError for another one, or none.
std::vector<NamedInput> inputs_named(const std::vector<std::string>& names);

/// The names of all inputs.
std::vector<std::string> input_names();

}  // namespace hsi4d::python
