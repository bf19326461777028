#include "pipelines/graph/frame_graph.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "autodiff/elementwise.h"
#include "autodiff/matrix.h"
#include "autodiff/reduce.h"
#include "autodiff/rotations.h"
#include "autodiff/tape_rows.h"
#include "body/blend_shapes.h"
#include "core/check.h"
#include "core/rotation.h"
#include "core/rotation_6d.h"
#include "optim/metrics.h"
#include "pipelines/draw/object_light.h"
#include "pipelines/draw/tape_image.h"
#include "pipelines/graph/camera_increment.h"
#include "pipelines/graph/motion_inputs.h"
#include "splat/render/camera_center.h"
#include "splat/render/project.h"
#include "splat/render/reachable.h"

namespace hsi4d {

namespace {

constexpr Index kJoints = kSmplxJoints;
constexpr Index kHeightOfPoint = 2, kHeightOfTransform = 11;  // columns of z in a row x y z, and in one of [R | t]

/// What of the scene the camera may see that moves no further than settings.camera_reach; one Gaussian where that is
/// nothing.
Gaussians seen_scene(const Gaussians& scene, const SplatView& view, const Matrix6<double>& xi_from_update,
                     const FrameGraphSettings& settings) {
  const Vector6<double> furthest = xi_from_update.cwiseAbs() * Vector6<double>::Constant(*settings.camera_reach);
  std::vector<Index> rows = reachable_rows(scene, view, {furthest.head<3>().norm(), furthest.tail<3>().norm()});
  if (rows.empty() && scene.count() > 0) rows.push_back(0);
  return selected(scene, rows);
}

template <class S>
void write_numbers(Tape<S>& tape, Var<S> leaf, const double* values) {
  const Array<S> array = tape.write(leaf);
  for (Index i = 0; i < array.shape.count(); ++i) array.data[i] = static_cast<S>(values[i]);
}

template <class S>
Vector3<double> read_vector(Tape<S>& tape, Var<S> leaf) {
  const ConstArray<S> array = tape.value(leaf);
  return {static_cast<double>(array(0, 0)), static_cast<double>(array(0, 1)), static_cast<double>(array(0, 2))};
}

}  // namespace

template <class S>
FrameGraph<S>::FrameGraph(Tape<S>& tape, const Clip& clip, const Rigid<double>& camera_from_world,
                          const FrameGraphSettings& settings)
    : tape_(tape),
      clip_(clip),
      settings_(settings),
      view_{clip.camera, clip.scene.origin_world, settings.render, settings.skip} {
  // Objects and the body are recorded in the world, and one render has one origin: the scene's must be zero until they
  // are recorded relative to it.
  HSI4D_CHECK(clip.scene.origin_world.isZero(0), "what moves is placed in the world, not relative to an origin");
  view_.camera.camera_from_world = camera_from_world;
  xi_from_update_ = camera_from_increment(settings.increment, view_.camera, clip.scene);
  camera_update_ = leaf("camera", "camera_update", 1, 6, nullptr);
  xi_ = camera_update_;
  if (settings.increment != CameraIncrement::kCamera) {
    const Var<S> map = tape_.constant("update_from_xi", shape_of(6, 6));  // transposed: it multiplies a row
    const Matrix6<double> transposed = xi_from_update_;  // column-major, so its memory is the transpose
    write_numbers(tape_, map, transposed.data());
    xi_ = matmul(camera_update_, map);
  }
  record_unknowns();
  const Vector3<float> background = settings.background.cast<float>();
  background_ = leaf("background", "background", 1, 3, background.data());
  const bool is_part_seen = settings.camera_reach && settings.skip.unseen_gaussians && intrinsics_.tape == nullptr;
  std::vector<Part> parts = {is_part_seen ? record_scene(seen_scene(clip.scene, view_, xi_from_update_, settings))
                                          : record_scene(clip.scene)};
  if (settings_.draw == Draw::kAll) {
    record_moving(parts);
  }
  record_render(parts, 1);
  give_unknowns();
  for (const std::string& name : parameter_group_names(settings_.draw)) {  // without objects some have no leaves
    const auto known = [&name](const ParameterGroup<S>& group) { return group.name == name; };
    if (std::none_of(groups_.begin(), groups_.end(), known)) groups_.push_back({name, {}});
  }
  for (const ParameterGroup<S>& group : groups_) {
    for (const Var<S> block : group.blocks) tape_.freeze(block);
  }
}

template <class S>
Var<S> FrameGraph<S>::leaf(const std::string& group, const std::string& name, Index rows, Index cols,
                           const float* values) {
  const Var<S> var = tape_.parameter(name, shape_of(rows, cols));
  if (values != nullptr) {
    const Array<S> array = tape_.write(var);
    std::copy_n(values, rows * cols, array.data);
  }
  add_to_group(group, var);
  return var;
}

template <class S>
ParameterGroup<S>& FrameGraph<S>::add_to_group(const std::string& group, Var<S> leaf) {
  auto place = std::find_if(groups_.begin(), groups_.end(), [&](const auto& known) { return known.name == group; });
  if (place == groups_.end()) place = groups_.insert(place, ParameterGroup<S>{group, {}});
  place->blocks.push_back(leaf);
  return *place;
}

/// A leaf of one rotation a row, in the numbers that the settings choose.
template <class S>
Var<S> FrameGraph<S>::rotation_leaf(const std::string& group, const std::string& name, Index rows) {
  const bool is_axis_angle = settings_.rotations == RotationParameters::kAxisAngle;
  const Var<S> var = tape_.parameter(name, shape_of(rows, is_axis_angle ? 3 : 6));
  add_to_group(group, var).are_axis_angles = is_axis_angle;
  return var;
}

/// Leaves of a part's Gaussians: groups PART_means and so on; messages call them by `name`.
template <class S>
GaussianVars<S> FrameGraph<S>::gaussian_leaves(const std::string& part, const std::string& name, const Gaussians& g) {
  const Index n = g.count();
  GaussianVars<S> vars;
  vars.means = leaf(part + "_means", name + " means", n, 3, g.means.data());
  vars.quats = leaf(part + "_quats", name + " quats", n, 4, g.quats.data());
  vars.log_scales = leaf(part + "_log_scales", name + " log_scales", n, 3, g.log_scales.data());
  vars.opacity_logits = leaf(part + "_opacity_logits", name + " opacity_logits", n, 1, g.opacity_logits.data());
  vars.colors = leaf(part + "_sh", name + " sh", n, 3 * g.sh_coefficients(), g.sh.data());
  return vars;
}

template <class S>
bool FrameGraph<S>::is_unknown(const char* group) const {
  return std::find(settings_.unknowns.begin(), settings_.unknowns.end(), group) != settings_.unknowns.end();
}

template <class S>
void FrameGraph<S>::record_unknowns() {
  const auto number = [this](const char* group) {
    return is_unknown(group) ? leaf(group, group, 1, 1, nullptr) : Var<S>{};
  };
  unknown_.focal_length = number(kFocalGroup);
  unknown_.scene_scale = number(kSceneScaleGroup);
  unknown_.scene_height = number(kSceneHeightGroup);
  if (is_unknown(kBetasGroup)) {
    HSI4D_CHECK(clip_.directions.has_value(), "betas are a group of a clip whose avatar has a shape");
    unknown_.betas = leaf(kBetasGroup, kBetasGroup, 1, clip_.directions->betas, nullptr);
  }
  intrinsics_ = intrinsics();
}

template <class S>
void FrameGraph<S>::give_unknowns() {
  std::vector<Var<S>> leaves;
  for (const ParameterGroup<S>& group : groups_) {
    if (is_unknown(group.name.c_str())) leaves.insert(leaves.end(), group.blocks.begin(), group.blocks.end());
  }
  if (!leaves.empty()) inputs_.unknowns = leaves.size() == 1 ? leaves.front() : concat_cols<S>(leaves);
}

/// fx and fy times their factor.
template <class S>
Var<S> FrameGraph<S>::intrinsics() const {
  if (unknown_.focal_length.tape == nullptr) return {};
  const Var<S> focal = tape_.constant("focal_px", shape_of(1, 2)), center = tape_.constant("center_px", shape_of(1, 2));
  write_numbers(tape_, focal, std::array{view_.camera.fx, view_.camera.fy}.data());
  write_numbers(tape_, center, std::array{view_.camera.cx, view_.camera.cy}.data());
  return concat_cols<S>(std::array{focal * exp(unknown_.focal_length), center});
}

/// [1,1] e⁻ˢ, by which what moves is scaled where it is drawn; empty where that is 1.
template <class S>
Var<S> FrameGraph<S>::drawn_size() const {
  return unknown_.scene_scale.tape == nullptr ? Var<S>{} : exp(-unknown_.scene_scale);
}

/// Rows of the world's coordinates in the scene's units, see UnknownVars.
/// @param height_column  of z, if a row is a point or [R | t]
template <class S>
Var<S> FrameGraph<S>::in_scene(Var<S> points, Index height_column) const {
  if (unknown_.scene_height.tape != nullptr) {
    const Var<S> up = tape_.constant("up", shape_of(1, points.shape().cols));
    tape_.write(up)(0, height_column) = 1;
    points = points - up * unknown_.scene_height;
  }
  const Var<S> size = drawn_size();
  return size.tape == nullptr ? points : points * size;
}

template <class S>
typename FrameGraph<S>::Part FrameGraph<S>::record_scene(const Gaussians& scene) {
  const SplatInputs<S> splats = standing_splats(gaussian_leaves("scene", "scene", scene), xi_, view_);
  hold_colors(splats.colors, {"scene_sh"});
  return {splats, scene.count()};
}

template <class S>
void FrameGraph<S>::record_moving(std::vector<Part>& parts) {
  const std::optional<SeenRows>& seen = settings_.seen;
  for (std::size_t o = 0; o < clip_.objects.size(); ++o) {
    const ClipObject& object = clip_.objects[o];
    parts.push_back(seen ? record_object({object.name, selected(object.gaussians, seen->objects[o]), object.joint})
                         : record_object(object));
  }
  inputs_.others.resize(clip_.others.size());
  for (LossInputs<S>& other : inputs_.others) other.is_of_other = true;
  for (std::size_t p = 0; p < clip_.people(); ++p) {
    const Avatar& avatar = clip_.person(p).avatar;
    parts.push_back(seen ? record_human(p, selected(avatar, seen->people[p])) : record_human(p, avatar));
  }
}

template <class S>
typename FrameGraph<S>::Part FrameGraph<S>::record_object(const ClipObject& object) {
  const GaussianVars<S> vars = gaussian_leaves("object", object.name, object.gaussians);
  Object placed = object.joint ? object_on_joint(object.name, *object.joint) : free_object(object.name);
  const Var<S> turn = rigid_rows(placed.turn, placed.transl);
  Var<S> transform = turn;
  placed.rotation = placed.turn;
  if (is_unknown(kObjectScaleGroup)) {
    unknown_.object_scale.push_back(leaf(kObjectScaleGroup, object.name + " scale", 1, 1, nullptr));
    placed.rotation = placed.turn * exp(unknown_.object_scale.back());
    transform = rigid_rows(placed.rotation, placed.transl);
  }
  SplatInputs<S> splats = moved_splats(vars, in_scene(transform, kHeightOfTransform), turn, xi_, view_);
  hold_colors(splats.colors, {"object_sh"});
  if (settings_.object_light) splats.colors = light_object(object, placed, splats.colors);
  objects_.push_back(placed);
  return {splats, object.gaussians.count()};
}

/// The colours under a light, which is a leaf.
template <class S>
Var<S> FrameGraph<S>::light_object(const ClipObject& object, Object& placed, Var<S> colors) {
  placed.light = leaf(kObjectLightGroup, object.name + " light", 1, 6, nullptr);
  return lit_colors(colors, outward_normals(tape_, object.gaussians), placed.turn, placed.light);
}

template <class S>
typename FrameGraph<S>::Object FrameGraph<S>::free_object(const std::string& name) {
  Object object;
  object.orient = rotation_leaf(kObjectOrientGroup, name + " orient", 1);
  object.transl = leaf(kObjectTranslGroup, name + " transl", 1, 3, nullptr);
  object.turn = record_rotations(object.orient);
  return object;
}

/// on_joint (pipelines/input/object_joint.h) of a leaf q, after the parent's pose.
template <class S>
typename FrameGraph<S>::Object FrameGraph<S>::object_on_joint(const std::string& name, const ObjectJoint& joint) {
  Object object;
  object.joint = tape_.parameter(name + " joint", kScalarShape);
  joint_ranges_.push_back({joint.low, joint.high});
  add_to_group(kObjectJointGroup, object.joint).block_ranges = joint_ranges_;
  const auto constant = [this](const char* what, const auto& matrix) {
    const Var<S> var = tape_.constant(what, shape_of(matrix.rows(), matrix.cols()));
    for (Index r = 0; r < matrix.rows(); ++r) {
      for (Index c = 0; c < matrix.cols(); ++c) tape_.write(var)(r, c) = static_cast<S>(matrix(r, c));
    }
    return var;
  };
  Var<S> rotation = constant("joint_rest_rotation", joint.rest.rotation), place;  // [3,3], [3,1]
  if (joint.type == JointType::kHinge) {
    const Var<S> axis_angle = constant("joint_axis", joint.axis.transpose()) * object.joint;
    const Var<S> turn = reshape(rotations_from_axis_angle(axis_angle), 3, 3);
    const Vector3<double> arm = joint.rest.translation - joint.origin;
    rotation = matmul(turn, rotation);
    place = matmul(turn, constant("joint_arm", arm)) + constant("joint_origin", joint.origin);
  } else {
    place = constant("joint_axis", joint.axis) * object.joint + constant("joint_rest_place", joint.rest.translation);
  }
  if (joint.parent) {
    const Object& parent = objects_[static_cast<std::size_t>(*joint.parent)];
    const Var<S> turn = reshape(parent.turn, 3, 3);
    rotation = matmul(turn, rotation);
    place = matmul(turn, place) + reshape(parent.transl, 3, 1);
  }
  object.turn = reshape(rotation, 1, 9);
  object.transl = reshape(place, 1, 3);
  return object;
}

/// @param avatar  what is drawn of the person's
template <class S>
typename FrameGraph<S>::Part FrameGraph<S>::record_human(std::size_t person, const Avatar& avatar) {
  const auto n = static_cast<Index>(avatar.opacity_logits.size());
  HSI4D_CHECK_EQ(static_cast<Index>(avatar.parents.size()), kJoints);
  Human& human = humans_.emplace_back();
  const std::string& name = clip_.person(person).name;
  const std::string of = person == 0 ? "" : name + " ";  // leaves of the first person need no name
  GaussianVars<S> vars;
  vars.means = leaf("human_means", name + " means", n, 3, avatar.means.data());
  vars.quats = leaf("human_quats", name + " quats", n, 4, avatar.quats.data());
  vars.log_scales = leaf("human_log_scales", name + " log_scales", n, 3, avatar.log_scales.data());
  vars.opacity_logits = leaf("human_opacity_logits", name + " opacity_logits", n, 1, avatar.opacity_logits.data());
  vars.colors = leaf("human_colors", name + " colors", n, 3, avatar.colors.data());
  for (const JointGroup& joints : kJointGroups) {
    human.joint_rotations.push_back(rotation_leaf(joints.name, of + joints.name, joints.count));
  }
  human.transl = leaf("transl", of + "transl", 1, 3, nullptr);
  human.rotations = record_rotations(concat_rows<S>(human.joint_rotations));
  record_skeleton(avatar, human);
  if (human.rest_offsets.tape != nullptr) vars.means = vars.means + human.rest_offsets;
  const PosedSkeleton<S> drawn = {in_scene(human.skeleton.transforms, kHeightOfTransform), human.skeleton.joints};
  if (settings_.color_nets.empty()) return {skinned_splats(vars, human.rotations, drawn, avatar), n};
  const ColorNet& net = settings_.color_nets[person];
  const HumanColors<S> colors =
      record_color_net(settings_.seen ? selected(net, settings_.seen->people[person]) : net, human);
  HSI4D_CHECK_EQ(colors.net.features.shape().rows, n);
  const SplatInputs<S> splats = skinned_splats(vars, human.rotations, drawn, avatar, &colors);
  hold_colors(splats.colors, {kColorNetGroup, kFeaturesGroup});
  return {splats, n};
}

/// The skeleton, and how betas that are looked for move means and joints in the rest pose. The pelvis stays where it is
/// in the world.
template <class S>
void FrameGraph<S>::record_skeleton(const Avatar& avatar, Human& human) {
  if (unknown_.betas.tape == nullptr) {
    human.skeleton = kinematic_chain(human.rotations, human.transl, avatar.parents, avatar.joints);
    return;
  }
  HSI4D_CHECK_EQ(avatar.count(), clip_.avatar.count());
  const auto offsets = [this](const std::vector<double>& directions) {
    const Index betas = clip_.directions->betas, points = std::ssize(directions) / (3 * betas);
    const Directions<S> prepared({directions, points, betas, {0}, betas});
    return blend_shapes<S>(std::vector<double>(static_cast<std::size_t>(3 * points)),
                           std::array{BlendTerm<S>{prepared, unknown_.betas}});
  };
  human.rest_offsets = offsets(clip_.directions->means);
  const Var<S> joint_offsets = offsets(clip_.directions->joints);
  const Var<S> joints = constant_rows<S>(tape_, "rest_joints", avatar.joints, 3) + joint_offsets;
  human.skeleton =
      kinematic_chain(human.rotations, human.transl - slice_rows(joint_offsets, 0, 1), avatar.parents, joints);
}

/// Colours that are computed anew only where one of the groups moves, if that is wanted.
template <class S>
void FrameGraph<S>::hold_colors(Var<S> colors, const std::vector<std::string>& groups) {
  if (settings_.hold_colors) held_.push_back({colors.id, groups});
}

template <class S>
HumanColors<S> FrameGraph<S>::record_color_net(const ColorNet& net, Human& human) {
  human.color_net = color_net_leaves(tape_, net);
  add_to_group(kFeaturesGroup, human.color_net.features);
  for (const MlpLayer<S>& layer : human.color_net.layers) {
    add_to_group(kColorNetGroup, layer.weights);
    add_to_group(kColorNetGroup, layer.bias);
  }
  HumanColors<S> colors{human.color_net, net.code_joints, {}};
  if (!net.view_direction) return colors;
  const Var<S> center = camera_center(xi_, view_);
  colors.camera_center = settings_.color_camera_gradient ? center : stop_gradient(center);
  return colors;
}

template <class S>
Var<S> FrameGraph<S>::record_rotations(Var<S> parameters) const {
  return settings_.rotations == RotationParameters::kSixD ? rotations_from_6d(parameters)
                                                          : rotations_from_axis_angle(parameters);
}

template <class S>
void FrameGraph<S>::record_render(const std::vector<Part>& parts, std::size_t first_object) {
  RenderRequest request;
  Index row = 0;
  for (std::size_t p = 0; p < parts.size(); ++p) {
    const bool is_object = p >= first_object && p < first_object + objects_.size();
    const bool is_human = p >= first_object + objects_.size();
    if ((is_object && settings_.object_opacity) || (is_human && settings_.human_opacity))
      request.groups.emplace_back(row, row + parts[p].count);
    row += parts[p].count;
  }
  request.depth = settings_.depth_map;
  rendered_ = render_parts(parts, request);
  inputs_.rendered = rendered_.image;
  inputs_.target = tape_.constant("target", rendered_.image.shape());
  inputs_.weight = tape_.constant("weight", rendered_.transmittance.shape());
  if (settings_.depth_map) {
    inputs_.depth = rendered_.depth;
    inputs_.transmittance = rendered_.transmittance;
    inputs_.depth_map = tape_.constant("depth_map", rendered_.depth.shape());
    inputs_.depth_map_weight = tape_.constant("depth_map_weight", rendered_.depth.shape());
  }
  if (settings_.draw == Draw::kScene) return;
  if (!objects_.empty()) {
    record_object_depths(parts, first_object);
    record_object_places();
  }
  if (draws_objects()) record_object_masks();
  for (std::size_t p = 0; p < humans_.size(); ++p) {
    if (settings_.human_opacity) record_human_inputs(p);
    if ((settings_.keypoints || settings_.bones) && clip_.person(p).keypoints) record_keypoints(p);
  }
}

/// Opacities are those of the objects, and last of the people.
template <class S>
void FrameGraph<S>::record_human_inputs(std::size_t person) {
  const Var<S> all = rendered_.group_opacity;
  const std::size_t plane = (draws_objects() ? objects_.size() : 0) + person;
  LossInputs<S>& inputs = inputs_of(person);
  inputs.human_opacity = all.shape().planes == 1 ? all : slice_planes(all, static_cast<Index>(plane), 1);
  inputs.human_mask = tape_.constant("human_mask", inputs.human_opacity.shape());
  inputs.human_seen = tape_.constant("human_seen", kScalarShape);
  inputs.object_masks = inputs_.object_masks;
}

template <class S>
void FrameGraph<S>::record_object_masks() {
  const auto count = static_cast<Index>(objects_.size());
  inputs_.object_opacity =
      settings_.human_opacity ? slice_planes(rendered_.group_opacity, 0, count) : rendered_.group_opacity;
  inputs_.object_center_target = tape_.constant("object_center_target", shape_of(count, 3));
  inputs_.object_masks = tape_.constant("object_masks", inputs_.object_opacity.shape());
  inputs_.object_seen = tape_.constant("object_seen", Shape{count, 1, 1, 1});
}

/// The scene is the first part; it stands still while the camera does.
template <class S>
Rendered<S> FrameGraph<S>::render_parts(const std::vector<Part>& parts, const RenderRequest& request) const {
  if (parts.size() == 1) return render(parts.front().splats, xi_, background_, view_, request, intrinsics_);
  std::vector<SplatInputs<S>> moving;
  for (std::size_t p = 1; p < parts.size(); ++p) moving.push_back(parts[p].splats);
  return render(parts.front().splats, stacked_splats(moving), xi_, background_, view_, request, intrinsics_);
}

template <class S>
void FrameGraph<S>::give_motion(const SceneState& first, const std::vector<SceneState>& frames, Index index) {
  HSI4D_CHECK(settings_.draw == Draw::kAll, "a graph of the scene alone has no body");
  std::vector<Var<S>> transforms;
  for (const Object& object : objects_) transforms.push_back(rigid_rows(object.rotation, object.transl));
  const Var<S> objects = transforms.empty() ? Var<S>{} : concat_rows<S>(transforms);
  for (std::size_t p = 0; p < humans_.size(); ++p) {
    const Human& human = humans_[p];
    hsi4d::give_motion(MovingFrames<S>{human.rotations, human.skeleton, objects, human.rest_offsets}, clip_, p, first,
                       frames, index, inputs_of(p));
  }
}

template <class S>
void FrameGraph<S>::give_motion_after(std::span<const SceneState> frames) {
  for (std::size_t p = 0; p < humans_.size(); ++p) {
    std::vector<double> rows;
    for (const SceneState& state : frames) {
      const std::vector<double> joints = pose_skeleton(clip_.person(p).avatar, state.person(p)).joints;
      rows.insert(rows.end(), joints.begin(), joints.begin() + 3 * kMetricJoints);
    }
    LossInputs<S>& inputs = inputs_of(p);
    inputs.joints_after = constant_rows(tape_, "joints_after", rows, 3 * kMetricJoints);
    inputs.motion = with_objects_after(*inputs.motion, frames);
  }
}

/// The human's points first, then those of the objects.
template <class S>
void FrameGraph<S>::give_tracks(const std::vector<TrackPoint>& points, const std::vector<TrackPlace>& places) {
  const Index frame = inputs_.motion->still_frames;  // the one that moves
  std::vector<BodyPoint> of_body;
  std::vector<ObjectPoint> of_objects;
  std::vector<double> body_targets, object_targets;
  for (const TrackPoint& point : points) {
    const bool is_of_body = point.object == std::ssize(objects_);
    if (is_of_body) of_body.push_back({frame, point.row, BodySet::kGaussians, point.offset});
    if (!is_of_body) of_objects.push_back({frame, point.object, point.row, point.offset});
    const TrackPlace& place = places[static_cast<std::size_t>(point.track)];
    std::vector<double>& targets = is_of_body ? body_targets : object_targets;
    targets.insert(targets.end(), {place.x * view_.camera.width, place.y * view_.camera.height, place.visible});
  }
  std::vector<Var<S>> parts;
  if (!of_body.empty()) parts.push_back(inputs_.body_points(of_body));
  if (!of_objects.empty()) parts.push_back(inputs_.object_points(of_objects));
  inputs_.tracks = places_in_image(parts.size() == 1 ? parts.front() : concat_rows<S>(parts));
  inputs_.tracks_target = tape_.constant("tracks_target", shape_of(std::ssize(points), 3));
  body_targets.insert(body_targets.end(), object_targets.begin(), object_targets.end());
  write_numbers(tape_, inputs_.tracks_target, body_targets.data());
}

template <class S>
void FrameGraph<S>::record_object_depths(const std::vector<Part>& parts, std::size_t first_object) {
  const auto count = static_cast<Index>(objects_.size());
  std::vector<Var<S>> depths;
  Index row = 0;  // of what moves
  for (std::size_t p = 1; p < first_object + objects_.size(); ++p) {
    if (p >= first_object) depths.push_back(mean(slice_rows(rendered_.projected.depths, row, parts[p].count)));
    row += parts[p].count;
  }
  inputs_.object_depth = concat_rows<S>(depths);
  if (unknown_.scene_scale.tape != nullptr) inputs_.object_depth = inputs_.object_depth * exp(unknown_.scene_scale);
  inputs_.object_depth_target = tape_.constant("object_depth_target", shape_of(count, 1));
}

/// Where points [N,3] of the world are in the image, [N,2] pixels.
template <class S>
Var<S> FrameGraph<S>::places_in_image(Var<S> points) const {
  const Var<S> axes = tape_.constant("unit_axes", shape_of(points.shape().rows, 9));
  for (Index i = 0; i < points.shape().rows; ++i) {  // without extent they would not be drawn, and have no gradient
    for (const Index diagonal : {0, 4, 8}) tape_.write(axes)(i, diagonal) = 1;
  }
  return project(in_scene(points, kHeightOfPoint), axes, xi_, view_, intrinsics_).means_px;
}

/// A pose's translation is where the object's centroid is.
template <class S>
std::vector<Var<S>> FrameGraph<S>::object_places() const {
  std::vector<Var<S>> centroids;
  for (const Object& object : objects_) centroids.push_back(object.transl);
  return centroids;
}

template <class S>
void FrameGraph<S>::record_object_places() {
  inputs_.object_place = places_in_image(concat_rows<S>(object_places()));
}

/// A point is a mean of joints.
template <class S>
void FrameGraph<S>::record_keypoints(std::size_t person) {
  const Keypoints& keypoints = *clip_.person(person).keypoints;
  const std::vector<KeypointJoints>& points = keypoints.joints;
  const Var<S> weights = tape_.constant("keypoint_joints", shape_of(std::ssize(points), kJoints));
  for (std::size_t k = 0; k < points.size(); ++k) {
    for (const auto& [joint, weight] : points[k])
      tape_.write(weights)(static_cast<Index>(k), joint) = static_cast<S>(weight);
  }
  const Var<S> places = matmul(weights, humans_[person].skeleton.joints);
  if (settings_.bones && keypoints.has_landmarks()) record_bones(person, places);
  if (!settings_.keypoints) return;
  LossInputs<S>& inputs = inputs_of(person);
  inputs.keypoints = places_in_image(places);
  inputs.keypoints_target = tape_.constant("keypoints_target", shape_of(std::ssize(points), 3));
}

/// Ways between points, in the axes of the camera Exp(ξ) T: rows wᵀ Rᵀ Exp(−ω), ω the rotation of ξ.
template <class S>
void FrameGraph<S>::record_bones(std::size_t person, Var<S> points) {
  std::vector<Bone>& bones = humans_[person].bones;
  bones = bones_of(clip_.person(person).keypoints->joints);
  if (bones.empty()) return;
  const auto count = std::ssize(bones);
  const Var<S> ends = tape_.constant("bone_ends", shape_of(count, points.shape().rows));
  for (Index b = 0; b < count; ++b) {
    for (const auto& [point, weight] : bones[static_cast<std::size_t>(b)])
      tape_.write(ends)(b, point) = static_cast<S>(weight);
  }
  const Var<S> axes = tape_.constant("camera_axes", shape_of(3, 3));           // transposed: it multiplies rows
  write_numbers(tape_, axes, view_.camera.camera_from_world.rotation.data());  // column-major: so its memory is
  const Var<S> turn = rotations_from_axis_angle(-slice_cols(xi_, 3, 3));
  const Var<S> rows =
      concat_rows<S>(std::array{slice_cols(turn, 0, 3), slice_cols(turn, 3, 3), slice_cols(turn, 6, 3)});
  LossInputs<S>& inputs = inputs_of(person);
  inputs.bones = matmul(matmul(matmul(ends, points), axes), rows);
  inputs.bones_target = tape_.constant("bones_target", shape_of(count, 4));
}

template <class S>
void FrameGraph<S>::write_rotation(Var<S> leaf, Index row, const Vector3<double>& axis_angle) {
  S* numbers = tape_.write(leaf).row(row);
  if (settings_.rotations == RotationParameters::kAxisAngle) {
    Vector3<double> wrapped = axis_angle;  // a file's may be any number of turns (row D9: angles beyond π)
    wrap_axis_angle(wrapped);
    for (Index i = 0; i < 3; ++i) numbers[i] = static_cast<S>(wrapped[i]);
    return;
  }
  const Matrix3<double> rotation = so3_exp(axis_angle);
  for (Index i = 0; i < 6; ++i) numbers[i] = static_cast<S>(rotation(i % 3, i / 3));
}

template <class S>
Vector3<double> FrameGraph<S>::read_rotation(Var<S> leaf, Index row) const {
  const S* numbers = tape_.value(leaf).row(row);
  Vector3<double> first(numbers[0], numbers[1], numbers[2]);
  if (settings_.rotations == RotationParameters::kAxisAngle) {
    wrap_axis_angle(first);
    return first;
  }
  return so3_log(rotation_from_6d(first, Vector3<double>(numbers[3], numbers[4], numbers[5])));
}

template <class S>
void FrameGraph<S>::set_state(const SceneState& state) {
  const std::array<double, 6> no_update{};
  write_numbers(tape_, camera_update_, no_update.data());
  for (const ParameterGroup<S>& group : groups_) {
    const bool is_unknown_one = is_unknown(group.name.c_str());
    for (std::size_t b = 0; is_unknown_one && b < group.blocks.size(); ++b) fill(group.blocks[b], S(0));
  }
  if (settings_.draw == Draw::kScene) return;
  HSI4D_CHECK_EQ(state.objects.size(), objects_.size());
  for (std::size_t o = 0; o < objects_.size(); ++o) {
    if (settings_.object_light) write_numbers(tape_, objects_[o].light, light_of(state, o).data());
    if (const std::optional<ObjectJoint>& joint = clip_.objects[o].joint) {
      const double q = joint_value(*joint, parent_from_object(*joint, state.objects, o));
      write_numbers(tape_, objects_[o].joint, &q);
      continue;
    }
    write_rotation(objects_[o].orient, 0, state.objects[o].rotation);
    write_numbers(tape_, objects_[o].transl, state.objects[o].translation.data());
  }
  HSI4D_CHECK_EQ(state.people(), humans_.size());
  for (std::size_t p = 0; p < humans_.size(); ++p) {
    const BodyPose& body = state.person(p);
    write_numbers(tape_, humans_[p].transl, body.transl.data());
    for (std::size_t g = 0; g < kJointGroups.size(); ++g) {
      for (Index j = 0; j < kJointGroups[g].count; ++j) {
        const double* axis_angle = body.axis_angle.data() + 3 * (kJointGroups[g].first + j);
        write_rotation(humans_[p].joint_rotations[g], j, Vector3<double>(axis_angle));
      }
    }
  }
}

template <class S>
void FrameGraph<S>::read_state(const ConfigMap<ParameterGroupSettings>& moved, SceneState& state) const {
  const auto is_moved = [&moved](const char* group) { return find_entry(moved, group) != nullptr; };
  if (is_moved("camera")) {
    Vector6<double> update;
    for (Index i = 0; i < 6; ++i) update[i] = static_cast<double>(tape_.value(camera_update_)(0, i));
    const Vector6<double> xi = xi_from_update_ * update;
    state.camera_from_world = se3_update(xi, view_.camera.camera_from_world);
  }
  if (settings_.object_light && is_moved(kObjectLightGroup)) {
    state.lights.resize(objects_.size());
    for (std::size_t o = 0; o < objects_.size(); ++o)
      std::copy_n(tape_.value(objects_[o].light).data, state.lights[o].size(), state.lights[o].data());
  }
  const bool is_parent_moved = is_moved(kObjectOrientGroup) || is_moved(kObjectTranslGroup);
  for (std::size_t o = 0; o < objects_.size(); ++o) {
    if (const std::optional<ObjectJoint>& joint = clip_.objects[o].joint) {
      if (!is_parent_moved && !is_moved(kObjectJointGroup)) continue;
      const double q = static_cast<double>(tape_.value(objects_[o].joint).scalar());
      state.objects[o] = pose_of(compose(world_from_parent(*joint, state.objects), on_joint(*joint, q)));
      continue;
    }
    if (is_moved(kObjectOrientGroup)) state.objects[o].rotation = read_rotation(objects_[o].orient, 0);
    if (is_moved(kObjectTranslGroup)) state.objects[o].translation = read_vector(tape_, objects_[o].transl);
  }
  for (std::size_t p = 0; p < humans_.size(); ++p) {
    BodyPose& body = state.person(p);
    if (is_moved("transl")) body.transl = read_vector(tape_, humans_[p].transl);
    for (std::size_t g = 0; g < kJointGroups.size(); ++g) {
      if (!is_moved(kJointGroups[g].name)) continue;
      for (Index j = 0; j < kJointGroups[g].count; ++j) {
        const Vector3<double> axis_angle = read_rotation(humans_[p].joint_rotations[g], j);
        std::copy_n(axis_angle.data(), 3, body.axis_angle.data() + 3 * (kJointGroups[g].first + j));
      }
    }
  }
}

template <class S>
ClipUnknowns FrameGraph<S>::unknowns() const {
  const auto number = [this](Var<S> leaf) {
    return leaf.tape == nullptr ? 0.0 : static_cast<double>(tape_.value(leaf).data[0]);
  };
  ClipUnknowns found;
  found.focal_length = std::exp(number(unknown_.focal_length));
  found.scene_scale = std::exp(number(unknown_.scene_scale));
  found.scene_height = number(unknown_.scene_height);
  for (const Var<S> scale : unknown_.object_scale) found.object_scales.push_back(std::exp(number(scale)));
  if (unknown_.betas.tape == nullptr) return found;
  const ConstArray<S> betas = tape_.value(unknown_.betas);
  found.betas.assign(betas.data, betas.data + betas.shape.count());
  return found;
}

template <class S>
void FrameGraph<S>::read_color_nets(const ConfigMap<ParameterGroupSettings>& moved, std::vector<ColorNet>& nets) const {
  for (std::size_t p = 0; p < humans_.size() && p < settings_.color_nets.size(); ++p) {
    if (find_entry(moved, kColorNetGroup) != nullptr) read_layers(humans_[p].color_net, nets[p]);
    if (find_entry(moved, kFeaturesGroup) != nullptr) read_features(humans_[p].color_net, nets[p]);
  }
}

template <class S>
void FrameGraph<S>::set_targets(const FrameTargets& targets) {
  HSI4D_CHECK(targets.image != nullptr, "a frame needs an image to be compared with");
  write_image(inputs_.target, *targets.image);
  if (targets.weight != nullptr) {
    write_image(inputs_.weight, *targets.weight);
  } else {
    fill(inputs_.weight, S(1));
  }
  for (std::size_t p = 0; p < humans_.size(); ++p)
    set_person(p, p == 0 ? PersonTargets{targets.human_mask, targets.human_seen, targets.keypoints}
                         : targets.others.at(p - 1));
  if (inputs_.given(inputs_.depth_map)) set_depth_map(targets.depth_map != nullptr ? *targets.depth_map : DepthMap());
  if (!inputs_.given(inputs_.object_depth)) return;
  HSI4D_CHECK_EQ(targets.depths.size(), objects_.size());
  write_numbers(tape_, inputs_.object_depth_target, targets.depths.data());
  if (inputs_.given(inputs_.object_masks)) set_object_masks(targets);
}

template <class S>
void FrameGraph<S>::set_person(std::size_t person, const PersonTargets& targets) {
  LossInputs<S>& inputs = inputs_of(person);
  if (inputs.given(inputs.human_mask)) {
    write_image(inputs.human_mask, *targets.mask);
    fill(inputs.human_seen, S(targets.seen ? 1 : 0));
  }
  if (inputs.given(inputs.keypoints_target)) set_keypoints(*targets.keypoints, inputs);
  if (inputs.given(inputs.bones_target)) set_bones(*targets.keypoints, humans_[person].bones, inputs);
}

template <class S>
void FrameGraph<S>::set_keypoints(const std::vector<Keypoint>& found, LossInputs<S>& inputs) {
  for (std::size_t k = 0; k < found.size(); ++k) {
    S* row = tape_.write(inputs.keypoints_target).row(static_cast<Index>(k));
    row[0] = static_cast<S>(found[k].x * view_.camera.width);
    row[1] = static_cast<S>(found[k].y * view_.camera.height);
    row[2] = static_cast<S>(found[k].confidence);
  }
}

/// Confidence 0 where an end is not known, or both are one.
template <class S>
void FrameGraph<S>::set_bones(const std::vector<Keypoint>& found, const std::vector<Bone>& bones,
                              LossInputs<S>& inputs) {
  for (std::size_t b = 0; b < bones.size(); ++b) {
    Vector3<double> way = Vector3<double>::Zero();
    double confidence = 1;
    for (const auto& [point, weight] : bones[b]) {
      const Keypoint& end = found[static_cast<std::size_t>(point)];
      confidence = end.landmark ? std::min(confidence, end.confidence) : 0;
      way += weight * end.landmark.value_or(Vector3<double>::Zero());
      if (confidence == 0) break;
    }
    if (!(way.norm() > 0)) confidence = 0;
    S* row = tape_.write(inputs.bones_target).row(static_cast<Index>(b));
    for (Index i = 0; i < 3; ++i) row[i] = static_cast<S>(confidence > 0 ? way.normalized()[i] : 0);
    row[3] = static_cast<S>(confidence);
  }
}

template <class S>
void FrameGraph<S>::set_depth_map(const DepthMap& map) {
  if (map.values.empty()) {
    fill(inputs_.depth_map, S(0));
    fill(inputs_.depth_map_weight, S(0));
    return;
  }
  write_image(inputs_.depth_map, map.values);
  write_image(inputs_.depth_map_weight, map.weights);
}

template <class S>
void FrameGraph<S>::set_object_masks(const FrameTargets& targets) {
  HSI4D_CHECK_EQ(targets.centers.size(), objects_.size());
  write_images(inputs_.object_masks, targets.object_masks);
  for (std::size_t o = 0; o < objects_.size(); ++o) {
    S* center = tape_.write(inputs_.object_center_target).row(static_cast<Index>(o));
    for (Index i = 0; i < 3; ++i) center[i] = static_cast<S>(targets.centers[o][i]);
    tape_.write(inputs_.object_seen).data[o] = center[2] > 0 ? 1 : 0;
  }
}

template class FrameGraph<float>;
template class FrameGraph<double>;

}  // namespace hsi4d
