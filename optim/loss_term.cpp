#include "optim/loss_term.h"

namespace hsi4d {

template <class S>
LossInputs<S> with_seams(LossInputs<S> inputs, const SeamMode& mode) {
  for (Var<S>* input : {&inputs.rendered, &inputs.object_opacity, &inputs.human_opacity, &inputs.object_place,
                        &inputs.object_depth, &inputs.body_rotations, &inputs.joints}) {
    if (input->tape != nullptr) *input = seam(*input, mode);
  }
  const auto behind_seam = [&mode](auto& record) {
    if (record) record = [record, &mode](const auto& points) { return seam(record(points), mode); };
  };
  behind_seam(inputs.body_points);
  behind_seam(inputs.object_points);
  inputs.seams = &mode;
  return inputs;
}

template LossInputs<float> with_seams(LossInputs<float>, const SeamMode&);
template LossInputs<double> with_seams(LossInputs<double>, const SeamMode&);

std::vector<LossDescription> descriptions_of(const std::vector<LossTerm>& terms) {
  std::vector<LossDescription> all;
  for (const LossTerm& term : terms) all.push_back(term.description);
  return all;
}

}  // namespace hsi4d
