// `hsi4d mesh`: a closed mesh from Gaussians.
#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "core/camera_file.h"
#include "core/check.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/stopwatch.h"
#include "optim/solid/mesh_topology.h"
#include "optim/solid/solid_mesh.h"
#include "pipelines/cli/interrupt.h"
#include "pipelines/cli/list.h"
#include "pipelines/cli/options.h"
#include "pipelines/cli/scene_options.h"
#include "pipelines/cli/terminal.h"
#include "pipelines/cli/text.h"
#include "pipelines/scan/surface.h"
#include "splat/files/splat_file.h"

namespace hsi4d::cli {

namespace {

struct MeshArguments {
  std::string gaussians, cameras, out, box, distances, occupancy, up = "z";
  bool is_object = false;
  std::optional<double> voxel, occupancy_voxel;
  double adaptivity = 0;
  std::optional<int> more_views, size_px, threads;
  std::optional<int> smallest;
  bool quiet = false;
};

const std::string kMeshCommand = "hsi4d mesh: ";
constexpr double kDistanceReach = 8;  // voxels of the level set on either side

SurfaceSettings settings_of(const MeshArguments& a) {
  SurfaceSettings settings;
  settings.is_object = a.is_object;
  if (!a.cameras.empty()) settings.cameras = read_cameras(a.cameras);
  if (!a.is_object && a.cameras.empty())
    throw UserError(kMeshCommand + "where is free space? --cameras of the pictures of a scene tell it, or --object");
  settings.voxel = a.voxel;
  check_range(a.voxel, kMeshCommand + "--voxel", 1e-5, 10);
  check_range(a.occupancy_voxel, kMeshCommand + "--occupancy-voxel", 1e-4, 10);
  check_range(a.adaptivity, kMeshCommand + "--adaptivity", 0, 1);
  if (!a.box.empty()) {
    const std::vector<double> numbers = parse_numbers(a.box, 6, kMeshCommand + "--box", "x,y,z,x,y,z");
    std::copy_n(numbers.begin(), 6, settings.box.emplace().begin());
  }
  settings.more_views = a.more_views.value_or(static_cast<int>(settings.more_views));
  settings.size_px = a.size_px.value_or(settings.size_px);
  check_range(settings.size_px, kMeshCommand + "--size", 16, 8192);
  settings.smallest = a.smallest.value_or(static_cast<int>(settings.smallest));
  if (a.is_object && settings.cameras.empty() && settings.more_views < 4)
    throw UserError(kMeshCommand + "--views: an object needs 4 and more, or --cameras");
  return settings;
}

/// One line a piece, the largest first.
std::string pieces_text(const TriangleMesh& mesh) {
  constexpr std::size_t kShown = 5;
  std::vector<TriangleMesh> parts = connected_parts(mesh);
  std::stable_sort(parts.begin(), parts.end(),
                   [](const TriangleMesh& a, const TriangleMesh& b) { return a.faces.size() > b.faces.size(); });
  std::string text;
  for (std::size_t i = 0; i < std::min(parts.size(), kShown); ++i) {
    const double volume = signed_volume(parts[i]);
    text += "  " + std::string(volume < 0 ? "a hollow" : "a solid") + " of " + short_number(std::abs(volume)) +
            " m3, " + count_text(std::ssize(parts[i].faces), "triangle") + ", genus " +
            std::to_string(genus(parts[i])) + "\n";
  }
  if (parts.size() > kShown)
    text += "  and " + count_text(static_cast<std::int64_t>(parts.size() - kShown), "smaller piece") + "\n";
  return text;
}

std::string cleaned_text(const CleanUp& cleaned) {
  std::string text;
  if (cleaned.closed_pockets > 0)
    text += "  filled: " + count_text(cleaned.closed_pockets, "pocket") + " of free space, not to be reached\n";
  if (cleaned.removed_specks > 0)
    text += "  left out: " + count_text(cleaned.removed_specks, "small piece") + " in free space\n";
  return text;
}

/// Throws UserError unless all that is asked for can be written, and replaces nothing that is read.
void check_outputs(const MeshArguments& a) {
  if (!a.distances.empty()) check_ending(a.distances, kMeshCommand + "--distances", {".vdb"});
  if (!a.occupancy.empty()) check_ending(a.occupancy, kMeshCommand + "--occupancy", {".npz"});
  if (a.occupancy.empty() && (a.occupancy_voxel || a.up != "z"))
    throw UserError(kMeshCommand + "--occupancy-voxel and --up are of the grid of --occupancy, which is not asked for");
  for (const std::string& file : {a.out, a.distances, a.occupancy}) {
    if (file.empty()) continue;
    check_no_input(file, kMeshCommand, {a.gaussians, a.cameras});
    check_writable(file);
  }
}

/// Writes the mesh and what else is asked for. Returns what the command prints.
/// Throws UserError for options and files, and as scanned_solid and surface_of.
std::string make_mesh(const MeshArguments& a) {
  mesh_ending(a.out);
  check_outputs(a);
  if (a.up != "y" && a.up != "z") throw UserError(kMeshCommand + "--up: " + a.up + "; allowed: y, z");
  Stopwatch watch;
  const SurfaceSettings settings = settings_of(a);
  const SplatFile file = read_splats_with_warnings(a.gaussians);
  ScannedSolid solid = scanned_solid(file.gaussians, settings, observer_on_terminal(a.quiet));
  const TriangleMesh mesh = surface_of(solid.grid, a.adaptivity);
  if (!a.occupancy.empty())
    write_occupancy(a.occupancy, occupancy_of(solid.grid, a.occupancy_voxel.value_or(solid.grid.voxel), a.up == "y"));
  if (!a.distances.empty()) write_distances(a.distances, solid.grid, kDistanceReach);
  write_mesh(a.out, mesh);
  return a.out + ": " + std::to_string(mesh.vertices.size()) + " vertices, " +
         count_text(std::ssize(mesh.faces), "triangle") + ", from " + count_text(std::ssize(solid.views), "view") +
         ", voxels of " + short_number(1000 * solid.grid.voxel) + " mm, in " + duration_text(watch.lap()) + "\n" +
         pieces_text(mesh) + cleaned_text(solid.cleaned);
}

std::string mesh_command(const MeshArguments& a) {
  const InterruptWatch watch;
  std::string text;
  const int threads = a.threads.value_or(0);
  with_threads(threads > 0 ? threads : thread_count(), [&] { text = make_mesh(a); });
  return text;
}

}  // namespace

void add_mesh(CLI::App& app, Program& program) {
  MeshArguments& a = program.options<MeshArguments>();
  CLI::App& command = *app.add_subcommand("mesh", "Make a closed mesh of a scene or an object from its Gaussians");
  command.add_option("GAUSSIANS", a.gaussians, "Of a scene or of an object")->required();
  command.add_option("--out", a.out, "Where to: .ply, .obj or .glb")->type_name("M")->required();
  command.add_option("--cameras", a.cameras, "Cameras that took the pictures: they are in free space")
      ->type_name("C.json");
  command.add_flag("--object", a.is_object, "It is seen from all around, and outside of it is free");
  command
      .add_option("--voxel", a.voxel,
                  "Metres between nodes; without: a 400th of a scene's longest side, a 200th of an object's")
      ->type_name("M");
  command.add_option("--box", a.box, "Where to look; without: what the cameras see")->type_name("x,y,z,x,y,z");
  command.add_option("--views", a.more_views, "Cameras that are placed beside the given ones; 144 without")
      ->check(whole_number(100000))
      ->type_name("N");
  command.add_option("--size", a.size_px, "Pixels along the longest side of what cameras see; 512 without")
      ->type_name("PX");
  command.add_option("--smallest", a.smallest, "Voxels of a piece in free space that is kept; 512 without")
      ->check(whole_number(1000000000))
      ->type_name("N");
  command.add_option("--adaptivity", a.adaptivity, "0: small triangles everywhere; to 1: larger where it is flat")
      ->type_name("A");
  command.add_option("--distances", a.distances, "Also signed distances, as a level set of OpenVDB")
      ->type_name("F.vdb");
  command.add_option("--occupancy", a.occupancy, "Also what is occupied, for evaluate --occupancy")->type_name("F.npz");
  command.add_option("--occupancy-voxel", a.occupancy_voxel, "Its voxels; without: those of --voxel")->type_name("M");
  command.add_option("--up", a.up, "Which of its axes is up: z, or y, as of TRUMANS and LINGO")->type_name("z|y");
  add_threads(command, a.threads);
  command.add_flag("--quiet", a.quiet, "No progress on stderr");
  run_when_chosen(command, program, [&] { return mesh_command(a); });
}

}  // namespace hsi4d::cli
