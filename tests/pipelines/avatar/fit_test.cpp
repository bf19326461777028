#include "pipelines/avatar/fit.h"

#include <algorithm>
#include <array>

#include <catch2/catch.hpp>

#include "body/procedural_body.h"
#include "core/camera_file.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/parallel.h"
#include "core/rotation.h"
#include "core/text.h"
#include "optim/metrics.h"
#include "pipelines/avatar/offsets.h"
#include "pipelines/config/run_config.h"
#include "pipelines/draw/posed_avatar.h"
#include "pipelines/input/body_files.h"
#include "pipelines/photos/alignment.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/views.h"
#include "stress/scratch_folder.h"

namespace fit_test {

using namespace hsi4d;

namespace {

namespace fs = std::filesystem;

/// A stage that learns fast enough for a test.
StageSettings quick_stage(int iterations) {
  StageSettings stage;
  stage.iterations = iterations;
  stage.optimize = {{"colors", {.lr = 0.05, .lr_final_share = 0.1, .until = {}}},
                    {"opacity_logits", {.lr = 0.02, .lr_final_share = 0.1, .until = {}}},
                    {"color_net", {.lr = 0.001, .lr_final_share = 0.1, .until = {}}}};
  stage.losses = {{"photometric", LossSettings{}}};
  return stage;
}

AvatarFitSettings quick_fit(const fs::path& views, int iterations = 150) {
  AvatarFitSettings settings;
  settings.views = views;
  settings.gaussians = 2500;
  settings.held_cameras = {2};
  settings.render.blur = 0.1;
  settings.stage = quick_stage(iterations);
  return settings;
}

SyntheticSettings few_views() {
  SyntheticSettings settings;
  settings.kind = SyntheticKind::kViews;
  settings.size_px = 96;
  settings.avatar_gaussians = 4000;
  settings.views_cameras = 4;
  settings.views_poses = 2;
  settings.seed = 5;
  return settings;
}

/// A set of views made once for all tests.
const fs::path& made_views() {
  static const ScratchFolder folder;
  static const fs::path file = [] {
    write_views(few_views(), video_render_settings(), fs::path(folder.path()) / "views");
    return fs::path(folder.path()) / "views" / "views.json";
  }();
  return file;
}

const LossDescription& loss_named(const std::string& name) {
  return std::find_if(loss_terms().begin(), loss_terms().end(),
                      [&](const LossTerm& term) { return term.description.name == name; })
      ->description;
}

AvatarFitResult fitted(const AvatarFitSettings& settings, const Observer& observer = {}) {
  return fit_avatar(settings, first_avatar(settings), read_view_set(settings.views), loss_terms(), observer);
}

}  // namespace

TEST_CASE("an avatar is learnt from pictures, and shown from where nobody stood") {
  AvatarFitSettings settings = quick_fit(made_views());
  settings.stage.iterations = 1;
  const AvatarFitResult before = fitted(settings), after = fitted(quick_fit(made_views()));
  WARN("held back: " << before.held.psnr_db << " dB before, " << after.held.psnr_db << " dB after, of the human "
                     << after.held.psnr_foreground_db.value() << "; learnt " << after.learnt.psnr_db
                     << ", of the human " << after.learnt.psnr_foreground_db.value());
  CHECK(after.learnt.views == 6);
  CHECK(after.held.views == 2);
  CHECK(after.held.psnr_db > before.held.psnr_db + 4);
  CHECK(after.held.psnr_db > 30);
  CHECK(after.held.psnr_foreground_db.value() > 21);
  CHECK(after.learnt.psnr_db > 38);
  CHECK(after.learnt.psnr_foreground_db.value() > 32);
  CHECK(after.avatar.count() == 2500);
  CHECK(after.avatar.means == before.avatar.means);  // not among what moves
  CHECK(after.avatar.colors != before.avatar.colors);
  CHECK(after.avatar.color_net.has_value());
  const ScratchFolder folder;
  write_avatar(folder / "a.safetensors", after.avatar);
  CHECK(read_avatar(folder / "a.safetensors").colors == after.avatar.colors);
}

TEST_CASE("colours that are beyond what can be shown, or learnt, come back") {
  const ScratchFolder folder;
  AvatarFitSettings settings = quick_fit(made_views(), 25);
  settings.stage.optimize = {{"colors", {.lr = 0.05, .until = {}}}};
  Avatar start = first_avatar(settings);
  start.color_net.reset();
  for (std::size_t i = 0; i < start.colors.size(); ++i) start.colors[i] = std::array{0.0F, 1.6F, -0.4F}[i % 3];
  write_avatar(folder / "start.safetensors", start);
  settings.avatar = folder / "start.safetensors";
  for (const ColorNetUse use : {ColorNetUse::kOn, ColorNetUse::kOff}) {
    settings.color_net.use = use;
    AvatarFitSettings first = settings;
    first.stage.iterations = 1;
    const AvatarFitResult before = fitted(first), after = fitted(settings);
    const double low = use == ColorNetUse::kOn ? kLeastColor : 0, high = use == ColorNetUse::kOn ? kLargestColor : 1;
    const auto is_shown = [&](float c) { return c >= static_cast<float>(low) && c <= static_cast<float>(high); };
    CHECK(std::all_of(after.avatar.colors.begin(), after.avatar.colors.end(), is_shown));
    CHECK(after.learnt.psnr_foreground_db.value() > before.learnt.psnr_foreground_db.value() + 3);

    // Of what does not move nothing is changed, be it as it may.
    first.stage.optimize = {{"opacity_logits", {.lr = 0.05, .until = {}}}};
    CHECK((fitted(first).avatar.colors == start.colors));
  }
}

TEST_CASE("what a fit measures is what the file of its avatar shows") {
  const ScratchFolder folder;
  for (const ColorNetUse use : {ColorNetUse::kOn, ColorNetUse::kOff}) {
    AvatarFitSettings settings = quick_fit(made_views(), 8);
    settings.stage.optimize = {{"colors", {.lr = 0.3, .until = {}}}, {"color_net", {.lr = 0.01, .until = {}}}};
    settings.color_net.use = use;
    const AvatarFitResult result = fitted(settings);
    write_avatar(folder / "a.safetensors", result.avatar);
    settings.avatar = folder / "a.safetensors";
    settings.stage.iterations = 1;
    settings.stage.optimize = {{"opacity_logits", {.lr = 1e-30, .until = {}}}};  // which changes nothing
    const AvatarFitResult again = fitted(settings);
    CHECK((again.avatar.colors == result.avatar.colors));
    CHECK(again.held.psnr_db == result.held.psnr_db);
    CHECK(again.learnt.psnr_foreground_db == result.learnt.psnr_foreground_db);
  }
}

TEST_CASE("an avatar fit is the same for any number of threads and again") {
  const AvatarFitSettings settings = quick_fit(made_views(), 8);
  std::vector<float> colors;
  for (const int threads : {1, 2, 3, 1}) {
    with_threads(threads, [&] {
      const AvatarFitResult result = fitted(settings);
      if (colors.empty()) colors = result.avatar.colors;
      CHECK(result.avatar.colors == colors);
    });
  }
}

TEST_CASE("views of one camera written as updates of another are those of the camera itself") {
  // A fit that learns nothing shows the truth as the pictures do, from every camera and in every pose.
  const ViewSet set = read_view_set(made_views());
  AvatarFitSettings settings = quick_fit(made_views(), 1);
  settings.avatar = made_views().parent_path() / "truth" / "avatar.safetensors";
  settings.color_net.use = ColorNetUse::kOff;
  settings.render = video_render_settings();
  settings.render.blur = 0.15;
  settings.stage.optimize = {{"colors", {.lr = 1e-12, .until = {}}}};
  settings.held_cameras = {};
  const AvatarFitResult result = fitted(settings);
  CHECK(result.learnt.views == 8);
  CHECK(result.learnt.psnr_db > 38);  // of 8 bits, and another pixel filter
}

TEST_CASE("a picture's alpha is its mask, and views that make no sense are refused") {
  const ViewSet set = read_view_set(made_views());
  REQUIRE(set.views.size() == 8);
  CHECK(set.cameras.size() == 4);
  CHECK(set.motion.poses.size() == 2);
  const ViewImage grey = view_image(set, set.views[3], {0.5, 0.5, 0.5}), red = view_image(set, set.views[3], {1, 0, 0});
  CHECK(grey.mask(0, 0, 0) == 0);
  CHECK(grey.mask(0, 48, 48) == 1);
  CHECK(grey.color(1, 0, 0) == 0.5f);
  CHECK(red.color(0, 0, 0) == 1.0f);
  CHECK(red.color(2, 48, 48) == grey.color(2, 48, 48));

  const ScratchFolder folder;
  fs::copy(made_views().parent_path(), fs::path(folder.path()) / "views", fs::copy_options::recursive);
  const fs::path file = fs::path(folder.path()) / "views" / "views.json";
  const auto fault = [&](std::vector<PosedView> views) {
    write_text_file(file, view_set_json("motion.npz", "cameras.json", views));
    try {
      const ViewSet read = read_view_set(file);
      view_image(read, read.views.front(), {0, 0, 0});
    } catch (const std::exception& e) {
      return std::string(e.what());
    }
    return std::string();
  };
  const PosedView good{"images/0000.png", {}, 0, 0};
  CHECK(fault({good}) == "");
  Image blue(3, grey.mask.height(), grey.mask.width());
  blue(2, 5, 6) = 1;
  write_image((file.parent_path() / "blue.png").string(), blue);
  CHECK_THAT(fault({{"images/0000.png", "blue.png", 0, 0}}), Catch::Contains("blue.png: is a colour mask: row 5"));
  CHECK_THAT(fault({}), Catch::Contains("there is no view"));
  const std::string poses = (file.parent_path() / "motion.npz").string();
  Motion late = read_motion(poses);
  late.first_frame = 3;
  write_motion((file.parent_path() / "late.npz").string(), late);
  write_text_file(file, view_set_json("late.npz", "cameras.json", {good}));
  CHECK_THROWS_WITH(read_view_set(file), Catch::Contains("late.npz: begins with frame 3 of its video; views count"));
  CHECK_THAT(fault({good, {"images/0000.png", {}, 4, 0}}),
             Catch::Contains("/views/1/camera: 4; there are 4, counted from 0"));
  CHECK_THAT(fault({{"images/0000.png", {}, 0, 2}}), Catch::Contains("/views/0/frame: 2; there are 2"));
  CHECK_THAT(fault({{"images/9.png", {}, 0, 0}}), Catch::Contains("images/9.png"));
  write_image((fs::path(folder.path()) / "views" / "small.png").string(), Image(3, 4, 4));
  CHECK_THAT(fault({{"small.png", {}, 0, 0}}), Catch::Contains("is 4x4 pixels; its camera has 96x96"));
  write_image((fs::path(folder.path()) / "views" / "grey.png").string(), Image(1, 96, 96));
  CHECK_THAT(fault({{"grey.png", {}, 0, 0}}), Catch::Contains("is grey"));
  write_text_file(file,
                  R"({"format": "hsi4d views", "version": 2, "motion": "motion.npz", "cameras": "cameras.json"})");
  CHECK_THROWS_WITH(read_view_set(file), Catch::Contains("/version"));
  write_text_file(file, R"({"format": "views", "version": 1, "motion": "motion.npz", "cameras": "cameras.json"})");
  CHECK_THROWS_WITH(read_view_set(file), Catch::Contains("hsi4d views"));
}

TEST_CASE("photographs whose cameras another program found are views of one frame") {
  const ScratchFolder folder;
  const ViewSet made = read_view_set(made_views());
  const auto write = [&](const std::string& lens, const Similarity& away = {}) {
    std::string frames;
    fs::create_directories(folder / "images");
    for (const PosedView& view : made.views) {
      if (view.frame != 1) continue;
      const std::string name = "images/" + std::to_string(view.camera) + ".png";
      fs::copy_file(view.image, folder / name, fs::copy_options::overwrite_existing);
      const Camera camera = moved_camera(made.cameras[static_cast<std::size_t>(view.camera)], away);
      std::string rows;
      const Matrix4<double> pose = matrix_from_rigid(inverse(camera.camera_from_world));
      for (Index i = 0; i < 4; ++i) {
        rows += i == 0 ? "[" : ", [";
        for (Index j = 0; j < 4; ++j)
          rows += (j == 0 ? "" : ", ") + number_text(j == 1 || j == 2 ? -pose(i, j) : pose(i, j));
        rows += "]";
      }
      frames +=
          (frames.empty() ? "" : ", ") + (R"({"file_path": ")" + name) + R"(", "transform_matrix": [)" + rows + "]}";
    }
    const Camera& camera = made.cameras.front();
    write_text_file(folder / "transforms.json", R"({"w": 96, "h": 96, "cx": 48, "cy": 48, "fl_x": )" +
                                                    number_text(camera.fx) + R"(, "fl_y": )" + number_text(camera.fy) +
                                                    lens + R"(, "frames": [)" + frames + "]}");
  };
  const auto views_json = [&](const std::string& more) {
    write_text_file(folder / "views.json", R"({"format": "hsi4d views", "version": 1, "motion": ")" +
                                               made.motion_file.string() + R"(", "photos": "transforms.json")" + more +
                                               "}");
    return fs::path(folder / "views.json");
  };
  write("");
  const ViewSet set = read_view_set(views_json(R"(, "frame": 1)"));
  REQUIRE(set.views.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(set.views[i].camera == static_cast<Index>(i));
    CHECK(set.views[i].frame == 1);
    const ViewImage photo = view_image(set, set.views[i], {0, 0, 1}),
                    view = view_image(made, made.views[4 + i], {0, 0, 1});
    CHECK(psnr_db(photo.color, view.color) > 99);
    CHECK(psnr_db(photo.mask, view.mask) > 99);
    CHECK(photo.weight.empty());
  }
  AvatarFitSettings settings = quick_fit(folder / "views.json", 1);  // the truth shows them
  settings.avatar = made_views().parent_path() / "truth" / "avatar.safetensors";
  settings.color_net.use = ColorNetUse::kOff;
  settings.render = video_render_settings();
  settings.render.blur = 0.15;
  settings.stage.optimize = {{"colors", {.lr = 1e-12, .until = {}}}};
  CHECK(fitted(settings).learnt.psnr_db > 38);
  CHECK(fitted(settings).held.views == 1);

