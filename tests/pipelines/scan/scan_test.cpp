#include "pipelines/scan/scan.h"

#include <filesystem>

#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/file.h"
#include "core/image_io.h"
#include "core/parallel.h"
#include "pipelines/config/run_config.h"
#include "pipelines/draw/image_of_scene.h"
#include "pipelines/scan/density.h"
#include "pipelines/scan/photo_checks.h"
#include "pipelines/scan/report.h"
#include "pipelines/scan/scan_graph.h"
#include "pipelines/scan/start.h"
#include "pipelines/synthetic/dataset.h"
#include "pipelines/synthetic/photos.h"
#include "splat/files/splat_file.h"
#include "stress/scratch_folder.h"

namespace scan_test {

using namespace hsi4d;

namespace fs = std::filesystem;

namespace {

ScratchFolder& scratch() {
  static ScratchFolder folder;
  return folder;
}

/// Pictures of a watering can, made once for all tests.
const fs::path& made_photos() {
  static const fs::path file = [] {
    SyntheticSettings settings;
    settings.kind = SyntheticKind::kPhotos;
    settings.photos_of = SyntheticSubject::kObject;
    settings.photos = 12;
    settings.size_px = 64;
    write_photos(settings, video_render_settings(), fs::path(scratch().path()) / "photos");
    return fs::path(scratch().path()) / "photos" / "transforms.json";
  }();
  return file;
}

ScanSettings quick_scan(int iterations) {
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  ScanSettings settings;
  settings.kind = ScanKind::kObject;
  settings.photos.path = made_photos();
  settings.photos.hold_every = 6;
  settings.start.count = 600;
  settings.density.most = 800;
  settings.density.from = 20;
  settings.density.every = 20;
  settings.sh_degree = 1;
  settings.sh_every = 50;
  settings.save_every = 40;
  settings.random_background = true;
  settings.stage.iterations = iterations;
  for (const auto& [name, lr] :
       {std::pair{"means", 5e-4}, {"quats", 1e-3}, {"log_scales", 5e-3}, {"opacity_logits", 5e-2}, {"sh", 1e-2}}) {
    ParameterGroupSettings group;
    group.lr = lr;
    settings.stage.optimize.emplace_back(name, group);
  }
  for (const LossDescription& loss : losses) {
    if (loss.name == "photometric") settings.stage.losses.emplace_back(loss.name, default_settings(loss));
  }
  return settings;
}

std::string bytes_of(const ScanSettings& settings, const fs::path& folder) {
  return read_text_file(scan_result(settings, folder).string());
}

fs::path folder_named(const char* name) { return fs::path(scratch().path()) / name; }

/// Wants to stop after so many questions.
struct Impatient {
  int left;
  Observer observer() {
    Observer result;
    result.stop_requested = [this] { return --left < 0; };
    return result;
  }
};

}  // namespace

TEST_CASE("an object is made from pictures with depths, and shown from where nobody stood") {
  const ScanSettings settings = quick_scan(300);
  const ScanSummary summary = run_scan(settings, folder_named("object"), false, loss_terms());
  CHECK(summary.held.pictures == 2);
  CHECK(summary.learnt.pictures == 10);
  CHECK(summary.held.psnr_db > 24);
  CHECK(summary.learnt.psnr_db > 27);
  CHECK(summary.curve.size() == 15);
  CHECK(summary.curve.back() > summary.curve.front() + 3);
  CHECK(summary.gaussians == 800);
  const Gaussians made = read_splats((folder_named("object") / "object.ply").string()).gaussians;
  CHECK(made.count() == 800);
  CHECK(made.sh_degree == 1);
  for (const char* file : {"summary.json", "report.html", "cameras.json", "config.json", "views/0000_images_0000.png"})
    CHECK(fs::exists(folder_named("object") / file));
  CHECK_FALSE(fs::exists(folder_named("object") / "checkpoint.npz"));
}

TEST_CASE("a reconstruction has the same bits on any number of threads", "[parallel]") {
  const ScanSettings settings = quick_scan(60);
  std::vector<std::string> results;
  for (const int threads : {1, 2, 3}) {
    const fs::path folder = folder_named(("threads" + std::to_string(threads)).c_str());
    with_threads(threads, [&] { run_scan(settings, folder, false, loss_terms()); });
    results.push_back(bytes_of(settings, folder));
  }
  CHECK(results[1] == results[0]);
  CHECK(results[2] == results[0]);
}

TEST_CASE("a reconstruction that was stopped anywhere and resumed has the bits of one that was not") {
  const ScanSettings settings = quick_scan(90);
  run_scan(settings, folder_named("whole"), false, loss_terms());
  const std::string whole = bytes_of(settings, folder_named("whole"));
  for (const int after : {3, 25, 55, 70}) {
    const fs::path folder = folder_named(("stopped" + std::to_string(after)).c_str());
    Impatient impatient{after};
    CHECK_THROWS_AS(run_scan(settings, folder, false, loss_terms(), impatient.observer()), Interrupted);
    run_scan(settings, folder, true, loss_terms());
    CHECK(bytes_of(settings, folder) == whole);
  }
}

TEST_CASE("a reconstruction goes on only with what it was begun with") {
  const ScanSettings settings = quick_scan(5);
  const fs::path folder = folder_named("again");
  CHECK_THROWS_AS(run_scan(settings, folder, true, loss_terms()), UserError);
  run_scan(settings, folder, false, loss_terms());
  CHECK_THROWS_AS(run_scan(settings, folder, false, loss_terms()), UserError);
  CHECK_THROWS_WITH(run_scan(settings, folder, true, loss_terms()), Catch::Matchers::Contains("is done"));
  CHECK_THROWS_WITH(run_scan(quick_scan(6), folder, true, loss_terms()), Catch::Matchers::Contains("other settings"));
}

TEST_CASE("a reconstruction that saves after every iteration stops too, and leaves nothing behind when it is done") {
  ScanSettings settings = quick_scan(9);
  settings.save_every = 1;
  const fs::path folder = folder_named("saving");
  Impatient impatient{4};
  CHECK_THROWS_AS(run_scan(settings, folder, false, loss_terms(), impatient.observer()), Interrupted);
  CHECK(fs::exists(folder / "checkpoint.npz"));
  run_scan(settings, folder, true, loss_terms());
  write_text_file((folder / "checkpoint.npz").string(), "left by a kill");
  CHECK_THROWS_WITH(run_scan(settings, folder, true, loss_terms()), Catch::Matchers::Contains("is done"));
  CHECK_FALSE(fs::exists(folder / "checkpoint.npz"));
}

TEST_CASE("pictures of which nothing counts are refused, or told") {
  const ScanSettings settings = quick_scan(5);
  const PosedImages set = read_posed_images(made_photos());
  std::vector<Photo> photos;
  for (const PosedImage& image : set.images) photos.push_back(read_photo(image, {}));
  CHECK_NOTHROW(check_what_counts(settings, set, photos));
  for (Photo& photo : photos) photo.weight = Image(1, photo.camera.height, photo.camera.width);
  CHECK_THROWS_WITH(check_what_counts(settings, set, photos),
                    Catch::Matchers::Contains("12 of 12 pictures show nothing that counts"));
}

TEST_CASE("pictures from within a wall are told by their depths") {
  const ScanSettings settings = quick_scan(5);
  const PosedImages set = read_posed_images(made_photos());
  std::vector<Photo> photos;
  for (const PosedImage& image : set.images) photos.push_back(read_photo(image, {}));
  const auto told = [&] {
    std::string warnings;
    const LogSink sink = log_to([&](LogLevel, std::string_view text) { warnings += text; }, LogLevel::kWarning);
    check_what_counts(settings, set, photos);
    return warnings;
  };
  REQUIRE_FALSE(photos[3].depth.empty());
  CHECK(told() == "");
  for (float& z : photos[3].depth.data()) z *= 0.01F;
  CHECK_THAT(told(), Catch::Matchers::Contains("half of what 1 of 12 pictures show is nearer than ") &&
                         Catch::Matchers::Contains("cameras in a wall? " + set.images[3].name));
  for (float& z : photos[3].depth.data()) z = 0;  // not known
  CHECK(told() == "");
}

TEST_CASE("the report of a reconstruction is not written over by that of a run") {
  const fs::path folder = folder_named("kept");
  run_scan(quick_scan(3), folder, false, loss_terms());
  CHECK(is_scan_folder(folder));
  CHECK_FALSE(is_scan_folder(folder_named("nothing_there")));
}

TEST_CASE("a checkpoint is of its pictures") {
  const ScanSettings original = quick_scan(9);
  const fs::path copy = folder_named("changed_photos");
  fs::copy(made_photos().parent_path(), copy, fs::copy_options::recursive);
  ScanSettings settings = original;
  settings.photos.path = copy / "transforms.json";
  settings.save_every = 1;
  const fs::path folder = folder_named("changed");
  Impatient impatient{4};
  CHECK_THROWS_AS(run_scan(settings, folder, false, loss_terms(), impatient.observer()), Interrupted);
  std::string text = read_text_file(settings.photos.path.string());
  text.replace(text.find("\"fl_x\": ") + 8, 1, "9");
  write_text_file(settings.photos.path.string(), text);
  CHECK_THROWS_AS(run_scan(settings, folder, true, loss_terms()), DataError);
}

TEST_CASE("pictures that make no scene are refused before any is read") {
  ScanSettings settings = quick_scan(5);
  PosedImages set = read_posed_images(made_photos());
  CHECK_NOTHROW(check_photo_cameras(settings, set));
  PosedImages sizes = set;
  sizes.images[3].camera.width = 65;
  CHECK_THROWS_WITH(check_photo_cameras(settings, sizes),
                    Catch::Matchers::Contains("images/0000.png has 64 x 64 pixels, images/0003.png has 65 x 64"));
  ScanSettings all_held = settings;
  all_held.photos.hold_every = 1;
  CHECK_THROWS_WITH(check_photo_cameras(all_held, set),
                    Catch::Matchers::Contains("/photos/hold_every: 1 holds back all of"));
  PosedImages one_place = set;
  for (PosedImage& image : one_place.images)
    image.camera.camera_from_world.translation = -image.camera.camera_from_world.rotation * Vector3<double>(1, 2, 3);
  CHECK_THROWS_WITH(check_photo_cameras(settings, one_place),
                    Catch::Matchers::Contains("pictures from one place tell"));
  settings.photos.hold_every = 0;
  PosedImages one = set;
  one.images.resize(1);
  CHECK_THROWS_WITH(check_photo_cameras(settings, one), Catch::Matchers::Contains("1 picture tells nothing of depth"));
  PosedImages huge = set;
  for (PosedImage& image : huge.images) image.camera.width = image.camera.height = 65536;
  CHECK_THROWS_WITH(check_photo_cameras(settings, huge),
                    Catch::Matchers::Contains("/photos/longest_side reduces them"));
  settings.density.most = 10;
  settings.start.count = 10;
  settings.start.points = folder_named("many.ply");
  settings.start.from = ScanStartKind::kPoints;
  std::string cloud =
      "ply\nformat ascii 1.0\nelement vertex 20\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
  for (int i = 0; i < 20; ++i) cloud += std::to_string(i) + " 0 0\n";
  write_text_file(settings.start.points.string(), cloud);
  CHECK_THROWS_WITH(first_gaussians(settings, set, {read_photo(set.images[0], {})}),
                    Catch::Matchers::Contains("/density/most: is 10; the start has 20 points already"));
}

TEST_CASE("every shipped config of reconstruct is read, and those that make pictures make them") {
  const fs::path configs = fs::path(HSI4D_SOURCE_DIR) / "configs" / "reconstruct";
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  int scans = 0, datasets = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(configs)) {
    INFO(entry.path().string());
    if (entry.path().filename().string().starts_with("photos")) {
      const RunConfig made = load_run_config(entry.path(),
                                             {"synthetic.size_px=32", "synthetic.photos=3",
                                              "synthetic.scene_gaussians=3000", "synthetic.object_gaussians=300"},
                                             losses);
      const fs::path folder = folder_named(("made" + std::to_string(datasets++)).c_str());
      write_photos(made.synthetic, video_render_settings(), folder);
      CHECK(read_posed_images(folder).images.size() > 1);
    } else {
      const ScanSettings scan = load_scan(
          entry.path(), {"photos.path=" + made_photos().string(), "stage.iterations=3", "start.count=100"}, losses);
      const fs::path folder = folder_named(("shipped" + std::to_string(scans++)).c_str());
      CHECK(run_scan(scan, folder, false, loss_terms()).iterations == 3);
    }
  }
  CHECK(scans == 2);
  CHECK(datasets == 2);
}

