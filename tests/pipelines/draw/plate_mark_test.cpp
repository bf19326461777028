#include "pipelines/draw/plate_mark.h"

#include <catch2/catch.hpp>

#include "splat/files/splat_file.h"
#include "tests/support/temporary_folder.h"

namespace plate_mark_test {

using namespace hsi4d;
using hsi4d::test::TemporaryFolder;

TEST_CASE("a plate is known by its file, and is read as any other") {
  const TemporaryFolder here;
  Gaussians one;
  one.means = {1, 2, 3};
  one.quats = {1, 0, 0, 0};
  one.log_scales = {-1, -2, -3};
  one.opacity_logits = {4};
  one.sh = {0.1F, 0.2F, 0.3F};
  write_plate_splats("plate.ply", one);
  write_splats("scene.ply", one);
  CHECK(is_plate_file("plate.ply"));
  CHECK_FALSE(is_plate_file("scene.ply"));
  CHECK_FALSE(is_plate_file("missing.ply"));
  CHECK_FALSE(is_plate_file("."));
  here.write("short.ply", "ply\n");
  CHECK_FALSE(is_plate_file("short.ply"));
  const SplatFile read = read_splats("plate.ply");
  CHECK(read.gaussians.means == one.means);
  CHECK(read.gaussians.sh == one.sh);
}

}  // namespace plate_mark_test