  CHECK(read_view_set(views_json(R"(, "longest_side": 48)")).cameras.front().width == 48);

  // In another world, which alignment.json takes to the motion's.
  const Matrix3<double> turn = so3_exp(Vector3<double>(0.4, -1, 2));
  const Similarity away{2.5, turn, {1, 2, 3}};
  write("", away);
  const Vector3<double> back = turn.transpose() * away.translation * (-1 / away.scale);
  std::string rows;
  for (Index i = 0; i < 3; ++i) {
    rows += "[";
    for (Index j = 0; j < 3; ++j) rows += number_text(turn(j, i) / away.scale) + ", ";
    rows += number_text(back[i]) + "], ";
  }
  write_text_file(folder / "alignment.json", R"({"matrix": [)" + rows + "[0, 0, 0, 1]]}");
  const ViewSet aligned = read_view_set(views_json(R"(, "frame": 1, "alignment": "alignment.json")"));
  for (std::size_t i = 0; i < 4; ++i) {
    const Matrix4<double> found = matrix_from_rigid(aligned.cameras[i].camera_from_world),
                          wanted = matrix_from_rigid(set.cameras[i].camera_from_world);
    // The same directions, from places that are as far from the origin.
    CHECK((found.topLeftCorner<3, 3>() - wanted.topLeftCorner<3, 3>()).norm() < 1e-9);
    CHECK((camera_center_world(aligned.cameras[i]) - camera_center_world(set.cameras[i])).norm() < 1e-9);
  }
  write(R"(, "k1": 0.3)");  // straightened: its corners are of no pixel
  const ViewSet bent = read_view_set(views_json(R"(, "frame": 1)"));
  const ViewImage straight = view_image(bent, bent.views[0], {0, 0, 1});
  CHECK(straight.weight(0, 0, 0) == 0);
  CHECK(straight.weight(0, 48, 48) == 1);
  CHECK(straight.mask(0, 48, 48) == 1);
  CHECK_THROWS_WITH(read_view_set(views_json(R"(, "frame": 2)")), Catch::Contains("json: /frame: 2; there are 2"));
  CHECK_THROWS_WITH(read_view_set(views_json(R"(, "cameras": "transforms.json")")),
                    Catch::Contains("photographs have cameras of their own"));
}

