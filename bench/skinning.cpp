// `hsi4d bench skinning`: time of the SMPL-X body on the tape, forward and backward with respect to its pose, and of
// the Gaussians on it.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>

#include <nlohmann/json.hpp>

#include "autodiff/elementwise.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "bench/list.h"
#include "bench/timing.h"
#include "body/avatar.h"
#include "body/procedural_body.h"
#include "body/smplx_body.h"
#include "core/parallel.h"
#include "core/random.h"
#include "core/stopwatch.h"
#include "core/table.h"
#include "pipelines/draw/posed_splats.h"

namespace hsi4d::cli {

namespace {

/// One step of one workload; `both` is forward and then backward.
struct SkinningMeasurement : BenchTime {
  Index vertices = 0;   ///< 0 where Gaussians are posed
  Index gaussians = 0;  ///< 0 where vertices are
  Index joints = 0;
  Index corrective_columns = 0;  ///< that follow every pose
  Index table_bytes = 0;         ///< of these columns, read once in each direction
  double packing_error_m = 0;    ///< most that packed numbers can move a vertex along an axis
};

constexpr Index kVertices = 10475;

struct BodyWorkload {
  const char* name;
  bool hands_move, correctives, packed;
  bool is_posing = false;  // Gaussians are posed instead of vertices
};
constexpr std::array<BodyWorkload, 6> kBodyWorkloads = {{{"smplx", true, true, true},
                                                         {"smplx_floats", true, true, false},
                                                         {"fixed_hands", false, true, true},
                                                         {"fixed_hands_floats", false, true, false},
                                                         {"no_correctives", true, false, false},
                                                         {"posing", true, false, false, true}}};

/// Largest corrective of a joint at a distance, metres: 5 mm at the joint, 0.3 mm everywhere.
double corrective_size(double distance) { return 0.0003 + 0.0047 * std::exp(-distance * distance / (2 * 0.1 * 0.1)); }

/// The procedural body with as many vertices as SMPL-X, and correctives that fall off with the distance from the joint.
SmplxModel made_up_model() {
  const BodyModel body = procedural_body();
  SmplxModel model;
  model.source = "bench";
  model.parents = body.parents;
  model.joints = body.joints;
  model.weights = {kVertices, kSmplxJoints, std::vector<double>(static_cast<std::size_t>(kVertices * kSmplxJoints))};
  model.correctives.resize(static_cast<std::size_t>(3 * kVertices * 9 * (kSmplxJoints - 1)));
  const Random random(0, random_stream("bench.skinning"));
  for (Index v = 0; v < kVertices; ++v) {
    const Index from = v * body.vertex_count() / kVertices;
    const float* x = body.vertices.data() + 3 * from;
    for (int i = 0; i < 3; ++i) model.vertices.push_back(static_cast<double>(x[i]));
    for (Index k = 0; k < body.weights.per_vertex; ++k) {
      const auto at = static_cast<std::size_t>(from * body.weights.per_vertex + k);
      model.weights.weights[static_cast<std::size_t>(v * kSmplxJoints + body.weights.indices[at])] +=
          body.weights.weights[at];
    }
    for (Index j = 1; j < kSmplxJoints; ++j) {
      double squared = 0;
      for (Index i = 0; i < 3; ++i) {
        const double d = static_cast<double>(x[i]) - body.joints[static_cast<std::size_t>(3 * j + i)];
        squared += d * d;
      }
      const double size = corrective_size(std::sqrt(squared));
      for (Index i = 0; i < 27; ++i) {
        const Index at = (3 * v + i / 9) * 9 * (kSmplxJoints - 1) + 9 * (j - 1) + i % 9;
        model.correctives[static_cast<std::size_t>(at)] =
            size * (2 * random.uniform(static_cast<std::uint64_t>(at)) - 1);
      }
    }
  }
  return model;
}

/// A body on a tape with all its pose to be optimised.
struct RecordedBody {
  Tape<float> tape;
  SmplxParameters<float> p;
  PosedSmplx<float> posed;
  std::vector<float> cotangent;
  std::vector<Var<float>> moved;

