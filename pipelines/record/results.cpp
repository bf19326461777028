#include "pipelines/record/results.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "body/glb.h"
#include "body/motion_edit.h"
#include "core/camera_file.h"
#include "core/check.h"
#include "core/image_io.h"
#include "core/log.h"
#include "core/rotation.h"
#include "core/text.h"
#include "core/video.h"
#include "pipelines/input/body_files.h"

namespace hsi4d {

namespace {

constexpr std::array<double, 8> kOtherSides = {45, -45, 30, -30, 60, -60, 20, -20};  // degrees
constexpr double kFreeView = 0.1;                                                    // metres around the line of sight
constexpr int kPanelWidth = 480;                                                     // pixels, at most

/// How many Gaussians of the scene are in the way between a camera and what it looks at.
Index count_between(const Gaussians& scene, const Vector3<double>& eye, const Vector3<double>& target) {
  const Vector3<double> way = target - eye;
  Index count = 0;
  for (Index i = 0; i < scene.count(); ++i) {
    const Vector3<double> place = Vector3<float>(scene.means.data() + 3 * i).cast<double>() + scene.origin_world - eye;
    const double share = place.dot(way) / way.squaredNorm();
    if (share < 0 || share > 0.9) continue;  // behind the camera, or at what it looks at
    const float* scales = scene.log_scales.data() + 3 * i;
    const double size = std::exp(static_cast<double>(*std::max_element(scales, scales + 3)));
    if ((place - share * way).norm() < kFreeView + size) ++count;
  }
  return count;
}

/// The side from which the scene hides the body least.
Rigid<double> camera_of_other_side(const Clip& clip, const SceneState& first) {
  const Vector3<double> pelvis(pose_joints(clip.avatar, first.body).data());
  Rigid<double> best;
  Index least = -1;
  for (const double degrees : kOtherSides) {
    const Rigid<double> camera = turned_camera(first.camera_from_world, pelvis, degrees * std::numbers::pi / 180);
    const Index count = count_between(clip.scene, -(camera.rotation.transpose() * camera.translation), pelvis);
    if (least >= 0 && count >= least) continue;
    least = count;
    best = camera;
  }
  return best;
}

Image mean_of(const Image& a, const Image& b) {
  Image mean(a.channels(), a.height(), a.width());
  for (int c = 0; c < a.channels(); ++c) {
    for (int y = 0; y < a.height(); ++y) {
      for (int x = 0; x < a.width(); ++x) mean(c, y, x) = (a(c, y, x) + b(c, y, x)) / 2;
    }
  }
  return mean;
}

std::array<double, 3> mean_color(const Image& image) {
  std::array<double, 3> mean{};
  for (int c = 0; c < 3; ++c) {
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) mean[static_cast<std::size_t>(c)] += static_cast<double>(image(c, y, x));
    }
    mean[static_cast<std::size_t>(c)] /= static_cast<double>(image.height()) * image.width();
  }
  return mean;
}

/// No wider than a panel.
Image panel_of(const Image& image) {
  if (image.width() <= kPanelWidth) return image;
  return resize_area(image, std::max(1, image.height() * kPanelWidth / image.width()), kPanelWidth);
}

Image beside(const std::vector<Image>& panels) {
  const Image& first = panels.front();
  Image all(first.channels(), first.height(), first.width() * static_cast<int>(panels.size()));
  for (std::size_t i = 0; i < panels.size(); ++i) {
    for (int c = 0; c < first.channels(); ++c) {
      for (int y = 0; y < first.height(); ++y)
        std::copy_n(panels[i].row(c, y), first.width(), all.row(c, y) + static_cast<int>(i) * first.width());
    }
  }
  return all;
}

/// preview.mp4 in the making. Its first failure is logged; from then on nothing is done.
class Preview {
 public:
  Preview(std::string path, double frame_rate) : path_(std::move(path)), frame_rate_(frame_rate) {}

  /// Appends images of one size, next to each other.
  void add(const std::vector<Image>& images) {
    attempt([&] {
      std::vector<Image> panels;
      for (const Image& image : images) panels.push_back(panel_of(image));
      const Image all = beside(panels);
      if (!video_) video_.emplace(path_, all.width(), all.height(), VideoFormat{.frame_rate = frame_rate_});
      video_->add(all);
    });
  }

  void commit() {
    attempt([&] { video_->commit(); });
  }

 private:
  template <class F>
  void attempt(F&& step) {
    if (failed_) return;
    try {
      return step();
    } catch (const DataError& error) {
      tell(error);
    } catch (const UserError& error) {
      tell(error);
    }
  }
  void tell(const std::exception& error) {
    failed_ = true;
    log_warning("preview.mp4 is not written: " + std::string(error.what()));
  }

