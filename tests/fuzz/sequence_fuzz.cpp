// Parameters of SMPL-X over time: one row for all frames, rows, rotations by joint, hands by coefficients.
#include "body/smplx_sequence.h"
#include "core/npz.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::sequence_fuzz {

namespace {

std::vector<float> halves(std::size_t count) { return std::vector<float>(count, 0.5F); }

Bytes one_frame() {
  NpzWriter file;
  file.add<float>("body_pose", {21, 3}, halves(63));
  file.add<float>("left_hand_pose", {2, 6}, halves(12));
  file.add<double>("betas", {10}, std::vector<double>(10, 1));
  return file.encode();
}

Bytes two_frames() {
  NpzWriter file;
  file.add<float>("global_orient", {2, 1, 3}, halves(6));
  file.add<double>("transl", {2, 3}, {0, 1, 2, 3, 4, 5});
  file.add<float>("right_hand_pose", {15, 3}, halves(45));
  file.add<float>("expression", {1, 4}, halves(4));
  file.add<float>("passed_over", {1}, halves(1));
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() { return {list_of(one_frame()), list_of(two_frames()), one_frame()}; }

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const SmplxSequence sequence = decode_smplx_sequence(archive_of(file), "fuzz.npz");
    HSI4D_CHECK(sequence.frames > 0, "parameters without frames were taken");
  });
}

const Target target("sequence", corpus, accepts);

}  // namespace hsi4d::fuzz::sequence_fuzz