TEST_CASE("a config of reconstruct that makes no sense is refused") {
  const std::vector<LossDescription> losses = descriptions_of(loss_terms());
  const auto refusal = [&](const std::string& text) -> std::string {
    const fs::path file = folder_named("refused.json");
    write_text_file(file.string(), text);
    try {
      load_scan(file, {}, losses);
    } catch (const UserError& error) {
      return error.what();
    }
    return "";
  };
  using Catch::Matchers::Contains;
  const std::string photos = R"("photos": {"path": ")" + made_photos().string() + "\"}";
  const auto stage = [&](const std::string& text) { return refusal("{" + photos + R"(, "stage": )" + text + "}"); };
  CHECK_THAT(refusal(R"({"density": {}, "stage": {"iterations": 1, "optimize": {"sh": {"lr": 1}}}})"),
             Contains("/photos/path: not given"));
  CHECK_THAT(refusal(R"({"data": {}})"), Contains("is no config of `hsi4d reconstruct`"));
  CHECK_THAT(stage(R"({"iterations": 1, "optimize": {"body_pose": {"lr": 1}}})"),
             Contains("there is no parameter group"));
  CHECK_THAT(stage(R"({"iterations": 1, "optimize": {"sh": {"lr": 1}}, "draw": "scene"})"), Contains("/stage/draw"));
  CHECK_THAT(stage(R"({"iterations": 1, "optimize": {"sh": {"lr": 1}}, "losses": {"mask": {}}})"),
             Contains("/stage/losses/mask"));
  CHECK_THAT(stage(R"({"iterations": 1, "optimize": {"sh": {"lr": 1}}, "optimizer": {"kind": "bfgs"}})"),
             Contains("/stage/optimizer/kind"));
}

