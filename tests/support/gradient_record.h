// What gradient checks measured, for the audit of all operators and losses (tools/gradient_audit): a line of JSON for
// each input of each operator that a check met, added to the file that HSI4D_GRADIENT_AUDIT names. Without it nothing
// happens.
#pragma once

#include <string>

#include "autodiff/gradcheck.h"
#include "autodiff/tape.h"

namespace hsi4d::test {

bool records_gradients();

/// What a figure is of: input `input` of an operator by itself, or a leaf through the whole graph of a check.
struct GradientFigure {
  std::string check;  ///< the check's name
  std::string node;   ///< the operator's name; empty: the whole graph
  int input = -1;
  std::string array;    ///< the input's name; "#7" has none
  const char* against;  ///< "double", "differences" or "complex step"
  double error = 0;     ///< relative; of "double" and "complex step" L2, of "differences" the largest of an entry
  Index entries = 0;
};
void record_gradient(const GradientFigure& figure);

/// Differences of every operator of a graph, and of its leaves.
void record_differences(const std::string& check, const GradcheckReport& report);

/// Each operator of the graph by itself in float and double: the same inputs, rounded to float, and random cotangents.
/// Leaves the tapes' values changed.
void record_float_errors(const std::string& check, Tape<double>& exact, Var<double> exact_result, Tape<float>& fast,
                         Var<float> fast_result);

}  // namespace hsi4d::test
