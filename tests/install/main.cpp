// A project outside of the source tree: a loss term of its own, its gradient checked, and the program that knows it.
#include <cmath>
#include <hsi4d/autodiff/gradcheck.h>
#include <hsi4d/core/version.h>
#include <hsi4d/pipelines/cli/program.h>
#include <iostream>
#include <vector>

#include "saturation.h"

namespace {

void fill(const hsi4d::Array<double>& image, double phase) {
  for (hsi4d::Index r = 0; r < image.total_rows(); ++r) {
    for (hsi4d::Index c = 0; c < image.shape.cols; ++c) {
      image.row(r)[c] = 0.5 + 0.4 * std::sin(1.7 * static_cast<double>(r * image.shape.cols + c) + phase);
    }
  }
}

bool gradient_is_right(const hsi4d::LossTerm& term) {
  hsi4d::Tape<double> tape;
  hsi4d::LossInputs<double> inputs;
  inputs.rendered = tape.parameter("rendered", hsi4d::image_shape<double>(3, 5, 7));
  inputs.target = tape.parameter("target", hsi4d::image_shape<double>(3, 5, 7));
  fill(tape.write(inputs.rendered), 0);
  fill(tape.write(inputs.target), 1);
  const hsi4d::GradcheckReport report = gradcheck(tape, term.record(inputs));
  std::cout << "gradient check of " << term.description.name << ": " << report << '\n';
  return report.ok();
}

}  // namespace

int main() {
  std::cout << "hsi4d " << hsi4d::version() << '\n';
  std::vector<hsi4d::LossTerm> terms = hsi4d::loss_terms();
  terms.push_back(outside::saturation_loss());
  if (!gradient_is_right(terms.back())) return 1;
  const char* arguments[] = {"outside", "list", "losses"};
  return hsi4d::cli::run_program(3, arguments, terms);
}