TEST_CASE("places of depths are on what was seen") {
  const PosedImages set = read_posed_images(made_photos());
  std::vector<Photo> photos;
  for (const PosedImage& image : set.images) photos.push_back(read_photo(image, {}));
  ScanStart start;
  start.count = 500;
  const std::vector<ColoredPoint> points = points_of_depths(start, photos);
  REQUIRE(points.size() > 200);
  CHECK(points.size() <= 500);
  const Gaussians truth = read_splats((made_photos().parent_path() / "truth" / "object.ply").string()).gaussians;
  Index far = 0;
  for (const ColoredPoint& point : points) {
    double nearest = 1e9;
    for (Index i = 0; i < truth.count(); ++i) {
      const Vector3<double> place = Vector3<float>(truth.means.data() + 3 * i).cast<double>() + truth.origin_world;
      nearest = std::min(nearest, (place - point.place).norm());
    }
    if (nearest > 0.03) ++far;
  }
  CHECK(far < std::ssize(points) / 20);  // where a pixel shows an edge, its depth lies between two surfaces
}

TEST_CASE("a start from points, from random places and without any") {
  ScanSettings settings = quick_scan(5);
  const PosedImages set = read_posed_images(made_photos());
  std::vector<Photo> photos;
  for (const PosedImage& image : set.images) photos.push_back(read_photo(image, {}));
  settings.start.from = ScanStartKind::kPoints;
  CHECK_THROWS_WITH(first_gaussians(settings, set, photos), Catch::Matchers::Contains("no point to begin with"));
  const fs::path cloud = folder_named("cloud.ply");
  write_text_file(cloud.string(),
                  "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
                  "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"
                  "0 0 0 255 0 51\n1 0 0 0 0 0\n0 1 0 0 0 0\n0 0 1 0 0 0\n");
  settings.start.points = cloud;
  const Gaussians at_points = first_gaussians(settings, set, photos);
  CHECK(at_points.count() == 4);
  CHECK(at_points.sh[0] == Approx(0.5 / 0.28209479177387814));
  CHECK(std::exp(at_points.log_scales[0]) == Approx(1));  // three neighbours at distance 1
  settings.start.from = ScanStartKind::kRandom;
  settings.start.box = {1, 2, 3, 2, 3, 4};
  const Gaussians random = first_gaussians(settings, set, photos);
  CHECK(random.count() == settings.start.count);
  for (Index i = 0; i < random.count(); ++i) {
    for (Index k = 0; k < 3; ++k) {
      const double x = random.means[static_cast<std::size_t>(3 * i + k)] + random.origin_world[k];
      CHECK((x > static_cast<double>(k) + 1 - 1e-5 && x < static_cast<double>(k) + 2 + 1e-5));
    }
  }
}

