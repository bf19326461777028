#include "pipelines/run/heading_starts.h"

#include <limits>
#include <numbers>
#include <vector>

#include "core/rotation.h"
#include "core/text.h"

namespace hsi4d {

SceneState with_turned_human(const SceneState& state, double radians) {
  SceneState turned = state;
  const Matrix3<double> turn = so3_exp(Vector3<double>(0, 0, radians)),
                        root = so3_exp(Vector3<double>(state.body.axis_angle.data()));
  turned.body.set_rotation(0, so3_log(Matrix3<double>(turn * root)));  // a body turns about its pelvis
  return turned;
}

HeadingStart best_heading(const SceneState& state, int headings,
                          const std::function<double(const SceneState& start)>& loss_from) {
  std::vector<double> losses;
  std::size_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  const double step = 2 * std::numbers::pi / headings;
  for (int i = 0; i < headings; ++i) {
    losses.push_back(loss_from(with_turned_human(state, i * step)));
    if (!(losses.back() < least)) continue;
    least = losses.back();
    best = losses.size() - 1;
  }
  std::string text = "headings";
  for (std::size_t i = 0; i < losses.size(); ++i) {
    text += (i == 0 ? " +" : ", +") + rounded(360.0 * static_cast<double>(i) / headings, 3) +
            " deg: " + rounded(losses[i], 3) + (i == best ? " (kept)" : "");
  }
  return {with_turned_human(state, static_cast<double>(best) * step), text};
}

}  // namespace hsi4d