TEST_CASE("settings of photographs are refused where there are none") {
  const ScratchFolder folder;
  fs::copy(made_views().parent_path(), folder / "views", fs::copy_options::recursive);
  const fs::path file = folder / "views/views.json";
  const auto with = [&](const std::string& more) {
    write_text_file(file, R"({"format": "hsi4d views", "version": 1, "motion": "motion.npz", )" + more + "}");
    return file;
  };
  const std::string some =
      R"("cameras": "cameras.json", "views": [{"image": "images/0000.png", "camera": 0, "frame": 0}])";
  CHECK_NOTHROW(read_view_set(with(some)));
  CHECK_THROWS_WITH(read_view_set(with(some + R"(, "longest_side": 48)")),
                    Catch::Contains("/longest_side: is of photographs; there is no /photos"));
  CHECK_THROWS_WITH(read_view_set(with(some + R"(, "frame": 1)")), Catch::Contains("/frame: is of photographs"));
  CHECK_THROWS_WITH(read_view_set(with(some + R"(, "alignment": "cameras.json")")),
                    Catch::Contains("/alignment: is of photographs"));
  CHECK_THROWS_WITH(read_view_set(with(R"("cameras": "cameras.json")")), Catch::Contains("there is no view"));
}

TEST_CASE("an avatar fit refuses what it cannot do, and stops when asked") {
  AvatarFitSettings settings = quick_fit(made_views(), 5);
  settings.held_cameras = {0, 1, 2, 3};
  CHECK_THROWS_WITH(fitted(settings), Catch::Contains("all views are held back"));
  settings.file = "fit.json";
  settings.held_cameras = {0, 4};
  CHECK_THROWS_WITH(fitted(settings), Catch::Contains("fit.json: /held_cameras/1: no view of ") &&
                                          Catch::Contains("is of camera 4; there are 4, counted from 0"));
  settings.held_cameras = {};
  settings.held_frames = {2};
  CHECK_THROWS_WITH(fitted(settings), Catch::Contains("fit.json: /held_frames/0: no view of ") &&
                                          Catch::Contains("is of frame 2; there are 2, counted from 0"));
  settings = quick_fit(made_views(), 5);
  Observer observer;
  observer.stop_requested = [] { return true; };
  CHECK_THROWS_AS(fitted(settings, observer), Interrupted);
}