TEST_CASE("the picture stays when faint Gaussians go to others") {
  ScanState state;
  state.gaussians = read_splats((made_photos().parent_path() / "truth" / "object.ply").string()).gaussians;
  // A tenth of them shows nothing; the others are half transparent, as in the middle of a reconstruction.
  for (std::size_t i = 0; i < state.gaussians.opacity_logits.size(); ++i)
    state.gaussians.opacity_logits[i] = i % 10 == 0 ? -7.0F : -0.5F;
  SceneView view;
  view.camera = read_posed_images(made_photos()).images[0].camera;
  view.background = {0.5, 0.5, 0.5};
  const Image before = render_picture({state.gaussians, {}}, view).image;
  DensitySettings settings;
  settings.growth = 1;
  CHECK(change_density(settings, 3, 1, state).moved > 100);
  const Image after = render_picture({state.gaussians, {}}, view).image;
  float largest = 0;
  double sum = 0;
  for (std::size_t i = 0; i < before.data().size(); ++i) {
    largest = std::max(largest, std::abs(before.data()[i] - after.data()[i]));
    sum += std::abs(before.data()[i] - after.data()[i]);
  }
  CAPTURE(largest, sum / static_cast<double>(before.data().size()));
  CHECK(largest < 2.0F / 255);
}