  RecordedBody(const SmplxBody<float>& body, bool hands_move) {
    const Random random(1, random_stream("bench.skinning"));
    std::uint64_t at = 0;
    const auto leaf = [&](const char* name, Index rows) {
      const Var<float> var = tape.parameter(name, shape_of(rows, 3));
      const Array<float> numbers = tape.write(var);
      for (Index i = 0; i < 3 * rows; ++i) numbers.data[i] = 0.6F * (random.uniform<float>(at++) - 0.5F);
      return var;
    };
    p.global_orient = leaf("global_orient", 1);
    p.body_pose = leaf("body_pose", 21);
    p.jaw_pose = leaf("jaw_pose", 1);
    p.leye_pose = leaf("leye_pose", 1);
    p.reye_pose = leaf("reye_pose", 1);
    p.left_hand_pose = leaf("left_hand_pose", 15);
    p.right_hand_pose = leaf("right_hand_pose", 15);
    p.transl = leaf("transl", 1);
    if (!hands_move) {
      tape.freeze(p.left_hand_pose);
      tape.freeze(p.right_hand_pose);
    }
    posed = pose_smplx(tape, body, p);
    for (Index i = 0; i < 3 * body.vertex_count(); ++i) cotangent.push_back(random.uniform<float>(at++) - 0.5F);
    moved = {p.global_orient, p.body_pose, p.jaw_pose, p.leye_pose, p.reye_pose, p.transl};
    if (hands_move) moved.insert(moved.end(), {p.left_hand_pose, p.right_hand_pose});
  }