TEST_CASE("the config of an avatar fit is checked") {
  const ScratchFolder folder;
  const auto load = [&](const std::string& text) {
    write_text_file(folder / "fit.json", text);
    return load_avatar_fit(folder / "fit.json", {}, descriptions_of(loss_terms()));
  };
  const std::string views = "\"views\": \"" + made_views().string() + "\"";
  const AvatarFitSettings read = load("{" + views + R"(, "held_frames": [1], "stage": {"iterations": 3,
      "optimize": {"colors": {"lr": 0.1}}, "losses": {"photometric": {}}}})");
  CHECK(read.held_frames == std::vector<double>{1});
  CHECK(read.stage.iterations == 3);
  CHECK(is_held(read, {"a.png", {}, 0, 1}));
  CHECK_FALSE(is_held(read, {"a.png", {}, 0, 0}));
  CHECK_THROWS_WITH(load("{}"), Catch::Contains("views"));
  const fs::path shipped = fs::path(HSI4D_SOURCE_DIR) / "configs" / "avatar" / "fit.json";
  CHECK(load_avatar_fit(shipped, {"views=" + made_views().string()}, descriptions_of(loss_terms())).gaussians == 20000);
  CHECK_THROWS_WITH(load("{" + views + R"(, "held_cameras": [0.5]})"), Catch::Contains("whole numbers"));
  CHECK_THROWS_WITH(load("{" + views + R"(, "stage": {"iterations": 1, "optimize": {"colours": {"lr": 1}}}})"),
                    Catch::Contains("colors"));
}

