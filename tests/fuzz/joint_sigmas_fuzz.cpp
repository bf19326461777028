// How sure a motion's joints are: `joint_sigma` of its file. What is taken is a table of numbers that are not negative.
#include "body/body_model.h"
#include "body/motion_io.h"
#include "core/npz.h"
#include "tests/fuzz/archive_list.h"

namespace hsi4d::fuzz::joint_sigmas_fuzz {

namespace {

Bytes sigmas_of(std::int64_t frames, std::int64_t joints, double number) {
  NpzWriter file;
  file.add<double>("trans", {2, 3}, {0, 1, 2, 3, 4, 5});
  file.add<double>("joint_sigma", {frames, joints, 2},
                   std::vector<double>(static_cast<std::size_t>(2 * frames * joints), number));
  return file.encode();
}

}  // namespace

std::vector<Bytes> corpus() {
  return {list_of(sigmas_of(2, 22, 0.01)), list_of(sigmas_of(2, 1, 0)), sigmas_of(2, 3, 1)};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const std::vector<double> sigmas = decode_joint_sigmas(archive_of(file), "fuzz.npz");
    HSI4D_CHECK(sigmas.size() % 2 == 0, "half a sigma was taken");
    for (const double sigma : sigmas) HSI4D_CHECK(!(sigma < 0), "a negative sigma was taken");
  });
}

const Target target("joint_sigmas", corpus, accepts);

}  // namespace hsi4d::fuzz::joint_sigmas_fuzz