  /// A step of everything that is optimised.
  void move() {
    for (const Var<float> leaf : moved) tape.write(leaf).data[0] += 1e-3F;
  }
};

bool is_hand(SmplxPart part) { return part == SmplxPart::kLeftHand || part == SmplxPart::kRightHand; }

SkinningMeasurement measured(const BodyWorkload& workload, const SmplxBody<float>& body, const char* step, int threads,
                             const std::vector<double>& seconds) {
  SkinningMeasurement m{bench_time(std::string("skinning/") + workload.name + "/" + step, threads, seconds)};
  m.vertices = body.vertex_count();
  m.joints = body.joint_count();
  for (std::size_t part = 0; part < kSmplxParts; ++part) {
    const Directions<float>& correctives = body.tables().correctives[part].directions();
    m.packing_error_m += correctives.largest_error();
    if (!workload.hands_move && is_hand(static_cast<SmplxPart>(part))) continue;
    m.corrective_columns += correctives.columns();
    m.table_bytes += correctives.bytes();
  }
  return m;
}

void bench_body(const BodyWorkload& workload, const SmplxModel& model, const BenchOptions& options,
                const std::function<void(const SkinningMeasurement&)>& report) {
  SmplxBodyOptions body_options;
  body_options.correctives = workload.correctives;
  body_options.packing = workload.packed ? kCorrectivePacking : 0;
  const SmplxBody<float> body(model, body_options);
  RecordedBody r(body, workload.hands_move);
  constexpr int kWarmUp = 3;
  std::vector<double> forward, backward, both;
  for (int i = -kWarmUp; i < options.repeats; ++i) {
    r.move();
    Stopwatch watch;
    r.tape.forward(r.posed.vertices);
    const double first = watch.lap();
    r.tape.backward(r.posed.vertices, r.cotangent);
    const double second = watch.lap();
    if (i < 0) continue;
    forward.push_back(first);
    backward.push_back(second);
    both.push_back(first + second);
  }
  report(measured(workload, body, "forward", options.threads, forward));
  report(measured(workload, body, "backward", options.threads, backward));
  report(measured(workload, body, "both", options.threads, both));
}

// --- Gaussians -------------------------------------------------------------------------------------------------------

constexpr Index kPosedGaussians = 50000;

/// Nanoseconds that the nodes from rotations to posed Gaussians have taken so far, forward and backward.
std::array<double, 2> posing_time(const Tape<float>& tape) {
  std::array<double, 2> time = {0, 0};
  for (const NodeStatistics& node : tape.statistics()) {
    if (node.name != "rotations_from_axis_angle" && node.name != "kinematic_chain" && node.name != "skin_frames")
      continue;
    time[0] += node.forward_ns;
    time[1] += node.backward_ns;
  }
  return time;
}

/// An avatar's means and axes by the pose, as a frame graph has them, beside a loss that looks at every number.
void bench_posing(const BodyWorkload& workload, const BenchOptions& options,
                  const std::function<void(const SkinningMeasurement&)>& report) {
  const Avatar avatar = surface_avatar(procedural_body(), {.gaussians = kPosedGaussians});
  Tape<float> tape;
  const auto constant = [&tape](const char* name, const std::vector<float>& numbers, Index cols) {
    const Var<float> var = tape.constant(name, shape_of(static_cast<Index>(numbers.size()) / cols, cols));
    tape.set(var, numbers);
    return var;
  };
  const Random random(2, random_stream("bench.skinning"));
  std::uint64_t at = 0;
  const auto noise = [&](Index count) {
    std::vector<float> numbers;
    for (Index i = 0; i < count; ++i) numbers.push_back(random.uniform<float>(at++) - 0.5F);
    return numbers;
  };
  const Var<float> pose = tape.parameter("pose", shape_of(kSmplxJoints, 3));
  tape.set(pose, noise(3 * kSmplxJoints));
  const GaussianVars<float> human = {constant("means", avatar.means, 3), constant("quats", avatar.quats, 4),
                                     constant("log_scales", avatar.log_scales, 3),
                                     constant("opacity_logits", avatar.opacity_logits, 1),
                                     constant("colors", avatar.colors, 3)};
  const Var<float> transl = tape.parameter("transl", shape_of(1, 3));
  const SplatInputs<float> posed = skinned_splats(human, rotations_from_axis_angle(pose), transl, avatar);
  const Var<float> loss = sum(posed.means * constant("d_means", noise(3 * kPosedGaussians), 3)) +
                          sum(posed.axes * constant("d_axes", noise(9 * kPosedGaussians), 9));
  tape.set_profiling(true);
  constexpr int kWarmUp = 3;
  std::array<std::vector<double>, 3> seconds;  // forward, backward, both
  for (int i = -kWarmUp; i < options.repeats; ++i) {
    tape.write(pose).data[3] += 1e-3F;
    const std::array<double, 2> before = posing_time(tape);
    tape.forward(loss);
    tape.backward(loss);
    const std::array<double, 2> after = posing_time(tape);
    if (i < 0) continue;
    for (std::size_t k = 0; k < 2; ++k) seconds[k].push_back(1e-9 * (after[k] - before[k]));
    seconds[2].push_back(seconds[0].back() + seconds[1].back());
  }
  constexpr std::array<const char*, 3> kDirections = {"forward", "backward", "both"};
  for (std::size_t k = 0; k < 3; ++k) {
    SkinningMeasurement m{
        bench_time(std::string("skinning/") + workload.name + "/" + kDirections[k], options.threads, seconds[k])};
    m.gaussians = kPosedGaussians;
    m.joints = kSmplxJoints;
    report(m);
  }
}

/// Of the correctives, by forward and backward; 0 where there are none.
double bytes_read(const SkinningMeasurement& m) {
  return (m.name.ends_with("/both") ? 2 : 1) * static_cast<double>(m.table_bytes);
}

/// Billions of them a second.
double rate(const SkinningMeasurement& m) { return m.median_ms > 0 ? bytes_read(m) / m.median_ms / 1e6 : 0; }

std::string json_line(const SkinningMeasurement& m) {
  nlohmann::ordered_json line = {{"gaussians", m.gaussians}, {"joints", m.joints}};
  if (m.gaussians == 0)
    line = {{"vertices", m.vertices},
            {"joints", m.joints},
            {"corrective_columns", m.corrective_columns},
            {"table_bytes", m.table_bytes},
            {"packing_error_m", m.packing_error_m},
            {"gbytes_per_s", rate(m)}};
  return bench_line(m, line.dump());
}

/// A body of 10,475 vertices and 486 correctives, made up from the procedural body, in float, with a fixed cotangent on
/// the vertices; and "posing", an avatar of 50,000 Gaussians from its joints' rotations to means and axes, with
/// cotangents on both.
BenchText measure_skinning(const BenchOptions& options) {
  std::string json;
  Table table{.head = {"", "median ms", "least ms", "points", "columns", "MB read", "GB/s"}, .align = "lr"};
  const auto report = [&](const SkinningMeasurement& m) {
    table.rows.push_back({m.name, Cell(m.median_ms, 3), Cell(m.min_ms, 3), m.vertices + m.gaussians,
                          m.corrective_columns, tenths(bytes_read(m) / 1e6), tenths(rate(m))});
    json += json_line(m);
  };
  std::optional<SmplxModel> model;
  for (const BodyWorkload& workload : chosen_workloads("skinning", options.workloads, kBodyWorkloads)) {
    if (!model && !workload.is_posing) model = made_up_model();
    with_threads(options.threads, [&] {
      if (workload.is_posing) return bench_posing(workload, options, report);
      bench_body(workload, *model, options, report);
    });
  }
  return {table_text(table), std::move(json)};
}

}  // namespace

BenchTopic skinning_topic() {
  return {"skinning", "Measure the body: skinning and its gradient, of vertices and of Gaussians", measure_skinning};
}

}  // namespace hsi4d::cli