TEST_CASE("what pictures show is learnt, and what they hardly show keeps the look that it began with") {
  // Learnt is from a camera before the person alone, beginning with colours that are far from the pictures'.
  ViewSet set = read_view_set(made_views());
  std::erase_if(set.views, [](const PosedView& view) { return view.camera != 0; });
  AvatarFitSettings settings = quick_fit(made_views(), 80);
  settings.held_cameras = {};
  settings.color_net.use = ColorNetUse::kOff;
  settings.stage.optimize = {{"colors", {.lr = 0.03, .lr_final_share = 0.1, .until = {}}}};
  Avatar first = surface_avatar(procedural_body(), {.gaussians = 2500});
  for (float& color : first.colors) color = 1 - color;
  const std::vector<float> normals = outward_normals(first);
  const auto changes = [&](double weight) {  // mean, of Gaussians on the front and on the back
    settings.stage.losses = {{"photometric", LossSettings{}}, {"look", default_settings(loss_named("look"))}};
    settings.stage.losses.back().second.weight = weight;
    const AvatarFitResult result = fit_avatar(settings, first, set, loss_terms());
    CHECK(result.learnt.psnr_foreground_db.value() > result.before.psnr_foreground_db.value() + 6);
    std::array<double, 2> change{}, count{};
    for (std::size_t n = 0; n < first.opacity_logits.size(); ++n) {
      if (std::abs(normals[3 * n + 2]) < 0.7F) continue;
      const std::size_t side = normals[3 * n + 2] > 0 ? 0 : 1;
      ++count[side];
      for (std::size_t i = 3 * n; i < 3 * n + 3; ++i)
        change[side] += std::abs(static_cast<double>(result.avatar.colors[i] - first.colors[i])) / 3;
    }
    return std::array{change[0] / count[0], change[1] / count[1]};
  };
  const auto free = changes(0), held = changes(0.01);
  WARN("mean change of a colour on the front " << free[0] << " without look, " << held[0] << " with; on the back "
                                               << free[1] << ", " << held[1]);
  CHECK(held[0] > 0.1);
  CHECK(held[1] < 0.2 * held[0]);
  CHECK(free[1] > 3 * held[1]);  // what shimmers through from behind is enough for whole steps
}

