// `hsi4d mesh` as a user runs it.
#include <catch2/catch.hpp>

#include "core/camera_file.h"
#include "core/file.h"
#include "optim/solid/mesh_distance.h"
#include "optim/solid/occupancy_grid.h"
#include "pipelines/synthetic/object.h"
#include "splat/files/splat_file.h"
#include "tests/support/program.h"

namespace mesh_command_test {

using namespace hsi4d;
using namespace hsi4d::test;

TEST_CASE("hsi4d mesh writes a closed mesh, distances and what is occupied") {
  const TemporaryFolder folder;
  write_splats("object.ply", synthetic_object(SyntheticSettings{}).gaussians);
  const ProgramResult run = run_hsi4d(
      {"mesh",  "object.ply",  "--object", "--views",     "30",    "--size", "96", "--voxel",   "0.01", "--out",
       "m.glb", "--distances", "m.vdb",    "--occupancy", "m.npz", "--up",   "y",  "--threads", "0",    "--quiet"});
  CAPTURE(run.err);
  REQUIRE(run.status == 0);
  CHECK_THAT(run.out, Catch::Contains("m.glb: ") && Catch::Contains("from 30 views") && Catch::Contains("a solid of"));
  CHECK(count_edges(read_mesh("m.glb")).open == 0);
  CHECK(read_file("m.vdb").size() > 1000);
  const OccupancyGrid occupancy = read_occupancy("m.npz");
  CHECK(occupancy.is_y_up);
  CHECK(occupancy.voxel_size == 0.01);
}

TEST_CASE("hsi4d mesh refuses what it cannot do before it begins") {
  const TemporaryFolder folder;
  write_splats("object.ply", synthetic_object(SyntheticSettings{}).gaussians);
  const auto error = [](std::vector<std::string> more) {
    std::vector<std::string> arguments = {"mesh", "object.ply"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProgramResult run = run_hsi4d(arguments);
    CHECK(run.status != 0);
    return run.err;
  };
  CHECK_THAT(error({"--out", "m.stl", "--object"}), Catch::Contains("a mesh ends in .obj, .ply or .glb"));
  CHECK_THAT(error({"--out", "m.ply"}), Catch::Contains("--cameras") && Catch::Contains("--object"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--voxel", "0"}),
             Catch::Contains("--voxel: 0 is out of range; allowed"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--box", "1,2"}), Catch::Contains("x,y,z,x,y,z"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--box", "0,0,0,0,1,1"}), Catch::Contains("there is no box"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--views", "2"}), Catch::Contains("needs 4 and more"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--up", "x", "--occupancy", "o.npz"}),
             Catch::Contains("allowed: y, z"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--adaptivity", "2"}), Catch::Contains("--adaptivity: 2"));
  CHECK_THAT(error({"--out", "object.ply", "--object"}), Catch::Contains("object.ply"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--up", "y"}),
             Catch::Contains("--occupancy, which is not asked for"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--distances", "d.npz"}), Catch::Contains(".vdb"));
  CHECK_THAT(error({"--out", "object.ply/m.ply", "--object"}), Catch::Contains("object.ply/m.ply"));
  CHECK_THAT(error({"--out", "m.ply", "--object", "--distances", "object.ply/m.vdb"}), Catch::Contains("m.vdb"));
  CHECK_FALSE(std::filesystem::exists("m.ply"));
}

}  // namespace mesh_command_test
