// Poses of objects in a motion's file: by name as ours, or of one object as CHOIS and OMOMO have them.
#include "core/npz.h"
#include "pipelines/evaluate/foreign_motion.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::motion_objects_fuzz {

namespace {

const std::vector<float> kTurned = {1, 0, 0, 0, 1, 0, 0, 0, 1, 0, -1, 0, 1, 0, 0, 0, 0, 1};

Bytes by_name() {
  NpzWriter file;
  for (const char* name : {"ball/rotation", "ball/translation"})
    file.add<double>(name, {2, 3}, {0, 1, 2, 0.5, 0.25, 4});
  return file.encode();
}

Bytes of_chois() {
  NpzWriter file;
  file.add<float>("obj_rot_mat", {2, 3, 3}, kTurned);
  file.add<float>("obj_com_pos", {2, 3, 1}, {0, 1, 2, 3, 4, 5});
  return file.encode();
}

Bytes of_origins() {
  NpzWriter file;
  file.add<float>("obj_rot", {2, 3, 3}, kTurned);
  file.add<double>("obj_trans", {2, 3}, {0, 1, 2, 3, 4, 5});
  return file.encode();
}

Scratch& scratch() {
  static Scratch made({{"motion.npz", by_name()}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() {
  std::vector<Bytes> all;
  for (const Bytes& good : {by_name(), of_chois(), of_origins()}) {
    all.push_back(Scratch::with_choice(0, good));
    all.push_back(Scratch::with_choice(0, list_of(good)));
  }
  return all;
}

bool accepts(std::span<const uint8_t> file) {
  scratch().try_file(file, [](std::span<const uint8_t> rest) { return archive_of(rest); });
  return is_read([&] {
    const ForeignObjects objects = read_motion_objects(scratch() / "motion.npz", "object");
    for (const std::vector<ObjectPose>& frame : objects.poses) {
      HSI4D_CHECK(frame.size() == objects.names.size(), "objects that a frame lacks were taken");
      for (const ObjectPose& pose : frame)
        HSI4D_CHECK(pose.rotation.allFinite() && pose.translation.allFinite(), "no number was taken");
    }
  });
}

const Target target("motion_objects", corpus, accepts);

}  // namespace hsi4d::fuzz::motion_objects_fuzz