TEST_CASE("a body that stands out from the one that it began with is learnt as offsets along the normal") {
  const ScratchFolder folder;
  const fs::path truth_file = made_views().parent_path() / "truth" / "avatar.safetensors";
  // The pictures are of the truth; it begins a centimetre and a half inside of it.
  Avatar first = read_avatar(truth_file.string());
  const std::vector<float> truth = first.means, normals = outward_normals(first);
  for (std::size_t i = 0; i < first.means.size(); ++i) first.means[i] -= 0.015F * normals[i];
  AvatarFitSettings settings = quick_fit(made_views(), 150);
  settings.color_net.use = ColorNetUse::kOff;
  settings.stage.optimize = {{"offsets", {.lr = 0.001, .lr_final_share = 0.1, .until = {}}}};
  settings.stage.losses = {{"mask", default_settings(loss_named("mask"))}};
  const AvatarFitResult result = fit_avatar(settings, first, read_view_set(made_views()), loss_terms());
  const auto outside = [&](const std::vector<float>& means) {  // metres along the normal, mean
    double sum = 0;
    for (std::size_t i = 0; i < means.size(); ++i) sum += static_cast<double>((means[i] - truth[i]) * normals[i]);
    return sum / static_cast<double>(first.count());
  };
  WARN("mean offset from the truth " << outside(first.means) << " before, " << outside(result.avatar.means)
                                     << " after; silhouette IoU " << result.before.silhouette_iou.value() << ", "
                                     << result.learnt.silhouette_iou.value());
  CHECK(outside(first.means) == Approx(-0.015).margin(1e-4));
  CHECK(std::abs(outside(result.avatar.means)) < 0.007);
  CHECK(result.learnt.silhouette_iou.value() > result.before.silhouette_iou.value() + 0.03);
  CHECK(result.avatar.colors == first.colors);
}

TEST_CASE("pixels near the border of a mask do not count where the settings say so") {
  AvatarFitSettings settings = quick_fit(made_views(), 1);
  const AvatarFitResult all = fitted(settings);
  settings.mask_inset_px = 4;
  const AvatarFitResult inner = fitted(settings);
  CHECK(inner.stage.loss < 0.9 * all.stage.loss);  // fewer pixels are other than black
  CHECK(inner.before.psnr_foreground_db == all.before.psnr_foreground_db);
}

