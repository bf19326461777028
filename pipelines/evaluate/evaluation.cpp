#include "pipelines/evaluate/evaluation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

#include "body/motion_edit.h"
#include "core/check.h"
#include "core/file.h"
#include "core/rotation.h"
#include "core/text.h"
#include "optim/object_points.h"
#include "optim/solid/mesh_file.h"
#include "pipelines/evaluate/evaluated_body.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/pose_estimate.h"
#include "pipelines/input/scene_setup.h"
#include "pipelines/metrics/clip_embeddings.h"
#include "pipelines/metrics/contact_metrics.h"
#include "pipelines/metrics/penetration.h"
#include "pipelines/record/folder.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

namespace {

namespace fs = std::filesystem;

/// All that is known of one input while it is measured.
struct Measurement {
  const EvaluationSettings& settings;
  const std::string& input;
  Evaluation result = {};
  Track estimate = {};
  std::optional<EvaluatedBody> body = {}, truth_body = {};
  AlignedTracks tracks = {};
  std::vector<Gaussians> objects = {};         // of the estimate, in its order; empty: not known
  std::vector<std::string> object_names = {};  // of those

  std::vector<const Gaussians*> object_pointers() const {
    std::vector<const Gaussians*> pointers;
    for (const Gaussians& object : objects) pointers.push_back(&object);
    return pointers;
  }
};

/// The first that is not empty of what `of` says of some paths.
template <class F>
auto first_of(const std::vector<std::string>& paths, const F& of) {
  for (const std::string& path : paths) {
    auto found = of(path);
    if (!found.empty()) return found;
  }
  return decltype(of(std::string())){};
}

/// One path, or of a chain that of each clip; none where there is no truth.
std::vector<std::string> truths_of(const EvaluationSettings& settings, const std::string& input) {
  if (!settings.truth.empty()) return {settings.truth};
  return is_run_folder(input) ? truths_of_run(input) : std::vector<std::string>();
}

EvaluatedBody put_on_body(const EvaluationSettings& settings, const std::string& avatar, Track& track) {
  return settings.body_model.empty() ? EvaluatedBody::of_avatar(avatar, track)
                                     : EvaluatedBody::of_model(settings.body_model, track);
}

/// The avatar of whose body the joints are, where no model is named.
std::string avatar_for(const EvaluationSettings& settings, const std::string& input,
                       const std::vector<std::string>& folders) {
  if (!settings.body_model.empty() || !settings.avatar.empty()) return settings.avatar;
  const std::string avatar = first_of(folders, avatar_of_track);
  if (!avatar.empty()) return avatar;
  std::vector<std::string> names = {input};
  for (const std::string& folder : folders) {
    if (folder != input) names.push_back(folder);
  }
  throw UserError("hsi4d evaluate: " + joined(names) + ": " + (names.size() > 1 ? "neither says" : "does not say") +
                  " of what body it is, and errors are those of its joints; --body-model M.npz or --avatar "
                  "F.safetensors says it");
}

/// @param upright  as UpHints has it
TrackOptions track_options(const EvaluationSettings& settings, const std::vector<std::string>& folders,
                           const std::optional<Vector3<double>>& upright) {
  TrackOptions options;
  options.frame_rate = settings.from_rate;
  options.person = settings.person;
  options.up = settings.up;
  options.upright = upright;
  options.objects = settings.objects;
  const std::vector<std::string> names = first_of(folders, object_names_of_track);
  if (names.size() == 1) options.object_name = names.front();
  return options;
}

/// Of the truth, of whose motions the options say what these leave open themselves.
TrackOptions truth_options(const EvaluationSettings& settings, const std::vector<std::string>& folders) {
  TrackOptions options = track_options(settings, folders, {});
  options.objects.clear();
  options.fills_in = true;
  return options;
}

// ---- Where things are ----

/// The pelvis of frame 0 in the world, of a track on its body.
Rigid<double> first_pelvis(const Track& track) {
  HSI4D_CHECK(track.motion.pelvis_rest.has_value(), track.name + ": is on no body");
  return world_pelvis(track.motion.poses.front(), *track.motion.pelvis_rest);
}

/// The pelvis that the run or dataset begins with, where it is of use; nothing where there is none.
std::optional<Rigid<double>> initial_pelvis(const std::string& avatar, const std::vector<std::string>& folders,
                                            const Measurement& m) {
  if (m.settings.align == MotionAlign::kNone && fs::is_directory(m.input)) return std::nullopt;
  const std::string initial = first_of(folders, initial_of_track);
  if (initial.empty()) return std::nullopt;
  Track first;
  first.name = initial;
  first.motion = read_motion_with_warnings(initial);
  check_begins_with_frame_0(first.motion, initial, "the human of frame 0 is needed");
  put_on_body(m.settings, avatar, first);
  return first_pelvis(first);
}

/// The second of the video at which a track begins.
double begin_of(const Track& track) { return track.motion.first_frame / track.motion.frame_rate; }

/// The pelvis in the world at a second of the video, of a track on its body.
Rigid<double> pelvis_at(const Track& track, double second) {
  return world_pelvis(body_at(track, second), *track.motion.pelvis_rest);
}

/// Lays the estimate on a pelvis, that of its own first pose: all that it holds moves alike.
/// @param truth  has the pelvis later too, and the two are laid on each other where both have begun; null: there is
/// none
void lay_on(std::optional<Rigid<double>> pelvis, const Track* truth, Measurement& m) {
  if (m.settings.align == MotionAlign::kNone) return;
  Rigid<double> own = first_pelvis(m.estimate);
  const double begin = std::max(begin_of(m.estimate), truth == nullptr ? 0 : begin_of(*truth));
  if (begin > 0 && truth != nullptr) {
    own = pelvis_at(m.estimate, begin);
    pelvis = pelvis_at(*truth, begin);
  } else if (begin > 0 && pelvis) {
    m.result.notes.push_back("begins with frame " + number_text(m.estimate.motion.first_frame) +
                             ", and is laid on the human of frame 0 there, as no truth says where the human is then");
  }
  if (!pelvis)
    throw UserError("hsi4d evaluate: --align: " + m.input +
                    ": there is no frame 0 to lay it on; --truth or --data has one");
  move_world(world_laid_on(own, *pelvis, m.settings.align), m.estimate);
}

/// The mean of the centres in an object's file, about which its poses act.
Vector3<double> centroid_in_file(const std::string& file) {
  const Gaussians gaussians = read_splats_with_warnings(file).gaussians;
  Vector3<double> sum = Vector3<double>::Zero();
  for (Index g = 0; g < gaussians.count(); ++g) sum += Vector3<float>(gaussians.means.data() + 3 * g).cast<double>();
  return gaussians.count() == 0
             ? sum
             : Vector3<double>(gaussians.origin_world + sum / static_cast<double>(gaussians.count()));
}

/// --object-surface of an object; empty: not given.
std::string surface_of_object(const EvaluationSettings& settings, const std::string& name) {
  for (const auto& [object, file] : settings.object_surfaces) {
    if (object == name) return file;
  }
  return "";
}

/// Where in its own file the point is that an object's poses act about: the mean of its Gaussians' centres, where these
/// are not known that of its mesh's vertices. Nothing where neither is known.
std::optional<Vector3<double>> centroid_of_object(const EvaluationSettings& settings,
                                                  const std::vector<std::string>& folders, const std::string& name) {
  const std::string gaussians =
      first_of(folders, [&name](const std::string& path) { return object_file_of_track(path, name); });
  if (!gaussians.empty()) return centroid_in_file(gaussians);
  const std::string surface = surface_of_object(settings, name);
  return surface.empty() ? std::nullopt : std::optional(mesh_centroid(surface));
}

/// Objects whose poses act about the mean m of their meshes' vertices, where Gaussians have another centroid c in the
/// same file's frame: t' = R (c − m) + t. Without a mesh nobody knows m, and it is taken for c.
void place_about_centroids(const std::vector<std::string>& folders, Measurement& m, Track& track) {
  for (std::size_t o = 0; o < track.objects.size(); ++o) {
    const std::string surface = surface_of_object(m.settings, track.objects[o]);
    if (surface.empty()) {
      m.result.notes.push_back("the poses of " + track.objects[o] + " in " + track.name +
                               " act about the middle of its mesh, which is not known and taken for that of its "
                               "Gaussians (--object-surface " +
                               track.objects[o] + "=F says it)");
      continue;
    }
    const Vector3<double> between = *centroid_of_object(m.settings, folders, track.objects[o]) - mesh_centroid(surface);
    for (std::vector<ObjectPose>& poses : track.object_poses)
      poses[o].translation += so3_exp(poses[o].rotation) * between;
  }
}

/// Objects whose translations are of the origins of their files get those of their centroids c: t' = R c + t. Where a
/// centroid is not known, objects are left out.
void place_objects(const std::vector<std::string>& folders, Measurement& m, Track& track) {
  if (track.objects_are_of_meshes) place_about_centroids(folders, m, track);
  if (!track.objects_are_of_origins) return;
  for (std::size_t o = 0; o < track.objects.size(); ++o) {
    const auto centroid = centroid_of_object(m.settings, folders, track.objects[o]);
    if (!centroid) {
      m.result.notes.push_back(
          "obj_trans of " + track.name + " is the place of the origin of the object's file, which " +
          "is not known: no object (--data or --object-surface " + track.objects[o] + "=F says where it is)");
      track.objects.clear();
      track.object_poses.clear();
      break;
    }
    for (std::vector<ObjectPose>& poses : track.object_poses)
      poses[o].translation += so3_exp(poses[o].rotation) * *centroid;
  }
  track.objects_are_of_origins = false;
}

// ---- What is measured ----

void add(const MetricValues& means, const std::vector<MetricValues>& by_frame, Evaluation& result) {
  result.values.insert(result.values.end(), means.begin(), means.end());
  for (FrameMetrics& frame : result.per_frame) {
    const MetricValues& more = by_frame[static_cast<std::size_t>(frame.frame)];
    frame.values.insert(frame.values.end(), more.begin(), more.end());
  }
}

/// The objects' Gaussians, where all are known.
void read_objects(const std::vector<std::string>& folders, Measurement& m) {
  std::vector<std::string> files;
  for (const std::string& name : m.estimate.objects)
    files.push_back(first_of(folders, [&name](const std::string& path) { return object_file_of_track(path, name); }));
  if (std::find(files.begin(), files.end(), "") != files.end()) files.clear();
  for (const std::string& file : files) m.objects.push_back(read_object(file));
  if (!files.empty()) m.object_names = m.estimate.objects;
  if (files.empty() && !m.estimate.object_poses.empty())
    m.result.notes.push_back("the Gaussians of " + joined(m.estimate.objects) +
                             " are not known: no contact and no ADD (--data says where they are)");
}

/// The points of those objects that are compared with the truth, in its order.
std::optional<std::vector<const Gaussians*>> compared_objects(const Measurement& m, const Track& truth) {
  std::vector<const Gaussians*> pointers;
  for (const std::string& name : truth.objects) {
    const auto at = std::find(m.object_names.begin(), m.object_names.end(), name);
    if (at == m.object_names.end()) return std::nullopt;
    pointers.push_back(&m.objects[static_cast<std::size_t>(at - m.object_names.begin())]);
  }
  return pointers.empty() ? std::nullopt : std::optional(pointers);
}

void measure_errors(const Track& truth, Measurement& m) {
  const auto compared = compared_objects(m, truth);
  std::optional<ObjectPoints> points;
  if (compared) points.emplace(*compared);
  const ObjectPoints* const known = points ? &*points : nullptr;
  m.result.values = sequence_summary(m.tracks.estimate, m.tracks.truth, m.tracks.frame_rate, known);
  m.result.per_frame = sequence_errors(m.tracks.estimate, m.tracks.truth, m.tracks.frame_rate, known);
}

/// Frames without errors, and the jitter.
void begin_without_truth(Measurement& m) {
  for (int t = 1; t < static_cast<int>(m.tracks.estimate.size()); ++t) m.result.per_frame.push_back({t, {}});
  m.result.values = motion_jitter(m.tracks.estimate, m.tracks.frame_rate);
}

void measure_feet_and_hands(Measurement& m) {
  const std::vector<MetricValues> sliding = sliding_by_frame(m.result.joints, m.tracks.frame_rate);
  add(mean_after_first(sliding), sliding, m.result);
  const std::vector<MetricValues> drift = floor_drift_by_frame(m.result.joints);
  add(mean_after_first(drift), drift, m.result);
  if (m.objects.empty()) return;
  const std::vector<MetricValues> contact =
      m.body->avatar() != nullptr ? contact_by_frame(*m.body->avatar(), m.object_pointers(), m.tracks.states)
                                  : contact_share_by_frame(m.result.joints, m.object_pointers(), m.tracks.states);
  add(mean_after_first(contact), contact, m.result);
}

/// Places that are known to be free: where the first camera is, and the joints of the first frame; of the truth where
/// it has them.
std::vector<Vector3<double>> free_places(const Measurement& m) {
  std::vector<const FrameState*> firsts;
  for (const std::vector<FrameState>* const states : {&m.tracks.truth, &m.tracks.estimate}) {
    if (!states->empty()) firsts.push_back(&states->front());
  }
  std::vector<Vector3<double>> places;
  for (const FrameState* const first : firsts) {
    if (!first->camera_from_world || !places.empty()) continue;
    places.push_back(inverse(*first->camera_from_world).translation);
  }
  const std::vector<double>& joints = firsts.front()->joints;
  for (std::size_t i = 0; i + 2 < joints.size(); i += 3) places.emplace_back(joints.data() + i);
  return places;
}

Solid scene_solid(const std::vector<std::string>& folders, Measurement& m) {
  const EvaluationSettings& s = m.settings;
  if (!s.surface.empty()) return mesh_solid(s.surface);
  if (!s.occupancy.empty()) return occupancy_solid(s.occupancy);
  const std::string surface = s.scene.empty() ? first_of(folders, surface_of_track) : "";
  if (!surface.empty()) return mesh_solid(surface);
  const std::string scene = s.scene.empty() ? first_of(folders, scene_of_track) : s.scene;
  if (scene.empty()) {
    m.result.notes.push_back(
        "penetration is not measured: nothing says what is solid (--surface, --occupancy, --scene, --data)");
    return {};
  }
  Solid solid = gaussian_solid(read_splats_with_warnings(scene).gaussians, free_places(m), scene);
  if (!solid.distance)
    m.result.notes.push_back("penetration is not measured: no Gaussian of " + scene +
                             " is opaque, flat, not alone and seen from the first frame");
  return solid;
}

void add_penetration(const std::vector<Penetration>& counts, MetricValues (*values)(const Penetration&),
                     Evaluation& result) {
  std::vector<MetricValues> by_frame;
  for (const Penetration& count : counts) by_frame.push_back(values(count));
  add(values(sum_after_first(counts)), by_frame, result);
}

void measure_scene(const std::vector<std::string>& folders, const std::vector<std::vector<double>>& points,
                   Measurement& m) {
  const Solid solid = scene_solid(folders, m);
  if (!solid.distance) return;
  m.result.surface = solid.source;
  m.result.notes.push_back("penetration by " + solid.source + ", of " + std::to_string(points.front().size() / 3) +
                           " points of the body");
  std::vector<Penetration> counts;
  for (const std::vector<double>& frame : points) counts.push_back(penetration_of(solid.distance, frame));
  add_penetration(counts, penetration_values, m.result);
}

Solid solid_of_object(const std::vector<std::string>& folders, std::size_t index, const Measurement& m) {
  const std::string& name = m.estimate.objects[index];
  const std::string surface = surface_of_object(m.settings, name);
  if (!surface.empty()) return object_mesh_solid(surface, *centroid_of_object(m.settings, folders, name));
  return m.objects.empty() ? Solid{} : object_solid(m.objects[index], name);
}

void measure_objects(const std::vector<std::string>& folders, const std::vector<std::vector<double>>& points,
                     Measurement& m) {
  if (m.estimate.object_poses.empty()) return;
  std::vector<SignedDistance> distances;
  std::vector<std::string> sources;
  for (std::size_t o = 0; o < m.estimate.objects.size(); ++o) {
    const Solid solid = solid_of_object(folders, o, m);
    distances.push_back(solid.distance);
    if (solid.distance) sources.push_back(solid.source);
  }
  if (sources.empty()) return;
  m.result.notes.push_back("penetration of objects by " + joined(sources));
  std::vector<Penetration> counts;
  for (std::size_t t = 0; t < points.size(); ++t) {
    counts.push_back(penetration_of(distances, rigids_of(m.tracks.states[t].objects), points[t]));
  }
  add_penetration(counts, object_penetration_values, m.result);
}

/// What a run has measured of its images: they are not drawn again.
void take_image_errors(Measurement& m) {
  const std::string file = RunPaths{m.input}.summary();
  if (!is_run_folder(m.input) || m.settings.frame_rate || !fs::exists(file)) return;
  const RunSummary summary = parse_summary(read_text_file(file), file);
  if (summary.metrics.empty() || std::ssize(summary.per_frame) != std::ssize(m.result.per_frame)) return;
  const auto take = [](const MetricValues& from, MetricValues& to) {
    for (const char* const name : kImageMetrics) {
      if (const double* const value = find_metric(from, name)) to.emplace_back(name, *value);
    }
  };
  take(summary.metrics.back().values, m.result.values);
  for (std::size_t i = 0; i < summary.per_frame.size(); ++i)
    take(summary.per_frame[i].values, m.result.per_frame[i].values);
}

void measure_clip(const std::string& file, Evaluation& result) {
  if (file.empty()) return;
  const ClipEmbeddings embeddings = read_clip_embeddings(file);
  const MetricValues values = clip_metrics(embeddings);
  result.values.insert(result.values.end(), values.begin(), values.end());
  std::string note = "CLIP by " + file + ", " + std::to_string(embeddings.frames) + " frames";
  if (!embeddings.model.empty()) note += ", " + with_escapes(embeddings.model);
  if (!embeddings.prompt.empty()) note += ", \"" + with_escapes(embeddings.prompt) + "\"";
  result.notes.push_back(std::move(note));
}

// ---- Protocols ----

/// Points of the feet that are asked for, or those that the body itself has.
std::array<Index, 4> foot_points_for(Measurement& m) {
  const std::vector<Index>& wanted = m.settings.foot_points;
  if (wanted.empty()) {
    const FootPoints feet = m.body->foot_points();
    std::vector<std::string> numbers;
    for (const Index row : feet.rows) numbers.push_back(std::to_string(row));
    m.result.notes.push_back("feet slide by points " + joined(numbers) + ", " + feet.words +
                             "; the protocol has four vertices of SMPL");
    return feet.rows;
  }
  for (const Index point : wanted) {
    if (point >= m.body->point_count())
      throw UserError("hsi4d evaluate: --foot-points: there is no point " + std::to_string(point) +
                      "; the body has 0 to " + std::to_string(m.body->point_count() - 1));
  }
  HSI4D_CHECK_EQ(wanted.size(), std::size_t{4});
  return {wanted[0], wanted[1], wanted[2], wanted[3]};
}

/// The shape of an object that is compared: a mesh, else the centres of its Gaussians.
ObjectShape shape_of_object(const std::vector<std::string>& folders, const std::string& name, const Measurement& m) {
  ObjectShape shape;
  const std::string surface = surface_of_object(m.settings, name);
  if (!surface.empty()) {
    const Vector3<double> centroid = *centroid_of_object(m.settings, folders, name);
    const TriangleMesh mesh = read_mesh(surface);
    shape.source = "the mesh " + surface;
    shape.faces = mesh.faces;
    for (const Vector3<double>& vertex : mesh.vertices) {
      const Vector3<double> place = vertex - centroid;
      shape.points.insert(shape.points.end(), place.data(), place.data() + 3);
    }
    return shape;
  }
  const auto at = std::find(m.object_names.begin(), m.object_names.end(), name);
  if (at == m.object_names.end())
    throw UserError("hsi4d evaluate: --protocol: the shape of " + name + " is not known; --object-surface " + name +
                    "=F or --data says it");
  const Gaussians& object = m.objects[static_cast<std::size_t>(at - m.object_names.begin())];
  const Index count = std::min(kSurfacePoints, object.count());
  for (Index i = 0; i < count; ++i) {
    const Vector3<double> place = Vector3<float>(object.means.data() + 3 * (i * object.count() / count)).cast<double>();
    shape.points.insert(shape.points.end(), place.data(), place.data() + 3);
  }
  shape.source = "the Gaussians of " + name;
  return shape;
}

void measure_protocol(const std::optional<Track>& truth, const std::vector<std::string>& folders, Measurement& m) {
  const Protocol protocol = m.settings.protocol;
  if (protocol == Protocol::kNone) return;
  if (!truth)
    throw UserError("hsi4d evaluate: --protocol: " + m.input +
                    ": there is no truth to compare with; --truth names one");
  if (m.body->point_count() != m.truth_body->point_count())
    throw UserError("hsi4d evaluate: --truth-body-model: has " + std::to_string(m.truth_body->point_count()) +
                    " vertices, --body-model " + std::to_string(m.body->point_count()) + "; allowed: as many");
  ProtocolSides sides{.tracks = m.tracks, .body = *m.body, .true_body = *m.truth_body};
  sides.aligned_frames = m.settings.aligned_frames;
  if (is_of_world(protocol)) {
    sides.foot_points = foot_points_for(m);
  } else {
    if (m.tracks.truth.front().world_from_object.empty())
      throw UserError("hsi4d evaluate: --protocol: " + m.input +
                      ": estimate and truth have no object in common, which the protocol measures");
    for (const std::string& name : truth->objects) sides.objects.push_back(shape_of_object(folders, name, m));
  }
  const ProtocolResult result = is_of_world(protocol) ? world_protocol(sides) : object_protocol(sides);
  m.result.values.insert(m.result.values.end(), result.values.begin(), result.values.end());
  const std::string name(choice_name(std::span<const ConfigChoice<Protocol>>(kProtocols), protocol));
  m.result.protocol = name;
  for (const std::string& note : result.notes) m.result.notes.push_back("protocol " + name + ": " + note);
}

void check_object_surfaces(const Measurement& m) {
  for (const auto& [name, file] : m.settings.object_surfaces) {
    if (std::find(m.estimate.objects.begin(), m.estimate.objects.end(), name) == m.estimate.objects.end())
      throw UserError("hsi4d evaluate: --object-surface: " + m.input + " has no object \"" + name + "\"" +
                      (m.estimate.objects.empty() ? "" : "; there is " + joined(m.estimate.objects)));
  }
}

void note_world(const Track& track, Measurement& m, const std::string& before) {
  if (!track.world.empty()) m.result.notes.push_back(before + track.world);
}

/// The truth on its body; nothing where there is none.
std::optional<Track> take_truth(const std::vector<std::string>& truths, const std::vector<std::string>& folders,
                                const std::string& avatar, Measurement& m) {
  if (truths.empty()) return std::nullopt;
  Track truth = read_joined_tracks(truths, truth_options(m.settings, folders));
  m.truth_body = m.settings.truth_body_model.empty() ? put_on_body(m.settings, avatar, truth)
                                                     : EvaluatedBody::of_model(m.settings.truth_body_model, truth);
  note_world(truth, m, "the truth: ");
  place_objects(folders, m, truth);
  return truth;
}

/// The estimate on its body, in the world of the truth.
/// @param begin  the pelvis that it should begin with
/// @param truth  null: there is none
void take_estimate(const std::optional<Rigid<double>>& begin, const Track* truth,
                   const std::vector<std::string>& folders, const std::string& avatar, Measurement& m) {
  std::optional<Vector3<double>> upright;
  if (begin) upright = Vector3<double>(begin->rotation.row(2));
  m.estimate = read_track(m.input, track_options(m.settings, folders, upright));
  m.body = put_on_body(m.settings, avatar, m.estimate);
  note_world(m.estimate, m, "");
  if (m.estimate.objects_stay)
    m.result.notes.push_back("the objects of " + m.settings.objects + " are in the scene's world, z up");
  if (truth != nullptr) {
    m.estimate.motion.frame_rate = rate_beside(m.estimate, *truth);
    m.estimate.motion.says_frame_rate = true;
  }
  lay_on(begin, truth, m);
  check_object_surfaces(m);
  place_objects(folders, m, m.estimate);
}

/// The estimate and, where there is one, the truth, on their bodies and at the same moments.
void read_tracks(const std::vector<std::string>& truths, const std::vector<std::string>& folders, Measurement& m) {
  if (!m.settings.objects.empty() && fs::is_directory(m.input))
    throw UserError("hsi4d evaluate: --objects is for a motion (.npz); " + m.input + " has objects of its own");
  const std::string avatar = avatar_for(m.settings, m.input, folders);
  const std::optional<Track> truth = take_truth(truths, folders, avatar, m);
  take_estimate(truth ? first_pelvis(*truth) : initial_pelvis(avatar, folders, m), truth ? &*truth : nullptr, folders,
                avatar, m);
  m.result.has_objects = !m.estimate.objects.empty() || (truth && !truth->objects.empty()) ||
                         !first_of(folders, object_names_of_track).empty();
  if (!truth) {
    measure_protocol(truth, folders, m);
    m.tracks = by_itself(m.estimate, m.body->skeleton(), m.settings.frame_rate);
    read_objects(folders, m);
    begin_without_truth(m);
    m.result.notes.emplace_back("there is no truth: errors are not measured (--truth names one)");
    return;
  }
  m.tracks = aligned(m.estimate, m.body->skeleton(), *truth, m.truth_body->skeleton(), m.settings.frame_rate);
  if (m.tracks.first > 0)
    m.result.notes.push_back("frames are compared from frame " + std::to_string(m.tracks.first) +
                             " of the video on, the first that both motions have");
  read_objects(folders, m);
  measure_errors(*truth, m);
  measure_protocol(truth, folders, m);
}

/// A run's motion is that of its first person.
void note_other_people(Measurement& m) {
  if (!is_run_folder(m.input)) return;
  std::vector<std::string> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(m.input)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("motion_of_")) files.push_back(name);
  }
  std::sort(files.begin(), files.end());
  if (!files.empty()) m.result.notes.push_back("only the first person is measured; the others are in " + joined(files));
}

