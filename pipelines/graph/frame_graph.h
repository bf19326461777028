// One frame on a tape: from the parameters of camera, human and objects to the image and the inputs of the losses.
//
//   scene       means, quats, log_scales, opacity_logits, sh                                ─┐
//   object o    the same, moved by [exp(orient) | transl], or on a joint by one number        ├─ render ─ image, masks
//   person p    rotations → kinematic chain → blended transforms → means, axes; color net   ─┘
//
// Every number that the image depends on is a leaf, frozen unless a stage moves it, so that each can be optimised, and
// checked, by its group's name: those of all objects, or of all people, are blocks of one group.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "optim/loss_term.h"
#include "optim/parameters.h"
#include "optim/stage.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/config/run_config.h"
#include "pipelines/draw/posed_splats.h"
#include "pipelines/draw/seen_rows.h"
#include "pipelines/draw/track_points.h"
#include "pipelines/input/clip.h"
#include "pipelines/input/clip_unknowns.h"
#include "pipelines/input/state.h"
#include "splat/render/render.h"

namespace hsi4d {

/// What a frame graph draws and how.
struct FrameGraphSettings {
  RenderSettings render;
  RenderSkips skip = {};
  bool hold_colors = false;  ///< colours change only where what makes them moves, see held()
  RotationParameters rotations = RotationParameters::kSixD;
  CameraIncrement increment = CameraIncrement::kCamera;
  Draw draw = Draw::kAll;
  Vector3<double> background = Vector3<double>::Zero();
  std::span<const ColorNet> color_nets =
      {};                              ///< by person, read when the graph is recorded; empty: the avatars' colours
  bool color_camera_gradient = false;  ///< colours of the net have a gradient in the camera, by the direction of view
  bool object_light = false;           ///< objects have a light, a leaf each
  bool human_opacity = false;          ///< the losses read the people's opacity, a channel of the render each
  bool object_opacity = false;         ///< likewise of the objects, a channel each
  bool keypoints = false;              ///< the losses read the clip's keypoints
  bool bones = false;                  ///< the losses read directions of bones, where the clip's keypoints have them
  bool depth_map = false;              ///< the losses read depths of pixels, which cost two channels of the render
  std::vector<std::string> unknowns = {};  ///< groups of what the clip's files do not know that are leaves: see below
  /// How far each of the camera's six numbers may go from 0; Gaussians of the scene that no such camera sees are left
  /// out, and the groups of the scene then hold the others alone. None: all are kept.
  std::optional<double> camera_reach = {};
  /// What is drawn of objects and human; the groups of their Gaussians then hold that alone, and `object_depth` is its
  /// mean. None: all of it.
  std::optional<SeenRows> seen = {};
};

/// The leaves of the unknown groups, each empty unless settings.unknowns names it. All are 0 for a clip as it is.
///
/// The scene and its camera keep their size on the tape: what moves is brought into the scene's units, p ↦ (p − h) e⁻ˢ,
/// to be drawn, and stays in metres for the losses.
template <class S>
struct UnknownVars {
  Var<S> focal_length;               ///< [1,1] log of a factor
  std::vector<Var<S>> object_scale;  ///< [1,1] by object, log of a factor
  Var<S> scene_scale;                ///< [1,1] s, log of a factor
  Var<S> scene_height;               ///< [1,1] h, metres
  Var<S> betas;                      ///< [1,B]
};

/// What a person beside the first one is compared with, as FrameTargets has it of that.
struct PersonTargets {
  const Image* mask = nullptr;
  bool seen = true;
  const std::vector<Keypoint>* keypoints = nullptr;
};

/// What a frame is compared with.
struct FrameTargets {
  const Image* image = nullptr;                 ///< [3,H,W]
  const Image* weight = nullptr;                ///< [1,H,W]; null: every pixel counts
  std::vector<Vector3<double>> centers;         ///< by object: x px, y px, the share that is seen; with object_masks
  std::vector<double> depths;                   ///< by object: mean camera z at the clip's first frame, metres
  const Image* human_mask = nullptr;            ///< [1,H,W] coverage; needed with settings.human_opacity
  bool human_seen = true;                       ///< the frame shows some of the human
  std::vector<const Image*> object_masks = {};  ///< coverage by object; needed with settings.object_opacity
  const std::vector<Keypoint>* keypoints = nullptr;  ///< of the frame; needed with settings.keypoints and bones
  const DepthMap* depth_map = nullptr;               ///< of the frame; null, or empty: nothing is known
  std::vector<PersonTargets> others = {};            ///< of the clip's other people
};

/// The frame graph. The tape and the clip must outlive it.
template <class S>
class FrameGraph {
 public:
  /// Records the graph; nothing is computed. `camera_from_world` is the camera about which the update is taken.
  FrameGraph(Tape<S>& tape, const Clip& clip, const Rigid<double>& camera_from_world,
             const FrameGraphSettings& settings);