TEST_CASE("the shipped views are learnt by the shipped fit") {
  const ScratchFolder folder;
  const fs::path configs = fs::path(HSI4D_SOURCE_DIR) / "configs" / "avatar";
  // As they are but for sizes and counts.
  RunConfig made = load_run_config(configs / "views.json", {}, descriptions_of(loss_terms()));
  CHECK(made.synthetic.kind == SyntheticKind::kViews);
  made.synthetic.size_px = 48;
  made.synthetic.avatar_gaussians = 1500;
  made.synthetic.views_cameras = 3;
  made.synthetic.views_poses = 2;
  const fs::path views = fs::path(folder.path()) / "views";
  write_views(made.synthetic, video_render_settings(), views);
  AvatarFitSettings settings =
      load_avatar_fit(configs / "fit.json", {"views=" + (views / "views.json").string(), "gaussians=1000"},
                      descriptions_of(loss_terms()));
  settings.stage.iterations = 12;
  for (auto& [name, group] : settings.stage.optimize) group.from = 0;  // as later iterations would be
  AvatarFitSettings first = settings;
  first.stage.iterations = 1;
  const AvatarFitResult before = fitted(first), after = fitted(settings);
  INFO("learnt " << before.learnt.psnr_db << " dB before, " << after.learnt.psnr_db << " dB after");
  CHECK(after.learnt.views == 6);
  CHECK(after.held.views == 0);
  CHECK(after.learnt.psnr_db > before.learnt.psnr_db + 1);
  CHECK(after.stage.rollbacks == 0);
  const Avatar start = first_avatar(settings);  // everything that the stage names has moved
  CHECK(after.avatar.colors != start.colors);
  CHECK(after.avatar.opacity_logits != start.opacity_logits);
  CHECK(after.avatar.log_scales != start.log_scales);
  CHECK(after.avatar.means != start.means);
  REQUIRE(after.avatar.color_net.has_value());
  CHECK(after.avatar.color_net->layers.back().bias != start.color_net->layers.back().bias);
  CHECK(after.avatar.color_net->features != start.color_net->features);
}

TEST_CASE("an avatar of a real body, learnt from the reference's pictures, is right in new views and poses", "[full]") {
  const fs::path file = fs::path(HSI4D_SOURCE_DIR) / "../shared/data/bodies/makehuman_smplx_layout.npz";
  if (!fs::exists(file)) {
    WARN("skipped: " << file << " is not there");
    return;
  }
  const ScratchFolder folder;
  AvatarFitSettings settings;
  settings.body.kind = BodyKind::kSmplx;
  settings.body.path = file;
  AvatarSettings truth;
  truth.gaussians = 6000;
  truth.seed = 11;
  const BodyModel body = rest_body(settings.body);
  const Avatar shown = surface_avatar(body, truth);
  // Six cameras and four poses to learn from. Held back are a seventh camera and a fifth pose, and both together.
  const Motion motion{10, view_poses(body, 5)};
  const std::vector<Camera> cameras = ring_of_cameras(7, 96);
  std::vector<PosedView> views;
  for (Index pose = 0; pose < 4; ++pose) {
    for (Index camera = 0; camera < 6; ++camera) views.push_back({{}, {}, camera, pose});
  }
  const std::vector<std::pair<Index, Index>> held = {{6, 0}, {6, 2}, {0, 4}, {3, 4}, {6, 4}};
  for (const auto& [camera, pose] : held) views.push_back({{}, {}, camera, pose});
  fs::create_directories(fs::path(folder.path()) / "images");
  parallel_for(std::ssize(views), 1, [&](Index begin, Index end) {  // the reference uses one thread a picture
    for (Index v = begin; v < end; ++v) {
      PosedView& view = views[static_cast<std::size_t>(v)];
      view.image = "images/" + std::to_string(v) + ".png";
      write_image(folder / view.image.string(),
                  picture_with_alpha(posed_avatar(shown, motion.poses[static_cast<std::size_t>(view.frame)]),
                                     cameras[static_cast<std::size_t>(view.camera)], video_render_settings(),
                                     Precision::kReference, 2));
    }
  });
  write_motion(folder / "motion.npz", motion);
  write_cameras(folder / "cameras.json", cameras);
  write_text_file(folder / "views.json", view_set_json("motion.npz", "cameras.json", views));
  settings.views = folder / "views.json";
  settings.held_cameras = {6};
  settings.held_frames = {4};
  settings.gaussians = 8000;
  settings.seed = 3;
  settings.render.blur = 0.08;
  settings.stage = quick_stage(600);
  settings.stage.optimize.push_back({"log_scales", {.lr = 0.004, .lr_final_share = 0.1, .until = {}}});
  const AvatarFitResult result = fitted(settings);
  WARN("held back: " << result.held.views << " views, " << result.held.psnr_db << " dB, of the human alone "
                     << result.held.psnr_foreground_db.value() << " dB; learnt: " << result.learnt.views << " views, "
                     << result.learnt.psnr_db << " dB, of the human alone " << result.learnt.psnr_foreground_db.value()
                     << " dB; " << result.stage.seconds << " s");
  CHECK(result.held.views == 5);
  CHECK(result.learnt.views == 24);
  CHECK(result.held.psnr_db >= 30);
  CHECK(result.held.psnr_foreground_db.value() >= 30);
}

}  // namespace fit_test
