// Any bytes as an alignment.json of `hsi4d align`.
#include <cmath>
#include <string>
#include <string_view>

#include <Eigen/LU>

#include "pipelines/locate/colmap_camera.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::alignment_fuzz {

std::vector<Bytes> corpus() {
  constexpr std::string_view kText =
      R"({"matrix": [[0, -2, 0, 1], [2, 0, 0, -4], [0, 0, 2, 0.5], [0, 0, 0, 1]], "scale": 2})";
  return {Bytes(kText.begin(), kText.end())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    const Similarity similarity = decode_alignment(std::string(file.begin(), file.end()), "fuzz.json");
    HSI4D_CHECK(similarity.scale > 0, "an accepted scale is not above 0");
    HSI4D_CHECK(std::abs(similarity.rotation.determinant() - 1) < 1e-6, "an accepted rotation is none");
  });
}

const Target target("alignment", corpus, accepts);

}  // namespace hsi4d::fuzz::alignment_fuzz