TEST_CASE("the density does not change after the last iteration") {
  ScanSettings settings = quick_scan(60);
  settings.density = {};
  settings.density.method = DensityMethod::kAdc;
  settings.density.from = 20;
  settings.density.every = 20;
  settings.density.reset_every = 60;
  CHECK(changes_density_after(settings.density, 39, 60));
  CHECK_FALSE(changes_density_after(settings.density, 59, 60));
  run_scan(settings, folder_named("adc_end"), false, loss_terms());
  const Gaussians made = read_splats(scan_result(settings, folder_named("adc_end")).string()).gaussians;
  CHECK(*std::max_element(made.opacity_logits.begin(), made.opacity_logits.end()) > 0);
}

TEST_CASE("a reconstruction by adaptive density control grows, learns, and goes on with the same bits") {
  ScanSettings settings = quick_scan(240);
  settings.density = {};
  settings.density.method = DensityMethod::kAdc;
  settings.density.most = 2000;
  settings.density.from = 20;
  settings.density.every = 20;
  settings.density.reset_every = 60;
  settings.density.until = 80;
  const ScanSummary summary = run_scan(settings, folder_named("adc"), false, loss_terms());
  CHECK(summary.gaussians > 700);
  CHECK(summary.gaussians <= 2000);
  CHECK(summary.learnt.psnr_db > 22);
  const fs::path stopped = folder_named("adc_stopped");
  Impatient impatient{50};
  CHECK_THROWS_AS(run_scan(settings, stopped, false, loss_terms(), impatient.observer()), Interrupted);
  with_threads(1, [&] { run_scan(settings, stopped, true, loss_terms()); });
  CHECK(bytes_of(settings, stopped) == bytes_of(settings, folder_named("adc")));
}