/// Looks whether all paths hold what they should, and finds the truths.
std::vector<std::string> checked_truths(const EvaluationSettings& settings, const std::string& input) {
  check_holds_track(input, "run");
  for (const std::string& path : {settings.truth, settings.data}) {
    if (!path.empty()) check_holds_track(path, "dataset");
  }
  return truths_of(settings, input);
}

}  // namespace

std::vector<std::string> data_folders(const EvaluationSettings& settings, const std::string& input) {
  std::vector<std::string> folders;
  if (fs::is_directory(input)) folders.push_back(input);
  for (const std::string& path : {settings.data, settings.truth}) {
    if (!path.empty()) folders.push_back(path);
  }
  if (settings.truth.empty() && is_run_folder(input)) {
    for (const std::string& truth : truths_of_run(input)) folders.push_back(truth);
  }
  return folders;
}

MotionInScene motion_in_scene(const EvaluationSettings& settings, const std::string& input) {
  const std::vector<std::string> truths = checked_truths(settings, input), folders = data_folders(settings, input);
  Measurement m{settings, input};
  read_tracks(truths, folders, m);
  Solid solid = scene_solid(folders, m);
  return {std::move(m.estimate), m.body->skeleton(), std::move(m.objects), std::move(solid)};
}

Evaluation evaluate(const EvaluationSettings& settings, const std::string& input, const std::string& clip) {
  const std::vector<std::string> truths = checked_truths(settings, input), folders = data_folders(settings, input);
  Measurement m{settings, input};
  m.result.name = input;
  m.result.truth = joined(truths);
  read_tracks(truths, folders, m);
  m.result.frames = std::ssize(m.tracks.estimate);
  m.result.frame_rate = m.tracks.frame_rate;
  for (const FrameState& state : m.tracks.estimate) m.result.joints.push_back(state.joints);
  measure_feet_and_hands(m);
  const std::vector<std::vector<double>> points = m.body->points(m.tracks.states);
  measure_scene(folders, points, m);
  measure_objects(folders, points, m);
  take_image_errors(m);
  measure_clip(clip, m.result);
  note_other_people(m);
  for (const auto& [name, value] : m.result.values) {
    if (!std::isfinite(value)) throw DataError(input + ": " + name + " is not a finite number");
  }
  return std::move(m.result);
}

}  // namespace hsi4d
