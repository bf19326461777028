// A folder of poses, a file a frame: the file of frame 3 beside a good one of frame 1.
#include "body/motion_edit.h"
#include "core/npz.h"
#include "tests/fuzz/archive_list.h"
#include "tests/fuzz/scratch.h"

namespace hsi4d::fuzz::pose_folder_fuzz {

namespace {

Bytes pose(float angle) {
  NpzWriter file;
  file.add<float>("global_orient", {1, 3}, {angle, 1, 2});
  file.add<float>("body_pose", {1, 63}, std::vector<float>(63, angle));
  file.add<float>("transl", {3}, {0, 1, 2});
  file.add<double>("betas", {1, 2}, {1, 2});
  return file.encode();
}

Scratch& scratch() {
  static Scratch made({{"00003.npz", pose(0.5F)}, {"00001.npz", pose(0.25F)}});
  return made;
}

}  // namespace

std::vector<Bytes> corpus() { return {list_of(pose(0.5F)), pose(1)}; }

bool accepts(std::span<const uint8_t> file) {
  write_file(scratch() / "00003.npz", archive_of(file));
  return is_read([&] {
    const PoseFolder folder = read_pose_folder(scratch().path(), 10);
    HSI4D_CHECK_EQ(std::ssize(folder.motion.poses), 3);
  });
}

const Target target("pose_folder", corpus, accepts);

}  // namespace hsi4d::fuzz::pose_folder_fuzz