  /// Writes the state into the leaves. The camera's update becomes zero: `state` must have the camera that the graph
  /// was recorded with.
  void set_state(const SceneState& state);
  /// Reads the leaves of the groups named in `moved` back into `state`; the rest of it keeps its bits. Rotations come
  /// as axis-angle with angles up to π.
  void read_state(const ConfigMap<ParameterGroupSettings>& moved, SceneState& state) const;
  /// Reads features and layers of the color nets back, those of them that are named in `moved`.
  void read_color_nets(const ConfigMap<ParameterGroupSettings>& moved, std::vector<ColorNet>& nets) const;
  /// What the unknown groups say, beside the clip.
  ClipUnknowns unknowns() const;
  /// Records what terms over the body's motion read. For graphs that draw all, once, after set_state.
  /// @param first   the clip's first frame
  /// @param frames  the states before this frame that such terms see, and last the one that was set
  /// @param index   in the clip, of the first of these
  void give_motion(const SceneState& first, const std::vector<SceneState>& frames, Index index = 0);
  /// Makes joints_after of the frames that follow, where the stages before left them, and tells where the objects are
  /// in these. After give_motion, once.
  void give_motion_after(std::span<const SceneState> frames);
  /// Records points that tracks follow, and where these are in the frame. After give_motion, once.
  /// @param points  some at least
  /// @param places  by track
  void give_tracks(const std::vector<TrackPoint>& points, const std::vector<TrackPlace>& places);
  /// Writes the frame: target, the weight of pixels, centres of the objects' masks. See FrameTargets.
  void set_targets(const FrameTargets& targets);

  const Rendered<S>& rendered() const { return rendered_; }
  const LossInputs<S>& loss_inputs() const { return inputs_; }
  /// Everything that may move, all of it frozen.
  const std::vector<ParameterGroup<S>>& groups() const { return groups_; }
  /// Where the objects' centroids are, [1,3] metres each, world, in the clip's order.
  std::vector<Var<S>> object_places() const;
  /// Colours, where settings.hold_colors says so.
  const std::vector<HeldOutput>& held() const { return held_; }

 private:
  struct Part {  // rows of all Gaussians that belong together
    SplatInputs<S> splats;
    Index count = 0;
  };
  struct Object {
    Var<S> orient, transl;  // leaves; of one on a joint transl is what that gives, and there is no orient
    Var<S> joint;           // [1,1] a leaf, of one on a joint
    Var<S> light;           // [1,6] a leaf, with settings.object_light
    Var<S> turn;            // [1,9] the rotation
    Var<S> rotation;        // [1,9] the same, times the object's factor where that is unknown
  };
  struct Human {
    Var<S> transl;
    Var<S> rest_offsets;                  // [N,3] of its means by unknown betas, or empty
    std::vector<Var<S>> joint_rotations;  // by kJointGroups
    Var<S> rotations;                     // [55,9] that they give
    PosedSkeleton<S> skeleton;
    ColorNetVars<S> color_net;  // empty without a color net
    std::vector<Bone> bones;    // between the person's keypoints
  };

  Var<S> leaf(const std::string& group, const std::string& name, Index rows, Index cols, const float* values);
  ParameterGroup<S>& add_to_group(const std::string& group, Var<S> leaf);
  Var<S> rotation_leaf(const std::string& group, const std::string& name, Index rows);
  GaussianVars<S> gaussian_leaves(const std::string& part, const std::string& name, const Gaussians& g);
  bool is_unknown(const char* group) const;
  void record_unknowns();
  void give_unknowns();
  Var<S> intrinsics() const;
  Var<S> drawn_size() const;
  Var<S> in_scene(Var<S> points, Index height_column) const;
  Part record_scene(const Gaussians& scene);
  void record_moving(std::vector<Part>& parts);
  Part record_object(const ClipObject& object);
  Object free_object(const std::string& name);
  Var<S> light_object(const ClipObject& object, Object& placed, Var<S> colors);
  Object object_on_joint(const std::string& name, const ObjectJoint& joint);
  Part record_human(std::size_t person, const Avatar& avatar);
  void record_skeleton(const Avatar& avatar, Human& human);
  HumanColors<S> record_color_net(const ColorNet& net, Human& human);
  void hold_colors(Var<S> colors, const std::vector<std::string>& groups);
  Var<S> record_rotations(Var<S> parameters) const;
  void record_render(const std::vector<Part>& parts, std::size_t first_object);
  LossInputs<S>& inputs_of(std::size_t person) { return person == 0 ? inputs_ : inputs_.others[person - 1]; }
  void record_human_inputs(std::size_t person);
  void record_keypoints(std::size_t person);
  void record_bones(std::size_t person, Var<S> points);
  Rendered<S> render_parts(const std::vector<Part>& parts, const RenderRequest& request) const;
  void record_object_depths(const std::vector<Part>& parts, std::size_t first_object);
  void record_object_places();
  Var<S> places_in_image(Var<S> points) const;
  void record_object_masks();
  void set_object_masks(const FrameTargets& targets);
  void set_person(std::size_t person, const PersonTargets& targets);
  void set_keypoints(const std::vector<Keypoint>& found, LossInputs<S>& inputs);
  void set_bones(const std::vector<Keypoint>& found, const std::vector<Bone>& bones, LossInputs<S>& inputs);
  void set_depth_map(const DepthMap& map);
  bool draws_objects() const { return settings_.object_opacity && !objects_.empty(); }
  void write_rotation(Var<S> leaf, Index row, const Vector3<double>& axis_angle);
  Vector3<double> read_rotation(Var<S> leaf, Index row) const;

  Tape<S>& tape_;
  const Clip& clip_;
  FrameGraphSettings settings_;
  SplatView view_;
  std::vector<ParameterGroup<S>> groups_;
  std::vector<HeldOutput> held_;
  Matrix6<double> xi_from_update_;
  Var<S> camera_update_;  // the leaf: numbers in the frame of settings.increment
  Var<S> xi_, background_;
  UnknownVars<S> unknown_;
  Var<S> intrinsics_;  // [1,4], or empty: the clip's
  std::vector<Object> objects_;
  std::vector<ParameterRange> joint_ranges_;  // by block of the joints' group
  std::vector<Human> humans_;
  Rendered<S> rendered_;
  LossInputs<S> inputs_;
};

}  // namespace hsi4d