  std::string path_;
  double frame_rate_;
  std::optional<VideoWriter> video_;
  bool failed_ = false;
};

}  // namespace

bool moves_colors(const RunConfig& config) {
  return std::any_of(config.stages.begin(), config.stages.end(), [](const auto& entry) {
    const auto& moved = entry.second.optimize;
    return find_entry(moved, "color_net") != nullptr || find_entry(moved, "avatar_features") != nullptr;
  });
}

Motion motion_of(const Clip& clip, const std::vector<SceneState>& states, std::size_t person) {
  const ClipPerson& who = clip.person(person);
  Motion motion{clip.frame_rate, bodies_of(states, person)};
  motion.pelvis_rest = pelvis_of(who.avatar.joints);
  motion.betas = who.betas;
  motion.gender = who.gender;
  return motion;
}

namespace {

std::vector<JointTrack> joint_tracks(const Clip& clip, const std::vector<SceneState>& states) {
  std::vector<JointTrack> tracks;
  for (std::size_t o = 0; o < clip.objects.size(); ++o) {
    const std::optional<ObjectJoint>& joint = clip.objects[o].joint;
    if (!joint) continue;
    JointTrack& track = tracks.emplace_back(JointTrack{clip.objects[o].name, {}});
    for (const SceneState& state : states)
      track.values.push_back(joint_value(*joint, parent_from_object(*joint, state.objects, o)));
  }
  return tracks;
}

}  // namespace

void write_results(const RunPaths& paths, const RunConfig& config, const Clip& clip,
                   const std::vector<SceneState>& states, const ColorState& colors,
                   const std::vector<PlaceSigmas>& sigmas) {
  std::vector<std::string> names;
  for (const ClipObject& object : clip.objects) names.push_back(object.name);
  const Motion motion = motion_of(clip, states);
  write_motion(paths.motion(), motion, joint_sigmas_of(sigmas));
  write_motion(paths.motion_at_30(), resampled(motion, kExportedRate));
  for (std::size_t p = 1; p < clip.people(); ++p)
    write_motion(paths.motion_of(clip.person(p).name), motion_of(clip, states, p));
  if (!names.empty()) write_object_tracks(paths.objects(), names, states, sigmas, joint_tracks(clip, states));
  write_cameras(paths.cameras(), cameras_of(states, clip.camera));
  for (std::size_t p = 0; moves_colors(config) && p < colors.nets.size(); ++p)
    write_color_net(p == 0 ? paths.color_net() : paths.color_net_of(clip.person(p).name), colors.nets[p]);
}

std::optional<BodyModel> write_body(const RunPaths& paths, const BodySettings& settings, const Avatar& avatar,
                                    const Motion& motion) {
  std::optional<BodyModel> body;
  try {
    body = rest_body(settings);
    const std::string difference = difference_from(*body, avatar);
    if (difference.empty()) {
      write_glb(paths.body(), *body, motion);
    } else {
      body.reset();
      log_info("body.glb is not written: " + difference);
    }
  } catch (const UserError& error) {
    log_warning("body.glb is not written: " + std::string(error.what()));
  } catch (const DataError& error) {
    log_warning("body.glb is not written: " + std::string(error.what()));
  }
  return body;
}

void write_views(const RunPaths& paths, const Clip& clip, const std::vector<SceneState>& states,
                 const StateRenderer& render, bool preview) {
  const Rigid<double> other_side = camera_of_other_side(clip, states.front());
  std::optional<Preview> video;
  if (preview) video.emplace(paths.preview(), clip.frame_rate);
  std::array<double, 3> beyond{};
  for (std::size_t t = 0; t < states.size(); ++t) {
    const auto index = static_cast<Index>(t);
    const auto number = static_cast<int>(t);
    const ClipFrame frame = read_frame(clip, index);
    const Image image = render(index, states[t], {});
    SceneState other = states[t];
    other.camera_from_world = other_side;
    if (t == 0) beyond = mean_color(frame.target);
    const Image side = render(index, other, beyond);
    if (t == 0) {
      write_image(paths.frame_image(number, "target"), frame.target);
      write_image(paths.frame_image(number, "render"), image);
    }
    write_image(paths.frame_image(number, "side"), side);
    if (video) video->add({frame.target, image, mean_of(frame.target, image), side});
  }
  if (video) video->commit();
}

Rigid<double> turned_camera(const Rigid<double>& camera_from_world, const Vector3<double>& pivot, double angle) {
  // x ↦ p + R (x − p) turns the camera; seen by it the world turns back.
  const Matrix3<double> back = so3_exp(Vector3<double>(0, 0, -angle));
  const Matrix3<double> rotation = camera_from_world.rotation * back;
  return {rotation, camera_from_world.rotation * (pivot - back * pivot) + camera_from_world.translation};
}

}  // namespace hsi4d