TEST_CASE("pictures that were exposed otherwise are explained by their exposures") {
  const fs::path folder = folder_named("exposed_photos");
  fs::copy(made_photos().parent_path(), folder, fs::copy_options::recursive);
  const PosedImages set = read_posed_images(folder);
  for (std::size_t i = 0; i < set.images.size(); ++i) {
    Photo photo = read_photo(set.images[i], {});
    Image image(4, photo.camera.height, photo.camera.width);
    const float gain = i % 6 == 0 ? 0.75F : i % 2 == 0 ? 0.6F : 0.9F;  // held back: the mean of the others
    for (int y = 0; y < image.height(); ++y) {
      for (int x = 0; x < image.width(); ++x) {
        for (int c = 0; c < 3; ++c) image(c, y, x) = gain * photo.color(c, y, x);
        image(3, y, x) = photo.alpha(0, y, x);
      }
    }
    write_image(set.images[i].image.string(), image);
  }
  ScanSettings settings = quick_scan(240);
  settings.photos.path = folder / "transforms.json";
  const double without = run_scan(settings, folder_named("not_exposed"), false, loss_terms()).learnt.psnr_db;
  ParameterGroupSettings exposures;
  exposures.lr = 0.02;
  settings.stage.optimize.emplace_back(kExposures, exposures);
  const ScanSummary with = run_scan(settings, folder_named("exposed"), false, loss_terms());
  CAPTURE(without, with.learnt.psnr_db, with.held.psnr_db);
  CHECK(with.learnt.psnr_db > without + 2);
  CHECK(with.held.psnr_db > 24);  // of the file as it is: the mean exposure is in it
  const fs::path stopped = folder_named("exposed_stopped");
  Impatient impatient{100};
  CHECK_THROWS_AS(run_scan(settings, stopped, false, loss_terms(), impatient.observer()), Interrupted);
  run_scan(settings, stopped, true, loss_terms());
  CHECK(bytes_of(settings, stopped) == bytes_of(settings, folder_named("exposed")));
}

namespace {

/// Mean over pixels of photos whose depths count of how far from them what is seen there is, of the depth.
double mean_spread(const Gaussians& made) {
  double sum = 0, count = 0;
  for (const PosedImage& posed : read_posed_images(made_photos()).images) {
    const Photo photo = read_photo(posed, {});
    ScanGraph graph(made, photo.camera, {}, 0, {.depth = true});
    graph.show(photo, Vector3<double>::Zero());
    graph.picture();
    Tape<float>& tape = graph.tape();
    tape.forward(graph.inputs().depth_moments);
    tape.forward(graph.inputs().transmittance);
    const ConstArray<float> moments = tape.value(graph.inputs().depth_moments),
                            transmittance = tape.value(graph.inputs().transmittance),
                            target = tape.value(graph.inputs().depth_target);
    for (Index y = 0; y < target.shape.rows; ++y) {
      for (Index x = 0; x < target.shape.cols; ++x) {
        const double d = target(y, x);
        if (d == 0) continue;
        const double spread = (moments(1, y, x) / d - 2 * moments(0, y, x)) / d + 1 - transmittance(y, x);
        sum += std::sqrt(std::max(0.0, spread));
        ++count;
      }
    }
  }
  REQUIRE(count > 1000);
  return sum / count;
}

}  // namespace

TEST_CASE("a loss of depths makes what is seen lie where the depths are") {
  ScanSettings settings = quick_scan(300);
  std::vector<double> spreads;
  for (const bool by_depths : {false, true}) {
    if (by_depths) {
      for (const LossDescription& loss : descriptions_of(loss_terms())) {
        if (loss.name == "depth_spread") settings.stage.losses.emplace_back(loss.name, default_settings(loss));
      }
    }
    const fs::path folder = folder_named(by_depths ? "by_depths" : "by_colours");
    const ScanSummary summary = run_scan(settings, folder, false, loss_terms());
    CHECK(summary.held.psnr_db > 24);
    spreads.push_back(mean_spread(read_splats(scan_result(settings, folder).string()).gaussians));
  }
  CAPTURE(spreads[0], spreads[1]);
  CHECK(spreads[1] < 0.85 * spreads[0]);  // what is left is mostly the size of 800 Gaussians
}

}  // namespace scan_test
