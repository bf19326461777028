#include "pipelines/run_state.h"

#include "core/check.h"
#include "optim/checkpoint.h"

namespace hsi4d {

namespace {

constexpr Index kPoseNumbers = 165;
constexpr Index kRigidNumbers = 12;

/// One state as numbers: camera [R | t] (12), then 6 an object, then the body's transl (3) and axis-angles (165).
void append(const SceneState& state, std::vector<double>& numbers) {
  for (Index r = 0; r < 3; ++r) {
    for (Index c = 0; c < 3; ++c) numbers.push_back(state.camera_from_world.rotation(r, c));
    numbers.push_back(state.camera_from_world.translation[r]);
  }
  for (const ObjectPose& pose : state.objects) {
    numbers.insert(numbers.end(), pose.rotation.data(), pose.rotation.data() + 3);
    numbers.insert(numbers.end(), pose.translation.data(), pose.translation.data() + 3);
  }
  numbers.insert(numbers.end(), state.body.transl.data(), state.body.transl.data() + 3);
  numbers.insert(numbers.end(), state.body.axis_angle.begin(), state.body.axis_angle.end());
}

Index numbers_per_state(const Clip& clip) {
  return kRigidNumbers + 6 * static_cast<Index>(clip.objects.size()) + 3 + kPoseNumbers;
}

SceneState state_from(const double* numbers, const Clip& clip) {
  SceneState state;
  for (Index r = 0; r < 3; ++r) {
    for (Index c = 0; c < 3; ++c) state.camera_from_world.rotation(r, c) = *numbers++;
    state.camera_from_world.translation[r] = *numbers++;
  }
  for (std::size_t o = 0; o < clip.objects.size(); ++o, numbers += 6) {
    state.objects.push_back({Vector3<double>(numbers), Vector3<double>(numbers + 3)});
  }
  state.body.transl = Vector3<double>(numbers);
  state.body.axis_angle.assign(numbers + 3, numbers + 3 + kPoseNumbers);
  return state;
}

}  // namespace

RunProgress first_progress(const Clip& clip, std::size_t stages) {
  RunProgress progress;
  progress.after_stage.assign(stages, {clip.first});
  progress.totals.resize(stages);
  progress.image_errors.resize(1);
  progress.covered = Image(1, clip.camera.height, clip.camera.width);
  return progress;
}

}  // namespace hsi4d
